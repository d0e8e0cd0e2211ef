"""The true machine, its true surfaces and its probe together: straight moves → where the ball touches.

A contact is found twice: without effects, which tells the effects where and when it happens, and then with what they change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Array, Artefact, Machine, World

from . import effects, surfaces
from .bystanders import Bystanders, bystanders
from .coefficients import RADIUS
from .effects import Disturbance, History
from .roots import Gap
from .shank import Shank, shank
from .world import Control, Placement, TrueMachine, nominal_machine, of_stylus, place, tip_in_table, true_machine


@dataclass(frozen=True)
class Rig:
    """Everything that is true of one cell; made by `rig`, which checks every name in it."""

    machine: Machine
    artefact: Artefact
    true: TrueMachine
    surfaces: surfaces.Surfaces
    shank: Shank
    bystanders: Bystanders
    effects: tuple[effects.Effect, ...]
    noise: float  # mm, one standard deviation of a touch
    seed: int


def rig(
    machine: Machine,
    artefact: Artefact,
    world: World,
    seed: int | None = None,
    extent: float = surfaces.EXTENT,
    control: Control | None = None,
) -> Rig:
    """machine, artefact, world, what the control compensates → what is true.

    Raises InputError for errors, facets or effects that do not exist.
    """
    radius = machine.probe.tip_radius + of_stylus(machine, world, RADIUS)
    truly = surfaces.surfaces(artefact, world, radius, extent)
    probe = shank(machine, artefact, truly.table)
    return Rig(
        machine,
        artefact,
        true_machine(machine, world, control),
        truly,
        probe,
        bystanders(machine, artefact, truly.table, probe),
        effects.checked(world.effects, machine, artefact),
        world.noise,
        world.seed if seed is None else seed,
    )


def home(machine: Machine) -> Array:
    """machine → (k,) mm rad, its reference position: rotary axes 0, every linear axis where it draws the tool off the table.

    An axis across the spindle stands at 0, or at the end of its travel that is nearest to 0.
    """
    nominal = nominal_machine(machine)
    still = np.zeros((1, len(machine.names)))
    spindle = np.array(machine.spindle.direction)
    position = np.zeros(len(machine.names))
    for name in machine.linear:
        column, axis = machine.column(name), machine.axis(name)
        low, high = axis.travel or (-np.inf, np.inf)
        step = still.copy()
        step[0, column] = 1.0
        along = float((tip_in_table(nominal, step, still) - tip_in_table(nominal, still, still))[0] @ spindle)
        away = high if along > 0.5 else low if along < -0.5 else min(max(0.0, low), high)
        position[column] = away if np.isfinite(away) else 0.0
    return position


def noise(r: Rig, count: int) -> Array:
    """rig, n → (n,) mm, repeatability of the first n touches; more touches leave the earlier ones as they are."""
    return np.random.default_rng([r.seed, 0]).normal(scale=r.noise, size=count)


def undisturbed(count: int) -> Disturbance:
    """n → n rows in which nothing changes."""
    return Disturbance(np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3)), {})


def rows_of(d: Disturbance, rows: NDArray[np.int64]) -> Disturbance:
    """disturbance of n touches, (m,) → that of those rows."""
    assert d.gap is not None and d.work is not None and d.table is not None
    return Disturbance(d.gap[rows], d.work[rows], d.table[rows], {name: value[rows] for name, value in d.errors.items()})


def seen(r: Rig, positions: Array, directions: Array, d: Disturbance) -> Placement:
    """(n, k) mm rad, (n, k) −1 0 1, disturbance → placement of the tip as the displaced table sees it."""
    assert d.work is not None and d.table is not None
    placement = place(r.true, positions, directions, d.errors)
    tip = placement.tip - np.einsum("nji,nj->ni", placement.table, d.work) - d.table
    return replace(placement, tip=tip)


def gap_along(r: Rig, start: Array, end: Array, directions: Array, rows: NDArray[np.int64], d: Disturbance) -> Gap:
    """(n, k) ends of straight moves, their directions, surfaces and disturbances → gap(moves, s) mm for `roots`, s in [0, 1]."""

    def gap(moves: NDArray[np.int64], s: Array) -> Array:
        positions = start[moves] + s[:, None] * (end[moves] - start[moves])
        change = rows_of(d, moves)
        assert change.gap is not None
        tip = seen(r, positions, directions[moves], change).tip
        return surfaces.gap(r.surfaces, rows[moves], tip) - change.gap

    return gap


def history(
    r: Rig,
    rows: NDArray[np.int64],
    positions: Array,
    directions: Array,
    move: Array,
    time: Array,
    day: NDArray[np.int64],
    feed: Array,
    day_start: Array,
) -> History:
    """surfaces, contacts, last motions and times of n touches → what the effects may know."""
    placement = place(r.true, positions, directions)
    normal_table = surfaces.true_normal(r.surfaces, rows, placement.tip)
    normal = np.einsum("nij,nj->ni", placement.table, normal_table)
    turning = [r.machine.column(name) for name in (*r.machine.rotary, "S")]
    turned = np.abs(np.diff(positions[:, turning], axis=0, prepend=positions[:1, turning])).max(axis=1) > 1e-9
    return History(
        r.machine,
        r.artefact,
        time,
        time - day_start,
        day,
        np.cumsum(turned),
        tuple(r.surfaces.facets[row] for row in rows),
        positions,
        directions,
        move,
        feed,
        placement.tip - r.surfaces.tip_radius * normal_table,
        normal_table,
        normal,
        np.einsum("nji,nj->ni", placement.spindle, normal),
        placement.table,
    )


def facet_rows(r: Rig, facets: Sequence[str]) -> NDArray[np.int64]:
    """facet ids → their rows among the surfaces."""
    index = {facet: row for row, facet in enumerate(r.surfaces.facets)}
    return np.array([index[facet] for facet in facets], dtype=np.int64)
