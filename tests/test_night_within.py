"""A knock while the machine is measured is named with its moment and its size where it is plain, and nothing else is."""

from __future__ import annotations

import shutil
from datetime import timedelta
from pathlib import Path

import pytest
from support.midway import knocked
from support.nights_parts import Event, Story, nights
from support.spoilt import FIRST, SPOILT, fault, judged_in_full, said, spoilt

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.nightly.mail import message
from tango_cnc.records import Cell, World

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("night_within")]
QUIET = 12
SETTINGS = Nightly(diagnose=False, check_minutes=5.5)
LATER = FIRST + timedelta(days=QUIET)


@pytest.fixture(scope="module")
def before(root: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Cell, World, Path]:
    """→ cell, its machine as it is after quiet nights, their history."""
    cell, truth = read_cell(root / "examples" / "trunnion"), read_world(root / "examples" / "trunnion" / "world.yaml")
    file = tmp_path_factory.mktemp("within") / "history.db"
    with judged_in_full(cell, SETTINGS), opened(file) as history:
        *_, (_, now) = nights(cell, truth, history, QUIET, 31, Story(), SETTINGS, FIRST)
    return cell, now, file


@pytest.mark.parametrize(
    ("name", "size", "share"), [("EY0C", 0.020, 0.3), ("EX0S", 0.010, 0.5), ("EC0X", 40e-6, 0.5), ("EB0C", 40e-6, 0.7)]
)
def test_a_knock_within_the_run_is_named_with_its_moment(
    before: tuple[Cell, World, Path], tmp_path: Path, name: str, size: float, share: float
) -> None:
    cell, now, file = before
    with judged_in_full(cell, SETTINGS), opened(Path(shutil.copy(file, tmp_path / "h.db"))) as history:
        with knocked({name: size}, share):
            ((record, _),) = nights(cell, now, history, 1, 41, Story(), SETTINGS, LATER)
        story = Story((Event(1, {name: size}),))
        ((full, _),) = nights(cell, now, history, 1, 42, story, SETTINGS, LATER + timedelta(days=1))
    found = record["within"]
    assert found["parameter"] == name and abs(found["size"] - size) < 4 * found["std"] < size
    touches = _touches(file.parent, record, tmp_path)
    first = touches[int(share * len(touches))]
    assert touches.index(found["touch_before"]) < touches.index(first) <= touches.index(found["touch_after"])
    assert said(record) == "doubtful" and not record["alarms"] and record["next"]["kind"] == "full"
    text = message(record, (), ())[1]
    assert "the machine moved while it was measured, between touches" in record["headline"] and name in text and "full run" in text
    place = touches.index(found["touch_before"]) + 1
    assert f"between touches {place} and" in text and f"of the {len(touches)} that were made" in text  # a check has few of them
    assert "Ask who was at the machine while it was measured." in text
    assert full["kind"] == "full" and [a["parameter"] for a in full["alarms"]] == [name]


def _touches(folder: Path, record: dict[str, object], tmp_path: Path) -> list[int]:
    """→ numbers of the touches of the newest night, as they were made."""
    with opened(tmp_path / "h.db") as history:
        entry = next(n.entry for n in history.nights("trunnion") if n.start_utc == record["start_utc"])
        lines = (history.night(entry).readings or "").splitlines()
    place = lines[0].split(",").index("touch")
    return [int(line.split(",")[place]) for line in lines[1:] if line]


def test_what_no_touch_tells_from_it_is_named_beside_it_as_in_an_alarm(before: tuple[Cell, World, Path], tmp_path: Path) -> None:
    cell, now, file = before
    with (
        judged_in_full(cell, SETTINGS),
        opened(Path(shutil.copy(file, tmp_path / "h.db"))) as history,
        knocked({"EX0C": 0.02}, 0.5),
    ):
        ((record, _),) = nights(cell, now, history, 1, 41, Story(), SETTINGS, LATER)
    found = record["within"]
    assert found["parameter"] == "EX0S" and "EX0C" in found["instead"] and "EX0C" in record["headline"]


def test_the_table_that_is_knocked_within_the_run_is_named(before: tuple[Cell, World, Path], tmp_path: Path) -> None:
    cell, now, file = before
    kept = Path(shutil.copy(file, tmp_path / "h.db"))
    with judged_in_full(cell, SETTINGS), opened(kept) as history, knocked({}, 0.5, (0.018, 0.009, 0.0)):
        ((record, _),) = nights(cell, now, history, 1, 41, Story(), SETTINGS, LATER)
    assert record["within"]["parameter"] == "table" and record["within"]["size"] == pytest.approx(0.0201, abs=0.001)


@pytest.mark.parametrize("name", [*SPOILT, "warm-up in a minute", "knock before the run"])
def test_what_is_no_step_within_the_run_is_not_called_one(name: str, before: tuple[Cell, World, Path], tmp_path: Path) -> None:
    cell, now, file = before
    wrong = fault(name if name in SPOILT else SPOILT[3], list(cell.artefact.facets))
    if name == "warm-up in a minute":
        wrong = type(wrong)({"cause": "thermal_drift", "amplitude": 0.03, "tau": 60, "direction": [0, 0.7, 0.7]})
    knock = name == "knock before the run"
    events = (Event(1, table=wrong.table),) if wrong.table else (Event(1, {"EY0C": 0.020}),) if knock else ()
    kept = Path(shutil.copy(file, tmp_path / "h.db"))
    with judged_in_full(cell, SETTINGS), opened(kept) as history, spoilt(type(wrong)() if knock else wrong):
        ((record, _),) = nights(cell, now, history, 1, 43, Story(events), SETTINGS, LATER)
    assert "within" not in record and said(record) in ("alarm", "doubtful", "set apart")
