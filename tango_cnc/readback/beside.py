"""What machine.yaml declares on the bodies of the machine (yoke, column, door …): whether motions of a program keep off it.

The planner proves more, with boxes of angles. Here every motion that a program really makes is looked at once more, from where the
axes stand to where it goes: a straight one as a whole, a turn at poses half a degree apart.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from .. import check
from ..check.apart import apart
from ..check.bodies import Thing, pairs, pose, poses
from ..records import Array, Artefact, Machine

STRAIGHT = 0.5  # mm that are kept on a straight motion: less than any planner leaves
TURNING = 3.0  # mm at each pose of a turn: what is 600 mm from the axis moves 2.6 mm within half a step; a planner leaves 5
STEP = 0.5  # deg between poses of a turn


class Beside:
    """One machine with what may meet what is declared on its bodies; false where nothing is declared."""

    def __init__(self, machine: Machine, artefact: Artefact) -> None:
        """machine, artefact → their pairs of things between which something moves."""
        self._machine = machine
        stands = tuple(f"obstacle {number}{obstacle.name}" for number, obstacle in enumerate(artefact.obstacles, 1))
        self._pairs = pairs(machine, check.solid(artefact), stands, tuple(artefact.balls)) if machine.obstacles else ()
        things = {id(thing): thing for pair in self._pairs for thing in (pair.one, pair.other)}
        self._things, number = tuple(things.values()), {each: i for i, each in enumerate(things)}
        self._one = np.array([number[id(pair.one)] for pair in self._pairs], dtype=int)
        self._other = np.array([number[id(pair.other)] for pair in self._pairs], dtype=int)
        self._size = np.array([_size(thing) for thing in self._things])

    def __bool__(self) -> bool:
        return bool(self._pairs)

    def met(self, places: Array, known: Collection[str], *, need: float, begun: bool = True) -> str:
        """(n, s, k) mm rad, axes that have a place, mm to keep → which two bodies come too near each other; empty for none.

        Each of the n motions is straight between its s places. `begun`: whether the first descent has been made; before it only the
        probe is looked at, since what else is on the machine has its warning in the plan.
        """
        if not self._pairs:
            return ""
        near = self._may_meet(places, need)
        for row in np.flatnonzero(near.any(axis=1)).tolist():
            pair = self._pairs[row]
            if not set(pair.axes) <= set(known) or not (begun or pair.across):
                continue
            some = places[near[row]]
            one, other = (poses(self._machine, axes, some) for axes in (pair.own, pair.others))
            if not apart(pair.one.shape, one, pair.other.shape, other, np.full(len(some), need)).all():
                return f"{pair.one.name} comes within {need:g} mm of {pair.other.name}; make the plan again with this machine.yaml"
        return ""

    def _may_meet(self, places: Array, need: float) -> np.ndarray:
        """(n, s, k) → (pairs, n) whether the balls around two things come so near: quick, and leaves out nearly all."""
        n, s, k = places.shape
        flat, at = places.reshape(n * s, k), dict[tuple[str, ...], tuple[Array, Array]]()
        centre = np.empty((len(self._things), n, s, 3))
        for i, thing in enumerate(self._things):
            if thing.carriers not in at:
                at[thing.carriers] = pose(self._machine, thing.carriers, flat)
            turn, shift = at[thing.carriers]
            centre[i] = (turn @ _middle(thing) + shift).reshape(n, s, 3)
        way = centre[self._one] - centre[self._other]
        middle = way.mean(axis=2)
        half = np.linalg.norm(way - middle[:, :, None], axis=3).max(axis=2)
        reach = (self._size[self._one] + self._size[self._other])[:, None]
        return np.asarray(np.linalg.norm(middle, axis=2) - half - reach <= need)


def _middle(thing: Thing) -> Array:
    corner = thing.shape.corner
    return np.asarray((corner.min(axis=0) + corner.max(axis=0)) / 2)


def _size(thing: Thing) -> float:
    """→ mm, radius of a ball around the middle that holds it."""
    return float(np.linalg.norm(thing.shape.corner - _middle(thing), axis=1).max()) + thing.shape.radius


def turn(first: float, last: float) -> Array:
    """deg, deg → deg of the poses of a turn."""
    return np.linspace(first, last, 2 + math.ceil(abs(last - first) / STEP))
