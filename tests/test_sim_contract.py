"""Readings that an independent program simulated agree with this simulator's conventions, to the noise that was put in."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from sim_controller import surfaces
from sim_controller.probing import facet_rows, rig
from sim_controller.simulate import simulate
from sim_controller.world import tip_in_table
from tango_cnc.files import read_cell, read_readings
from tango_cnc.records import World

NOISE = 0.0007  # mm, of the independent program


@pytest.fixture(scope="module")
def told(shared: Path) -> tuple:
    """→ cell, true world without facet offsets, readings, facet of each."""
    folder = shared / "contract" / "hu40t"
    cell = read_cell(folder)
    truth = json.loads((folder / "truth.json").read_text())
    stylus = {name: value for name, value in truth.items() if name.endswith("t")}
    world = World({name: value for name, value in truth.items() if name not in stylus}, stylus)
    readings = read_readings(folder / "readings.csv", cell.machine, cell.artefact)
    return cell, world, readings, np.array(readings.facet)


def facet_gaps(cell, world, readings) -> np.ndarray:
    r = rig(cell.machine, cell.artefact, world)
    return surfaces.gap(r.surfaces, facet_rows(r, readings.facet), tip_in_table(r.true, readings.position, readings.direction))


def pooled(gaps: np.ndarray, facets: np.ndarray) -> float:
    """Standard deviation about the mean of each flat facet."""
    flat = [f for f in dict.fromkeys(facets) if len(f) < 3]
    rest = [gaps[facets == f] - gaps[facets == f].mean() for f in flat]
    return float(np.sqrt(sum((r**2).sum() for r in rest) / (sum(map(len, rest)) - len(flat))))


def test_under_the_true_errors_only_the_noise_is_left_of_every_facet(told: tuple) -> None:
    cell, world, readings, facets = told
    # 357 flat touches, 26 offsets: the standard deviation of this estimate is 4 %
    assert pooled(facet_gaps(cell, world, readings), facets) == pytest.approx(NOISE, rel=0.12)


def test_each_convention_matters_here(told: tuple) -> None:
    cell, world, readings, facets = told
    plain = pooled(facet_gaps(cell, world, readings), facets)
    for name in ("EA0B", "EX0C", "EA0C", "EB0C", "EB0Z", "EA0Y", "EX0S", "EY0S", "EXX1", "EYY1"):
        turned = replace(world, errors={**world.errors, name: -world.errors[name]})
        assert pooled(facet_gaps(cell, turned, readings), facets) > 1.1 * plain, name


def test_five_touches_of_each_ball_lie_on_a_sphere_of_its_radius(told: tuple) -> None:
    cell, world, readings, facets = told
    tip = tip_in_table(rig(cell.machine, cell.artefact, world).true, readings.position, readings.direction)
    for ball in cell.artefact.balls.values():
        mine = np.array([cell.artefact.facets[f].ball == ball.id for f in facets])
        reach = ball.radius + cell.machine.probe.tip_radius
        fit = least_squares(lambda c, t=tip[mine], r=reach: np.linalg.norm(t - c, axis=1) - r, ball.centre)
        assert np.sqrt((fit.fun**2).sum() / 2) < 3.3 * NOISE  # two degrees of freedom: chi-square beyond 99.99 %


def test_our_own_simulation_of_that_machine_lands_where_those_readings_are(told: tuple) -> None:
    cell, world, readings, facets = told
    gaps = facet_gaps(cell, world, readings)
    flat = np.array([len(f) < 3 for f in facets])
    offsets = {f: float(gaps[facets == f].mean()) for f in dict.fromkeys(facets[flat])}
    ours = simulate(cell.machine, cell.artefact, cell.strategy, replace(world, facets=offsets))
    same_motion = (ours.direction == readings.direction)[:, :5].all(axis=1) & flat
    assert same_motion.sum() > 100
    apart = np.linalg.norm(ours.position - readings.position, axis=1)[same_motion]
    assert np.sqrt((apart**2).mean()) == pytest.approx(NOISE, rel=0.15)
