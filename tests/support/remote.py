"""What several tests share of link remote."""

import os
import shutil
import socket
import subprocess
import threading
import time

import paramiko
import pytest
from pyftpdlib.authorizers import DummyAuthorizer
from pyftpdlib.handlers import FTPHandler, TLS_FTPHandler
from pyftpdlib.servers import ThreadedFTPServer

WORD = "geheim9"
os.environ["TANGO_TESTS_WORD"] = WORD  # programs that a test starts have it, too
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
        return f"{self._url}/{name}?password=env:TANGO_TESTS_WORD{self._more}{said}"


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


def place(server, name):
    """→ the path of a file there, as the server names it."""
    return server._url.split("127.0.0.1")[1].partition("/")[2].join(["/", f"/{name}"]).replace("//", "/")
