"""A control that writes its records into a file on a share: half lines, replaced files, and whole runs of two languages."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.linkparts import MARK, job
from support.profiles import spoken
from support.runs import STRATEGY, Result
from support.simulated_runs import agree

from postprocessors import heidenhain
from tango_cnc.commands.init import write_example
from tango_cnc.link.client import Begun, Refused
from tango_cnc.link.protocols import file as protocol
from tango_cnc.link.transport import Lost, open_port, parse, said_before
from tango_cnc.records import InputError, LinkError


@pytest.fixture
def share(tmp_path):
    (tmp_path / "share").mkdir()
    return tmp_path / "share"


def opened(file, query=""):
    return open_port(parse(f"file://{file}{query}", protocol.OPTIONS))


def test_what_stands_in_the_file_already_is_of_another_run(share):
    file = share / "TANGO.TXT"
    file.write_bytes(b"TANGO START 0A 1\nP1 H1 X1\nTANGO END 1\n")
    line = opened(file)
    assert line.read(0) == b""
    with file.open("ab") as control:
        control.write(b"TANGO START 0B 1\n")
    assert line.read(0) == b"TANGO START 0B 1\n"
    assert line.read(0) == b""


def test_who_started_the_control_first_reads_from_the_last_start_mark(share):
    file = share / "TANGO.TXT"
    file.write_bytes(b"TANGO START 0A 1\nP1 H1 X1\nTANGO END 1\nTANGO START 0B 1\nP1 H1 X2\n")
    assert opened(file, "?from=last").read(0) == b"TANGO START 0B 1\nP1 H1 X2\n"


def test_the_file_need_not_be_there_before_the_control_writes_it(share):
    line = opened(share / "TANGO.TXT")
    assert line.read(0) == b""
    (share / "TANGO.TXT").write_bytes(b"\xef\xbb\xbfTANGO START 0B 1\r\n")
    assert line.read(0) == b"TANGO START 0B 1\r\n"


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_a_half_line_waits_for_its_end_wherever_it_is_cut(share, end):
    """The LF of a CR that ended the line already is no line."""
    record = b"P1 H1 X20.0030 Y0.0000 K20.0030" + end
    for cut in range(1, record.index(end) + 1):
        file = share / f"{cut}.txt"
        line = opened(file)
        file.write_bytes(record[:cut])
        assert line.read(0) == b""
        with file.open("ab") as control:
            control.write(record[cut:])
        assert line.read(0) == record


def test_a_file_that_has_grown_before_its_data_has_come_is_read_when_it_is_there(share):
    """Over a network a reader may see the new size first, and NULs where the data will stand."""
    file = share / "TANGO.TXT"
    line = opened(file)
    file.write_bytes(b"P1 H1 X1\n" + b"\0" * 9)
    assert line.read(0) == b"P1 H1 X1\n"
    assert line.read(0) == b""
    file.write_bytes(b"P1 H1 X1\nP2 H1 X2\n")
    assert line.read(0) == b"P2 H1 X2\n"


@pytest.mark.parametrize("new", [b"P1\n", b"TANGO START 0C 1\nP1 H1 X3\nTANGO END 1\nand more\n"])
def test_a_file_that_was_replaced_is_read_from_its_beginning(share, new):
    file = share / "TANGO.TXT"
    file.write_bytes(b"TANGO START 0A 1\nP1 H1 X1\n")
    line = opened(file)
    (share / "new").write_bytes(new)
    os.replace(share / "new", file)
    assert line.read(0) == new
    file.unlink()
    assert line.read(0) == b""


def test_a_share_that_is_gone_is_a_lost_line(share):
    line = opened(share / "TANGO.TXT")
    share.rmdir()
    with pytest.raises(Lost, match="still mounted"):
        line.read(0)


def test_a_path_that_cannot_be_meant_is_refused(share):
    with pytest.raises(LinkError, match=r"there is no folder .* mounted"):
        opened(share / "nowhere" / "TANGO.TXT")
    with pytest.raises(InputError, match="found a folder"):
        opened(share)
    with pytest.raises(InputError, match="no file"):
        parse("file://", protocol.OPTIONS)


@pytest.mark.parametrize(
    ("url", "path"),
    [
        ("file:///mnt/control%20one/TANGO.TXT", "/mnt/control one/TANGO.TXT"),
        ("file:///C:/share/TANGO.TXT", "C:/share/TANGO.TXT"),
        ("file://Z:/TANGO.TXT?from=last", "Z:/TANGO.TXT"),
    ],
)
def test_paths_as_people_and_programs_write_them(url, path):
    assert parse(url, protocol.OPTIONS).target == path


@pytest.mark.long
@pytest.mark.parametrize(
    ("post", "language", "name"),
    [
        ("heidenhain", "klartext", "TANGO.H"),
        ("heidenhain\n  cycle: 444", "klartext", "TANGO.H"),
        pytest.param("siemens", "siemens", "TANGO.MPF", marks=pytest.mark.long),
    ],
)
def test_a_whole_run_of_a_control_that_writes_a_file(tmp_path, share, post, language, name):
    """The program is carried to the control and started there while `tango run` waits for what it writes."""
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    find = ", find: {feed: 800, retreat: 8.5}" if "444" in post else ""
    (folder / "strategy.yaml").write_text(STRATEGY.replace("feed: 180}", f"feed: 180{find}}}"))
    cell = (folder / "tango.yaml").read_text()
    (folder / "tango.yaml").write_text(spoken(cell, f"post: {post}"))
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    (share / "stored.txt").write_text("".join(f"{line}\n" for line in ("TNC:\\TANGO.A", *heidenhain.mask())))
    command = [
        sys.executable,
        "-m",
        "sim_controller",
        "--cell",
        folder,
        "--language",
        language,
        "--start",
        folder / "program" / name,
    ]
    stored = ["--stored", share / "stored.txt"] if "heidenhain" in post else []
    with subprocess.Popen([*command, "--records", share / "TANGO.TXT", *stored]) as control:
        try:
            result = Result("run", "-C", folder, "--port", f"file://{share / 'TANGO.TXT'}?from=last", "--timeout", "20")
        finally:
            control.kill()
    assert result.code == 0, result.err
    assert agree(folder)


def test_a_damaged_line_counts_from_the_start_mark_on():
    """What stands in the file before it is of another run, or a person's: it stops nothing."""
    one = protocol.Client(job(), {})
    assert one.receive(b"P1 H1 X1,5\n") == []
    marks = one.receive(f"TANGO START {MARK} 3\n".encode())
    assert isinstance(marks[-1], Begun)
    (refused,) = one.receive(b"P1 H1 X1,5\n")
    assert isinstance(refused, Refused) and "a comma" in refused.why


def test_whoever_reads_an_old_file_is_told_how_old_it_is(tmp_path: Path) -> None:
    """Records of yesterday become readings of today: nobody else would notice."""
    file = tmp_path / "TANGO.TXT"
    file.write_text("TANGO START 0123456789AB 8\n")
    last = parse(f"file://{file}?from=last", protocol.OPTIONS)
    for age, said in ((3600.0, "1 h 0 min ago"), (26 * 3600.0, "26 h 0 min ago"), (9 * 86400.0, "9 days ago")):
        os.utime(file, (time.time() - age,) * 2)
        assert said_before(last).endswith(said)
    assert said_before(parse(f"file://{file}", protocol.OPTIONS)) == ""
    file.unlink()
    assert said_before(last) == ""
