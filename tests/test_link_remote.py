"""The disk of a control over the network: real servers of FTP, FTPS, SFTP and SMB; program put and compared, records followed."""

import contextlib
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
import time

import paramiko
import pytest
from pyftpdlib.authorizers import DummyAuthorizer
from pyftpdlib.handlers import FTPHandler, TLS_FTPHandler
from pyftpdlib.servers import ThreadedFTPServer
from support.linkparts import job
from test_link_same_parameters import SIGMAS, estimate
from test_run import STRATEGY, Result
from test_run_simulated import agree

from sim_controller.probing import rig
from sim_controller.session import Session, Setup
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, read_world
from tango_cnc.link._client import Failed
from tango_cnc.link.protocols import remote
from tango_cnc.link.transport import Lost, open_port, parse
from tango_cnc.records import InputError, LinkError

WORD = "geheim9"
PROGRAM = b"%\nO8700 (PROGRAM 4BC33F4A4AB1 PLAN 98C4F7B8ADCC)\nM30\n%\n"


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def listening(port, process=None):
    for _ in range(200):
        with socket.socket() as one:
            if one.connect_ex(("127.0.0.1", port)) == 0:
                return
        assert process is None or process.poll() is None, "the server has ended"
        time.sleep(0.05)
    raise AssertionError("the server does not listen")


class Server:
    """Where a control keeps its files, and the URL of that place."""

    def __init__(self, folder, url, more="", stop=lambda: None):
        self.folder, self.stop, self._url, self._more = folder, stop, url, more

    def url(self, name="TANGO.TXT", **options):
        said = "".join(f"&{key}={value}" for key, value in options.items())
        return f"{self._url}/{name}?password={WORD}{self._more}{said}"


def ftp_server(tmp_path, folder, secure, **more):
    handler = type("Handler", (TLS_FTPHandler if secure else FTPHandler,), more)
    handler.authorizer = DummyAuthorizer()
    handler.authorizer.add_user("anna", WORD, str(folder), perm="elradfmwMT")
    if secure:
        key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
        command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
        subprocess.run([*command, "-keyout", key, "-out", cert], check=True, capture_output=True)
        handler.certfile, handler.keyfile = str(cert), str(key)
    server = ThreadedFTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, kwargs={"timeout": 0.05, "handle_exit": False}, daemon=True).start()
    port = server.address[1]
    return Server(folder, f"{'ftps' if secure else 'ftp'}://anna@127.0.0.1:{port}", "&verify=no" * secure, server.close_all)


def ssh_server(tmp_path, folder):
    for name in ("host", "user"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / name], check=True)
    (tmp_path / "authorized").write_bytes((tmp_path / "user.pub").read_bytes())
    port = free_port()
    os.makedirs("/run/sshd", exist_ok=True)
    settings = {
        "Port": port,
        "ListenAddress": "127.0.0.1",
        "HostKey": tmp_path / "host",
        "AuthorizedKeysFile": tmp_path / "authorized",
        "StrictModes": "no",
        "UsePAM": "no",
        "PermitRootLogin": "yes",
        "PidFile": tmp_path / "pid",
        "Subsystem": "sftp internal-sftp",
    }
    (tmp_path / "sshd.conf").write_text("".join(f"{key} {value}\n" for key, value in settings.items()))
    process = subprocess.Popen([shutil.which("sshd") or "/usr/sbin/sshd", "-D", "-e", "-f", tmp_path / "sshd.conf"])
    listening(port, process)
    hash_ = paramiko.Ed25519Key.from_private_key_file(str(tmp_path / "host")).fingerprint.replace("+", "%2B")
    user = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()
    more = f"&key={tmp_path / 'user'}&hostkey={hash_}"
    return Server(folder, f"sftp://{user}@127.0.0.1:{port}{folder}", more, process.kill)


def smb_server(tmp_path, folder):
    """A Samba of its own: its users, sockets and locks are in tmp_path."""
    own = tmp_path / "samba"
    own.mkdir()
    user = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()
    port = free_port()
    places = ("lock", "state", "cache", "pid", "private")
    settings = {
        "smb ports": port,
        "interfaces": "127.0.0.1",
        "bind interfaces only": "yes",
        "server role": "standalone server",
        "passdb backend": f"tdbsam:{own / 'passdb.tdb'}",
        "ncalrpc dir": own / "ncalrpc",
        "log file": own / "log",
        "disable netbios": "yes",
        "load printers": "no",
        **{("private dir" if place == "private" else f"{place} directory"): own / place for place in places},
    }
    for place in places:
        (own / place).mkdir()
    text = "".join(f"{key} = {value}\n" for key, value in settings.items())
    (own / "smb.conf").write_text(f"[global]\n{text}[control]\npath = {folder}\nread only = no\n")
    word = f"{WORD}\n{WORD}\n"
    command = ["smbpasswd", "-c", own / "smb.conf", "-s", "-a", user]
    subprocess.run(command, input=word, text=True, check=True, capture_output=True)
    server = [shutil.which("smbd") or "/usr/sbin/smbd", "-F", "--no-process-group", "-s", own / "smb.conf", "-l", own]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(server, start_new_session=True, **quiet)  # it ends its whole group
    listening(port, process)
    return Server(folder, f"smb://{user}@127.0.0.1:{port}/control", "", process.terminate)


KINDS = {
    "ftp": lambda tmp_path, folder: ftp_server(tmp_path, folder, False),
    "ftps": lambda tmp_path, folder: ftp_server(tmp_path, folder, True),
    "sftp": ssh_server,
    "smb": smb_server,
}
NEEDED = {"ftps": ("openssl",), "sftp": ("sshd", "ssh-keygen"), "smb": ("smbd", "smbpasswd")}


def marked(kind):
    marks = [pytest.mark.system(*NEEDED[kind])] if kind in NEEDED else []
    return pytest.param(kind, marks=[*marks, *([pytest.mark.long] if kind == "smb" else [])])


@pytest.fixture(params=[marked(kind) for kind in KINDS])
def server(request, tmp_path):
    folder = tmp_path / "control"
    folder.mkdir()
    one = KINDS[request.param](tmp_path, folder)
    yield one
    one.stop()


def opened(server, **options):
    return open_port(parse(server.url(**options), remote.OPTIONS))


def looked(line):
    """→ what the next look brings."""
    line._due = 0.0
    return line.read(1.0)


def test_a_record_file_is_followed_as_it_grows(server):
    file = server.folder / "TANGO.TXT"
    file.write_bytes(b"TANGO START 0A 1\nP1 H1 X1\nTANGO END 1\n")
    line = opened(server)
    assert looked(line) == b""  # what is there already is of another run
    with file.open("ab", buffering=0) as control:
        control.write(b"TANGO START 0B 1\nP1 H1")
        assert looked(line) == b"TANGO START 0B 1\n"
        control.write(b" X2\n\0\0\0")
        assert looked(line) == b"P1 H1 X2\n"
    file.write_bytes(b"TANGO START 0C 2\n")
    assert looked(line) == b"TANGO START 0C 2\n"
    file.unlink()
    assert looked(line) == b""
    line.close()
    assert opened(server).read(0.0) == b""  # a file that is not there yet


def test_who_started_the_control_first_reads_from_the_last_start_mark(server):
    (server.folder / "TANGO.TXT").write_bytes(b"TANGO START 0A 1\nTANGO END 1\nTANGO START 0B 1\nP1 H1 X2\n")
    assert opened(server, **{"from": "last"}).read(0.0) == b"TANGO START 0B 1\nP1 H1 X2\n"


def test_a_program_is_put_and_read_back(server):
    line = opened(server, program=place(server, "O8700.NC"))
    assert line.write(b"put " + PROGRAM.hex().encode() + b"\n") > 0
    assert (server.folder / "O8700.NC").read_bytes() == PROGRAM
    assert re.fullmatch(rb"PUT [0-9a-f]{64}\n", line.read(0.0))
    line.write(b"put " + PROGRAM.replace(b"M30", b"M02").hex().encode() + b"\n")  # one of ours may be replaced
    assert b"M02" in (server.folder / "O8700.NC").read_bytes()


def test_a_program_of_somebody_else_is_left_alone(server):
    (server.folder / "O8700.NC").write_bytes(b"%\nO8700 (PART 17)\nM30\n%\n")
    line = opened(server, program=place(server, "O8700.NC"))
    with pytest.raises(Lost, match="is no program of 'tango plan'"):
        line.write(b"put " + PROGRAM.hex().encode() + b"\n")
    assert b"PART 17" in (server.folder / "O8700.NC").read_bytes()


def place(server, name):
    """→ the path of a file there, as the server names it."""
    return server._url.split("127.0.0.1")[1].partition("/")[2].join(["/", f"/{name}"]).replace("//", "/")


@pytest.mark.long
@pytest.mark.parametrize(
    "server",
    ["ftp", *(pytest.param(k, marks=[pytest.mark.long, pytest.mark.system(*NEEDED[k])]) for k in ("ftps", "sftp", "smb"))],
    indirect=True,
)
def test_a_whole_run_brings_the_program_and_follows_the_records(server, tmp_path):
    """The person at the control: starts the program as soon as it is there."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    (cell / "strategy.yaml").write_text(STRATEGY)
    (cell / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (cell / "world.yaml").read_text()))
    records, program = server.folder / "TANGO.TXT", server.folder / "O8700.NC"
    records.touch()
    command = [sys.executable, "-m", "sim_controller", "--cell", cell, "--start", program, "--records", records]
    with subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL) as control:
        try:
            url = server.url(program=place(server, "O8700.NC"))
            result = Result("run", "-C", cell, "--port", url, "--timeout", "60")
        finally:
            control.kill()
    assert result.code == 0, result.err
    assert agree(cell)
    written = "".join(file.read_text(errors="replace") for file in (cell / "readings.json", cell / "readings.journal"))
    assert WORD not in written + result.err + result.out


@contextlib.contextmanager
def attended(cell, program, records):
    """cell with a world, files of program and records → within it, somebody starts each program that comes; these."""
    left, started = threading.Event(), []

    def work():
        read = read_cell(cell)
        session = Session(rig(read.machine, read.artefact, read_world(cell / "world.yaml"), 1), Setup("macro_b"))
        before = ""
        while not left.wait(0.2):
            text = program.read_text(encoding="ascii") if program.exists() else ""
            if text.endswith("%\n") and text == before and text not in started:  # twice the same: whole
                started.append(text)
                with records.open("ab", buffering=0) as out:
                    session.run(session.control(out.write), (line for line in text.splitlines() if line.strip() != "%"))
            before = text

    person = threading.Thread(target=work, daemon=True)
    person.start()
    try:
        yield started
    finally:
        left.set()
        person.join(20)


@pytest.mark.long
@pytest.mark.parametrize(
    "server",
    ["ftp", *(pytest.param(k, marks=[pytest.mark.long, pytest.mark.system(*NEEDED[k])]) for k in ("ftps", "sftp", "smb"))],
    indirect=True,
)
def test_the_whole_strategy_of_the_example_gives_the_parameters_of_the_simulated_machine(server, tmp_path):
    """All touches in several programs, each started by the person at the control: the same parameters as without a link."""
    cell = tmp_path / "cell"
    write_example(cell, "hu40t")
    (cell / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", (cell / "world.yaml").read_text()))
    records = server.folder / "TANGO.TXT"
    records.touch()
    with attended(cell, server.folder / "O8700.NC", records) as started:
        url = server.url(program=place(server, "O8700.NC"))
        result = Result("run", "-C", cell, "--port", url, "--timeout", "120")
    assert result.code == 0, result.err
    assert len(started) > 1
    assert Result("simulate", "-C", cell, "-o", cell / "simulated.csv").code == 0
    true, got = estimate(cell, "simulated.csv"), estimate(cell, "readings.csv")
    away = [abs(p["value"] - true["parameters"][n]["value"]) / max(p["std"], 1e-12) for n, p in got["parameters"].items()]
    print(f"\n{server._url[:5]}: residual {got['residual']['rms_um']:.3f} µm rms, {len(away)} within {max(away):.1f} of their std")
    assert got["terms"] == true["terms"] and got["residual"]["rms_um"] < 1.0 and max(away) < SIGMAS


@pytest.mark.long
@pytest.mark.parametrize("server", [marked("ftp"), marked("ftps"), marked("smb")], indirect=True)
def test_a_password_that_is_wrong_is_said_without_it(server):
    with pytest.raises(LinkError) as error:
        open_port(parse(server.url().replace(WORD, "falsch7"), remote.OPTIONS))
    assert "refuses" in str(error.value) and "falsch7" not in str(error.value)


@pytest.mark.system(*NEEDED["sftp"])
def test_a_control_whose_key_nobody_knows_is_refused_with_its_key(tmp_path):
    server = ssh_server(tmp_path, tmp_path)
    try:
        url = re.sub(r"&hostkey=[^&]*", "", server.url())
        with pytest.raises(LinkError, match=r"is not known: SHA256:.*hostkey=SHA256:"):
            open_port(parse(url, remote.OPTIONS))
    finally:
        server.stop()


def test_a_program_that_comes_back_otherwise_is_not_started():
    client = remote.Client(job(), {"program": "/O1.NC"})
    client.bytes_to_send(1 << 20)
    events = client.receive(b"PUT 0000\n")
    assert [type(event) for event in events] == [Failed]
    assert "is not the one that was put there" in events[0].why


@pytest.mark.parametrize("url", ["ftp://host", "ftp://host/", "sftp:///x", "sftp://a b/c", "ftp://anna@host:99999/x"])
def test_a_url_without_host_or_file_is_refused(url):
    with pytest.raises(InputError, match="no host, or no file"):
        parse(url, remote.OPTIONS)
