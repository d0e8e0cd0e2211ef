"""Machine and artefact → every touch that could be made: a grid of indexations, and of each the facets that the probe gets to.

A candidate is one row of the Jacobian: what the touch would say about every unknown. Its scatter is that of all the others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..identify import Selection, select
from ..model import known, linearise
from ..plan import standing
from ..records import Approach, Array, Cell, Indexation, InputError, Strategy, TermItem
from ..touches import of_facets
from .region import turn

MOST = 220  # indexations of the grid, without those at which the spindle is turned
STEPS = (5.0, 7.5, 10.0, 15.0, 22.5, 30.0, 45.0)  # deg
FINER = 1.6  # the axis that turns all round has steps larger by this
SAME = math.radians(0.01)  # between indexations that are one
WIDE = 1.0  # mm at the longest lever: so far from nominal is nothing before it is measured
Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Candidates:
    """n touches at m indexations; unknowns are scaled so that one of each moves a touch by some millimetres."""

    cell: Cell  # whose strategy holds all of them
    selection: Selection
    facet: tuple[str, ...]  # (n,)
    pose: Rows  # (n,) indexation
    rows: Array  # (n, p)
    scale: Array  # (p,) an unknown in its own unit is `scale` times the scaled one
    held: Array  # (p, p) what is known without a touch, per squared scatter: scale bar, calibrated facets, and the width of all
    twice: tuple[int, ...] = ()  # unknowns whose change since an earlier run is an unknown of its own, after all others

    @property
    def sigma(self) -> float:
        """→ mm, standard deviation of a touch."""
        return self.cell.machine.probe.repeatability or 1e-4

    @cached_property
    def of_pose(self) -> list[Rows]:
        """→ rows of each indexation."""
        return [np.flatnonzero(self.pose == j) for j in range(len(self.cell.strategy.indexations))]


def grid(cell: Cell, most: int = MOST) -> list[dict[str, float]]:
    """cell, how many at most → indexations (rad) over the travels; the spindle is turned where rotary axes are square."""
    machine = cell.machine
    spans = {name: turn(machine, name) for name in machine.rotary}
    for step in STEPS:
        lines = [_levels(*spans[name], step * (FINER if spans[name][1] - spans[name][0] > 6 else 1.0)) for name in machine.rotary]
        if math.prod(map(len, lines)) <= most:
            break
    else:
        raise InputError(f"design: {len(machine.rotary)} rotary axes make more than {most} indexations")
    upright = [dict(zip(machine.rotary, angles, strict=True)) | {"S": 0.0} for angles in itertools.product(*lines)]
    square = [p for p in upright if _square(p, machine.rotary)]
    return upright + [p | {"S": s * math.pi / 2} for p in square for s in (1, 2, 3)]


def _levels(low: float, high: float, step: float) -> list[float]:
    """rad, rad, deg → whole multiples of a divisor of 90° or 180° near the step, within the span."""
    whole = max(1, round(180 / step))
    size = 180 / whole
    first, last = math.ceil(math.degrees(low) / size - 1e-9), math.floor(math.degrees(high) / size + 1e-9)
    return [math.radians(round(i * size, 6)) for i in range(first, last + 1)]


def _square(position: Mapping[str, float], rotary: Sequence[str]) -> bool:
    """→ whether all rotary axes are at zero but one, which is at a multiple of a right angle and not at half a turn backwards."""
    off = [position[name] for name in rotary if abs(position[name]) > 1e-9]
    return len(off) == 0 or (len(off) == 1 and abs(math.remainder(off[0], math.pi / 2)) < 1e-9 and abs(off[0]) < 1.1 * math.pi / 2)


def candidates(
    cell: Cell,
    terms: Sequence[TermItem],
    approach: Approach,
    degree: int = 3,
    most: int = MOST,
    also: Sequence[Mapping[str, float]] = (),
) -> Candidates:
    """cell, terms of the model, how a facet is touched, further indexations (rad) than those of the grid → every possible touch.

    Raises InputError when there is none, and for terms that nothing knows.
    """
    places = with_others(grid(cell, most), also, (*cell.machine.rotary, "S"))
    stations = [Indexation(position, tuple(cell.artefact.facets)) for position in places]
    whole = replace(cell, strategy=Strategy("all that can be touched", approach, tuple(stations)))
    whole = replace(whole, strategy=standing(whole))
    return of_strategy(whole, terms, degree)


def of_strategy(whole: Cell, terms: Sequence[TermItem], degree: int = 3) -> Candidates:
    """cell whose strategy has every touch that may be chosen → candidates."""
    machine, indexations = whole.machine, whole.strategy.indexations
    facet = tuple(f for i in indexations for f in i.facets)
    pose = np.repeat(np.arange(len(indexations)), [len(i.facets) for i in indexations])
    station = np.array([[i.position.get(name, 0.0) for name in machine.names] for i in indexations])
    touches = of_facets(machine, whole.artefact, facet, station[pose], np.zeros((len(facet), len(machine.names))))
    whole = replace(whole, artefact=touches.artefact)  # a ball that no plan could locate is none
    direction = _directions(touches.nominal.position, touches.normal, touches.chain)
    for k, name in enumerate((*machine.rotary, "S")):  # from which side an axis came is decided by the order; half from either
        direction[:, machine.column(name)] = np.where((pose >> k) % 2, 1.0, -1.0)
    touches = replace(touches.nominal, direction=direction)
    selection = select(touches, terms, degree)
    model = selection.model
    start = np.zeros(len(model.names))
    _, jacobian = linearise(model, start)
    _, certain, uncertainty = known(model, start)
    size = np.sqrt(np.mean(jacobian**2, axis=0))
    scale = 1 / np.where(size > 0, size, 1.0)
    sigma = machine.probe.repeatability or 1e-4
    own = certain * scale * (sigma / uncertainty)[:, None]
    held = own.T @ own + (sigma / WIDE) ** 2 * np.eye(len(scale))
    return Candidates(whole, selection, facet, pose, jacobian * scale, scale, held)


def with_others(
    places: Sequence[dict[str, float]], also: Sequence[Mapping[str, float]], names: Sequence[str]
) -> list[dict[str, float]]:
    """indexations, others, the axes that make them → all of them (rad), what is the same to `SAME` once."""
    found, seen = list(places), {tuple(round(p.get(name, 0.0) / SAME) for name in names) for p in places}
    for position in also:
        own = {name: position.get(name, 0.0) for name in names}
        key = tuple(round(value / SAME) for value in own.values())
        if key not in seen:
            seen.add(key)
            found.append(own)
    return found


def _directions(position: Array, normal: Array, chain: kinematics.Chain) -> Array:
    """(n, k) contacts, (n, 3) normals → (n, k) sense in which each linear axis came: by the approach, or going down the tool."""
    base, _, jacobian = kinematics.affine(chain, position)
    columns = list(chain.linear_columns)
    inward = np.linalg.solve(jacobian, -normal[..., None])[..., 0]
    down = np.linalg.solve(jacobian, -kinematics.spindle_axis(chain, position)[..., None])[..., 0]
    sense = np.where(np.abs(inward) > 1e-3, np.sign(inward), np.where(np.abs(down) > 1e-3, np.sign(down), 1.0))
    found = np.zeros_like(base)
    found[:, columns] = sense
    return found
