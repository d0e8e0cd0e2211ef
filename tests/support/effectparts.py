"""One cell, one history of touches and one ruler for the effects of the simulated machine."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_controller.effects import History
from sim_controller.effects._apply import names
from sim_controller.probing import facet_rows, history, rig
from sim_controller.simulate import simulate
from tango_cnc.files import read_cell
from tango_cnc.records import Array, Cell, World

# What world.yaml must at least give for each cause, of a size that good machines have; others need an amplitude only.
LEAST: dict[str, dict[str, object]] = {
    "ambient_cycle": {"amplitude": 0.003, "period": 1200, "direction": [1, 0, 0]},
    "axis_location": {"name": "EX0C", "amplitude": 0.02},
    "backlash": {"amplitude": 0.005, "axis": "X"},
    "chip": {"amplitude": 0.05, "facet": 16, "at": 30},
    "compensation_kink": {"axis": "X", "nodes": [-200, 0, 200], "values": [0, 0.003, -0.001]},
    "cyclic_error": {"axis": "Y", "amplitude": 0.002, "period": 10},
    "cylinder_cosine": {"radius": 200},
    "encoder_harmonic": {"axis": "C", "amplitude": 2e-5},
    "error_motion": {"name": "EYX", "amplitude": 0.01},
    "first_touch": {"amplitude": 0.002},
    "gravity_sag": {"axis": "B", "amplitude": 0.005, "direction": [0, -1, 0]},
    "indexation_seating": {"amplitude": 0.002},
    "learned": {
        "factors": [{"covariate": "X", "kind": "polynomial", "low": -300, "high": 300, "count": 2}],
        "weight": "machine z",
        "values": [0.002, 0.001],
    },
    "move_length_memory": {"axis": "X", "amplitude": 0.003, "length": 50},
    "moving_mass": {"name": "EAZ", "by": "Y", "amplitude": 1e-5},
    "noise_level": {"amplitude": 0.001},
    "outliers": {"amplitude": 0.05, "rate": 0.05},
    "pretravel_anisotropy": {"amplitude": 0.003},
    "probe_hysteresis": {"amplitude": 0.001},
    "probe_lobing": {"amplitude": 0.004},
    "pulse": {"amplitude": 0.004, "direction": [0, 0, 1], "at": 20, "until": 60},
    "random_walk": {"amplitude": 0.003},
    "rotary_axial": {"axis": "C", "amplitude": 0.003},
    "rotary_backlash": {"axis": "C", "amplitude": 2e-5},
    "rotary_radial": {"axis": "C", "amplitude": 0.003, "direction": [1, 0, 0]},
    "rotary_tilt": {"axis": "C", "amplitude": 1e-5, "direction": [1, 0, 0]},
    "scale_drift": {"axis": "X", "amplitude": 4e-5, "tau": 2400},
    "screw_heat": {"axis": "X", "amplitude": 1e-5, "tau": 600},
    "spindle_orientation": {"amplitude": 0.001},
    "step": {"amplitude": 0.005, "direction": [0, 0, 1], "at": 100},
    "surface_form": {"amplitude": 0.002},
    "swapped_facets": {"facets": [16, 17]},
    "table_drift": {"amplitude": 0.005, "tau": 2400, "direction": [0, 1, 0]},
    "table_growth": {"amplitude": 4e-5, "tau": 2400},
    "thermal_drift": {"amplitude": 0.01, "tau": 2400, "direction": [0, 1, 0]},
    "trigger_latency": {"delay": 0.001},
}
LEAST |= {name: {"amplitude": 0.002} for name in names() if name not in LEAST}
RANDOM = {"indexation_seating", "noise_level", "outliers", "random_walk", "spindle_orientation", "surface_form"}


def flat(cell: Cell) -> Cell:
    """The cell without its balls, on which a displacement across the normal counts in second order."""
    facets = {name: facet for name, facet in cell.artefact.facets.items() if facet.ball is None}
    indexations = tuple(replace(i, facets=tuple(f for f in i.facets if f in facets)) for i in cell.strategy.indexations)
    artefact = replace(cell.artefact, facets=facets, balls={}, scale_bar=None)
    return replace(cell, artefact=artefact, strategy=replace(cell.strategy, indexations=indexations))


EXAMPLES = Path(__file__).parents[2] / "examples"
# wCBXfZY(S)t: X carries B carries C and the table, Z carries Y and the tool; B and C turn about the origin at X = 0
CELL = flat(read_cell(EXAMPLES / "hu40t"))
MACHINE = CELL.machine
LENGTH = MACHINE.probe.length
STYLUS = {"EXt": 2.0, "EYt": -1.0}  # mm: without an offset nobody sees the spindle turn
X, Y, Z = np.eye(3)


def world(cause: str, **more: object) -> World:
    return World(effects=({"cause": cause, **LEAST[cause], **more},), seed=5)


def measured(cell: Cell, world: World) -> History:
    """What effects may know of the touches of a cell; exact where the world has neither effects nor noise."""
    r = rig(cell.machine, cell.artefact, world)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world)
    rows = facet_rows(r, readings.facet)
    count = len(readings)
    feed, zero = np.full(count, 180.0), np.zeros(count)
    return history(r, rows, readings.position, readings.direction, readings.direction, readings.time, readings.day, feed, zero)


TOUCHES = measured(CELL, World())
PLAIN = simulate(MACHINE, CELL.artefact, CELL.strategy, World())


def early(changed: Array, plain: Array) -> Array:
    """(n, k) positions with and without an effect → (n,) mm: how much earlier each surface is read, along its normal.

    The approach is along the normal. In the machine frame the tool moves against the work as the axes do, X carrying the table.
    """
    linear = [MACHINE.column(name) for name in MACHINE.linear]
    return np.einsum("ni,ni->n", (changed - plain)[:, linear] * np.array([-1.0, 1.0, 1.0]), TOUCHES.normal)


def read_early(cause: str, stylus: dict[str, float] | None = None, **more: object) -> Array:
    """→ (n,) mm: how much earlier than without the effect each surface is read on a machine that is right otherwise."""
    worlds = World(stylus=stylus or {}), replace(world(cause, **more), stylus=stylus or {})
    plain, changed = (simulate(MACHINE, CELL.artefact, CELL.strategy, w).position for w in worlds)
    return early(changed, plain)


def at(letter: str) -> Array:
    """→ (n,) mm or rad: where that axis stands at each touch."""
    return TOUCHES.position[:, MACHINE.column(letter)]


def carried_by_b(vector: Array) -> Array:
    """(3,) → (n, 3): that vector of the body of B, as it stands in the machine."""
    sine, cosine = np.sin(at("B")), np.cos(at("B"))
    x, y, z = vector
    return np.column_stack([x * cosine + z * sine, np.full(len(sine), y), z * cosine - x * sine])


def along(vectors: Array) -> Array:
    """(3,) or (n, 3) mm of a displacement of the work, machine frame → (n,) mm by which it makes the surfaces read early."""
    return np.einsum("ni,ni->n", TOUCHES.normal, np.broadcast_to(vectors, TOUCHES.normal.shape))


def turning(axes: Array) -> Array:
    """(3,) or (n, 3) axes through the point where B meets C → (n,) mm read early for each rad that the work turns about them."""
    points = np.einsum("nij,nj->ni", TOUCHES.table, TOUCHES.point)
    return along(np.cross(np.broadcast_to(axes, points.shape), points))
