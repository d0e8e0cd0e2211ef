"""One cell, one history of touches and one ruler for the effects of the simulated machine."""

from __future__ import annotations

import inspect
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from sim_controller import effects
from sim_controller.effects import History
from sim_controller.probing import facet_rows, history, rig
from sim_controller.simulate import simulate
from tango_cnc.files import read_cell
from tango_cnc.records import Array, Cell, World


def uses_chance(cause: str) -> bool:
    """effect → whether it draws random numbers."""
    return "rng." in inspect.getsource(import_module(f"sim_controller.effects.{cause}").disturb)


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
    return World(effects=({"cause": cause, **effects.example(cause), **more},), seed=5)


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
