"""The disk of a control over the network: real servers of FTP, FTPS, SFTP and SMB; program put and compared, records followed."""

import contextlib
import errno
import os
import re
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import paramiko
import pytest
from support.linkparts import job
from support.parameters import SIGMAS, estimate
from support.remote import (
    NEEDED,
    PROGRAM,
    WORD,
    ftp_server,
    marked,
    place,
    server,  # noqa: F401  fixtures
    ssh_server,
)
from support.runs import STRATEGY, Result
from support.simulated_runs import agree

from postprocessors import load, program
from sim_controller.probing import rig
from sim_controller.session import Session, Setup
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, read_world
from tango_cnc.link.client import Failed
from tango_cnc.link.protocols import remote
from tango_cnc.link.transport import Lost, foreseen, open_port, parse
from tango_cnc.link.transport._remote import _name
from tango_cnc.plan import plan
from tango_cnc.records import InputError, LinkError

GOLDEN = Path(__file__).parent / "golden" / "cell"


def opened(server, **options):
    return open_port(parse(server.url(**options), remote.OPTIONS))


def looked(line):
    """→ what the next look brings."""
    line._due = 0.0
    return line.read(1.0)


@pytest.mark.few(1)
def test_a_record_file_is_followed_as_it_grows(server):
    file = server.folder / "TANGO.TXT"
    file.write_bytes(b"TANGO START 0A 1\nP1 H1 X1\nTANGO END 1\n")
    line = opened(server)
    assert looked(line) == b""  # what is there already is of another run
    with file.open("ab", buffering=0) as control:
        control.write(b"TANGO START 0B 1\rP1 H1")  # a Haas ends its lines so
        assert looked(line) == b"TANGO START 0B 1\r"
        control.write(b" X2\n\0\0\0")
        assert looked(line) == b"P1 H1 X2\n"
    file.write_bytes(b"TANGO START 0C 2\n")
    assert looked(line) == b"TANGO START 0C 2\n"
    file.unlink()
    assert looked(line) == b""
    line.close()
    assert opened(server).read(0.0) == b""  # a file that is not there yet


@pytest.mark.few(1)
def test_a_folder_that_does_not_exist_is_refused_before_a_program_is_put(server):
    """Else the person starts the program, which writes nowhere, and the run waits for a file that never comes."""
    (server.folder / "records").mkdir()
    program = place(server, "O8700.NC")
    line = open_port(parse(server.url("records/TANGO.TXT", program=program), remote.OPTIONS))
    assert looked(line) == b""
    line.close()
    with pytest.raises(InputError, match=r"there is no folder \S*/record at the control.*Correct the path"):
        open_port(parse(server.url("record/TANGO.TXT", program=program), remote.OPTIONS))
    assert [file.name for file in server.folder.iterdir()] == ["records"]


@pytest.mark.few(2)
@pytest.mark.parametrize("text", [b"my measurements of last year\n", b"x" * 9000, b"P1\nTANGO\n"])
def test_a_record_file_of_somebody_else_is_refused_before_a_program_is_put(text, server):
    (server.folder / "TANGO.TXT").write_bytes(text)
    with pytest.raises(InputError, match="a file without a record of a TANGO program, and the control would write into it"):
        opened(server, program=place(server, "O8700.NC"))
    assert (server.folder / "TANGO.TXT").read_bytes() == text and not (server.folder / "O8700.NC").exists()


@pytest.mark.few(1)
@pytest.mark.parametrize("text", [b"", b"\0\0\0", b"TANGO ST", b"x" * 9000 + b"\r\nTANGO END 0A 1\r\n", b"\x12P12 H1 X 3.5\r\n"])
def test_a_record_file_that_is_empty_or_has_records_is_taken(text, server):
    (server.folder / "TANGO.TXT").write_bytes(text)
    opened(server).close()


@pytest.mark.few(1)
def test_who_started_the_control_first_reads_from_the_last_start_mark(server):
    (server.folder / "TANGO.TXT").write_bytes(b"TANGO START 0A 1\nTANGO END 1\nTANGO START 0B 1\nP1 H1 X2\n")
    assert opened(server, **{"from": "last"}).read(0.0) == b"TANGO START 0B 1\nP1 H1 X2\n"


@pytest.mark.few(1)
def test_a_program_is_put_and_read_back(server):
    line = opened(server, program=place(server, "O8700.NC"))
    assert line.write(b"put " + PROGRAM.hex().encode() + b"\n") > 0
    assert (server.folder / "O8700.NC").read_bytes() == PROGRAM
    assert re.fullmatch(rb"PUT [0-9a-f]{64}\n", line.read(0.0))
    line.write(b"put " + PROGRAM.replace(b"M30", b"M02").hex().encode() + b"\n")  # one of ours may be replaced
    assert b"M02" in (server.folder / "O8700.NC").read_bytes()


@pytest.mark.few(1)
def test_a_program_of_somebody_else_is_left_alone(server):
    (server.folder / "O8700.NC").write_bytes(b"%\nO8700 (PART 17)\nM30\n%\n")
    line = opened(server, program=place(server, "O8700.NC"))
    with pytest.raises(Lost, match="is no program of 'tango plan'"):
        line.write(b"put " + PROGRAM.hex().encode() + b"\n")
    assert b"PART 17" in (server.folder / "O8700.NC").read_bytes()


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
def test_a_password_that_is_wrong_is_said_without_it(server, monkeypatch):
    monkeypatch.setenv("TANGO_TESTS_WORD", "falsch7")
    with pytest.raises(LinkError) as error:
        open_port(parse(server.url(), remote.OPTIONS))
    assert "refuses" in str(error.value) and "falsch7" not in str(error.value) and error.value.exit_code == 2


@pytest.mark.parametrize("server", [marked("ftps")], indirect=True)
def test_a_certificate_that_is_not_trusted_is_named_and_what_to_do(server):
    """It was "Operation not permitted": the number of a certificate that is refused is that of another error of the system."""
    with pytest.raises(LinkError, match=r"certificate of the control is refused \(self.signed certificate\).*SSL_CERT_FILE"):
        open_port(parse(server.url().replace("&verify=no", ""), remote.OPTIONS))


@pytest.mark.parametrize("server", [marked("ftp"), marked("smb")], indirect=True)
def test_a_login_that_is_refused_is_not_tried_again(server):
    """Thirty tries in a minute lock a name at the control."""
    line = opened(server)
    line._hang_up()  # as a control does that closes idle connections
    line._address = replace(line._address, options={**line._address.options, "password": "another"})
    began = time.monotonic()
    with pytest.raises(Lost, match=r"refuses the login \(.+\): correct user and password"):
        looked(line)
    assert time.monotonic() - began < 30


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


@pytest.mark.few(1)
@pytest.mark.parametrize("scheme", ["ftp", "sftp", "smb"])
def test_nobody_there_is_said_in_the_same_words_whatever_the_library(scheme):
    with pytest.raises(LinkError, match=rf"^port {scheme}://anna@127.0.0.1:1/S/TANGO.TXT does not open: Connection refused\. Is"):
        open_port(parse(f"{scheme}://anna@127.0.0.1:1/S/TANGO.TXT", remote.OPTIONS))


def test_a_pipe_is_no_key_and_has_no_password(tmp_path):
    os.mkfifo(pipe := tmp_path / "pipe")
    with pytest.raises(InputError, match=r"key: found .*pipe; allowed: the file of a private key"):
        foreseen(parse(f"sftp://anna@127.0.0.1:1/x?key={pipe}", remote.OPTIONS))
    with pytest.raises(InputError, match=r"password: found .*pipe; allowed: a file with one word"):
        parse(f"sftp://anna@127.0.0.1:1/x?password=file:{pipe}", remote.OPTIONS)


OTHERWISE = {"fanuc": "O7700", "fagor": "TANGO.NC"}


@pytest.mark.parametrize("post", ["siemens", "okuma", "heidenhain", *OTHERWISE])
def test_in_a_folder_a_program_has_the_name_that_its_control_takes(post):
    """What 'tango plan' calls it; a Fanuc knows its number."""
    called, _, lines = program(load(post), plan(read_cell(GOLDEN)), {}, "0" * 12)
    assert _name("\n".join(lines()).encode("ascii")) == OTHERWISE.get(post, called)


def refused_put(line):
    """line to a server → why its program cannot be put there."""
    with pytest.raises(Lost) as error:
        line.write(b"put %s\n" % PROGRAM.hex().encode())
        for _ in range(3):
            line.read(0.0)
    return str(error.value)


class Full:
    """A disk that is full in the middle of a program; `away`: and the connection is gone with it."""

    def __init__(self, store, away):
        self._store, self._away = store, away

    def __getattr__(self, name):
        return getattr(self._store, name)

    def write(self, path, data):
        self._store.write(path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("server", [marked("ftp"), marked("sftp"), marked("smb")], indirect=True)
def test_a_program_that_was_cut_off_is_taken_away_or_said_to_lie_there(server, monkeypatch):
    """It lay there, and whoever saw it could start it."""
    name = place(server, "O8700.NC")
    line = opened(server, program=name)
    line._store = Full(line._store, False)
    assert "No space left on device; the part of it that lay there was taken away" in refused_put(line)
    assert not (server.folder / "O8700.NC").exists()
    line = opened(server, program=name)
    line._store = Full(line._store, True)
    monkeypatch.setattr(line, "_open", lambda: (_ for _ in ()).throw(ConnectionRefusedError(111, "Connection refused")))
    why = refused_put(line)
    assert f"as {name}: No space left on device; a part of it may lie there: delete it, and start nothing" in why
    assert (server.folder / "O8700.NC").read_bytes() == PROGRAM[: len(PROGRAM) // 2]


@pytest.mark.parametrize("server", [marked("ftp")], indirect=True)
def test_a_program_that_was_cut_off_before_its_name_keeps_no_later_one_out(server):
    """It was called no program of 'tango plan', by every run from then on."""
    file, other = server.folder / "O8700.NC", PROGRAM.replace(b"4BC33F", b"0D1234")
    for part, fine in ((other[:22], True), (other[:30], True), (b"%", True), (b"%\nO8700 (MINE)", False)):
        file.write_bytes(part)
        line = opened(server, program=place(server, "O8700.NC"))
        if fine:
            line.write(b"put %s\n" % PROGRAM.hex().encode())
            assert line.read(0.0).startswith(b"PUT ") and file.read_bytes() == PROGRAM
        else:
            assert "is no program of 'tango plan'" in refused_put(line) and file.read_bytes() == part


@pytest.mark.parametrize("server", [marked("ftp"), marked("smb")], indirect=True)
def test_a_disk_that_is_full_without_a_word_leaves_no_part(server, monkeypatch):
    line = opened(server, program=place(server, "O8700.NC"))
    whole = line._store.write
    monkeypatch.setattr(line._store, "write", lambda path, data: whole(path, data[:40]))
    line.write(b"put %s\n" % PROGRAM.hex().encode())
    assert line.read(0.0).startswith(b"PUT ") and not (server.folder / "O8700.NC").exists()


@pytest.mark.parametrize("server", [marked("ftp"), marked("smb")], indirect=True)
def test_a_program_of_before_that_cannot_be_written_over_stays(server, monkeypatch):
    name, old = place(server, "O8700.NC"), PROGRAM.replace(b"M30", b"M02")
    (server.folder / "O8700.NC").write_bytes(old)
    line = opened(server, program=name)
    monkeypatch.setattr(line._store, "write", lambda path, data: (_ for _ in ()).throw(LinkError("the control says no")))
    assert refused_put(line).endswith(f"as {name}: the control says no")
    assert (server.folder / "O8700.NC").read_bytes() == old


@pytest.mark.parametrize("server", [marked("ftp"), marked("sftp"), marked("smb")], indirect=True)
def test_a_folder_is_no_record_file_and_that_is_said_at_once(server):
    """Over smb it took a minute, over ftp for ever."""
    (server.folder / "jobs").mkdir()
    began = time.monotonic()
    with pytest.raises(InputError, match="jobs is a folder at the control; allowed: the file of the records"):
        open_port(parse(server.url("jobs"), remote.OPTIONS))
    assert time.monotonic() - began < 20


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("smb://anna@host/TANGO.TXT", r"path: found /TANGO\.TXT; allowed: the share, then a file on it"),
        ("smb://anna@host/S/TANGO.TXT?program=/O1.NC", r"program: found /O1\.NC; allowed: the share"),
        ("ftp://anna@host/A.TXT?program=/a.txt", "which is the file of the records; allowed: another file"),
    ],
)
def test_a_place_that_cannot_be_meant_is_wrong_input(url, why):
    """A share without a file was waited for, a minute long; one file of both was found out when the program was on its way."""
    with pytest.raises(InputError, match=why):
        foreseen(parse(url, remote.OPTIONS))
    foreseen(parse("smb://anna@host/S/TANGO.TXT?program=/S/", remote.OPTIONS))


@pytest.mark.parametrize("server", [marked("smb")], indirect=True)
def test_a_share_refuses_in_words_of_this_program(server):
    name = "/control/a*b.NC"
    why = refused_put(opened(server, program=name))
    assert why.endswith(f"as {name}: the control takes no such name") and "STATUS" not in why and "Errno" not in why
    with pytest.raises(InputError, match=r"program: there is no folder /elsewhere at the control"):
        opened(server, program="/elsewhere/O1.NC")


@pytest.mark.system(*NEEDED["sftp"])
def test_a_key_that_has_changed_is_called_changed_and_nothing_is_sent(tmp_path, monkeypatch):
    """It was called unknown, or a login that was refused: nobody looked who answers there now."""
    server = ssh_server(tmp_path, tmp_path)
    home = tmp_path / "home"
    (home / ".ssh").mkdir(parents=True)
    monkeypatch.setenv("HOME", str(home))
    try:
        own = server.url().partition("&hostkey=")[2].partition("&")[0]
        with pytest.raises(
            LinkError, match=r"has changed: it is SHA256:.*hostkey in the port's URL is SHA256:other.*ssh-keygen -R"
        ):
            open_port(parse(server.url().replace(own, "SHA256:other"), remote.OPTIONS))
        port = re.search(r":(\d+)/", server.url())[1]
        for kind in (paramiko.Ed25519Key.from_private_key_file(str(tmp_path / "user")), paramiko.RSAKey.generate(1024)):
            known = f"[127.0.0.1]:{port} {kind.get_name()} {kind.get_base64()}\n"
            (home / ".ssh" / "known_hosts").write_text(known)
            with pytest.raises(LinkError) as error:
                open_port(parse(re.sub(r"&hostkey=[^&]*", "", server.url()), remote.OPTIONS))
            told = str(error.value)
            assert "has changed: it is SHA256:" in told and f"known_hosts has {kind.fingerprint}" in told
            assert f"ssh-keygen -R '[127.0.0.1]:{port}'" in told and "login" not in told
    finally:
        server.stop()


def test_a_plus_in_a_setting_is_a_plus():
    """Half of all hashes of keys have one; it was read as a blank, and the right key was refused."""
    there = parse("sftp://anna@host/x?hostkey=SHA256:gO/+eaT/fU&program=/a+b/", remote.OPTIONS)
    assert there.options["hostkey"] == "SHA256:gO/+eaT/fU" and there.options["program"] == "/a+b/"
    assert parse("sftp://anna@host/x?hostkey=SHA256:gO%2BeaT", remote.OPTIONS).options["hostkey"] == "SHA256:gO+eaT"


@pytest.mark.few(0)
@pytest.mark.system(*NEEDED["sftp"])
def test_a_private_key_that_does_not_open_is_no_login_that_was_refused(tmp_path, monkeypatch):
    server = ssh_server(tmp_path, tmp_path)
    monkeypatch.setenv("TANGO_TESTS_PHRASE", "open8")
    try:
        (tmp_path / "user").unlink()
        (tmp_path / "user.pub").unlink()
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "open8", "-f", tmp_path / "user"], check=True)
        (tmp_path / "authorized").write_bytes((tmp_path / "user.pub").read_bytes())
        open_port(parse(server.url(passphrase="env:TANGO_TESTS_PHRASE"), remote.OPTIONS)).close()
        monkeypatch.setenv("TANGO_TESTS_PHRASE", "other9")
        for url in (
            server.url(passphrase="env:TANGO_TESTS_PHRASE"),
            server.url().replace(f"key={tmp_path / 'user'}", f"key={tmp_path / 'user.pub'}"),
            re.sub(r"password=[^&]*&?", "", server.url()),
        ):
            with pytest.raises(InputError, match=r"key: found .*passphrase=env:NAME.*The control was not asked"):
                open_port(parse(url, remote.OPTIONS))
    finally:
        server.stop()


@pytest.mark.few(0)
@pytest.mark.system(*NEEDED["ftps"])
def test_a_control_that_asks_for_tls_is_said_to_do_so(tmp_path):
    (tmp_path / "control").mkdir()
    server = ftp_server(tmp_path, tmp_path / "control", True, tls_control_required=True)
    try:
        with pytest.raises(LinkError, match=r"asks for TLS: ftps:// in the port's URL"):
            open_port(parse(server.url().replace("ftps://", "ftp://").replace("&verify=no", ""), remote.OPTIONS))
    finally:
        server.stop()
