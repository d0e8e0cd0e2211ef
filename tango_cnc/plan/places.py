"""Where the tip of the probe goes at each touch: worked out when it is asked for, so that a long plan takes next to no memory.

What decides it is little: a facet, an indexation, and how high the probe is above the stand-off on its three ways.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import check, kinematics
from ..check.bodies import pairs
from ..records import Array, Artefact, InputError, Machine, Plan, Strategy
from .guard import Guard, Looked

BLOCK = 4096  # touches worked on at once, so that memory does not grow with their number
Rows = NDArray[np.integer]


def blocks(count: int, size: int | None = None) -> Iterator[slice]:
    """number of rows, most of them at once (None: BLOCK) → slices that cover them in turn."""
    size = size or BLOCK
    return (slice(begin, min(begin + size, count)) for begin in range(0, count, size))


@dataclass(frozen=True)
class Scene:
    """What all touches of a plan have in common: by facet (f) and by indexation (m), in the order of artefact and strategy."""

    machine: Machine
    artefact: Artefact
    strategy: Strategy
    chain: kinematics.Chain
    solid: check.Solid
    facet: tuple[str, ...]  # f names
    tip: Array  # (f, 3) mm, tip centre at contact, table frame
    normal: Array  # (f, 3)
    station: Array  # (m, k) rad, linear columns 0
    up: Array  # (m, 3) from the tip towards the spindle, table frame
    top: Array  # (m,) mm, how far anything on the table reaches in that direction
    guard: Guard

    def belongs_to(self, plan: Plan) -> bool:
        """plan → whether it is still of this machine, artefact and strategy."""
        return self.machine is plan.machine and self.artefact is plan.artefact and self.strategy is plan.strategy

    def standoff(self, facet: Rows, at: Rows) -> tuple[Array, Array]:
        """(n,) facets, (n,) indexations → (n, 3) mm stand-offs, (n, 3) directions to the spindle."""
        return self.tip[facet] + self.strategy.approach.standoff * self.normal[facet], self.up[at]

    def axes(self, at: Rows, tips: Array) -> Array:
        """(n,) indexations, (j, n, 3) mm → (j, n, k) mm rad. Raises InputError for axes that do not reach all of space."""
        indexation, own = np.unique(at, return_inverse=True)
        base, origin, jacobian = (each[own] for each in kinematics.affine(self.chain, self.station[indexation]))
        found = np.repeat(base[None], len(tips), axis=0)
        try:
            found[..., list(self.chain.linear_columns)] = np.linalg.solve(jacobian, (tips - origin)[..., None])[..., 0]
        except np.linalg.LinAlgError:
            raise InputError("machine: the three linear axes do not span space; check their directions") from None
        return found


def nowhere(axes: int) -> tuple[Rows, Array]:
    """axes of the machine → `Places.left` of touches that are all left as their lifts say."""
    return np.empty(0, np.int32), np.empty((0, axes))


def scene(machine: Machine, artefact: Artefact, strategy: Strategy, looked: Looked | None = None) -> Scene:
    """machine, artefact, strategy → what all its touches have in common; `looked`: as of `Guard`."""
    chain, solid = kinematics.chain(machine), check.solid(artefact)
    facets = artefact.facets.values()
    normal = np.array([facet.normal for facet in facets])
    tip = np.array([facet.point for facet in facets]) + machine.probe.tip_radius * normal
    station = np.array([[i.position.get(name, 0.0) for name in machine.names] for i in strategy.indexations])
    up = np.concatenate([kinematics.spindle_axis(chain, station[rows]) for rows in blocks(len(station))])
    top = np.concatenate([solid.top(up[rows]) for rows in blocks(len(station))])
    named = tuple(f"obstacle {number}{obstacle.name}" for number, obstacle in enumerate(artefact.obstacles, 1))
    guard = Guard(machine, pairs(machine, solid, named, tuple(artefact.balls)), looked)
    return Scene(machine, artefact, strategy, chain, solid, tuple(artefact.facets), tip, normal, station, up, top, guard)


@dataclass(frozen=True)
class Places:
    """n touches of a scene; asked for rows of them, it gives their places."""

    scene: Scene
    facet: Rows  # (n,)
    at: Rows  # (n,) indexation
    lift: Array  # (3, n) mm above the stand-off along the tool: clear level, entering, leaving
    left: tuple[Rows, Array]  # (t,) rows in their order that are left to other places, (t, k) mm rad
    given: Array | None = None  # (n, 3, k) stand-off, contact and search end of touches that were not made here

    def __call__(self, rows: Rows) -> Array:
        """(m,) → (m, 6, k) mm rad: stand-off, contact, search end, clear level, entering, leaving."""
        scene, facet, at = self.scene, self.facet[rows], self.at[rows]
        tip, normal = scene.tip[facet], scene.normal[facet]
        standoff, up = scene.standoff(facet, at)
        over = [standoff + lift[rows, None] * up for lift in self.lift]
        tips = np.array([standoff, tip, tip - scene.strategy.approach.search * normal, *over])
        found = scene.axes(at, tips).transpose(1, 0, 2)
        if self.given is not None:
            found[:, :3] = self.given[rows]
        which, where = self.left
        if len(which):
            nearest = np.minimum(np.searchsorted(which, rows), len(which) - 1)
            other = which[nearest] == rows
            found[other, 5] = where[nearest[other]]
        return found
