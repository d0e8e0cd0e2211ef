"""Small mistakes that every other check lets pass: the residuals show their pattern, or the readings contradict themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.coverage import judged, pushed

from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Array, Cell, Readings


@pytest.fixture(scope="module")
def cell(root: Path) -> Cell:
    return read_cell(root / "examples" / "trunnion")


@pytest.fixture(scope="module")
def readings(cell: Cell, root: Path) -> Readings:
    return simulate(cell.machine, cell.artefact, cell.strategy, read_world(root / "examples/trunnion/world.yaml"), seed=21)


def column(cell: Cell, readings: Readings, axis: str, change: Array) -> Readings:
    position = np.array(readings.position)
    position[:, cell.machine.column(axis)] += change
    return replace(readings, position=position)


def test_nothing_is_lacking_where_nothing_is_wrong(cell: Cell, readings: Readings) -> None:
    assert judged(cell, readings).verdict == "trustworthy"


def test_a_rotary_scale_of_twenty_millionths_is_seen(cell: Cell, readings: Readings) -> None:
    angle = readings.position[:, cell.machine.column("C")]
    found = judged(cell, column(cell, readings, "C", 2e-5 * angle))
    assert found.verdict == "doubtful" and "C went further than the readings say" in " ".join(found.reasons)
    assert "ECCb" in found.untrusted  # 7 µrad of backlash that is not there, of which ± 0.5 would be said


def test_a_table_that_tilts_in_the_last_tenth_is_seen(cell: Cell, readings: Readings) -> None:
    point = np.array([cell.artefact.facets[f].point for f in readings.facet])
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    late = np.arange(len(readings)) >= 0.9 * len(readings)
    tilted = np.cross([7e-5, 4e-5, 3e-5], point - point.mean(axis=0))
    found = judged(cell, pushed(cell, readings, late * np.einsum("ij,ij->i", normal, tilted)))
    assert found.verdict == "doubtful" and "the table, or what is on it, had moved or turned at touch 20" in " ".join(found.reasons)


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_a_rotary_column_of_directions_that_contradicts_the_positions_is_said(cell: Cell, readings: Readings, share: float) -> None:
    direction = np.array(readings.direction)
    direction[np.random.default_rng(3).random(len(readings)) < share, cell.machine.column("A")] *= -1
    found = judged(cell, replace(readings, direction=direction))
    assert found.verdict == "doubtful" and "dA contradict the positions" in " ".join(found.reasons)
    assert "EAAb" in found.untrusted and "ECCb" not in found.untrusted


def test_an_axis_that_always_comes_from_one_side_is_no_contradiction(cell: Cell, readings: Readings) -> None:
    direction = np.array(readings.direction)
    direction[:, cell.machine.column("A")] = 1.0
    assert not any("contradict" in reason for reason in judged(cell, replace(readings, direction=direction)).reasons)
