"""Small mistakes that every other check lets pass: the residuals show their pattern, or the readings contradict themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.coverage import judged, pushed

from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world
from tango_cnc.kinematics import chain, tip
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


@pytest.mark.long
def test_a_rotary_scale_of_twenty_millionths_is_seen(cell: Cell, readings: Readings) -> None:
    angle = readings.position[:, cell.machine.column("C")]
    found = judged(cell, column(cell, readings, "C", 2e-5 * angle))
    assert found.verdict == "doubtful" and "C went further than the readings say" in " ".join(found.reasons)
    assert "ECCb" in found.untrusted  # 7 µrad of backlash that is not there, of which ± 0.5 would be said


@pytest.mark.long
def test_a_table_that_tilts_in_the_last_tenth_is_seen(cell: Cell, readings: Readings) -> None:
    point = np.array([cell.artefact.facets[f].point for f in readings.facet])
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    late = np.arange(len(readings)) >= 0.9 * len(readings)
    tilted = np.cross([7e-5, 4e-5, 3e-5], point - point.mean(axis=0))
    found = judged(cell, pushed(cell, readings, late * np.einsum("ij,ij->i", normal, tilted)))
    assert found.verdict == "doubtful" and "the table, or what is on it, had moved or turned at touch 20" in " ".join(found.reasons)


@pytest.mark.few(0)
@pytest.mark.parametrize("share", [1.0, 0.3])
def test_a_rotary_column_of_directions_that_contradicts_the_positions_is_said(cell: Cell, readings: Readings, share: float) -> None:
    direction = np.array(readings.direction)
    direction[np.random.default_rng(3).random(len(readings)) < share, cell.machine.column("A")] *= -1
    found = judged(cell, replace(readings, direction=direction))
    assert found.verdict == "doubtful" and "dA contradict the positions" in " ".join(found.reasons)
    assert "EAAb" in found.untrusted and "ECCb" not in found.untrusted


@pytest.mark.long
def test_an_axis_that_always_comes_from_one_side_is_no_contradiction(cell: Cell, readings: Readings) -> None:
    direction = np.array(readings.direction)
    direction[:, cell.machine.column("A")] = 1.0
    assert not any("contradict" in reason for reason in judged(cell, replace(readings, direction=direction)).reasons)


def doubted(cell: Cell, readings: Readings) -> str:
    found = judged(cell, readings)
    assert found.verdict == "doubtful"
    return " ".join(found.reasons)


def along(cell: Cell, readings: Readings, axis: str, way: Array) -> Readings:
    """Readings of a machine whose axis goes `way` mm or rad further than it says, as touches along the normals show it."""
    c = chain(cell.machine)
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    further = np.array(readings.position)
    further[:, cell.machine.column(axis)] += way
    moved = tip(c, further) - tip(c, np.array(readings.position))
    return pushed(cell, readings, -np.sum(normal * moved, axis=1))


@pytest.mark.long
def test_readings_that_were_filtered_are_said(cell: Cell, readings: Readings) -> None:
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    point = np.array([cell.artefact.facets[f].point for f in readings.facet])
    off = np.sum((tip(chain(cell.machine), readings.position) - point) * normal, axis=1) - cell.machine.probe.tip_radius
    before = np.concatenate([off[:1], off[:-1]])
    assert "a part of the touch before or after it" in doubted(cell, pushed(cell, readings, 0.03 * (before - off)))


@pytest.mark.few(0)
def test_a_clamp_that_lets_go_in_a_band_is_said(cell: Cell, readings: Readings) -> None:
    at = readings.position[:, cell.machine.column("C")]
    loose = 3e-5 * ((at > -1.3) & (at < 0.4))
    assert "C stood elsewhere than the readings say wherever it was from" in doubted(cell, along(cell, readings, "C", loose))


@pytest.mark.long
def test_a_single_place_of_an_axis_is_no_stretch(cell: Cell, readings: Readings) -> None:
    a = readings.position[:, cell.machine.column("A")]
    text = doubted(cell, along(cell, readings, "A", 3e-5 * (np.abs(a + np.radians(30)) < 1e-3)))
    assert "A stood elsewhere than the readings say wherever it was at -30°" in text and "wherever it was from" not in text


@pytest.mark.few(0)
def test_a_column_that_gives_way_far_out_is_said(cell: Cell, readings: Readings) -> None:
    z = readings.position[:, cell.machine.column("Z")]
    over = (z - z.min()) / np.ptp(z)
    eps = along(cell, readings, "Y", np.full(len(readings), 1e-3))
    toward = np.linalg.norm(tip(chain(cell.machine), eps.position) - tip(chain(cell.machine), readings.position), axis=1) / 1e-3
    assert "gave way to the touch" in doubted(cell, pushed(cell, readings, -0.009 * toward**2 * over))


@pytest.mark.long
def test_a_scale_that_grows_during_the_run_is_said(cell: Cell, readings: Readings) -> None:
    x = readings.position[:, cell.machine.column("X")]
    assert "the scale of X had changed" in doubted(cell, along(cell, readings, "X", 6e-5 * x * np.linspace(0, 1, len(x))))


@pytest.mark.long
def test_a_squareness_that_drifts_during_the_run_is_said(cell: Cell, readings: Readings) -> None:
    """3.6 µm over 150 mm at the end: the scatter of a touch shows nothing of it, and EC0X is the mean of the run."""
    y = readings.position[:, cell.machine.column("Y")]
    found = judged(cell, along(cell, readings, "X", 2.4e-5 * y * np.linspace(0, 1, len(y))))
    assert "the squareness of X and Y had changed" in " ".join(found.reasons) and "EC0X" in found.untrusted


@pytest.mark.long
def test_a_table_that_rings_after_a_turn_is_said(cell: Cell, readings: Readings) -> None:
    """20 µm a quarter of a turn of A along z, a third of it left after 20 s."""
    a, c = (readings.position[:, cell.machine.column(axis)] for axis in "AC")
    turned = np.diff(a, prepend=a[:1])
    begin = np.maximum.accumulate(np.where((turned != 0) | (np.diff(c, prepend=c[:1] - 1) != 0), np.arange(len(a)), 0))
    since = readings.time - readings.time[begin]
    found = judged(cell, along(cell, readings, "Z", 0.02 * turned[begin] / (np.pi / 2) * np.exp(-since / 20)))
    assert "right after a turn of A" in " ".join(found.reasons)


@pytest.mark.long
def test_a_clamp_that_creeps_after_each_indexation_is_said(cell: Cell, readings: Readings) -> None:
    """4 µm along Y, as far whichever axis has turned, and gone after some three touches: EY0S would be twelve deviations off."""
    turned = np.any(np.diff(readings.position[:, [cell.machine.column(axis) for axis in "AC"]], axis=0) != 0, axis=1)
    begin = np.maximum.accumulate(np.where(np.concatenate([[True], turned]), np.arange(len(readings)), 0))
    found = judged(cell, along(cell, readings, "Y", 0.004 * np.exp(-(np.arange(len(readings)) - begin) / 3)))
    assert "at the first touches after each indexation" in " ".join(found.reasons) and "EY0S" in found.untrusted


@pytest.mark.long
def test_a_compensation_that_is_switched_on_is_said(cell: Cell, readings: Readings) -> None:
    on = np.arange(len(readings)) >= 0.6 * len(readings)
    x, y = (readings.position[:, cell.machine.column(a)] for a in "XY")
    switched = along(cell, along(cell, readings, "Y", on * 4e-5 * x), "Z", on * -3e-5 * y)
    assert "a compensation of the control had been switched" in doubted(cell, switched)


@pytest.mark.long
def test_of_a_compensation_that_is_switched_on_no_parameter_is_trusted(cell: Cell, readings: Readings) -> None:
    on = np.arange(len(readings)) >= 0.4 * len(readings)
    z = readings.position[:, cell.machine.column("Z")]
    curve = 0.023 * np.sin(4.0 * np.pi * (z - z.min()) / np.ptp(z))  # a table of any shape, not a straight line
    found = judged(cell, along(cell, readings, "Y", on * curve))
    assert found.verdict == "doubtful" and "Its shape is unknown" in " ".join(found.reasons)
    assert set(found.untrusted) >= {"EC0A", "EB0A", "EX0S"}


@pytest.mark.long
def test_touches_that_do_not_fit_in_one_part_of_the_run_only_put_all_parameters_in_doubt(root: Path) -> None:
    folder = root / "examples" / "hu40t"
    plain = read_cell(folder)
    run = simulate(plain.machine, plain.artefact, plain.strategy, read_world(folder / "world.yaml"), seed=5)
    before = np.arange(len(run)) < 91  # the squareness of X and Y rests on these touches, and they agree among themselves
    found = judged(plain, along(plain, run, "X", before * 5.8e-5 * run.position[:, plain.machine.column("Y")]))
    assert "the two parts of the run contradict each other" in " ".join(found.reasons)
    assert found.verdict == "doubtful" and "EC0Y" in found.untrusted


@pytest.mark.long
def test_an_axis_that_stops_elsewhere_from_touch_to_touch_puts_all_parameters_in_doubt(root: Path) -> None:
    folder = root / "examples" / "three_axis_calibrated"
    plain = read_cell(folder)
    run = simulate(plain.machine, plain.artefact, plain.strategy, read_world(folder / "world.yaml"), seed=6)
    normal = np.array([plain.artefact.facets[f].normal for f in run.facet])
    slips = np.random.default_rng(4).choice([0.0, 0.0, 0.0, 0.02], len(run))
    found = judged(plain, pushed(plain, run, slips * np.abs(normal[:, 0])))
    said = " ".join(found.reasons)
    assert "are along X. These touches do not show why. X may have stopped, or been read, elsewhere from touch to touch" in said
    assert "the probe may read by direction (lobing); something may have moved along X" in said
    assert found.verdict == "doubtful" and {"EXX1", "EXXb"} <= set(found.untrusted)


def test_what_three_axes_cannot_show_of_a_bend_is_noted(root: Path) -> None:
    folder = root / "examples" / "three_axis_calibrated"
    plain = read_cell(folder)
    readings = simulate(plain.machine, plain.artefact, plain.strategy, read_world(folder / "world.yaml"), seed=3)
    notes = " ".join(judged(plain, readings).remarks)
    assert "cannot show a bend of X, Y, Z" in notes and "EB0Z" in notes


@pytest.mark.few(0)
def test_five_axes_show_a_bend_and_note_nothing(cell: Cell, readings: Readings) -> None:
    assert "bent" not in " ".join(judged(cell, readings).remarks)
