"""What would be corrected twice is refused; a run whose tool center point control was stated wrongly decides nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.compensated import example, first, measured, write

from sim_controller.compensation import read
from tango_cnc.commands._present import present
from tango_cnc.compensate import loop, propose
from tango_cnc.compensate.outcome import Outcome, asked_otherwise, outcome
from tango_cnc.compensate.targets import SIGN_TRIAL
from tango_cnc.compensate.targets.siemens import steps
from tango_cnc.records import InputError

NOW, LATER = "2026-01-01T00:00:00Z", "2026-02-01T00:00:00Z"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    (tmp_path / "tango.yaml").write_text("tango: 1\n")
    return tmp_path


def test_two_controls_do_not_hold_the_same_error(cell: Path) -> None:
    one, two, again = (loop.store(cell, propose(first("trunnion"), target), NOW) for target in ("haas", "centroid", "haas"))
    assert loop.other_control(cell, two) is None
    loop.note(cell, one, NOW, "written")
    other = loop.other_control(cell, two)
    assert other is not None and other.number == 1
    assert loop.other_control(cell, again) is None  # it takes the place of the first
    loop.note(cell, one, LATER, "rolled back", text="spindle changed")
    assert loop.other_control(cell, two) is None


def test_readings_from_before_a_compensation_do_not_contain_it(cell: Path) -> None:
    rows = [f"{i:08x}" for i in range(10)]
    kept = loop.store(cell, propose(first("trunnion"), "haas"), NOW, rows=rows)
    assert loop.ignored(cell, rows, None) is None  # proposed, and not in the control
    loop.note(cell, kept, NOW, "written")
    missed = loop.ignored(cell, rows, None)
    assert missed is not None and missed[0].number == 1 and "10 of 10 rows" in missed[1]
    earlier = loop.ignored(cell, ["other"], "2025-12-31T00:00:00Z")
    assert earlier is not None and "before the compensation" in earlier[1]
    assert loop.ignored(cell, ["other"], LATER) is None


def test_readings_of_an_earlier_compensation_are_from_before_the_later_one(cell: Path) -> None:
    """1 was made from `rows`, 2 on top of it from `second`, 3 from what was measured with 2: each knows what it cannot be in."""
    rows, second, third = ([f"{i:08x}" for i in range(start, start + 10)] for start in (0, 10, 20))
    proposal, days = propose(first("trunnion"), "haas"), (NOW, LATER, "2026-03-01T00:00:00Z")
    one, two, _ = (loop.store(cell, proposal, day, rows=made) for day, made in zip(days, (rows, second, third), strict=True))
    assert "10 of 10 rows" in loop.before(cell, one.record, rows, None)
    assert "4 of 4 rows" in loop.before(cell, one.record, rows[3:7], None)  # some of them are the same touches
    assert "compensation 1, which is older" in loop.before(cell, two.record, rows, None)
    assert "10 of 10 rows" in loop.before(cell, two.record, second, None)
    assert "before the compensation" in loop.before(cell, two.record, ["other"], NOW)
    assert not loop.before(cell, one.record, second, None)  # made with 1 in the control; 2 need not have been loaded
    assert not loop.before(cell, two.record, third, "2026-02-02T00:00:00Z")


def test_another_compensation_than_the_one_in_the_control_is_refused(cell: Path) -> None:
    proposal = propose(first("trunnion"), "haas", poses=100)
    one, two = (loop.store(cell, proposal, day) for day in (NOW, LATER))
    asked: dict[str, Any] = {"present": one.folder, "file": None, "trial_of": None, "target": "haas"}
    assert present(cell, asked)[1] == one.record  # nothing is noted as written: the person knows
    loop.note(cell, two, LATER, "written")
    with pytest.raises(InputError, match=r"compensation 2 \(haas\) is in the control; allowed: --present .*002-haas"):
        present(cell, asked)
    assert present(cell, {**asked, "present": two.folder})[1] == two.record


def test_a_folder_that_is_no_cell_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found no tango.yaml; allowed: the folder of a cell, given with -C"):
        loop.one(tmp_path, 1)


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, Outcome]:
    """The answer about tool center point control → outcome of a run that was made with it on."""
    folder = tmp_path_factory.mktemp("cell")
    cell, world = example("trunnion")
    proposal = propose(measured(cell, world), "siemens")
    kept = loop.store(folder, proposal, NOW)
    again = measured(cell, world, read(write(proposal, folder / "loaded"), cell.machine), seed=11)
    return {tcp: outcome(kept, again, list(proposal.held), tcp=tcp) for tcp in (True, False)}


def test_a_wrong_answer_decides_nothing(answers: dict[bool, Outcome]) -> None:
    """What the kinematics hold is gone and is taken off once more: a share of more than all is no news of the control."""
    assert answers[True].verdict == "kept" and answers[False].verdict == "not as promised"
    asked = asked_otherwise(answers[False], answers[True], tcp=False)
    assert asked.verdict == "undecided" and "state --tcp" in asked.text
    assert asked_otherwise(answers[True], answers[False], tcp=True) is answers[True]


def test_with_it_on_the_verdict_stays_and_both_reasons_are_named(answers: dict[bool, Outcome]) -> None:
    asked = asked_otherwise(answers[False], answers[True], tcp=True)
    assert asked.verdict == answers[False].verdict
    assert "state --no-tcp" in asked.text and "does not use the kinematics" in asked.text


def test_a_sign_trial_asks_for_no_sign_trial(cell: Path) -> None:
    proposal = propose(first("trunnion"), "siemens")
    assert SIGN_TRIAL in steps(proposal.request)
    whole, trial = (loop.store(cell, proposal, NOW, cell / name, trial=name == "b").record["steps"] for name in "ab")
    assert sum("--sign-trial" in step for step in whole) == 1 and not any("sign" in step for step in trial)
    assert [step.split(". ", 1)[1] for step in whole if "--sign-trial" not in step] == [s.split(". ", 1)[1] for s in trial]
    assert [int(step.split(".")[0]) for step in trial] == list(range(1, len(trial) + 1))
