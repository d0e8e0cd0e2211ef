"""Readings that tell next to nothing end in a sentence, in every command that shows numbers."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from tango_cnc.cli import guarded, tango

MORE = {  # what a command has to be told besides its readings
    "compare": ("--with", "{cell}/whole.csv"),
    "compensate": ("--target", "siemens", "--dry-run"),
    "design": ("--goal", "check"),
    "predict": ("{cell}/part.nc", "--zero", "X=0,Y=0,Z=60", "--tool-length", "150"),
}
ELSEWHERE = {  # whose readings are others: of a sphere, of a protocol that is signed, those that it makes
    "accept": "test_acceptance.py",
    "capability": "test_capability.py",
    "run": "test_run.py",
}
PART = "G21 G90 G54\nG0 X0. Y0. Z20. A0. C0.\nG1 Z5. F500.\nG1 X20.\nM30\n"


def reading() -> list[str]:
    """→ commands that take readings, found by their option."""
    context = click.Context(tango)
    found = {name: tango.get_command(context, name) for name in tango.list_commands(context)}
    return [name for name, one in found.items() if one is not None and any("--readings" in p.opts for p in one.params)]


COMMANDS = [name for name in reading() if name not in ELSEWHERE]
Row = dict[str, str]


def called(*arguments: str) -> int:
    return guarded(tango.main, list(arguments), standalone_mode=False)


def one_place(rows: list[Row]) -> list[Row]:
    """The control sent the same record for every touch."""
    return [rows[0] | {"touch": str(i), "time_s": str(5.0 * i)} for i in range(1, 201)]


def one_facet(rows: list[Row]) -> list[Row]:
    return [row for row in rows if row["facet"] == "5"]


def three(rows: list[Row]) -> list[Row]:
    return rows[:3]


def one(rows: list[Row]) -> list[Row]:
    """A run that was interrupted after its first touch."""
    return rows[:1]


def missed(rows: list[Row]) -> list[Row]:
    return [row | {"status": "miss"} for row in rows]


@pytest.mark.few(1)
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("spoil", [one_place, one_facet, three, one, missed])
def test_a_sentence_and_no_traceback(
    spoil: Callable[[list[Row]], list[Row]], command: str, simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = Path(shutil.copytree(simulated, tmp_path / "cell"))
    with (cell / "simulated.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    with (cell / "simulated.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(spoil(rows))
    shutil.copy(simulated / "simulated.csv", cell / "whole.csv")
    (cell / "part.nc").write_text(PART, encoding="utf-8")
    more = [word.format(cell=cell) for word in MORE.get(command, ())]
    status = called(command, "-C", str(cell), "--readings", str(cell / "simulated.csv"), *more)
    said = capsys.readouterr()
    asked = f"tango {command} with readings that tell nothing; a command that needs more words: MORE of this file"
    assert status in (1, 2), f"{asked}: ended with {status}: {said.err}"
    assert said.out or said.err.lstrip().startswith("tango: "), f"{asked}: {said.err}"
    assert "Usage:" not in said.err and "no such file" not in said.err, f"{asked}: {said.err}"


def test_whose_readings_are_others_has_a_test_of_its_own() -> None:
    assert set(ELSEWHERE) <= set(reading()) and set(MORE) <= set(COMMANDS)
    assert not [file for file in ELSEWHERE.values() if not (Path(__file__).parent / file).is_file()]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cell = tmp_path_factory.mktemp("degenerate") / "cell"
    assert called("init", "--example", "trunnion", str(cell)) == 0
    assert called("simulate", "-C", str(cell)) == 0
    return cell
