"""A night is in doubt when something is wrong with its readings, and not otherwise. `benchmarks/doubt.py` does it over years."""

from __future__ import annotations

import shutil
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from support.nights_parts import Event, Story, nights
from support.spoilt import FIRST, SPOILT, Fault, fault, judged_in_full, said, spoilt

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.nightly.mail import message
from tango_cnc.records import Cell, World

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("night_doubt")]
QUIET = 12
SETTINGS = Nightly(diagnose=False, check_minutes=3.0)


@pytest.fixture(scope="module")
def before(root: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Cell, World, Path, list[str]]:
    """→ cell, its machine as it is after quiet nights, their history, what each morning said."""
    cell, truth = read_cell(root / "examples" / "trunnion"), read_world(root / "examples" / "trunnion" / "world.yaml")
    file, mornings = tmp_path_factory.mktemp("doubt") / "history.db", []
    with judged_in_full(cell, SETTINGS), opened(file) as history:
        for record, now in nights(cell, truth, history, QUIET, 21, Story(), SETTINGS, FIRST):
            mornings.append(said(record))
            truth = replace(now)
    return cell, truth, file, mornings


def test_a_diagnosis_that_cannot_be_made_hides_no_alarm(root: Path, tmp_path: Path) -> None:
    """A check of two minutes has as many touches as unknowns."""
    cell, truth = read_cell(root / "examples" / "trunnion"), read_world(root / "examples" / "trunnion" / "world.yaml")
    settings = Nightly(check_minutes=2.0)
    story = Story((Event(2, table=(0.018, 0.009, 0.0)),))
    with judged_in_full(cell, settings), opened(tmp_path / "history.db") as history:
        *_, (record, _) = nights(cell, truth, history, 2, 23, story, settings, FIRST)
    assert said(record) == "alarm" and "table" in record["headline"] and "more touches" in record["undiagnosed"]
    assert "No cause was looked for" in message(record, (), ())[1]


def test_quiet_nights_are_not_in_doubt(before: tuple[Cell, World, Path, list[str]]) -> None:
    assert before[3] == QUIET * ["good"]


WARMING = {"cause": "thermal_drift", "amplitude": 0.020}


@pytest.mark.parametrize(
    ("tau", "direction", "plain"),
    [(900, [0, 0.7, 0.7], True), (900, [1, 0, 0], True), (300, [0, 0.7, 0.7], True), (900, [0, 0, 1], False)],
)
def test_a_machine_that_warms_up_in_the_run_is_not_said_to_have_changed(
    before: tuple[Cell, World, Path, list[str]], tmp_path: Path, tau: float, direction: list[float], plain: bool
) -> None:
    """Its check looks like a spindle that has moved; along Z like a scale that has changed, which three minutes hardly tell."""
    cell, truth, file, _ = before
    warming = Fault({**WARMING, "tau": tau, "direction": direction})
    with judged_in_full(cell, SETTINGS), opened(Path(shutil.copy(file, tmp_path / "history.db"))) as history, spoilt(warming):
        ((record, _),) = nights(cell, truth, history, 1, 22, Story(), SETTINGS, FIRST + timedelta(days=QUIET))
    assert record["next"]["kind"] == "full"
    if not plain and said(record) == "alarm":
        assert [a["instead"][0] for a in record["alarms"]] == ["warm-up of the machine"]
        return
    assert said(record) == "doubtful" and not record["alarms"] and "on the move while it was measured" in record["headline"]


@pytest.mark.parametrize("errors", [{"EZZ1": -1.2e-5}, {"EY0S": 0.008}, {"EX0S": 0.008}])
def test_a_change_that_a_warm_up_resembles_is_an_alarm_without_doubt(
    before: tuple[Cell, World, Path, list[str]], tmp_path: Path, errors: dict[str, float]
) -> None:
    cell, truth, file, _ = before
    story = Story((Event(1, errors),))
    with judged_in_full(cell, SETTINGS), opened(Path(shutil.copy(file, tmp_path / "history.db"))) as history:
        ((record, _),) = nights(cell, truth, history, 1, 22, story, SETTINGS, FIRST + timedelta(days=QUIET))
    (alarm,) = record["alarms"]
    assert said(record) == "alarm" and list(errors) == [alarm["parameter"]]
    assert not any("warm-up" in other for other in alarm["instead"])


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_night_is_no_good_morning(name: str, before: tuple[Cell, World, Path, list[str]], tmp_path: Path) -> None:
    cell, truth, file, _ = before
    wrong = fault(name, list(cell.artefact.facets))
    story = Story((Event(1, table=wrong.table),) if wrong.table else ())
    with judged_in_full(cell, SETTINGS), opened(Path(shutil.copy(file, tmp_path / "history.db"))) as history, spoilt(wrong):
        ((record, _),) = nights(cell, truth, history, 1, 22, story, SETTINGS, FIRST + timedelta(days=QUIET))
    wanted = {"swapped facets": "doubtful", "half of the touches missing": "doubtful", "table knocked by 20 µm": "alarm"}
    assert said(record) == wanted[name] if name in wanted else said(record) in ("alarm", "doubtful", "set apart")
    assert record["next"]["kind"] == "full" or said(record) == "set apart"
