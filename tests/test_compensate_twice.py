"""What would be corrected twice is refused; a run whose tool center point control was stated wrongly decides nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.compensated import example, first, measured, proposed, write
from support.few import every

from sim_controller.compensation import read
from tango_cnc.commands._present import present
from tango_cnc.compensate import loop, propose
from tango_cnc.compensate.contradicted import contradicted
from tango_cnc.compensate.hidden import of_record
from tango_cnc.compensate.outcome import Outcome, asked_otherwise, judged, outcome
from tango_cnc.compensate.promise import Figure
from tango_cnc.compensate.space import Held
from tango_cnc.compensate.targets import SIGN_TRIAL
from tango_cnc.compensate.targets.siemens import steps
from tango_cnc.estimate import Estimate
from tango_cnc.records import InputError

NOW, LATER = "2026-01-01T00:00:00Z", "2026-02-01T00:00:00Z"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    (tmp_path / "tango.yaml").write_text("tango: 1\n")
    return tmp_path


@pytest.mark.long
def test_two_controls_do_not_hold_the_same_error(cell: Path) -> None:
    one, two, again = (loop.store(cell, proposed("trunnion", target), NOW) for target in ("haas", "centroid", "haas"))
    assert loop.other_control(cell, two) is None
    loop.note(cell, one, NOW, "written")
    other = loop.other_control(cell, two)
    assert other is not None and other.number == 1
    assert loop.other_control(cell, again) is None  # it takes the place of the first
    loop.note(cell, one, LATER, "rolled back", text="spindle changed")
    assert loop.other_control(cell, two) is None


@pytest.mark.few(0)
def test_readings_from_before_a_compensation_do_not_contain_it(cell: Path) -> None:
    rows = [f"{i:08x}" for i in range(10)]
    kept = loop.store(cell, proposed("trunnion", "haas"), NOW, rows=rows)
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
    proposal, days = proposed("trunnion", "haas"), (NOW, LATER, "2026-03-01T00:00:00Z")
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
    at = replace(example("trunnion")[0], folder=cell)
    assert present(at, asked)[1] == one.record  # nothing is noted as written: the person knows
    loop.note(cell, two, LATER, "written")
    with pytest.raises(InputError, match=r"compensation 2 \(haas\) is in the control; allowed: --present .*002-haas"):
        present(at, asked)
    assert present(at, {**asked, "present": two.folder})[1] == two.record


def test_a_folder_that_is_no_cell_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found no tango.yaml; allowed: the folder of a cell, given with -C"):
        loop.one(tmp_path, 1)


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> tuple[loop.Kept, Estimate, list[Held]]:
    """A compensation, what a run with it in the control finds (made with tool center point control on), what its target holds."""
    folder = tmp_path_factory.mktemp("cell")
    cell, world = example("trunnion")
    proposal = propose(measured(cell, world), "siemens")
    kept = loop.store(folder, proposal, NOW)
    again = measured(cell, world, read(write(proposal, folder / "loaded"), cell.machine), seed=11)
    return kept, again, list(proposal.held)


@pytest.fixture(scope="module")
def answers(second: tuple[loop.Kept, Estimate, list[Held]]) -> dict[bool, Outcome]:
    """The answer about tool center point control → outcome of a run that was made with it on."""
    kept, again, held = second
    return {tcp: outcome(kept, again, held, tcp=tcp) for tcp in (True, False)}


@pytest.mark.long
def test_readings_that_another_answer_explains_are_named(second: tuple[loop.Kept, Estimate, list[Held]]) -> None:
    """Made with tool center point control and with the tables; a knock of 50 µm that nothing explains says nothing."""
    kept, again, held = second
    assert not contradicted(kept, again, held, tcp=True)
    assert "made with it on, they leave" in contradicted(kept, again, held, tcp=False)
    assert "made without it, it would leave" in contradicted(kept, first("trunnion"), held, tcp=True)
    knocked = again.values.copy()
    knocked[[c.name for c in again.model.coefficients].index("EY0C")] += 0.05
    for tcp in (True, False):
        assert not contradicted(kept, replace(again, values=knocked), held, tcp=tcp)


@pytest.mark.long
@pytest.mark.parametrize("tcp", every([False, True], 2))
def test_what_is_left_is_one_number(
    second: tuple[loop.Kept, Estimate, list[Held]], answers: dict[bool, Outcome], tcp: bool
) -> None:
    """The same readings: what `--measured` finds left is what a next proposal says is there now."""
    kept, again, _ = second
    limits = {n: tuple(np.radians(v) if n in "AC" else v) for n, v in kept.record["volume"].items()}
    now = propose(again, "siemens", present=of_record(kept.record), volume=limits, tcp=tcp).fit.rms_before
    left = answers[tcp].measured
    assert [left.value, left.low, left.high] == pytest.approx([now.value, now.low, now.high], rel=1e-3)


@pytest.mark.long
def test_a_wrong_answer_decides_nothing(answers: dict[bool, Outcome]) -> None:
    """What the kinematics hold is gone and is taken off once more: a share of more than all is no news of the control."""
    assert answers[True].verdict == "kept" and answers[False].verdict == "not as promised"
    asked = asked_otherwise(answers[False], answers[True], tcp=False)
    assert asked.verdict == "undecided" and "state --tcp" in asked.text
    assert asked_otherwise(answers[True], answers[False], tcp=True) is answers[True]


@pytest.mark.long
def test_with_it_on_the_verdict_stays_and_both_reasons_are_named(answers: dict[bool, Outcome]) -> None:
    asked = asked_otherwise(answers[False], answers[True], tcp=True)
    assert asked.verdict == answers[False].verdict
    assert "state --no-tcp" in asked.text and "does not use the kinematics" in asked.text


@pytest.mark.parametrize(
    ("before", "promised", "left", "share", "word"),
    [
        # Second compensations of a simulated machine, as a user had them: each keeps its promise, and each was "rolled back".
        ((3.81, 3.15, 5.45), (3.41, 3.10, 3.95), (3.54, 3.21, 4.22), (1.20, 0.86, 1.54), "kept"),
        ((2.07, 0.83, 4.88), (1.48, 0.70, 2.91), (2.42, 1.41, 3.82), (1.03, 0.93, 1.14), "kept"),
        ((1.80, 0.45, 4.05), (0.90, 0.48, 1.97), (1.45, 0.87, 2.76), (1.43, 0.78, 2.07), "kept"),
        # A large one: loaded, not loaded, half of its tables, with a wrong sign, held twice.
        ((30.1, 29.8, 30.5), (0.9, 0.5, 1.9), (1.3, 0.8, 2.5), (1.00, 0.99, 1.01), "kept"),
        ((30.1, 29.8, 30.5), (0.9, 0.5, 1.9), (30.0, 29.7, 30.4), (0.00, -0.02, 0.02), "no help"),
        ((30.1, 29.8, 30.5), (0.9, 0.5, 1.9), (16.6, 16.2, 17.0), (0.70, 0.69, 0.71), "not as promised"),
        ((30.1, 29.8, 30.5), (0.9, 0.5, 1.9), (60.2, 59.8, 60.6), (-1.0, -1.02, -0.98), "no help"),
        ((30.1, 29.8, 30.5), (0.9, 0.5, 1.9), (30.1, 29.7, 30.5), (2.00, 1.98, 2.02), "no help"),
        # A small one that these touches cannot tell from none, one that is not loaded and seen as such, one with a knock after it.
        ((2.0, 0.8, 4.9), (1.4, 0.7, 2.9), (1.9, 0.8, 4.0), (0.55, 0.10, 0.95), "undecided"),
        ((2.0, 0.8, 4.9), (1.4, 0.7, 2.9), (2.1, 1.0, 4.0), (0.50, -0.30, 1.30), "undecided"),
        ((2.0, 1.6, 2.9), (1.0, 0.7, 1.5), (2.0, 1.6, 2.9), (0.10, -0.20, 0.40), "no help"),
        ((3.81, 3.15, 5.45), (3.41, 3.10, 3.95), (24.0, 23.5, 24.5), (1.10, 0.80, 1.40), "not as promised"),
    ],
)  # fmt: skip
def test_only_evidence_against_it_is_no_help(
    before: tuple[float, float, float],
    promised: tuple[float, float, float],
    left: tuple[float, float, float],
    share: tuple[float, float, float],
    word: str,
) -> None:
    assert judged(Figure(*before), Figure(*promised), Figure(*left), Figure(*share)) == word


@pytest.mark.long
def test_a_sign_trial_asks_for_no_sign_trial(cell: Path) -> None:
    proposal = proposed("trunnion", "siemens")
    assert SIGN_TRIAL in steps(proposal.request)
    whole, trial = (loop.store(cell, proposal, NOW, cell / name, trial=name == "b").record["steps"] for name in "ab")
    assert sum("--sign-trial" in step for step in whole) == 1 and not any("sign" in step for step in trial)
    asked = next(step for step in whole if "--sign-trial" in step)  # of a table: touches of the probing programs feel it
    tables = {h.table for h in proposal.held if not h.tcp}
    assert any(f"--sign-trial '{table}'" in asked for table in tables) and "these act with tool center point control only" in asked
    assert [step.split(". ", 1)[1] for step in whole if "--sign-trial" not in step] == [s.split(". ", 1)[1] for s in trial]
    assert [int(step.split(".")[0]) for step in trial] == list(range(1, len(trial) + 1))
