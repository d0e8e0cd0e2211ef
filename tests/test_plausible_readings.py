"""What readings give away by themselves: cycles that were pasted, positions that were rounded."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.plausible.data import Remark, remarks
from tango_cnc.records import Cell, Readings


@pytest.fixture(scope="module")
def cell(root: Path) -> Cell:
    return read_cell(root / "examples" / "trunnion")


@pytest.fixture(scope="module")
def twice(cell: Cell, root: Path) -> Readings:
    """Two honest cycles."""
    return simulate(cell.machine, cell.artefact, cell.strategy, read_world(root / "examples/trunnion/world.yaml"), cycles=2, seed=5)


def pasted(readings: Readings, shift: float = 0.0) -> Readings:
    position = np.array(readings.position)
    position[readings.cycle == 2] = position[readings.cycle == 1]
    position[readings.cycle == 2, 0] += shift
    return replace(readings, position=position)


def found(cell: Cell, readings: Readings) -> list[Remark]:
    return [r for r in remarks(cell, readings) if r.verdict == "implausible"]


def test_honest_cycles_are_no_copies(cell: Cell, twice: Readings) -> None:
    assert found(cell, twice) == []
    # A display of 1 µm shows the same digits in many honest touches of a probe that repeats to 0.3 µm.
    sharp = replace(cell, machine=replace(cell.machine, probe=replace(cell.machine.probe, repeatability=0.0003)))
    quiet = pasted(twice)
    noise = np.random.default_rng(1).normal(0, 0.0003, quiet.position[:, :3].shape)
    shown = np.column_stack([np.round(quiet.position[:, :3] + noise, 3), quiet.position[:, 3:]])
    assert found(sharp, replace(quiet, position=shown)) == []


@pytest.mark.parametrize("shift, how", [(0.0, "digit for digit:"), (0.001, "but for a shift of all touches")])
def test_a_pasted_cycle_is_implausible_and_named(cell: Cell, twice: Readings, shift: float, how: str) -> None:
    (remark,) = found(cell, pasted(twice, shift))
    assert remark.text.startswith("cycle 2 repeats cycle 1 digit for digit") and how in remark.text
    assert (remark.kind, remark.key) == ("copied_positions", "cycle")
    assert remark.change == "delete the rows of cycle 2, and measure them"


def test_rounded_positions_are_named_with_their_digit_and_first(cell: Cell, twice: Readings) -> None:
    one, digit = twice.rows(twice.cycle == 1), 0.1
    rounded = replace(one, position=np.column_stack([np.round(one.position[:, :3] / digit) * digit, one.position[:, 3:]]))
    judgement = judge(cell, rounded, honest(estimate(cell.machine, cell.artefact, rounded, cell.terms)))
    assert judgement.verdict == "doubtful"
    assert any(re.match(f"every position is a whole multiple of {digit:g} mm:", r) for r in judgement.reasons)
    assert judgement.suspicions[0].kind == "rounded_positions"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("axis", ["X", "C"])
def test_an_axis_the_wrong_way_on_the_first_example_is_no_traceback(axis: str, root: Path) -> None:
    known = read_cell(root / "examples" / "hu40t")
    readings = simulate(known.machine, known.artefact, known.strategy, read_world(root / "examples/hu40t/world.yaml"), seed=3)
    position = np.array(readings.position)
    position[:, readings.axes.index(axis)] *= -1
    spoilt = replace(readings, position=position)
    result = honest(estimate(known.machine, known.artefact, spoilt, known.terms))
    assert judge(known, spoilt, result, search=False).verdict == "implausible"
