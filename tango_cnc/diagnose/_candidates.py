"""Everything that may be in the residuals: every cause with every setting, and shapes that have no name.

A shape without a name is a smooth function of one covariate in one frame. When one of them fits clearly better than any
cause, the honest answer is the covariate, not the nearest cause.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import terms
from ..kinematics import Slot
from ..records import Array
from ..terms import GAP, Coefficient
from ..touches import Touches

VISIBLE = 0.02  # part of a pattern outside the model below which nobody can tell


@dataclass(frozen=True)
class Candidate:
    """One explanation: columns (n, k) mm of residual for unit values; a name, or a covariate where there is none."""

    cause: str  # "" for a shape without a name, "outlier" for a single touch
    setting: Mapping[str, Any]
    columns: Array
    coefficients: tuple[Coefficient, ...] = ()

    @property
    def named(self) -> bool:
        """→ whether this is a cause of the catalogue."""
        return self.cause not in ("", "outlier")


def pattern(touches: Touches, coefficients: Collection[Coefficient]) -> Array:
    """touches, coefficients → (n, k): residual that each leaves per unit when the model lacks it (nominal levers)."""
    levers = touches.seen.slots
    columns = [c.regressor(touches) * (-1.0 if c.slot == GAP else -levers[c.slot]) for c in coefficients]
    return np.array(columns).reshape(len(columns), len(touches)).T


def candidate(touches: Touches, cause: str, setting: Mapping[str, Any]) -> Candidate:
    """cause with its setting → candidate. Raises InputError for settings that it does not have."""
    coefficients = terms.cause(cause, touches.machine, setting)
    return Candidate(cause, dict(setting), pattern(touches, coefficients), tuple(coefficients))


def named(touches: Touches, present: Collection[str], excluded: Collection[str] = ()) -> Iterator[Candidate]:
    """touches, names of fitted coefficients, causes left out → every cause that is not in the model with every setting."""
    for cause, module in terms.causes().items():
        if cause in excluded or not hasattr(module, "variants"):
            continue
        for setting in module.variants(touches):
            found = candidate(touches, cause, setting)
            if not {c.name for c in found.coefficients} <= set(present):
                yield found


def outliers(touches: Touches) -> Iterator[Candidate]:
    """touches → each of them alone."""
    for i, column in enumerate(np.eye(len(touches))):
        yield Candidate("outlier", {"touch": i}, column[:, None])


def covariates(touches: Touches) -> dict[str, tuple[str, Array]]:
    """touches → name: (kind, (n,) values): what residuals are plotted and smoothed against."""
    machine = touches.machine
    result: dict[str, tuple[str, Array]] = {"time": ("line", touches.time), "order": ("line", np.arange(1.0, len(touches) + 1))}
    for axis in (*machine.linear, *machine.rotary, "S"):
        values = touches.axis(axis)
        if np.ptp(values) > (1.0 if axis in machine.linear else 0.05):
            turning = axis not in machine.linear and np.ptp(values) > np.pi
            result[axis] = ("angle" if turning else "line", values)
    for sensor, values in touches.temperatures.items():
        if np.ptp(values) > 0.05:
            result[f"T_{sensor}"] = ("line", values)
    if np.isfinite(touches.feed).all() and np.ptp(touches.feed) > 0:
        result["feed"] = ("line", touches.feed)
    return result


def smooth(kind: str, values: Array, degree: int = 4) -> Array:
    """line or angle (rad), (n,) values → (n, degree) shapes without the constant: Legendre polynomials or harmonics."""
    if kind == "angle":
        return np.column_stack([f(m * values) for m in range(1, degree // 2 + 1) for f in (np.cos, np.sin)])
    spread = np.ptp(values)
    scaled = 2 * (values - values.min()) / spread - 1 if spread else np.zeros_like(values)
    return np.polynomial.legendre.legvander(scaled, degree)[:, 1:]


def shapes(touches: Touches) -> Iterator[Candidate]:
    """touches → smooth functions of every covariate, in every frame and direction, and of what happened before."""

    def shape(covariate: str, frame: str, columns: Array, kind: str = "smooth") -> Candidate:
        return Candidate("", {"covariate": covariate, "frame": frame, "shape": kind}, columns)

    def times(function: Array, weights: Array) -> Array:
        return np.einsum("nf,nw->nfw", function, weights.reshape(len(touches), -1)).reshape(len(touches), -1)

    machine, table, spindle = touches.machine_normal, touches.normal, touches.spindle_normal
    one = np.ones(len(touches))
    known = covariates(touches)
    for name, (kind, values) in known.items():
        if name == "order":
            continue
        function = smooth(kind, values)
        yield shape(name, "none", times(function, one))
        yield shape(name, "machine", times(function[:, :3], machine))
        for i, letter in enumerate("xyz"):
            yield shape(name, f"machine {letter}", times(function, machine[:, i]))
        if name == "time":
            yield shape(name, "table", times(function[:, :3], table))
            yield shape(name, "table", times(function, np.sum(table * touches.point, axis=1)), "growth")
            hats = np.abs(np.linspace(0, 1, 10)[None, :] - _unit(values)[:, None]) < 1 / 18
            yield shape(name, "machine", times(hats[:, 1:].astype(float), machine), "blocks")
            yield shape(name, "table", times(hats[:, 1:].astype(float), table), "blocks")
            for axis in touches.machine.linear:
                yield shape(name, f"axis {axis}", times(function[:, :2], touches.lever(axis) * touches.axis(axis)), "growth")
            for facet in dict.fromkeys(touches.facet):
                on = (np.array(touches.facet) == facet).astype(float)
                if on.sum() > 5:
                    yield shape(f"facet {facet}", "table", times(function[:, :2], on), "changes with time")
        if name in touches.machine.linear:
            yield shape(name, f"axis {name}", times(smooth("line", values, 8), touches.lever(name)))
            for other in touches.machine.linear:
                for turn in range(3, 6):
                    lever = touches.seen.slots.get(Slot(other, "intra", turn))
                    if lever is not None:
                        yield shape(name, f"tilt of {other}", times(function, lever))
        if name in touches.machine.rotary:
            yield shape(name, f"axis {name}", times(smooth(kind, values, 6), touches.lever(name)))
            yield shape(name, "table", times(function[:, :3], table))
            tilts = np.column_stack([touches.seen.slots[Slot(name, "inter", i)] for i in range(3, 6)])
            yield shape(name, f"tilt of {name}", times(function[:, :3], tilts))
        if name == "S":
            yield shape(name, "spindle", times(function[:, :3], spindle[:, :2]))
    azimuth = np.arctan2(spindle[:, 1], spindle[:, 0])
    across = np.hypot(spindle[:, 0], spindle[:, 1])
    yield shape("probe direction", "spindle", times(smooth("angle", azimuth, 8), across))
    yield shape("probe direction", "spindle", np.column_stack([spindle[:, 2] ** 2, spindle[:, 2] ** 3, across**2 * spindle[:, 2]]))
    before = np.zeros_like(spindle)
    before[1:] = spindle[:-1]
    yield shape("previous touch", "spindle", times(before, spindle), "memory")
    fresh = np.concatenate([[True], np.diff(touches.indexation) > 0]).astype(float)
    yield shape("first touch of an indexation", "none", np.column_stack([fresh]), "memory")
    yield shape("first touch of an indexation", "machine", times(fresh[:, None], machine), "memory")
    for axis in (*touches.machine.linear, *touches.machine.rotary):
        if len(set(touches.sign(axis)) - {0.0}) == 2:
            yield shape(f"d{axis}", f"axis {axis}", times(touches.sign(axis)[:, None], touches.lever(axis)), "sign")
            yield shape(f"d{axis}", "machine", times(touches.sign(axis)[:, None], machine), "sign")
        way = np.abs(np.diff(touches.axis(axis), prepend=touches.axis(axis)[:1]))
        yield shape(f"way of {axis}", f"axis {axis}", times(smooth("line", way, 3), touches.lever(axis)), "memory")


def _unit(values: Array) -> Array:
    return (values - values.min()) / (np.ptp(values) or 1.0)
