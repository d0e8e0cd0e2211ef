"""Everything that may be in the residuals: every cause with every setting, and shapes that have no name.

A shape without a name is a smooth function of one covariate in one frame. When one of them fits clearly better than any
cause, the honest answer is the covariate, not the nearest cause.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import terms
from ..kinematics import Slot
from ..records import Array
from ..terms import GAP, Coefficient, Shape
from ..terms._cause import times
from ..touches import Touches

VISIBLE = 0.02  # part of a pattern outside the model below which nobody can tell


@dataclass(frozen=True, eq=False)
class Candidate:
    """One explanation: columns (n, k) mm of residual for unit values; a name, or a covariate where there is none."""

    cause: str  # "" for a shape without a name, "outlier" for a single touch
    setting: Mapping[str, Any]
    columns: Array
    coefficients: tuple[Coefficient, ...] = ()
    known: int = 0  # of the coefficients: their values follow from what is estimated already

    @property
    def named(self) -> bool:
        """→ whether this is a cause of the catalogue."""
        return self.cause not in ("", "outlier")

    @property
    def learned(self) -> bool:
        """→ whether this is a shape that was learned from this machine."""
        return self.cause == terms.serving("learned")


def pattern(touches: Touches, coefficients: Collection[Coefficient]) -> Array:
    """touches, coefficients → (n, k): residual that each leaves per unit when the model lacks it (nominal levers)."""
    levers = touches.seen.slots
    columns = [c.regressor(touches) * (-1.0 if c.slot == GAP else -levers[c.slot]) for c in coefficients]
    return np.array(columns).reshape(len(columns), len(touches)).T


def candidate(touches: Touches, cause: str, setting: Mapping[str, Any]) -> Candidate:
    """cause with its setting → candidate. Raises InputError for settings that it does not have."""
    coefficients = terms.cause(cause, touches.machine, setting)
    known = terms.causes()[cause].known
    return Candidate(cause, dict(setting), pattern(touches, coefficients), tuple(coefficients), known)


def named(
    touches: Touches,
    present: Collection[str],
    excluded: Collection[str] = (),
    settings: Callable[[terms.Cause], Iterator[Mapping[str, Any]]] | None = None,
) -> Iterator[Candidate]:
    """touches, names of fitted coefficients, causes left out → every cause that is not in the model with every setting."""
    for cause, record in terms.causes().items():
        if cause in excluded:
            continue
        for setting in record.variants(touches) if settings is None else settings(record):
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


def shapes(touches: Touches, causes: Collection[str], rows: int | None = None) -> Iterator[Candidate]:
    """touches, causes in the catalogue → smooth functions of every covariate, in every frame and direction, and of what happened
    before; steps and periods as well, unless the catalogue has a name for them.
    """
    for covariate, frame, kind, columns in (*_places(touches), *_probing(touches), *_plain(touches, causes, rows or len(touches))):
        yield Candidate("", {"covariate": covariate, "frame": frame, "shape": kind}, columns)


def _places(touches: Touches) -> Iterator[Shape]:
    machine, table = touches.machine_normal, touches.normal
    one = np.ones(len(touches))
    levers = touches.seen.slots
    for name, (kind, values) in covariates(touches).items():
        if name == "order":
            continue
        few = smooth(kind, values, 4)[:, : 4 if kind == "angle" else 3]
        many = smooth(kind, values, 8 if kind == "angle" else 4)
        yield name, "none", "smooth", times(many, one)
        yield name, "machine", "smooth", times(few, machine)
        for i, letter in enumerate("xyz"):
            yield name, f"machine {letter}", "smooth", times(many, machine[:, i])
        if name == "time":
            yield name, "table", "smooth", times(few, table)
            yield name, "table", "growth", times(many, np.sum(table * touches.point, axis=1))
            for axis in touches.machine.linear:
                yield name, f"axis {axis}", "growth", times(few[:, :2], touches.lever(axis) * touches.axis(axis))
            for facet in dict.fromkeys(touches.facet):
                on = (np.array(touches.facet) == facet).astype(float)
                if on.sum() > 5:
                    yield f"facet {facet}", "table", "changes with time", times(few[:, :2], on)
        if name in touches.machine.linear:
            yield name, f"axis {name}", "smooth", times(smooth("line", values, 8), touches.lever(name))
            for other in touches.machine.linear:
                for turn in range(3, 6):
                    if (lever := levers.get(Slot(other, "intra", turn))) is not None:
                        yield name, f"tilt of {other}", "smooth", times(many, lever)
        if name in touches.machine.rotary:
            yield name, f"axis {name}", "smooth", times(smooth(kind, values, 8), touches.lever(name))
            for stage, frame in (("intra", "body"), ("inter", "bed")):
                for first, what in ((0, "shift"), (3, "tilt")):
                    moved = [levers[s] for i in range(first, first + 3) if (s := Slot(name, stage, i)) in levers]  # type: ignore[arg-type]
                    yield name, f"{frame} of {name}", what, times(few, np.column_stack(moved))
                    for one_way in moved:
                        yield name, f"{frame} of {name}", what, times(many, one_way)
        if name == "S":
            yield name, "spindle", "smooth", times(few, touches.spindle_normal[:, :2])


def _probing(touches: Touches) -> Iterator[Shape]:
    machine, spindle = touches.machine_normal, touches.spindle_normal
    azimuth = np.arctan2(spindle[:, 1], spindle[:, 0])
    across = np.hypot(spindle[:, 0], spindle[:, 1])
    yield "probe direction", "spindle", "smooth", times(smooth("angle", azimuth, 8), across)
    axial = [spindle[:, 2] ** 2, spindle[:, 2] ** 3, across**2 * spindle[:, 2]]
    yield "probe direction", "spindle", "smooth", np.column_stack(axial)
    before = np.zeros_like(spindle)
    before[1:] = spindle[:-1]
    yield "previous touch", "spindle", "memory", times(before, spindle)
    fresh = np.concatenate([[True], np.diff(touches.indexation) > 0]).astype(float)[:, None]
    yield "first touch of an indexation", "none", "memory", fresh
    yield "first touch of an indexation", "machine", "memory", times(fresh, machine)
    for axis in (*touches.machine.linear, *touches.machine.rotary):
        if len(set(touches.sign(axis)) - {0.0}) == 2:
            yield f"d{axis}", f"axis {axis}", "sign", times(touches.sign(axis)[:, None], touches.lever(axis))
            yield f"d{axis}", "machine", "sign", times(touches.sign(axis)[:, None], machine)
        way = np.abs(np.diff(touches.axis(axis), prepend=touches.axis(axis)[:1]))
        yield f"way of {axis}", f"axis {axis}", "memory", times(smooth("line", way, 3), touches.lever(axis))


def _plain(touches: Touches, causes: Collection[str], rows: int) -> Iterator[Shape]:
    """Simple shapes with few coefficients: each only where the catalogue has no name for it."""
    for name, record in terms.causes().items():
        if name not in causes:
            yield from record.unnamed(touches, rows)
