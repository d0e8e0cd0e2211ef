"""One more attack on each promise that a run makes, beside those of the other tests: hidden names, symbolic links, every write."""

import contextlib
import errno
import hashlib
import json
import os
import random
import re
import sys
import time
import zlib

import pytest
from support import gateway
from support.linkparts import job, machine, plan
from support.runs import Control, Result, readings
from support.runs import cell as cell  # a fixture

from tango_cnc.link.client import Touched
from tango_cnc.link.protocols import dnc, modbus, remote
from tango_cnc.link.secrets import shown
from tango_cnc.link.sensors import read_sensors
from tango_cnc.link.transport import open_port, parse
from tango_cnc.link.trust import Distrust, Leeway, judge
from tango_cnc.link.words import record
from tango_cnc.records import InputError

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="links and devices of POSIX")


# 1. Modbus


@pytest.mark.few(0)
def test_two_runs_whose_numbers_agree_in_sixteen_bits_never_take_each_others_echo():
    """The same plan twice at one control; layout 2 could not tell these two apart."""
    for seed in range(8):
        chance = random.Random(seed)
        control = gateway.Control(chance)
        way = gateway.Gateway(control, chance, {})
        runs = []
        for nonce in (0x0001_0007, 0x0002_0007):
            made = job(nonce=nonce, patience=(60.0,) * 4, start_patience=60.0)
            runs.append(gateway.Run(nonce, modbus.Client(made, {}), gateway.wanted(made)))
        while any(run.ended is None for run in runs) and control.now < 600.0:
            chance.choice([run for run in runs if run.ended is None]).step(way)
        verdict = gateway.judged(control, way, runs)
        assert (verdict.unsafe, verdict.invented) == ([], 0), seed
        assert len({one.client for one in control.begun}) <= 1 or not all(run.complete for run in runs)


# 2. One writer a cell; 3. files named in a URL


@POSIX
@pytest.mark.long
def test_a_second_run_by_another_name_of_the_same_folder_is_refused(cell, tmp_path):
    (tmp_path / "other").symlink_to(cell)
    control = Control(cell, stop=3)
    with running(cell, control) as process:
        until(lambda: (cell / "readings.journal").exists())
        result = Result("run", "-C", tmp_path / "other", "--port", "socket://127.0.0.1:9", "--timeout", "1")
        assert result.code == 3 and str(process.pid) in result.err, result.err


@POSIX
@pytest.mark.parametrize("name", ["link", "program/../artefact.yaml"])
def test_a_file_of_the_cell_is_left_alone_by_whatever_name(cell, name):
    before = (cell / "artefact.yaml").read_bytes()
    (cell / "program").mkdir(exist_ok=True)
    (cell / "link").symlink_to(cell / "artefact.yaml")
    url = f"linuxcnc://127.0.0.1:1?file={cell / name}&log={cell / 'new.txt'}"
    result = Result("run", "-C", cell, "--port", url, "--timeout", "1")
    assert result.code == 2 and "it would be lost" in result.err, result.err
    assert (cell / "artefact.yaml").read_bytes() == before


@pytest.mark.few(2)
@POSIX
@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("file:///etc/passwd", "a file without a record"),
        ("file:///etc", "found a folder"),
        ("file:///dev/zero", "a device or a pipe"),
        ("file://CELL/mine", "a file without a record"),
        ("linuxcnc://127.0.0.1:1?file=/etc/passwd&log=CELL/new.txt", "it would be lost"),
        ("modbus+tcp://127.0.0.1:1/1?layout=/etc/passwd", "no layout"),
        ("opcua://127.0.0.1:1?nodes=/etc/passwd", "names no variables"),
        ("grbl+socket://127.0.0.1:1?orient=m19&feed=1e9", "at most"),
    ],
)
def test_files_in_a_url_that_are_not_of_tango_are_refused_and_not_shown(cell, url, why):
    (cell / "mine").write_text("call the vendor\nP17 of the hall\n")
    url = url.replace("CELL", str(cell))
    result = Result("run", "-C", cell, "--port", url, "--timeout", "1")
    assert result.code == 2 and why in result.err and "root:" not in result.err, result.err
    assert url.startswith("grbl") or not (cell / "program").exists()


@pytest.mark.parametrize(
    "text", ["", "TANGO ST", "TANGO START 3F02A91C77D0 383\n", "hello\r\n\x12P17 H1 X-  91.2000 Y    0.5040\r\n\x14", "\0\0"]
)
def test_a_file_that_a_control_has_written_into_is_taken(tmp_path, text):
    (tmp_path / "TANGO.TXT").write_bytes(text.encode())
    open_port(parse(f"file://{tmp_path / 'TANGO.TXT'}", {})).close()


@contextlib.contextmanager
def running(folder, control, *more, **streams):
    import subprocess

    command = [
        sys.executable,
        "-m",
        "tango_cnc",
        "run",
        "-C",
        folder,
        "--port",
        f"{control.url}?listen=no",
        "--timeout",
        "20",
        *more,
    ]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | streams
    with subprocess.Popen([str(word) for word in command], **quiet) as process:
        try:
            yield process
        finally:
            process.kill()


def until(condition):
    for _ in range(600):
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("it has not happened")


# 5. Every write of a run


class Disk:
    """Refuses the n-th opening for writing, renaming or making of a folder inside a cell, and those after it."""

    def __init__(self):
        self.folder, self.left, self.error, self.refused, self.asked = "", -1, errno.ENOSPC, [], False

    def refuses(self, folder, at, error):
        """From the first call on this process asks at whatever it opens, which no process should that tests something else."""
        self.folder, self.left, self.error, self.refused = str(folder), at, error, []
        if not self.asked:
            sys.addaudithook(self._asked)
        self.asked = True

    def _asked(self, event, what):
        if self.left < 0 or event not in ("open", "os.rename", "os.mkdir", "os.truncate"):
            return
        path = os.fsdecode(what[0]) if isinstance(what[0], str | bytes) else ""
        writes = event != "open" or bool((what[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        if not writes or not path.startswith(self.folder):
            return
        self.left -= 1
        if self.left < 0:
            self.refused.append((event, path))
            self.left = 0
            raise OSError(self.error, os.strerror(self.error), path)


DISK = Disk()


@pytest.mark.parametrize("error", [errno.ENOSPC, pytest.param(errno.EROFS, marks=pytest.mark.long)])
@pytest.mark.parametrize("at", [3, *(pytest.param(n, marks=pytest.mark.long) for n in (0, 1, 2, *range(4, 12)))])
def test_a_disk_that_takes_nothing_from_any_write_on_leaves_a_run_to_be_resumed(cell, at, error):
    DISK.refuses(cell, at, error)
    try:
        result = Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20")
    finally:
        DISK.left = -1
    if not DISK.refused:
        assert result.code == 0, result.err
        return
    assert result.code == 3 and os.strerror(error) in result.err and "Traceback" not in result.err, (DISK.refused, result.err)
    journal = cell / "readings.journal"
    more = ["--resume"] if journal.exists() and '"segment"' in journal.read_text() else []
    again = Result("run", "-C", cell, "--port", f"{Control(cell).url}?listen=no", "--timeout", "20", *more)
    assert again.code == 0, (DISK.refused, again.err)
    assert sorted(readings(cell).touch) == [1, 2, 3, 4, 5, 6, 7]
    assert Result("journal", "verify", "-C", cell).code == 0


# 7. A post named by path is code


@pytest.mark.few(0)
@POSIX
@pytest.mark.untrusted
def test_a_link_that_points_elsewhere_after_it_was_trusted_is_asked_about_again(cell):
    post = "from postprocessors.fanuc import *  # noqa: F403\n"
    (cell / "good.py").write_text(post)
    (cell / "bad.py").write_text(f"import pathlib\npathlib.Path({str(cell / 'ran')!r}).touch()\n{post}")
    (cell / "mine.py").symlink_to("good.py")
    assert Result("trust", cell / "mine.py").code == 0
    (cell / "mine.py").unlink()
    (cell / "mine.py").symlink_to("bad.py")
    for command in ("check", "plan", "link-test", "run"):
        result = Result(command, "-C", cell, *(["--post", cell / "mine.py"] if command != "check" else []))
        assert result.code != 0 or command == "check", result.err
    assert not (cell / "ran").exists()


# 8. Secrets


@pytest.mark.parametrize(
    "url",
    [
        "ftp://anna:geheim8@127.0.0.1:1/TANGO.TXT",
        "ftps://anna:geheim8@127.0.0.1:1/TANGO.TXT",
        "sftp://anna:geheim8@127.0.0.1:1/TANGO.TXT",
        "smb://anna@shop:geheim8@127.0.0.1:1/SHARE/TANGO.TXT",
        "smb://:geheim8@127.0.0.1:1/SHARE/TANGO.TXT",
        "lsv2://x:geheim8@127.0.0.1/TNC:/TANGO.TXT",
        "opcua://anna:geheim8@127.0.0.1:4840",
        "socket://anna:geheim8@127.0.0.1:8193",
    ],
)
def test_a_password_before_the_host_is_refused_and_shown_nowhere(url):
    for text in (url, url.replace("geheim8", "geheim8@x")):
        with pytest.raises(InputError, match=r"stands in the address itself.* env:NAME") as refused:
            parse(text, remote.OPTIONS)
        assert "geheim8" not in str(refused.value) and "geheim8" not in shown(text)


@pytest.mark.parametrize(
    "sensor",
    ['mqtt: "mqtt://anna:geheim8@127.0.0.1/shop/bed"', 'mtconnect: "http://anna:geheim8@127.0.0.1:5000/current", item: bed'],
)
def test_a_password_in_the_address_of_a_sensor_is_refused_and_not_shown(tmp_path, sensor):
    (tmp_path / "sensors.yaml").write_text(f"sensors:\n  bed: {{{sensor}}}\n")
    with pytest.raises(InputError, match="env:NAME") as refused:
        read_sensors(tmp_path)
    assert "geheim8" not in str(refused.value)


@pytest.mark.few(4)
@pytest.mark.parametrize("name", ["password", "%70assword", "pass%77ord", "%70%61%73%73%77%6F%72%64", "passphrase", "p%61ssphrase"])
def test_a_password_under_a_coded_name_is_shown_nowhere(cell, name, monkeypatch):
    monkeypatch.setenv("CELL_WORD", "geheim9")
    url = f"ftp://anna@127.0.0.1:1/TANGO.TXT?{name}=env:CELL_WORD"
    address = parse(url, remote.OPTIONS)
    assert "geheim9" in address.hidden and "geheim9" not in address.url and "geheim9" not in shown(url)
    result = Result("run", "-C", cell, "--port", url, "--timeout", "1", "--transcript", cell / "talk.txt")
    everything = result.err + result.out + "".join(one.read_text(errors="replace") for one in cell.rglob("*") if one.is_file())
    assert result.code == 3 and "geheim9" not in everything
    with pytest.raises(InputError, match="stands in the address itself") as written:
        parse(url.replace("env:CELL_WORD", "geheim8"), remote.OPTIONS)
    assert "geheim8" not in str(written.value) and "geheim8" not in shown(url.replace("env:CELL_WORD", "geheim8"))


# 9. A resumed dnc run listens


@pytest.mark.parametrize("sign", [b"\x13", b"\x12", b"P5 H"])
def test_codes_and_pieces_of_records_begin_the_silence_anew(sign):
    client = dnc.Client(job(quiet=40.0), {})
    for _ in range(5):
        client.elapsed(39.0)
        client.receive(sign)
        assert client.bytes_to_send(100) == b""


# 10. The journal


def test_a_journal_that_was_written_anew_as_a_whole_shows_beside_the_readings(cell):
    """Every check sum and every hash is right again: one touch moved by 3 µm."""
    assert Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20").code == 0
    file, before, lines = cell / "readings.journal", None, []
    for line in file.read_text().splitlines():
        entry = json.loads(line[9:])
        if entry["kind"] == "reading" and entry["touch"] == 4:
            entry["position"][0] += 0.003
        if before is not None and "before" in entry:
            entry["before"] = hashlib.sha256(before).hexdigest()[: len(entry["before"])]
        body = json.dumps(entry, separators=(",", ":"), ensure_ascii=False)
        before = f"{zlib.crc32(body.encode()):08x} {body}".encode()
        lines.append(before)
    file.write_bytes(b"".join(line + b"\n" for line in lines))
    result = Result("journal", "verify", "-C", cell)
    assert result.code == 1, result.out


def test_a_journal_that_stands_twice_in_its_file_is_refused(cell):
    assert Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20").code == 0
    file = cell / "readings.journal"
    file.write_bytes(file.read_bytes() * 2)
    assert Result("journal", "verify", "-C", cell).code == 1
    assert Result("run", "-C", cell, "--resume", "--port", "socket://127.0.0.1:9").code == 2


# 11. Records


@pytest.mark.parametrize(
    "text",
    [
        "P1 H1 X20.003 Y0.000 Z50.000 B0.000 C0.000 Knan",
        "P1 H1 X1e1 Y0.000 Z50.000 B0.000 C0.000 K60.000",
        "P1 H1 X20.003 Y0.000 Z50.000 B0.000 C0.000 K70.003 K70.003",
        "P1 H1 X+-20.003 Y0.000 Z50.000 B0.000 C0.000 K70.003",
        "P01٣ H1 X20.003 Y0.000 Z50.000 B0.000 C0.000 K70.003",
    ],
)
def test_a_record_that_is_nearly_one_is_none(text):
    found = record(text, ("X", "Y", "Z", "B", "C", "K"))
    assert type(found).__name__ == "Refused" and not re.search(r"\n", found.why)


def sum_of(places, off):
    values = [20.003, 0.0, 50.0, 0.0, 0.0]
    text = " ".join(f"{letter}{value:.{places}f}" for letter, value in zip("XYZBC", values, strict=True))
    return record(f"P1 H1 {text} K{sum(values) + off:.{places}f}", ("X", "Y", "Z", "B", "C", "K"))


@pytest.mark.parametrize(("places", "taken", "refused"), [(3, 0.006, 0.007), (4, 0.0006, 0.0007)])
def test_a_sum_may_be_off_by_a_unit_of_the_last_place_for_each_number_and_by_no_more(places, taken, refused):
    """As docs/link.md says: controls round or cut each number and the sum for themselves."""
    for sign in (1, -1):
        assert type(sum_of(places, sign * taken)).__name__ == "Touched"
        assert type(sum_of(places, sign * refused)).__name__ == "Refused"


@pytest.mark.parametrize("flag", [0, 1, 2])
@pytest.mark.parametrize("letter", "XYZ")
def test_a_place_where_no_machine_can_be_is_no_reading_although_its_sum_is_right(flag, letter):
    places = {"X": "20.000", "Y": "0.000", "Z": "50.000", "B": "0.000", "C": "0.000"}
    places |= {letter: "99999999999999999999.000", "K": "99999999999999999999.000"}
    text = " ".join(f"{name}{value}" for name, value in places.items())
    said = record(f"P1 H{flag} {text}", ("X", "Y", "Z", "B", "C", "K"))
    assert isinstance(said, Touched)
    with pytest.raises(Distrust, match=f"{letter} is 1e\\+20 mm"):
        judge(said, plan().touches[0], machine(), Leeway())
