"""Smooth functions of one or two covariates, each felt by a touch in its own way: what a shape without a name is made of.

A shape is kept as plain numbers: kind, range and number of the functions of each covariate, how a touch feels it, and one value
a product of functions. `learned/<name>.yaml` of a cell holds them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..kinematics import Slot
from ..records import Array, InputError
from ..touches import Touches

LEGENDRE, WAVES, TURN, CYCLE, SIDE, BEYOND, EVEN = "polynomial", "waves", "turn", "cycle", "side", "beyond", "even"
ONE = "none"
PLAYS = (30, 60, 120, 240)  # °: how far a rotary axis turns back before all that was wound up is wound up the other way
SHORT = 20.0  # mm of a way: what is shorter is told apart by its size, what is longer by the logarithm of it


@dataclass(frozen=True)
class Factor:
    """Functions of one covariate: `kind` with `count` functions over `low` … `high` (mm, rad, s, K)."""

    covariate: str
    kind: str
    low: float
    high: float
    count: int
    cycles: float = 0.0  # over the range, of what repeats

    def functions(self, values: Array) -> Array:
        """(n,) values → (n, count); beyond the range the value at its end."""
        x = np.clip(values, self.low, self.high)
        if self.kind == TURN:
            order = np.arange(1, self.count // 2 + 1)
            angle = x[:, None] * order
            return np.hstack([np.cos(angle) / order, np.sin(angle) / order])
        if self.kind == SIDE:
            return np.sign(values)[:, None]
        if self.kind == BEYOND:  # what rests elsewhere from a place on
            return (np.asarray(values) > self.low).astype(float)[:, None]
        if self.kind == EVEN:  # what a load does is the same on both sides of zero, and has a corner there
            u = np.clip(np.abs(values), 0.0, self.high) / (self.high or 1.0)
            return np.asarray(np.polynomial.legendre.legvander(2 * u - 1, self.count)[:, 1:], dtype=float)
        u = (x - self.low) / ((self.high - self.low) or 1.0)
        if self.kind == CYCLE:  # any form that repeats
            angle = 2 * np.pi * u[:, None] * self.cycles * np.arange(1, self.count // 2 + 1)
            order = np.arange(1, self.count // 2 + 1)
            return np.hstack([np.cos(angle) / order, np.sin(angle) / order])
        if self.kind == WAVES:
            order = np.arange(1, self.count + 1)
            return np.asarray(np.cos(np.pi * u[:, None] * order) / order)
        return np.asarray(np.polynomial.legendre.legvander(2 * u - 1, self.count)[:, 1:], dtype=float)


@dataclass(frozen=True)
class Form:
    """What a shape is: functions of its covariates, times how a touch feels it (`weight`)."""

    factors: tuple[Factor, ...]
    weight: str

    @property
    def covariate(self) -> str:
        """→ the covariates as people read them."""
        return " × ".join(f.covariate for f in self.factors)

    @property
    def frame(self) -> str:
        """→ frame or axis in which it acts."""
        return self.weight

    def columns(self, touches: Touches, known: Mapping[str, Array] | None = None, felt: Array | None = None) -> Array:
        """touches, their `values` and `weights` where they are at hand → (n, k) features.

        Raises InputError for a covariate that these touches lack.
        """
        known = values(touches) if known is None else known
        for f in self.factors:
            if f.covariate not in known:
                raise InputError(f"terms: the learned shape follows {f.covariate!r}, which these touches do not have")
        felt = weights(touches, self.weight) if felt is None else felt
        return self.product([f.functions(known[f.covariate]) for f in self.factors], felt)

    def product(self, functions: Sequence[Array], felt: Array) -> Array:
        """(n, c) functions of each factor, (n, w) how a touch feels the shape → (n, k) features."""
        n = len(felt)
        every = [np.column_stack([np.ones(n), own]) for own in functions]
        if len(every) == 1:
            product = every[0][:, 1:]
        elif self.factors[0].kind == SIDE:  # without the sign there is no interaction with it
            product = every[0][:, 1:] * every[1]
        else:
            product = (every[0][:, :, None] * every[1][:, None, :]).reshape(n, -1)[:, 1:]
        return (product[:, :, None] * felt[:, None, :]).reshape(n, -1)


def weights(touches: Touches, name: str) -> Array:
    """touches, how a shape is felt → (n, w): 1, normals of a frame, or the lever of an axis."""
    if name == ONE:
        return np.ones((len(touches), 1))
    kind, _, rest = name.partition(" ")
    frames = {"machine": touches.machine_normal, "table": touches.normal, "spindle": touches.spindle_normal}
    if kind in frames:
        normal = frames[kind]
        return normal[:, ["xyz".index(rest)]] if rest else normal
    if kind == "axis":
        return -touches.lever(rest)[:, None]
    if kind == "tilt":
        letter, axis = rest.split(" of ")
        return -touches.seen.slots[Slot(axis, "intra", 3 + "ABC".index(letter))][:, None]
    if kind == "across":
        return np.hypot(touches.spindle_normal[:, 0], touches.spindle_normal[:, 1])[:, None]
    raise InputError(f"terms: weight: found {name!r}; allowed: {ONE}, machine, table, spindle, axis X, tilt A of X, across")


def values(touches: Touches) -> Mapping[str, Array]:
    """touches → every covariate that a shape may follow, (n,) each; mm, rad, s, K."""
    machine = touches.machine
    n = len(touches)
    result: dict[str, Array] = {"time": touches.warm}
    for axis in (*machine.linear, *machine.rotary, "S"):
        result[axis] = touches.axis(axis)
    for axis in (*machine.linear, *machine.rotary):
        moved = np.diff(touches.axis(axis), prepend=touches.axis(axis)[:1])
        result[f"way of {axis}"] = np.arcsinh(moved / SHORT)  # short ways matter most
        if axis in machine.rotary:
            latest = np.maximum.accumulate(np.where(np.abs(moved) > 1e-4, np.arange(n), 0))
            result[f"way of {axis}"] = np.abs(moved[latest])
            result |= {f"path of {axis} {play}": wound(touches.axis(axis), np.radians(play)) for play in PLAYS}
        result[f"d{axis}"] = touches.sign(axis)
    first = np.flatnonzero(np.diff(touches.indexation, prepend=-1))
    begin = touches.time[first][np.searchsorted(first, np.arange(n), side="right") - 1]
    result["since indexation"] = touches.time - begin
    pause = np.diff(touches.time)
    longest = pause.max(initial=1.0)  # the probe has rested before the first touch
    result["pause"] = np.log(np.maximum(np.concatenate([[longest], pause]), 1.0))
    result["probe direction"] = np.arctan2(touches.spindle_normal[:, 1], touches.spindle_normal[:, 0])
    result["probe direction along"] = touches.spindle_normal[:, 2]
    for i, letter in enumerate("xyz"):
        result[f"normal {letter}, machine"] = touches.machine_normal[:, i]
        result[f"normal {letter}, table"] = touches.normal[:, i]
        result[f"place {letter}, table"] = touches.point[:, i]
    facet = np.array(touches.facet)
    result |= {f"facet {one}": (facet == one).astype(float) for one in dict.fromkeys(touches.facet)}
    for sensor, value in touches.temperatures.items():
        result[f"T_{sensor}"] = value - value[0]
    if np.isfinite(touches.feed).all():
        result["feed"] = touches.feed
    return result


def wound(path: Array, play: float) -> Array:
    """(n,) places of an axis in their order, play → (n,) how far it is ahead of what it drags along behind a play, rad.

    This is the simplest hysteresis: it depends on the path alone, and from ±play/2 on it does not grow (Prandtl 1928).
    """
    ahead, found = 0.0, []
    for step in np.diff(path, prepend=path[:1]):
        ahead = min(max(ahead + float(step), -play / 2), play / 2)
        found.append(ahead)
    return np.array(found)


def spec(form: Form) -> dict[str, Any]:
    """shape → plain data for files."""
    return {
        "factors": [
            {"covariate": f.covariate, "kind": f.kind, "low": f.low, "high": f.high, "count": f.count}
            | ({"cycles": f.cycles} if f.cycles else {})
            for f in form.factors
        ],
        "weight": form.weight,
    }


def form_of(data: Mapping[str, Any]) -> Form:
    """plain data → shape."""
    return Form(tuple(Factor(**f) for f in data["factors"]), str(data["weight"]))
