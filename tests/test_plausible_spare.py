"""Touches without weight count, for whatever reason; a fit with few touches to spare is never believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.coverage import pushed

from sim_controller.simulate import simulate
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.plausible.spare import FEW, FEWEST, MOST
from tango_cnc.records import Cell, Readings

Measured = tuple[Cell, Readings]


@pytest.fixture(scope="module")
def measured(pytestconfig: pytest.Config) -> Measured:
    folder = pytestconfig.rootpath / "examples" / "trunnion"
    cell = read_cell(folder)
    return cell, simulate(cell.machine, cell.artefact, cell.strategy, read_world(folder / "world.yaml"), seed=31)


def judged(cell: Cell, readings: Readings) -> tuple[Judgement, Estimate]:
    result = honest(estimate(cell.machine, cell.artefact, readings, cell.terms))
    return judge(cell, readings, result, search=False), result


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", [1, 2])
def test_late_touches_that_leave_hardly_any_with_weight_are_implausible(measured: Measured, seed: int) -> None:
    cell, readings = measured
    late = np.random.default_rng(seed).random(len(readings)) < 0.3
    judgement, result = judged(cell, pushed(cell, readings, np.where(late, -0.05, 0.0)))
    assert result.unused.mean() > MOST > result.out.mean(), "more are without weight than do not fit"
    assert judgement.verdict == "implausible"
    assert any(f"{int(result.unused.sum())} touches have no weight" in reason for reason in judgement.reasons)
    assert {*result.parameters, *result.setup} <= set(judgement.untrusted)


@pytest.mark.few(0)
def test_few_touches_to_spare_are_incomplete_and_no_parameter_is_trusted(measured: Measured) -> None:
    cell, readings = measured
    whole = judged(cell, readings)[1]
    some = np.ones(len(readings), dtype=bool)
    some[np.random.default_rng(3).permutation(len(readings))[: whole.dof - FEWEST + 4]] = False
    judgement, result = judged(cell, readings.rows(some))
    assert result.dof < FEWEST < FEW < whole.dof
    assert judgement.incomplete and {*result.parameters, *result.setup} <= set(judgement.untrusted)
    assert any(f"leave {result.dof} degrees of freedom" in reason for reason in judgement.reasons)
    followed = judge(cell, readings.rows(some), result, search=False, alone=False)
    assert not any("degrees of freedom" in reason for reason in followed.reasons), "with nights before, each touch is one to spare"


@pytest.mark.few(0)
@pytest.mark.parametrize("wrong", ["an eighth is off", "all scatter by 4 µm"])
def test_what_scatters_for_no_known_reason_leaves_no_parameter_trusted(measured: Measured, wrong: str) -> None:
    cell, readings = measured
    rng = np.random.default_rng(6)
    off = np.where(rng.random(len(readings)) < 0.125, 0.05, 0.0) if "eighth" in wrong else rng.normal(0, 0.004, len(readings))
    judgement, result = judged(cell, pushed(cell, readings, off))
    assert judgement.verdict == "doubtful"
    assert {*result.parameters, *result.setup} <= set(judgement.untrusted)


def test_a_sound_cell_has_nothing_of_this(measured: Measured) -> None:
    judgement, _ = judged(*measured)
    assert (judgement.verdict, judgement.untrusted, judgement.incomplete) == ("trustworthy", (), False)


@pytest.mark.long
def test_where_most_touches_missed_these_come_first_and_no_mistake_is_said_to_fit(measured: Measured) -> None:
    cell, readings = measured
    some = np.random.default_rng(4).random(len(readings)) < 0.3
    longer = replace(cell, machine=replace(cell.machine, probe=replace(cell.machine.probe, length=cell.machine.probe.length + 12)))
    few = replace(readings, status=tuple("ok" if s else "miss" for s in some))
    result = honest(estimate(longer.machine, longer.artefact, few, longer.terms))
    judgement = judge(longer, few, result)
    first, *others = judgement.suspicions
    assert judgement.incomplete and first.kind == "missing_touches"
    assert "compare directions and points of the axes" in first.text
    assert others and not any(s.fits or s.text.startswith("the readings fit") for s in others)
