"""What shapes are drawn over: the covariates that change in these touches, and the axes among them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..records import Array, Machine
from ..terms._shape import BEYOND, LEGENDRE, ONE, SIDE, TURN, Factor
from ..touches import Touches

PLACES = 40  # of an axis beyond which something may rest elsewhere
OFTEN = 6  # touches of a facet that show a course, and beyond a place
WHOLE = 4.0  # rad: what an axis turns beyond this is a wave, and no polynomial of four functions
HALF = 2.0  # rad: what waves of an axis can do with a name, they can do without one
LEAST = {"way": 1e-3, "pause": 0.2, "place": 1.0, "path": 0.05, "since": 1.0, "T": 0.05, "feed": 1e-6, "probe": 0.05, "time": 1.0}


@dataclass(frozen=True)
class Ground:
    """Covariates (n,) by name that are no constant, in mm, rad, s, K; axes that move, in the order of the machine."""

    known: Mapping[str, Array]
    machine: Machine

    @property
    def linear(self) -> list[str]:
        """→ linear axes that move."""
        return [a for a in self.machine.linear if a in self.known]

    @property
    def rotary(self) -> list[str]:
        """→ rotary axes that turn."""
        return [a for a in self.machine.rotary if a in self.known]

    @property
    def axes(self) -> tuple[str, ...]:
        """→ all of them."""
        return (*self.linear, *self.rotary)

    @property
    def directions(self) -> tuple[str, ...]:
        """→ how a touch may feel what moves the tool along an axis of the machine."""
        return tuple(f"machine {c}" for c in "xyz")

    @property
    def felt(self) -> tuple[str, ...]:
        """→ how a touch may feel what it follows: as it is, along an axis of the machine, as an error of an axis."""
        return (ONE, *self.directions, *(f"axis {a}" for a in self.axes))

    def line(self, name: str, count: int, kind: str = LEGENDRE) -> Factor:
        """covariate, number and kind of functions → functions over all that it covers."""
        v = self.known[name]
        return Factor(name, kind, float(v.min()), float(v.max()), count)

    def slow(self, name: str, count: int, waves: int) -> Factor:
        """covariate of a pair, polynomials, waves → waves where an axis turns so far that no polynomial follows it."""
        turns = name in self.machine.rotary and np.ptp(self.known[name]) > WHOLE
        return around(name, waves) if turns else self.line(name, count)

    def beyond(self, name: str, most: int = PLACES) -> Iterator[Factor]:
        """axis, how many places at most → steps at the places between those that were used."""
        for place in between(self.known[name], most):
            yield Factor(name, BEYOND, place, float(self.known[name].max()), 1)


def around(name: str, count: int) -> Factor:
    """angle, number of waves → waves around the full circle."""
    return Factor(name, TURN, -1e3, 1e3, count)


def side(name: str) -> Factor:
    """direction from which an axis came, as −1, 0 and 1 → one function, its sign."""
    return Factor(name, SIDE, -1.0, 1.0, 1)


def between(v: Array, most: int = PLACES, least: int = OFTEN) -> list[float]:
    """(n,) angles or places, how many at most, touches on each side → places between those that were used."""
    used = np.unique(np.round(v, 4))
    if len(used) > most:
        used = np.unique(np.quantile(used, np.linspace(0, 1, most)))
    middle = (used[1:] + used[:-1]) / 2
    return [float(m) for m in middle if min((v > m).sum(), (v < m).sum()) >= least]


def moves(touches: Touches, name: str, v: Array) -> bool:
    """touches, name and values (n,) of a covariate → whether it changes so much that it is no constant."""
    kind = name.split(" ")[0].split("_")[0]
    if len(name) == 2 and name[0] == "d":
        return len(set(v) - {0.0}) == 2
    least = LEAST.get(kind, 1.0 if name in touches.machine.linear else 0.05)
    return bool(np.ptp(v) > least)
