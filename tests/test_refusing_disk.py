"""Every call of a run that writes is refused once: a sentence, exit status 3, nothing lost, and the run is resumed as it says.

The calls are counted in a run whose disk takes everything, so a call that somebody adds is refused here from then on. A function
whose text writes and that no run has asked fails the last test.
"""

from __future__ import annotations

import errno
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest
from support.refusingdisk import ROOT, SHORT, Call, Disk, refusing, sites
from support.runs import STRATEGY, Control, Result, readings

from tango_cnc.commands.init import write_example
from tango_cnc.link.protocols import linuxcnc
from tango_cnc.link.transport import foreseen, open_port, parse
from tango_cnc.records import LinkError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="which file an open handle has is asked of /proc")
KINDS = ("first", "again", "resumed")  # a new cell; over a complete run; after one that broke off
# What a run does without: outputs beside it, and what it takes away when all is written.
BESIDE = {"commands/_live.py", "commands/run.py:_transcript", "files/targets.py:writable"}
LATE = {"link/measure.py:_finish", "link/lock.py:_released", "files/plan.py:write_together"}  # unlink, rmdir
# Functions that write and that no run over a socket asks, and what asks them.
ELSEWHERE = {
    "cli.py:_say": "a closed terminal",
    "cli.py:_streams": "a program without streams",
    "commands/_progress.py:_to_nowhere": "a closed terminal",
    "commands/_trusted.py:trust": "tango trust",
    "commands/init.py:write_example": "tango init",
    "commands/run.py:_transcript": "the file opens at the first byte, in commands/_live.py",
    "link/aside.py:_written": "the screen",
    "link/transport/_linuxcnc.py:_put": "the test of linuxcnc",
    "link/transport/_port.py:write": "a serial line",
    "link/transport/_refused.py:knows": "a copy of a damaged known_hosts, where the system has such",
}


def outputs(cell: Path) -> list[object]:
    return ["--transcript", cell / "bytes.txt", "--json", cell / "events.json"]


def run(cell: Path, *more: object, stop: int | None = None) -> Result:
    control = Control(cell, stop=stop, hang_up=True)
    return Result("run", "-C", cell, "--port", f"{control.url}?listen=no", "--timeout", "20", *more)


@cache
def begun(kind: str, folder: Path) -> Path:
    """kind of run, a folder → the cell as it is before it."""
    cell = folder / kind
    write_example(cell, "hu40t")
    (cell / "strategy.yaml").write_text(STRATEGY)
    if kind == "again":
        assert run(cell).code == 0
    if kind == "resumed":
        assert run(cell, stop=3).code == 3
    return cell


def asked(kind: str, cell: Path, disk: Disk) -> Result:
    more = ["--resume"] if kind == "resumed" else []
    with refusing(disk):
        return run(cell, *outputs(cell), *more)


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("refusing")


def written(kind: str, places: Path) -> list[Call]:
    """kind of run → its calls that write, in their order."""
    cell = places / f"{kind}-whole"
    shutil.copytree(begun(kind, places), cell)
    disk = Disk((cell,))
    result = asked(kind, cell, disk)
    shutil.rmtree(cell)
    assert result.code == 0, result.err
    return disk.calls


def kept(cell: Path) -> set[bytes]:
    """folder of a cell → what is measured there: the texts of its readings and journals; those of a partial file are in both."""
    found = (file for pattern in ("readings*.csv", "*.journal") for file in cell.glob(pattern))
    return {file.read_bytes() for file in found if "partial" not in file.name}


def goes_on(kind: str, places: Path, at: int, error: int, on: bool) -> Iterator[str]:
    """kind of run, call that is refused, error, whether those after it are too → what is wrong with what came of it."""
    before = begun(kind, places)
    cell = places / f"{kind}-{at}"
    shutil.copytree(before, cell)
    disk = Disk((cell,), at, error, on)
    result = asked(kind, cell, disk)
    if not disk.refused:  # a short write is none of this call, or the run has fewer calls this time
        shutil.rmtree(cell)
        return
    first = disk.refused[0]
    said = "" if error == SHORT else os.strerror(error)
    where = f"call {at} {first.what} of {first.site} to {Path(first.path).name}"
    if first.site == "files/targets.py:writable" and on:  # asked before anything is begun
        if result.code != 2 or said not in result.err or kept(cell) != kept(before):
            yield f"{where}: exit {result.code}: {result.err[-300:]}"
        shutil.rmtree(cell)
        return
    if "Traceback" in result.err or result.code not in (0, 3):
        yield f"{where}: exit {result.code}: {result.err[-300:]}"
    harmless = {first.site, first.site.partition(":")[0]} & BESIDE or (first.site in LATE and first.what in ("unlink", "rmdir"))
    if error != SHORT and not harmless and (result.code != 3 or said not in result.err):
        yield f"{where}: exit {result.code} without {said}: {result.err[-300:]}"
    lost = [text for text in kept(before) if not any(now.startswith(text) for now in kept(cell))]
    if lost:
        yield f"{where}: {len(lost)} files of before are lost"
    if result.code == 3:
        again = run(cell, *(["--resume"] if "--resume" in result.err or kind == "resumed" else []))
        if again.code != 0:
            yield f"{where}: then exit {again.code}: {result.err[-200:]} THEN {again.err[-300:]}"
            return
    if not (cell / "readings.csv").exists():
        yield f"{where}: no readings"
    elif sorted(readings(cell).touch) != [1, 2, 3, 4, 5, 6, 7] or Result("journal", "verify", "-C", cell).code != 0:
        yield f"{where}: not every touch is there"
    left = [file.name for file in cell.rglob(".*") if file.name != ".tango.lock"] if result.code == 0 and not on else []
    if left and not on and not harmless:
        yield f"{where}: {left} are left"
    shutil.rmtree(cell)


ERRORS = (errno.ENOSPC, errno.EIO, errno.EROFS)  # in turn: which one it is makes no difference but in the message


def different(calls: Sequence[Call]) -> list[int]:
    """calls → numbers of those to refuse: of calls that do the same to one file the first, the second and the last."""
    alike: dict[tuple[str, ...], list[int]] = {}
    for number, call in enumerate(calls):
        alike.setdefault((call.what, call.site, Path(call.path).name.split(".csv.")[0][:12]), []).append(number)
    return sorted({number for numbers in alike.values() for number in (*numbers[:2], numbers[-1])})


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", KINDS)
def test_a_call_here_and_there_is_refused(kind: str, places: Path) -> None:
    numbers = different(written(kind, places))
    assert len(numbers) > 30
    assert [text for at in numbers[5::15] for text in goes_on(kind, places, at, errno.ENOSPC, at % 2 == 0)] == []


@pytest.mark.few(1)
@pytest.mark.parametrize("option", ["--transcript", "--json"])
def test_an_output_that_does_not_open_while_the_machine_moves_ends_no_run(option: str, places: Path) -> None:
    """click has an error of its own for it, which ended the run with exit status 1 in mid-conversation."""
    cell = places / option.strip("-")
    shutil.copytree(begun("first", places), cell)
    file = cell / "out" / "bytes.txt"
    file.parent.mkdir()
    disk = Disk((file.parent,), 1)  # the first is the trial whether anything can be written there
    with refusing(disk):
        result = run(cell, option, file)
    assert [call.what for call in disk.refused] == ["open"] and result.code == 0, result.err
    assert "No space left on device" in result.err and "the run goes on" in result.err
    assert sorted(readings(cell).touch) == [1, 2, 3, 4, 5, 6, 7]


@pytest.mark.long
@pytest.mark.parametrize("how", ["once", "from then on", "half is taken"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_call_is_refused(kind: str, how: str, places: Path) -> None:
    wrong = []
    for at in different(written(kind, places)):
        error = SHORT if how == "half is taken" else ERRORS[at % len(ERRORS)]
        wrong += goes_on(kind, places, at, error, how == "from then on")
    assert wrong == []


@pytest.mark.parametrize("error", [*ERRORS, SHORT])
def test_a_program_for_linuxcnc_that_cannot_be_written_leaves_nothing_to_start_and_keeps_no_later_run_out(
    tmp_path: Path, error: int
) -> None:
    """The error of a full disk names no file, and a program that is cut off before its mark is taken for somebody else's."""
    program = b"(TANGO small)\n(PROGRAM 0A1B2C3D4E5F PLAN 0A1B2C3D4E5F)\nM2\n"
    with socket.create_server(("127.0.0.1", 0)) as server:
        names = f"file={tmp_path / 'tango.ngc'}&log={tmp_path / 'log.txt'}"
        address = parse(f"linuxcnc://127.0.0.1:{server.getsockname()[1]}?{names}", linuxcnc.OPTIONS)
        for at in range(3):
            for file, text in (("tango.ngc", program), ("log.txt", b"TANGO START 0A1B2C3D4E5F 3\n")):
                (tmp_path / file).write_bytes(text)
            port, disk = open_port(address), Disk((tmp_path,), at, error)
            with refusing(disk):
                try:
                    port.write(b"put tango.ngc " + program.hex().encode() + b"\n")
                except LinkError as refused:
                    file = "log.txt" if disk.refused[0].what == "unlink" else "tango.ngc"
                    assert f"{file}: cannot be written ({os.strerror(error)}); make room" in str(refused)
                else:
                    assert error == SHORT
            port.close()
            left = (tmp_path / "tango.ngc").read_bytes()
            assert left == program or (left == b"" and disk.refused[0].what == "write")
            foreseen(address)
        assert error == SHORT or disk.refused[0].what == "unlink"


MODULES = """
import sys
from pathlib import Path
from support.runs import Control, Result
cell = Path(sys.argv[1])
assert Result("run", "-C", cell, "--port", Control(cell).url, "--timeout", "20").code == 0
print(*(module.__file__ for name, module in sys.modules.items() if name.startswith("tango_cnc.") and module.__file__), sep="\\n")
"""


@pytest.mark.few(0)
def test_every_function_of_a_run_that_writes_was_asked(places: Path) -> None:
    """Of all modules that a run loads: one that is asked by no kind of run here is named with the reason."""
    path = os.pathsep.join([str(ROOT / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])])
    cell = places / "modules"
    shutil.copytree(begun("first", places), cell)
    loaded = subprocess.run(
        [sys.executable, "-c", MODULES, cell], env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    found = sites([Path(line) for line in loaded.stdout.splitlines()])
    assert len(found) > 15
    asked_for = {call.site for kind in KINDS for call in written(kind, places)}
    assert found - asked_for == set(ELSEWHERE)
