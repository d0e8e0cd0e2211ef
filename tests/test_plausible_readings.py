"""What readings give away by themselves: cycles that were pasted, positions that were rounded."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_readings_text, read_world, readings_text
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.plausible.data import Remark, remarks
from tango_cnc.plausible.program import another_program
from tango_cnc.records import Cell, Readings, World


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


@pytest.mark.long
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


@pytest.mark.long
def test_rounded_positions_are_named_with_their_digit_and_first(cell: Cell, twice: Readings) -> None:
    one, digit = twice.rows(twice.cycle == 1), 0.1
    rounded = replace(one, position=np.column_stack([np.round(one.position[:, :3] / digit) * digit, one.position[:, 3:]]))
    judgement = judge(cell, rounded, honest(estimate(cell.machine, cell.artefact, rounded, cell.terms)))
    assert judgement.verdict == "doubtful"
    assert any(re.match(f"every position is a whole multiple of {digit:g} mm:", r) for r in judgement.reasons)
    assert judgement.suspicions[0].kind == "rounded_positions"


def doubts(cell: Cell, readings: Readings, kind: str) -> list[Remark]:
    return [r for r in remarks(cell, readings) if r.kind == kind]


@pytest.mark.parametrize(
    "rows, axes, step", [("second half", "XYZ", 0.01), ("all", "X", 0.01), ("all", "XYZ", 0.005), ("second half", "Z", 0.1)]
)
def test_positions_rounded_in_a_part_are_named(cell: Cell, twice: Readings, rows: str, axes: str, step: float) -> None:
    position = np.array(twice.position)
    half = np.arange(len(position)) >= (len(position) // 2 if rows == "second half" else 0)
    for axis in axes:
        i = twice.axes.index(axis)
        position[half, i] = np.round(position[half, i] / step) * step
    (remark,) = doubts(cell, replace(twice, position=position), "rounded_positions")
    said = "in steps" if rows == "all" and axes == "XYZ" else "whole multiples"  # where others are not, it says so
    assert remark.verdict == "doubtful" and remark.key == ", ".join(axes) and f"{said} of {step:g} mm" in remark.text
    assert set(remark.touches) <= set(twice.touch[half].tolist())


@pytest.mark.parametrize(("repeatability", "said"), [(6e-4, True), (9e-4, False)], ids=["swamped", "stated"])
def test_a_control_that_counts_inches_says_so_or_has_it_stated(
    cell: Cell, twice: Readings, repeatability: float, said: bool
) -> None:
    counts = 0.00254  # mm, 0.0001 inch
    position = np.column_stack([np.round(twice.position[:, :3] / counts) * counts, twice.position[:, 3:]])
    own = replace(cell, machine=replace(cell.machine, probe=replace(cell.machine.probe, repeatability=repeatability)))
    found = doubts(own, replace(twice, position=position), "rounded_positions")
    assert [("in steps of 0.00254 mm" in r.text, "others are not" in r.text) for r in found] == [(True, False)] * said


@pytest.mark.few(0)
@pytest.mark.parametrize("digit", [1e-3, 1e-4])
@pytest.mark.parametrize("example", ["trunnion", "hu40t", "fork_head", "split"])
def test_honest_digits_are_not_taken_for_rounded_ones(example: str, digit: float, root: Path) -> None:
    own = read_cell(root / "examples" / example)
    readings = simulate(own.machine, own.artefact, own.strategy, read_world(root / "examples" / example / "world.yaml"), seed=8)
    position = np.array(readings.position)
    position[:, :3] = np.round(position[:, :3] / digit) * digit
    assert (
        doubts(own, readings, "rounded_positions") == [] == doubts(own, replace(readings, position=position), "rounded_positions")
    )


@pytest.mark.parametrize(("share", "digits"), [(0.3, 6), (0.1, 6), (0.3, 3)])
def test_positions_rounded_here_and_there_are_named(cell: Cell, twice: Readings, share: float, digits: int) -> None:
    position = np.round(twice.position, digits)
    position[:, 3:] = twice.position[:, 3:]
    some = np.random.default_rng(2).random(len(twice)) < share
    position[some, :3] = np.round(position[some, :3], 2)
    (said,) = doubts(cell, replace(twice, position=position), "rounded_positions")
    assert "0.01 mm" in said.text and set(said.touches) & set(twice.touch[some].tolist())


def test_five_rounded_rows_of_a_short_plan_are_named_though_no_axis_has_many(root: Path) -> None:
    own = read_cell(root / "examples" / "three_axis")
    readings = simulate(own.machine, own.artefact, own.strategy, read_world(root / "examples/three_axis/world.yaml"), seed=8)
    position = np.array(readings.position)
    some = [5, 14, 23, 36, 47]
    position[some, :3] = np.round(position[some, :3], 2)
    (said,) = doubts(own, replace(readings, position=position), "rounded_positions")
    assert set(said.touches) == set(readings.touch[some].tolist())


@pytest.mark.long
@pytest.mark.parametrize("step", [1 / 80, 5 / 2048, 0.0031])
def test_positions_of_a_drive_that_counts_in_steps_are_named(cell: Cell, twice: Readings, step: float) -> None:
    """80 steps a millimetre, 2048 a turn of a screw of 5 mm; zero lies anywhere; six decimals, as in readings.csv."""
    one = twice.rows(twice.cycle == 1)
    position = np.array(one.position)
    x = one.axes.index("X")
    position[:, x] = np.round(np.round((position[:, x] - 0.37) / step) * step + 0.37, 6)
    counted = replace(one, position=position)
    (remark,) = doubts(cell, counted, "rounded_positions")
    assert remark.verdict == "doubtful" and remark.key == "X"
    assert float(remark.text.split("steps of ")[1].split(" ")[0]) == pytest.approx(step, rel=1e-4)
    judgement = judge(cell, counted, honest(estimate(cell.machine, cell.artefact, counted, cell.terms)), search=False)
    assert {"EXX1", "EX0S", "EXXb"} <= set(judgement.untrusted)
    known = replace(cell, machine=replace(cell.machine, probe=replace(cell.machine.probe, repeatability=step / 2.5)))
    assert doubts(known, counted, "rounded_positions") == [], "who states it need not be reminded"


@pytest.mark.few(1)
@pytest.mark.parametrize("jitter", [2e-5, 1e-4])
def test_a_cycle_that_was_pasted_and_shaken_a_little_is_named(cell: Cell, twice: Readings, jitter: float) -> None:
    copy = pasted(twice)
    position = np.array(copy.position)
    position[copy.cycle == 2, :3] += np.random.default_rng(3).normal(0, jitter, (int((copy.cycle == 2).sum()), 3))
    (remark,) = doubts(cell, replace(copy, position=position), "copied_positions")
    assert remark.verdict == "doubtful" and "cycle 2 agrees with cycle 1" in remark.text
    assert doubts(cell, twice, "copied_positions") == []


@pytest.mark.long
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


def spoilt(readings: Readings, column: int, values: np.ndarray) -> Readings:
    position = np.array(readings.position)
    position[:, column] = values
    return replace(readings, position=position)


@pytest.mark.parametrize("column, way", [(0, 1), (1, -1), (2, 1)])
def test_a_column_that_was_sorted_alone_is_named(cell: Cell, twice: Readings, column: int, way: int) -> None:
    (remark,) = found(cell, spoilt(twice, column, np.sort(twice.position[:, column])[::way]))
    assert (remark.kind, remark.key) == ("row_order", "XYZ"[column]) and "was sorted without its rows" in remark.text


def test_a_column_that_a_plan_goes_through_in_one_way_is_not_sorted(cell: Cell, twice: Readings) -> None:
    order = np.argsort(twice.position[:, 0])  # whole rows: each touch is still where its facet is
    assert not [r for r in remarks(cell, twice.rows(order)) if r.kind == "row_order"]


def test_positions_of_other_rows_are_not_called_rounded(cell: Cell, twice: Readings) -> None:
    for seed in range(3):
        mixed = replace(twice, position=twice.position[np.random.default_rng(seed).permutation(len(twice))])
        assert not [r for r in remarks(cell, mixed) if r.kind == "rounded_positions"]


@pytest.mark.parametrize("dropped", [{"dX", "dY", "dZ"}, {"dA"}, {"dX", "dY", "dZ", "dA", "dC", "dS"}], ids=len)
def test_a_copy_of_readings_has_the_direction_columns_that_they_had(cell: Cell, twice: Readings, dropped: set[str]) -> None:
    head, *rows = list(csv.reader(readings_text(twice).splitlines()))
    kept = [i for i, name in enumerate(head) if name not in dropped]
    without = "".join(",".join(row[i] for i in kept) + "\n" for row in (head, *rows))
    read = read_readings_text(without, cell.machine, cell.artefact)
    assert {f"d{name}" for name in read.derived} == dropped and readings_text(read) == without


def test_a_row_copied_over_the_next_is_named_and_is_no_other_program(cell: Cell, twice: Readings) -> None:
    one = twice.rows(twice.cycle == 1)
    order = np.arange(len(one))
    order[98] = 97
    copied = replace(one.rows(order), touch=one.touch)
    (remark,) = another_program(cell, copied)
    assert (remark.kind, remark.touches) == ("repeated_touches", (99,)) and "to the last digit" in remark.text
    shaken = spoilt(copied, 0, copied.position[:, 0] + 0.001 * (np.arange(len(one)) == 98))
    assert {r.kind for r in another_program(cell, shaken)} == {"another_program"}


@pytest.mark.parametrize(("factor", "unit"), [(1 / 60, "minutes or hours"), (1000.0, "milliseconds")])
def test_a_clock_in_another_unit_is_noted(cell: Cell, twice: Readings, factor: float, unit: str) -> None:
    one = twice.rows(twice.cycle == 1)
    assert not [r for r in remarks(cell, one) if "time_s" in r.text]
    (note,) = [r for r in remarks(cell, replace(one, time=one.time * factor)) if "time_s" in r.text]
    assert note.verdict == "trustworthy" and f"is in {unit}" in note.text


def test_a_long_pause_is_no_other_unit(cell: Cell, twice: Readings) -> None:
    one = twice.rows(twice.cycle == 1)
    lunch = np.where(np.arange(len(one)) > 40, 5 * 3600.0, 0.0)
    assert not [r for r in remarks(cell, replace(one, time=one.time + lunch)) if "time_s" in r.text]


@pytest.fixture(scope="module")
def in_a_row(cell: Cell) -> tuple[Cell, Readings]:
    """Six touches of each facet, one after the other: the control writes 1 µm, the probe scatters by the stated 0.7 µm."""
    each = tuple(replace(i, facets=tuple(f for f in i.facets for _ in range(6))) for i in cell.strategy.indexations[:6])
    own = replace(cell, strategy=replace(cell.strategy, indexations=each))
    own = replace(own, machine=replace(cell.machine, probe=replace(cell.machine.probe, repeatability=0.0007)))
    exact = simulate(own.machine, own.artefact, own.strategy, World(noise=0.0007), seed=3)
    return own, replace(exact, position=np.column_stack([np.round(exact.position[:, :3], 3), exact.position[:, 3:]]))


def test_touches_in_a_row_that_end_on_the_same_digits_by_chance_were_not_copied(in_a_row: tuple[Cell, Readings]) -> None:
    own, honest_ones = in_a_row
    assert len(np.unique(honest_ones.position, axis=0)) < 0.95 * len(honest_ones), "many do"
    assert doubts(own, honest_ones, "copied_positions") == []


def test_touches_in_a_row_that_the_control_writes_as_the_first_of_them_were_copied(in_a_row: tuple[Cell, Readings]) -> None:
    own, readings = in_a_row
    position = np.array(readings.position)
    position[:, :3] = position[np.arange(len(position)) // 6 * 6, :3]
    (remark,) = doubts(own, replace(readings, position=position), "copied_positions")
    assert "exactly the position of another" in remark.text
