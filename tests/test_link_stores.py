"""Disks over the network: what a port's URL states reaches the library of every protocol; what it leaves out is left to it."""

from __future__ import annotations

import contextlib
import ftplib
import socket
import sys
import threading
from types import ModuleType
from typing import Any

import pytest

from tango_cnc.link.protocols import remote
from tango_cnc.link.transport import open_port, parse
from tango_cnc.records import LinkError


class Enough(OSError):
    """The library has been asked; nobody is there."""


class Refused(Exception):
    """Stands for what a library raises by itself."""


class AuthenticationException(Refused):
    """As paramiko calls a refused password."""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """→ what the libraries were asked for: host, port, user, password, and settings that are not None."""
    said: dict[str, Any] = {}

    def told(**more: Any) -> None:
        said.update({name: value for name, value in more.items() if value is not None and "timeout" not in name})

    class Ssh:
        def load_system_host_keys(self) -> None: ...
        def set_missing_host_key_policy(self, policy: object) -> None: ...
        def close(self) -> None: ...

        def connect(self, host: str, port: int, user: str | None, password: str | None, **more: Any) -> None:
            told(host=host, port=port, user=user, password=password, **more)
            raise Enough

    def session(host: str, user: str | None, password: str | None, *, port: int, **more: Any) -> None:
        told(host=host, port=port, user=user, password=password)
        raise Enough

    def login(self: ftplib.FTP, user: str, password: str) -> None:
        told(user=user, password=password)
        raise Enough

    libraries: dict[str, dict[str, Any]] = {
        "paramiko": {"SSHClient": Ssh, "MissingHostKeyPolicy": object, "SSHException": Refused},
        "smbclient": {"register_session": session},
        "smbprotocol": {},
        "smbprotocol.exceptions": dict.fromkeys(("SMBOSError", "LogonFailure", "AccessDenied", "SMBException"), Refused),
    }
    for name, content in libraries.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(ftplib.FTP, "connect", lambda self, host, port: told(host=host, port=port))
    monkeypatch.setattr(ftplib.FTP, "login", login)
    monkeypatch.setattr(ftplib.FTP_TLS, "login", login)
    monkeypatch.setenv("AT_THE_CONTROL", "g&h=8 #?")
    return said


def reached(asked: dict[str, Any], url: str) -> dict[str, Any]:
    with pytest.raises(LinkError, match="does not open"):
        open_port(parse(url, remote.OPTIONS))
    return asked


PORTS = {"ftp": 21, "ftps": 21, "sftp": 22, "smb": 445}


@pytest.mark.parametrize("scheme", PORTS)
def test_host_port_user_and_password_arrive(scheme: str, asked: dict[str, Any]) -> None:
    found = reached(asked, f"{scheme}://anna%20b@192.0.2.7:2222/S/TANGO.TXT?password=env:AT_THE_CONTROL")
    assert found == {"host": "192.0.2.7", "port": 2222, "user": "anna b", "password": "g&h=8 #?"}


@pytest.mark.parametrize("scheme", PORTS)
def test_what_no_url_states_is_the_port_of_the_protocol_and_no_name(scheme: str, asked: dict[str, Any]) -> None:
    """FTP alone has a name for who has none."""
    nobody = {"user": "anonymous", "password": ""} if scheme.startswith("ftp") else {}
    assert reached(asked, f"{scheme}://192.0.2.7/S/TANGO.TXT") == {"host": "192.0.2.7", "port": PORTS[scheme], **nobody}


def test_a_key_and_its_passphrase_arrive(asked: dict[str, Any], tmp_path: Any) -> None:
    (key := tmp_path / "key").write_text("-")
    found = reached(asked, f"sftp://anna@192.0.2.7/TANGO.TXT?key={key}&passphrase=env:AT_THE_CONTROL")
    assert found == {"host": "192.0.2.7", "port": 22, "user": "anna", "key_filename": str(key), "passphrase": "g&h=8 #?"}


def test_a_user_of_a_domain_is_named_with_it(asked: dict[str, Any]) -> None:
    assert reached(asked, "smb://anna@192.0.2.7/S/TANGO.TXT?domain=WORKS")["user"] == "WORKS\\anna"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            AuthenticationException("Authentication failed."),
            r"the control refuses the login \(Authentication failed\): correct user",
        ),
        (Refused("Error reading SSH protocol banner"), "does not open: Error reading SSH protocol banner"),
        (Refused(), "does not open: Refused"),
    ],
)
def test_what_the_control_refuses_is_told_from_a_line_that_broke(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
) -> None:
    """Who is refused has to change something; where the line broke, the same again may do."""

    def connect(*args: Any, **more: Any) -> None:
        raise error

    monkeypatch.setattr(sys.modules["paramiko"].SSHClient, "connect", connect)
    with pytest.raises(LinkError, match=said):
        open_port(parse("sftp://anna@192.0.2.7/TANGO.TXT", remote.OPTIONS))


class Disk:
    """FTP with one file of records. `ends` are the answers to the ends of transfers, the last one for all that follow."""

    def __init__(self, *ends: str) -> None:
        self.ends, self.sessions, self.content = list(ends), 0, b"TANGO START 4BC33F4A4AB1 3\nP1 H1 X1\n"
        self.server = socket.create_server(("127.0.0.1", 0))
        self.url = f"ftp://127.0.0.1:{self.server.getsockname()[1]}/T.TXT"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            connection, _ = self.server.accept()
            self.sessions += 1
            with contextlib.suppress(ConnectionError), connection, connection.makefile("rb") as lines:
                connection.sendall(b"220 here\r\n")
                for line in lines:
                    connection.sendall(self._answer(line.split()[0].decode(), connection))

    def _answer(self, verb: str, connection: socket.socket) -> bytes:
        if verb == "PASV":
            self.data = socket.create_server(("127.0.0.1", 0))
            port = self.data.getsockname()[1]
            return f"227 (127,0,0,1,{port >> 8},{port & 255})\r\n".encode()
        if verb == "RETR":
            connection.sendall(b"150 it comes\r\n")
            data, _ = self.data.accept()
            data.sendall(self.content)
            data.close()
            end = self.ends.pop(0) if len(self.ends) > 1 else self.ends[0]
            return "".join(f"{answer}\r\n" for answer in end.split("|")).encode()
        if verb == "SIZE":
            return f"213 {len(self.content)}\r\n".encode()
        return b"230 yes\r\n" if verb in ("USER", "PASS") else b"200 yes\r\n"


DONE = "226 Transfer complete."


@pytest.mark.parametrize("before", range(4))
@pytest.mark.parametrize("end", [f"426 cut off|{DONE}", f"{DONE}|{DONE}"], ids=["cut off", "said twice"])
def test_a_transfer_that_is_answered_twice_puts_no_ftp_session_out_of_step(end: str, before: int) -> None:
    """The answer that is left over is none to the next question: a new session is opened for it."""
    server = Disk(*[DONE] * before, end, DONE)
    if end.startswith(DONE) and before < 2:  # while the port is opened nothing is tried again
        with pytest.raises(LinkError, match="does not open: the control answers 226"):
            open_port(parse(server.url, remote.OPTIONS))
        return
    port = open_port(parse(server.url, remote.OPTIONS))
    server.content += b"P2 H1 X2\n"
    assert port.read(1.0) == b"P2 H1 X2\n"
    server.content += b"P3 H1 X3\n"
    while not (last := port.read(1.0)):
        pass
    assert (last, server.sessions) == (b"P3 H1 X3\n", 2)
    port.close()
