"""Disks over the network: what a port's URL states reaches the library of every protocol; what it leaves out is left to it."""

from __future__ import annotations

import contextlib
import ftplib
import io
import random
import socket
import sys
import threading
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from support.mutants import spoilt
from support.runs import Result
from support.runs import cell as cell  # a fixture

from tango_cnc.link import transport
from tango_cnc.link.protocols import lsv2, remote
from tango_cnc.link.transport import fits, open_port, parse
from tango_cnc.records import InputError, LinkError


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

    letters, greeting, passive, login = "utf-8", "220 here", "227 (127,0,0,1,{},{})", "230 yes"

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
                connection.sendall(f"{self.greeting}\r\n".encode(self.letters))
                for line in lines:
                    connection.sendall(self._answer(line.split()[0].decode(), connection))

    def _answer(self, verb: str, connection: socket.socket) -> bytes:
        if verb == "PASV":
            self.data = socket.create_server(("127.0.0.1", 0))
            port = self.data.getsockname()[1]
            return f"{self.passive.format(port >> 8, port & 255)}\r\n".encode(self.letters)
        if verb == "RETR":
            connection.sendall(b"150 it comes\r\n")
            data, _ = self.data.accept()
            data.sendall(self.content)
            data.close()
            end = self.ends.pop(0) if len(self.ends) > 1 else self.ends[0]
            return "".join(f"{answer}\r\n" for answer in end.split("|")).encode(self.letters)
        if verb == "SIZE":
            return f"213 {len(self.content)}\r\n".encode()
        return f"{self.login}\r\n".encode(self.letters) if verb in ("USER", "PASS") else b"200 yes\r\n"


DONE = "226 Transfer complete."


@pytest.mark.few(3)
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


class Western(Disk):
    """A control of a country that answers in its letters, one byte each."""

    letters, greeting = "latin-1", "220 Grüß Gott"


def test_an_ftp_answer_in_letters_of_the_control_ends_nothing() -> None:
    """RFC 959 says nothing of UTF-8. It was a traceback in the middle of a run, or no way to open the port."""
    server = Western("226 Übertragung beendet.")
    port = open_port(parse(server.url, remote.OPTIONS))
    server.content += b"P2 H1 X2\n"
    assert port.read(1.0) == b"P2 H1 X2\n"
    port.close()


@pytest.mark.parametrize("letters", ["latin-1", "utf-8"])
def test_what_an_ftp_control_refuses_is_shown_in_its_letters(monkeypatch: pytest.MonkeyPatch, letters: str) -> None:
    monkeypatch.setattr(Western, "letters", letters)
    monkeypatch.setattr(Western, "login", "530 Kennwort ungültig.")
    with pytest.raises(LinkError, match=r"refuses the login \(530 Kennwort ungültig\)"):
        open_port(parse(Western(DONE).url, remote.OPTIONS))


@pytest.mark.parametrize(
    ("passive", "size", "said"),
    [
        (f"227 (127,0,0,1,{'9' * 30},1)", "213 40", "does not open: the control answers .*too large"),
        ("227 (127,0,0,1,{0},{1})", "213 many", "does not open: the control answers 213 many"),
        ("227 (127,0,0,1,{0},{1})" + "x" * 9000, "213 40", "does not open: the control answers got more than 8192 bytes"),
    ],
)
def test_an_ftp_answer_that_is_none_is_a_sentence(monkeypatch: pytest.MonkeyPatch, passive: str, size: str, said: str) -> None:
    monkeypatch.setattr(Disk, "passive", passive)
    real = Disk._answer

    def answer(self: Disk, verb: str, connection: socket.socket) -> bytes:
        return f"{size}\r\n".encode() if verb == "SIZE" else real(self, verb, connection)

    monkeypatch.setattr(Disk, "_answer", answer)
    with pytest.raises(LinkError, match=said):
        open_port(parse(Disk(DONE).url, remote.OPTIONS))


@pytest.mark.parametrize(
    ("url", "protocol"),
    [
        ("ftp://h/records/O8700?program=/records/", remote),
        ("sftp://h/o8700?program=/", remote),
        ("smb://h/S/A/O8700?program=/S/A/", remote),
        ("lsv2://h/TNC:/O8700?program=TNC:/", lsv2),
    ],
)
def test_a_program_that_is_called_as_the_records_in_its_folder_is_wrong_input(url: str, protocol: Any) -> None:
    """It was found out at the control, when the journal of a run had been begun."""
    with pytest.raises(InputError, match=r"program: found the folder .*, where this program is called .*O8700, which is the file"):
        fits(parse(url, protocol.OPTIONS), b"%\nO8700 (TANGO)\nM30\n%\n")
    fits(parse(url, protocol.OPTIONS), b"%\nO8701 (TANGO)\nM30\n%\n")


@pytest.mark.few(0)
def test_such_a_run_begins_nothing(cell: Any) -> None:
    result = Result("run", "-C", cell, "--yes", "--port", "ftp://127.0.0.1:1/records/o7700?program=/records/")
    assert result.code == 2 and "where this program is called" in result.err, result.err
    assert not (cell / "program").exists() and not list(cell.glob("*.journal"))


KEY = "AAAAC3NzaC1lZDI1NTE5AAAAIKTBQWmNOeQdlGPGX6L9h1ZgJ9nlQ3yw7ZtHYdlWVEgU"
DAMAGED = [
    f"other ssh-ed25519 {KEY[:-3]}",
    "other ssh-ed25519 \xff\xfe",
    "other",
    "|1|a ssh-rsa AAAA",
    "x ecdsa-sha2-nistp256 AAAA",
]


@pytest.mark.parametrize("line", DAMAGED)
def test_a_damaged_line_of_known_hosts_is_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, line: str) -> None:
    """paramiko stopped there with errors of its own: a traceback, whichever host the line was of."""
    paramiko = pytest.importorskip("paramiko")
    (tmp_path / ".ssh").mkdir()
    (tmp_path / ".ssh" / "known_hosts").write_bytes(f"a ssh-ed25519 {KEY}\n{line}\nb ssh-ed25519 {KEY}\n".encode("latin-1"))
    monkeypatch.setenv("HOME", str(tmp_path))
    client = paramiko.SSHClient()
    transport._refused.knows(client)
    assert all(client._system_host_keys.lookup(host) for host in "ab") and not client._system_host_keys.lookup("c")


def test_a_damaged_private_key_is_wrong_input(tmp_path: Path) -> None:
    paramiko = pytest.importorskip("paramiko")
    good, key = io.StringIO(), tmp_path / "key"
    paramiko.ECDSAKey.generate().write_private_key(good)
    lines = good.getvalue().splitlines()
    refused = 0
    for seed in range(150):
        key.write_bytes(spoilt("\n".join(lines).encode(), random.Random(seed)))
        try:
            transport._refused.opens(paramiko, {"key": str(key)})
        except InputError as error:
            refused += 1
            assert "allowed: a private key" in str(error) or "which is encrypted" in str(error)
    assert refused > 100
