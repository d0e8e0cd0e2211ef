"""What an error of the machine does to a part: the machine is moved with it and without it.

The zero of the part is found where every rotary axis stands at 0. What lies there is right; what the rotary axes turn to the
spindle afterwards is off by what the error has changed on the way, as seen from the part.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from .. import kinematics
from ..identify import columns, rich_plan
from ..iso230.poses import at_poses
from ..kinematics import Slot
from ..model import STYLUS, Model, setup_coefficient
from ..records import Array, Cell, InputError, Machine
from ..terms import Coefficient, find, inter_axis

TURN = np.pi  # rad: the far side of the part; what turns on comes round again
STEPS = 13  # places of a rotary axis over its turn
POINTS = 24  # of the part
ENOUGH = 0.99  # of the largest: what one axis alone does nearly as well needs no second one to be told
SEEN = 1e-4  # of what a column could amount to: less of it is no error of its own
NOTHING = 1e-3  # µm: what is less turns nowhere
SAME = 1e-6  # of a column: what two of them differ by where no touch tells them apart
DIGITS = 6  # of how much of one error does as much as another


class Effect(NamedTuple):
    """Where an error is worst on a part: by how much (µm), and the rotary axes that are turned there, by how much (deg)."""

    worst: float
    turned: Mapping[str, float]


def on_parts(cell: Cell, parameter: str, size: float) -> Effect | None:
    """cell, name of an error, its size in mm or rad → where it is worst on a part whose zero was found at 0 of the rotary axes.

    None on a machine without rotary axes, and for what is no error of the machine.
    """
    machine = cell.machine
    if not machine.rotary or (error := _error(machine, parameter)) is None:
        return None
    places = [_places(machine, name) for name in machine.rotary]
    turns = np.array(list(product(*places)))  # (m, r)
    gap = np.linalg.norm(_seen_from_the_part(cell, {error: size}, turns, _part(cell)), axis=2).max(axis=1) * 1e3
    least = ENOUGH * gap.max()
    fewest = min(np.flatnonzero(gap >= least), key=lambda i: (np.count_nonzero(turns[i]), _others(machine, error, turns[i])))
    own = np.count_nonzero(turns, axis=1) <= np.count_nonzero(turns[fewest])
    same = own & np.all((turns != 0) == (turns[fewest] != 0), axis=1)
    best = max(np.flatnonzero(same), key=lambda i: (round(float(gap[i]), 6), -float(np.abs(turns[i]).sum()), float(turns[i].sum())))
    turned = {name: float(np.degrees(a)) for name, a in zip(machine.rotary, turns[best], strict=True) if a}
    return Effect(float(gap.max()), turned if gap.max() > NOTHING else {})


def moved_on_parts(cell: Cell, sizes: Mapping[str, float]) -> float:
    """cell, {name of an error: its size in mm or rad} → µm of all of them together where they are worst on such a part; 0 on a
    machine without rotary axes. What is no error of the machine is left out.
    """
    machine = cell.machine
    errors = {error: size for name, size in sizes.items() if size and (error := _error(machine, name)) is not None}
    if not machine.rotary or not errors:
        return 0.0
    turns = np.array(list(product(*(_places(machine, name) for name in machine.rotary))))
    off = _seen_from_the_part(cell, errors, turns, _part(cell))
    return float(np.linalg.norm(off, axis=2).max()) * 1e3


def _others(machine: Machine, error: Coefficient, turn: Array) -> int:
    """→ how many axes are turned there that the error does not belong to."""
    return sum(bool(a) and name != error.slot.axis for name, a in zip(machine.rotary, turn, strict=True))


def _error(machine: Machine, parameter: str) -> Coefficient | None:
    try:
        found = find(parameter, machine)
    except InputError:
        return None
    return found[0] if len(found) == 1 else None


def _places(machine: Machine, name: str) -> Array:
    """→ rad, 0 first: what a rotary axis can be turned to, at most half a turn either way."""
    low, high = machine.axis(name).travel or (-TURN, TURN)
    return np.unique([0.0, *np.linspace(max(low, -TURN), min(high, TURN), STEPS)])


def _part(cell: Cell) -> Array:
    """→ (p, 3) mm in the table frame: the part is as large as the artefact."""
    points = np.array([facet.point for facet in cell.artefact.facets.values()])
    farthest = np.argsort(-np.linalg.norm(points, axis=1))
    return points[farthest[:POINTS]]


def _seen_from_the_part(cell: Cell, errors: Mapping[Coefficient, float], turns: Array, part: Array) -> Array:
    """cell, {error: its size}, (m, r) rad, (p, 3) mm → (m, p, 3) mm: where the tip goes beside the point, less the same at 0."""
    machine = cell.machine
    position = np.zeros((len(turns) + 1, len(part), len(machine.names)))
    position[1:, :, [machine.column(name) for name in machine.rotary]] = turns[:, None, :]
    flat = position.reshape(-1, position.shape[2])
    chain = kinematics.chain(machine)
    flat = kinematics.inverse(chain, flat, np.tile(part, (len(position), 1)))
    poses = at_poses(machine, flat, np.zeros_like(flat))
    acting: dict[Slot, Array] = {}
    for error, size in errors.items():
        own = np.asarray(size * error.regressor(poses))
        acting[error.slot] = acting[error.slot] + own if error.slot in acting else own
    off = (kinematics.tip(chain, flat, acting) - kinematics.tip(chain, flat)).reshape(len(position), len(part), 3)
    return np.asarray(off[1:] - off[0])


@lru_cache(maxsize=64)
def alike(machine: Machine, parameter: str) -> Mapping[str, float]:
    """machine, name of a location error → {name of another that no touch on this machine can tell from it: how much of that (mm,
    rad) does the same as 1 mm or 1 rad of it}; negative where it goes the other way.

    Each by itself: they move every touch as it does, but for what stylus, facets and balls take up.
    """
    candidates = [c for c in inter_axis.coefficients(machine, 0) if c.slot.axis in (*machine.rotary, "S")]
    own = next((i for i, c in enumerate(candidates) if c.name == parameter), None)
    if own is None:
        return {}
    setup = [setup_coefficient(name) for name in STYLUS]
    matrix, could = columns(Model(rich_plan(machine), (*setup, *candidates)))
    first, count = len(setup), len(candidates)
    taken = np.hstack([matrix[:, :first], matrix[:, first + count :]])
    left, size, _ = np.linalg.svd(taken / np.maximum(np.linalg.norm(taken, axis=0), 1e-300), full_matrices=False)
    base = left[:, size > 1e-9 * size[0]]
    rest = matrix[:, first : first + count]
    rest = rest - base @ (base.T @ rest)
    rest = rest - base @ (base.T @ rest)
    length = np.linalg.norm(rest, axis=0)
    seen = length > SEEN * could[first : first + count]
    if not seen[own]:
        return {}
    cosine = (rest[:, own] @ rest) / np.maximum(length[own] * length, 1e-300)
    same = [i for i in range(count) if i != own and seen[i] and abs(cosine[i]) > 1 - SAME]
    return {candidates[i].name: round(float(np.sign(cosine[i]) * length[own] / length[i]), DIGITS) for i in same}


@lru_cache(maxsize=16)
def like_the_stylus(machine: Machine) -> dict[str, tuple[float, float, float]]:
    """machine → {location error that no touch tells from another stylus: mm of stylus X Y Z that do the same as 1 mm of it}.

    The height of a pivot is one of them: a probe that has become shorter touches as if the pivot had moved.
    """
    candidates = [c for c in inter_axis.coefficients(machine, 0) if c.slot.axis in machine.rotary and c.unit == "mm"]
    setup = [setup_coefficient(name) for name in STYLUS]
    matrix, could = columns(Model(rich_plan(machine), (*setup, *candidates)))
    first, count = len(setup), len(candidates)
    table = matrix[:, first + count :]
    base, size, _ = np.linalg.svd(table, full_matrices=False)
    base = base[:, size > 1e-9 * size[0]]
    rest = matrix[:, : first + count] - base @ (base.T @ matrix[:, : first + count])
    found = {}
    for i, c in enumerate(candidates, first):
        same, *_ = np.linalg.lstsq(rest[:, :first], rest[:, i], rcond=None)
        left = float(np.linalg.norm(rest[:, i] - rest[:, :first] @ same))
        if np.linalg.norm(rest[:, i]) > SEEN * could[i] > left:
            found[c.name] = (float(same[0]), float(same[1]), float(same[2]))
    return found
