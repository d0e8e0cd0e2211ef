"""Mistakes in the middle of a run: an axis that counts from elsewhere, a column that is lost, touches that are late."""

from __future__ import annotations

import math
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.estimated import judged, measured
from support.few import every

from tango_cnc.judgement import Judgement, Suspicion
from tango_cnc.records import Cell, Readings
from tango_cnc.touches import from_readings

Rows = slice | np.ndarray


def spoilt(root: Path, example: str, axis: str, rows: Rows, more: float = 0.0, times: float = 1.0, seed: int = 4) -> Judgement:
    """One column of a sound run, in some rows times a factor and larger."""
    cell, readings = measured(root, example, seed)
    position = np.array(readings.position)
    column = cell.machine.column(axis)
    position[rows, column] = position[rows, column] * times + more
    return judged(cell, replace(readings, position=position))


def late(cell: Cell, readings: Readings, mask: np.ndarray, by: float) -> Readings:
    """Touches that read beyond the surface by so many mm."""
    touches = from_readings(cell.machine, cell.artefact, readings)
    levers = np.stack([touches.lever(name) for name in cell.machine.linear], axis=1)
    position = np.array(readings.position)
    position[:, [cell.machine.column(n) for n in cell.machine.linear]] -= (
        levers / (levers**2).sum(1)[:, None] * (by * mask)[:, None]
    )
    return replace(readings, position=position)


def first(judgement: Judgement, kind: str) -> Suspicion:
    assert judgement.verdict != "trustworthy"
    found = judgement.suspicions[0]
    assert found.kind == kind
    return found


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("example", "axis", "row", "more"),
    every([("trunnion", "Y", 113, 50.0), ("hu40t", "Z", 200, -0.5), ("fork_head", "X", 100, 3.0), ("huron", "Y", 60, 0.1)], 1),
)
def test_an_axis_that_counts_from_another_zero_is_named_with_the_touch_and_the_size(
    example: str, axis: str, row: int, more: float, root: Path
) -> None:
    found = first(spoilt(root, example, axis, slice(row, None), more), "zero_since")
    assert found.key == axis and found.fits and abs(found.touches[0] - row) <= 8
    said = re.search(rf"{axis} by ([+-][\d.]+) mm", found.text)
    assert said and abs(float(said[1]) + more) < 0.002


@pytest.mark.long
def test_a_part_of_the_run_from_another_zero_is_named_with_both_ends(root: Path) -> None:
    found = first(spoilt(root, "split", "Z", slice(71, 128), 6.7), "zero_since")
    assert found.key == "Z" and found.fits and abs(found.touches[0] - 72) <= 8 and abs(found.touches[-1] - 128) <= 8


@pytest.mark.long
def test_an_axis_in_inches_from_a_touch_on_is_named(root: Path) -> None:
    found = first(spoilt(root, "fork_head", "Z", slice(120, None), times=1 / 25.4), "unit_since")
    assert found.key == "Z" and found.fits and "from touch 121 on" in found.text


@pytest.mark.few(0)
@pytest.mark.parametrize(("example", "row"), every([("trunnion", 1), ("hu40t", 380), ("split", 224)], 1))
def test_a_column_of_the_spindle_that_was_lost_is_named(example: str, row: int, root: Path) -> None:
    judgement = spoilt(root, example, "S", slice(row, None), times=0.0)
    found = first(judgement, "column_wrong")
    assert found.key == "S" and "S of the readings is 0°" in found.text
    assert {"EXt", "EYt"} <= set(judgement.untrusted)  # what only turning the spindle tells


@pytest.mark.long
def test_a_rotary_axis_that_counts_from_another_zero_is_named(root: Path) -> None:
    found = first(spoilt(root, "hu40t", "B", slice(227, None), math.radians(-0.24)), "column_wrong")
    assert found.key == "B" and found.fits and "-0.2400°" in found.text
    found = first(spoilt(root, "hu40t", "B", slice(227, None), math.radians(0.05)), "zero_since")  # less than a program would show
    assert found.key == "B" and found.fits


@pytest.mark.long
@pytest.mark.parametrize("share", [0.15, 0.35])
def test_touches_that_are_late_by_one_distance_are_named_with_it(share: float, root: Path) -> None:
    cell, readings = measured(root, "huron", 4)
    mask = np.random.default_rng(5).random(len(readings)) < share
    found = first(judged(cell, late(cell, readings, mask, 0.2)), "late_touches")
    assert "200 µm late" in found.text


@pytest.mark.long
def test_touches_that_are_late_toward_one_side_are_named_with_it(root: Path) -> None:
    cell, readings = measured(root, "trunnion", 4)
    mask = from_readings(cell.machine, cell.artefact, readings).machine_normal[:, 1] > 0.7
    found = first(judged(cell, late(cell, readings, mask, 1.4)), "late_touches")
    assert "toward Y-" in found.text and "1400 µm late" in found.text


@pytest.mark.long
def test_late_touches_that_are_more_than_a_plausible_backlash_are_named_with_side_and_size(root: Path) -> None:
    """The backlash took half of it, and what was left of some touches was named in its place."""
    cell, readings = measured(root, "split", 4)
    mask = from_readings(cell.machine, cell.artefact, readings).machine_normal[:, 1] < -0.7
    found = first(judged(cell, late(cell, readings, mask, 0.2)), "late_touches")
    assert found.fits and "toward Y+" in found.text
    said = re.search(r"(\d+) µm late", found.text)
    assert said and abs(float(said[1]) - 200) < 3


@pytest.mark.long
def test_a_sign_that_was_lost_where_no_contact_shows_it_is_named_from_there(root: Path) -> None:
    cell, readings = measured(root, "fork_head", 4)
    position = np.array(readings.position)
    column = cell.machine.column("C")
    position[37:, column] = np.abs(position[37:, column])  # C turns the ball about itself at touches 38 to 42
    found = first(judged(cell, replace(readings, position=position)), "lost_sign")
    assert found.key == "C" and "touches from 38 to" in found.text


@pytest.mark.long
def test_a_part_begins_and_ends_with_touches_that_feel_it(root: Path) -> None:
    found = first(spoilt(root, "hu40t", "X", slice(101, 121), 0.05), "zero_since")
    assert (found.touches[0], found.touches[-1]) == (106, 121)
    assert "between touches 91 and 106" in found.change  # 102 is the first that is wrong


@pytest.mark.long
def test_touches_without_weight_of_one_indexation_are_a_reason(root: Path) -> None:
    """Twenty-three of its thirty-six touches went on to agree, by facets that no other indexation touches: no angle fitted them."""
    judgement = spoilt(root, "hu40t", "C", slice(263, 299), math.radians(0.05), seed=700)
    found = first(judgement, "indexation")
    assert found.key == "C" and "264 to 299" in found.text
    assert any("of one indexation" in text for text in judgement.reasons)


@pytest.mark.long
def test_a_zero_that_changes_in_many_days_is_named_within_memory_that_grows_with_the_touches(root: Path) -> None:
    """The weights of 24 days of trunnion, touch by touch, would be 240 MB, and several times that on the way to a verdict."""
    cell, one = measured(root, "trunnion", 4)
    days = 24
    count = len(one.touch)
    rows = np.tile(np.arange(count), days)
    many = replace(one.rows(rows), day=np.repeat(np.arange(1, days + 1), count))
    position = np.array(many.position) + np.random.default_rng(5).normal(scale=0.0007, size=many.position.shape) * [
        1,
        1,
        1,
        0,
        0,
        0,
    ]
    first = 15 * count + 40
    position[first:, cell.machine.column("X")] += 0.4
    tracemalloc.start()
    judgement = judged(cell, replace(many, position=position))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert judgement.suspicions[0].kind == "zero_since", judgement.suspicions[:2]
    assert "from touch 41 on: X by -0.400 mm more" in judgement.suspicions[0].text
    assert peak < 600e6, peak
