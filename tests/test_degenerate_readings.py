"""Readings that tell next to nothing end in a sentence, in every command that shows numbers."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tango_cnc.cli import guarded, tango

COMMANDS = (
    "estimate",
    *(pytest.param(c, marks=pytest.mark.long) for c in ("verify", "diagnose", "iso230", "uncertainty", "report")),
)
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
    status = called(command, "-C", str(cell), "--readings", str(cell / "simulated.csv"))
    said = capsys.readouterr()
    assert status in (1, 2)
    assert said.out or said.err.startswith("tango: ")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cell = tmp_path_factory.mktemp("degenerate") / "cell"
    assert called("init", "--example", "trunnion", str(cell)) == 0
    assert called("simulate", "-C", str(cell)) == 0
    return cell
