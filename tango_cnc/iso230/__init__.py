"""Error polynomials → the figures of ISO 230-1 (and ISO 230-2, 230-7): what an acceptance report states.

Every figure is read off one axis moved alone over the range that was touched, at the origin of its axis frame. The others
stand at zero, or in the middle of their touched range where zero was never touched. Between the points where its extremes
lie, every figure is linear in the coefficients, so that standard deviations follow from the covariance directly.

| figure | reference | source |
|---|---|---|
| positioning: mean bidirectional range, reversal value, systematic deviation (M, B, E) | | ISO 230-2:2014 |
| straightness | least-squares line | ISO 230-1:2012 |
| angular error motion: roll, tilts | | ISO 230-1:2012 |
| squareness, parallelism, angle | least-squares lines, axis average lines | ISO 230-1:2012 |
| radial, axial and tilt error motion | axis average line, least squares | ISO 230-7:2015 |
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..estimate import Estimate
from ..records import Array, Machine
from ..terms import Coefficient
from ..touches import Touches
from ._between import between
from ._figure import Figure, Tell
from ._line import line_of, motions
from ._motions import motion_figures
from .expansion import stretches
from .temperature import Known

__all__ = ["Curve", "Figure", "Tell", "curves", "figures", "of_coefficients", "ranges"]


def ranges(touches: Touches) -> dict[str, tuple[float, float]]:
    """touches → touched range of every axis that moved, mm or rad."""
    names = (*touches.machine.linear, *touches.machine.rotary)
    found = {name: (float(touches.axis(name).min()), float(touches.axis(name).max())) for name in names}
    return {name: (low, high) for name, (low, high) in found.items() if high - low > 1e-6}


def figures(
    result: Estimate, over: dict[str, tuple[float, float]] | None = None, expansion: Known | None = None
) -> tuple[Figure, ...]:
    """estimate, ranges (mm, rad; default: touched), what temperature adds to every scale (mm/mm) → figures of its coefficients."""
    model = result.model
    index = [i for i, c in enumerate(model.coefficients) if c.slot.stage in ("inter", "motion", "intra")]
    chosen = [model.coefficients[i] for i in index]
    values, covariance = result.values[index], result.covariance[np.ix_(index, index)]
    if expansion is not None:
        linear, p = model.touches.machine.linear, len(chosen)
        chosen = [*chosen, *stretches(model.touches.machine)]
        values, known = np.append(values, np.full(len(linear), expansion.value)), covariance
        covariance = np.zeros((len(chosen), len(chosen)))
        covariance[:p, :p], covariance[p:, p:] = known, expansion.std**2  # one expansion for all axes
    return of_coefficients(model.touches.machine, chosen, values, covariance, over or ranges(model.touches))


def of_coefficients(
    machine: Machine, coefficients: Sequence[Coefficient], values: Array, covariance: Array, over: dict[str, tuple[float, float]]
) -> tuple[Figure, ...]:
    """coefficients with values (p,) and covariance (p, p), ranges of axes (mm, rad) → figures."""
    lines = {name: line_of(machine, machine.axis(name), coefficients, *over[name]) for name in machine.names if name in over}
    tell = Tell(values, covariance)
    found: list[Figure] = []
    for line in lines.values():
        found += motion_figures(line, tell)
    found += between(machine, lines, tell)
    return tuple(found)


class Curve(NamedTuple):
    """An error motion as estimated, about its mean over the range, in the unit of people, with its standard deviation."""

    kind: str
    name: str
    unit: str
    value: Array  # (m,)
    std: Array  # (m,)


def curves(result: Estimate) -> dict[str, tuple[Array, list[Curve]]]:
    """estimate → axis: positions (m,) in mm or degrees over the touched range, its error motions there."""
    model = result.model
    index = [i for i, c in enumerate(model.coefficients) if c.slot.stage in ("inter", "motion", "intra")]
    chosen = [model.coefficients[i] for i in index]
    values, covariance = result.values[index], result.covariance[np.ix_(index, index)]
    found = {}
    for name, (low, high) in ranges(model.touches).items():
        line = line_of(model.touches.machine, model.touches.machine.axis(name), chosen, low, high)
        drawn = []
        for motion in motions(line):
            curve = motion.factor * (motion.curve - motion.curve.mean(axis=0))
            drawn.append(Curve(motion.kind, motion.name, motion.unit, curve @ values, _std(curve, covariance)))
        if drawn:
            found[name] = (line.command * (1.0 if line.axis.kind == "linear" else 180 / np.pi), drawn)
    return found


def _std(curve: Array, covariance: Array) -> Array:
    return np.sqrt(np.clip(np.sum(curve @ covariance * curve, axis=1), 0.0, None))
