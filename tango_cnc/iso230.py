"""Error polynomials → the figures of ISO 230-1 (and ISO 230-2, 230-7): what an acceptance report states.

Every figure is read off one axis moved alone over the range that was touched, at the origin of its axis frame. The others
stand at zero, or in the middle of their touched range where zero was never touched. Reference lines, mean
axes of rotation and their ranges are linear in the coefficients between the points where extremes lie, so that standard
deviations follow from the covariance directly.

| figure | reference | source |
|---|---|---|
| positioning: mean bidirectional range, reversal value, systematic deviation | | ISO 230-2:2014, 3.12–3.16 |
| straightness | least-squares line | ISO 230-1:2012, 3.4 |
| angular error motion: roll, tilts | | ISO 230-1:2012, 3.4.16 |
| squareness, parallelism, angle | least-squares lines, axis average lines | ISO 230-1:2012, 3.6, 3.7 |
| radial, axial and tilt error motion | axis average line, least squares | ISO 230-7:2015, 3.3–3.5 |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .estimate import Estimate
from .kinematics import axis_frame
from .records import COMPONENTS, Array, Artefact, Axis, Facet, Machine
from .terms import Coefficient
from .touches import Touches, of_facets

POINTS = 201
ARCSECOND = 180 * 3600 / np.pi  # a radian
PARALLEL = 1e-6


@dataclass(frozen=True)
class Figure:
    """One figure in the unit that people use; `range` in mm or degrees, None for a figure of several axes."""

    kind: str
    name: str
    value: float
    std: float
    unit: str  # µm, µrad, µm/m, ″
    range: tuple[float, float] | None = None
    note: str = ""

    @property
    def arcseconds(self) -> float | None:
        """→ ″ of a small angle, None for a length."""
        return self.value * 1e-6 * ARCSECOND if self.unit in ("µrad", "µm/m") and self.kind != "positioning gain" else None


@dataclass(frozen=True)
class _Line:
    """One axis moved alone: regressors along it, (m, p), for each of its six components; those where it rests, (6, p)."""

    axis: Axis
    frame: Array  # (3, 3) rows = base vectors of the axis frame in the machine frame
    base: int
    sense: float
    command: Array  # (m,)
    along: tuple[Array, ...]
    at_rest: Array
    inter: Array  # (6, p)
    reversal: Array  # (p,) what the last motion adds to the positioning error


def ranges(touches: Touches) -> dict[str, tuple[float, float]]:
    """touches → touched range of every axis that moved, mm or rad."""
    names = (*touches.machine.linear, *touches.machine.rotary)
    found = {name: (float(touches.axis(name).min()), float(touches.axis(name).max())) for name in names}
    return {name: (low, high) for name, (low, high) in found.items() if high - low > 1e-6}


def figures(result: Estimate, over: dict[str, tuple[float, float]] | None = None) -> tuple[Figure, ...]:
    """estimate, ranges (mm, rad; default: what was touched) → all figures that its coefficients determine."""
    model = result.model
    index = [i for i, c in enumerate(model.coefficients) if c.slot.stage in ("inter", "motion", "intra")]
    chosen = [model.coefficients[i] for i in index]
    values, covariance = result.values[index], result.covariance[np.ix_(index, index)]
    return of_coefficients(model.touches.machine, chosen, values, covariance, over or ranges(model.touches))


def of_coefficients(
    machine: Machine, coefficients: Sequence[Coefficient], values: Array, covariance: Array, over: dict[str, tuple[float, float]]
) -> tuple[Figure, ...]:
    """coefficients with values (p,) and covariance (p, p), ranges of axes (mm, rad) → figures."""
    lines = {name: _line(machine, machine.axis(name), coefficients, *over[name]) for name in machine.names if name in over}
    tell = _Tell(values, covariance)
    found: list[Figure] = []
    for line in lines.values():
        found += _motion_figures(line, tell)
    found += _between(machine, lines, tell)
    return tuple(found)


class Curve(NamedTuple):
    """An error motion as estimated, in the unit of people, with its standard deviation."""

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
        line = _line(model.touches.machine, model.touches.machine.axis(name), chosen, low, high)
        drawn = [
            Curve(m.kind, m.name, m.unit, m.factor * (m.curve @ values), m.factor * _std(m.curve, covariance))
            for m in _motions(line)
        ]
        if drawn:
            found[name] = (line.command * (1.0 if line.axis.kind == "linear" else 180 / np.pi), drawn)
    return found


def _std(curve: Array, covariance: Array) -> Array:
    return np.sqrt(np.clip(np.sum(curve @ covariance * curve, axis=1), 0.0, None))


@dataclass(frozen=True)
class _Tell:
    """Linear combinations of the coefficients → values with standard deviations."""

    values: Array
    covariance: Array

    def one(self, weights: Array) -> tuple[float, float]:
        return float(weights @ self.values), float(max(float(weights @ self.covariance @ weights), 0.0) ** 0.5)

    def spread(self, curve: Array) -> tuple[float, float]:
        """(m, p) → largest minus smallest of the curve, and its standard deviation."""
        y = curve @ self.values
        return self.one(curve[int(np.argmax(y))] - curve[int(np.argmin(y))])


def _line(machine: Machine, axis: Axis, coefficients: Sequence[Coefficient], low: float, high: float) -> _Line:
    command = np.linspace(low, high, POINTS)
    rest = (low + high) / 2 if axis.kind == "linear" and not low <= 0 <= high else 0.0
    position = np.zeros((POINTS + 1, len(machine.names)))
    position[:, machine.column(axis.name)] = [*command, rest]
    still = _poses(machine, position, 0.0)
    forward = _poses(machine, position, 1.0)
    p = len(coefficients)
    along = tuple(np.zeros((POINTS, p)) for _ in range(6))
    at_rest, inter, reversal = np.zeros((6, p)), np.zeros((6, p)), np.zeros(p)
    frame, base, sense = axis_frame(axis.name, axis.direction)
    own = base + (0 if axis.kind == "linear" else 3)
    for j, c in enumerate(coefficients):
        if c.slot.axis != axis.name:
            continue
        value = c.regressor(still)
        if c.slot.stage == "inter":
            inter[c.slot.component, j] = value[-1]
            continue
        component = own if c.slot.stage == "motion" else c.slot.component
        along[component][:, j] = value[:-1]
        at_rest[component, j] = value[-1]
        if c.slot.stage == "motion":
            reversal[j] = (c.regressor(forward) - value)[0]
    return _Line(axis, np.eye(3) if frame is None else frame, base, sense, command, along, at_rest, inter, reversal)


def _poses(machine: Machine, position: Array, direction: float) -> Touches:
    nowhere = Artefact("poses", {"0": Facet("0", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))})
    return of_facets(machine, nowhere, ["0"] * len(position), position, np.full_like(position, direction))


def _range(line: _Line) -> tuple[float, float]:
    scale = 1.0 if line.axis.kind == "linear" else 180 / np.pi
    return float(line.command[0] * scale), float(line.command[-1] * scale)


def _positioning(line: _Line, tell: _Tell) -> list[Figure]:
    name, unit = f"E{line.axis.name}{line.axis.name}", "µm" if line.axis.kind == "linear" else "µrad"
    factor = 1e3 if unit == "µm" else 1e6
    curve, over = line.along[line.base + (0 if unit == "µm" else 3)], _range(line)
    found = []
    if curve.any():
        value, std = tell.spread(curve)
        found.append(Figure("positioning", f"{name} M", value * factor, std * factor, unit, over, "mean bidirectional range"))
        slope, _ = _straight(line, curve)
        gain, std = tell.one(slope)
        found.append(Figure("positioning gain", name, gain * 1e6, std * 1e6, "µm/m" if unit == "µm" else "µrad/rad", over))
    if line.reversal.any():
        b, std_b = tell.one(2 * line.reversal)
        note = "reversal value: lost motion" if b < 0 else "reversal value: more than was commanded"
        found.append(Figure("reversal", f"{name} B", abs(b) * factor, std_b * factor, unit, over, note))
        if curve.any():
            whole = line.reversal * (2.0 if b > 0 else -2.0)
            y = curve @ tell.values
            both = curve[int(np.argmax(y))] - curve[int(np.argmin(y))] + whole
            value, std = tell.one(both)
            note = "bidirectional systematic deviation; accuracy A needs repeated runs"
            found.append(Figure("positioning", f"{name} E", value * factor, std * factor, unit, over, note))
    return found


def _straight(line: _Line, curve: Array) -> tuple[Array, Array]:
    """(m, p) → slope (p,) of the least-squares line, deviations from it (m, p)."""
    matrix = np.column_stack([np.ones(POINTS), line.command])
    fit = np.linalg.lstsq(matrix, curve, rcond=None)[0]
    return fit[1], curve - matrix @ fit


class Motion(NamedTuple):
    """One error motion over the range of its axis, against its reference line; `curve` is linear in the coefficients."""

    kind: str
    name: str
    note: str
    factor: float  # mm, rad → unit
    unit: str
    curve: Array  # (m, p)


def _motions(line: _Line) -> list[Motion]:
    """→ the error motions of an axis, positioning first."""
    name, found = line.axis.name, []
    linear = line.axis.kind == "linear"
    own = line.base + (0 if linear else 3)
    if line.along[own].any():
        unit, factor = ("µm", 1e3) if linear else ("µrad", 1e6)
        found.append(Motion("positioning", f"E{name}{name}", "mean bidirectional range", factor, unit, line.along[own]))
    if linear:
        for i in range(3):
            if i != line.base and line.along[i].any():
                curve = _straight(line, line.along[i])[1]
                found.append(Motion("straightness", f"E{COMPONENTS[i]}{name}", "about the least-squares line", 1e3, "µm", curve))
        for i in range(3):
            if line.along[3 + i].any():
                note = "roll" if i == line.base else f"tilt about {'XYZ'[i]}"
                found.append(Motion("angular", f"E{COMPONENTS[3 + i]}{name}", note, 1e6, "µrad", line.along[3 + i]))
        return found
    j, k = _across(line)
    if line.along[line.base].any():
        found.append(Motion("axial", f"E{COMPONENTS[line.base]}{name}", "along the axis", 1e3, "µm", line.along[line.base]))
    for first, kind, factor, unit in ((0, "radial", 1e3, "µm"), (3, "tilt", 1e6, "µrad")):
        if line.along[first + j].any() or line.along[first + k].any():
            _, rest = _turned(line, (line.along[first + j], line.along[first + k]))
            for i, curve in zip((j, k), rest, strict=True):
                found.append(Motion(kind, f"E{COMPONENTS[first + i]}{name}", "about the axis average line", factor, unit, curve))
    return found


def _motion_figures(line: _Line, tell: _Tell) -> list[Figure]:
    found = _positioning(line, tell)
    for motion in _motions(line):
        if motion.kind != "positioning":
            value, std = tell.spread(motion.curve)
            factor = motion.factor
            found.append(Figure(motion.kind, motion.name, value * factor, std * factor, motion.unit, _range(line), motion.note))
    return found


def _turned(line: _Line, curves: tuple[Array, Array]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """two components across a rotary axis, body frame → (offset of the mean axis, error motion) along both fixed directions.

    In the fixed frame d(θ) = R(θ) · components = a + R(θ) b + rest: a places the axis average line, b is how the table sits
    on the axis (eccentricity, taken up by the facet offsets), the rest is the error motion (ISO 230-7, 3.3).
    """
    angle = line.sense * line.command
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    fixed = np.vstack([cosine * curves[0] - sine * curves[1], sine * curves[0] + cosine * curves[1]])
    one, nil = np.ones_like(cosine), np.zeros_like(cosine)
    matrix = np.vstack([np.hstack([one, nil, cosine, -sine]), np.hstack([nil, one, sine, cosine])])
    fit = np.linalg.lstsq(matrix, fixed, rcond=None)[0]
    rest = fixed - matrix @ fit
    return (fit[0], fit[1]), (rest[:POINTS], rest[POINTS:])


def _across(line: _Line) -> tuple[int, int]:
    return (line.base + 1) % 3, (line.base + 2) % 3


def _between(machine: Machine, lines: dict[str, _Line], tell: _Tell) -> list[Figure]:
    """Directions (3, p) and places (3, p) of the reference lines → squareness, parallelism, angle, offset."""
    directions, places = {}, {}
    for branch in (machine.workpiece_branch, machine.tool_branch):
        turn, shift, origin = np.zeros((3, len(tell.values))), np.zeros((3, len(tell.values))), np.zeros(3)
        for name in branch:
            if name not in lines:
                continue
            line = lines[name]
            point = np.array(line.axis.point)
            shift = shift + np.cross(turn, point - origin, axisa=0, axisc=0)
            origin = point
            turn = turn + line.frame.T @ line.inter[3:]
            shift = shift + line.frame.T @ line.inter[:3]
            bend, off = _reference(line)
            directions[name] = np.cross(turn + bend, np.array(line.axis.direction), axisa=0, axisc=0)
            places[name] = shift + off
            turn = turn + line.frame.T @ line.at_rest[3:]
            shift = shift + line.frame.T @ line.at_rest[:3]
    found = []
    names = [name for name in (*machine.linear, *machine.rotary) if name in directions]
    for i, one in enumerate(names):
        for two in names[:i]:
            found += _pair(machine.axis(two), machine.axis(one), directions[two], directions[one], tell)
    rotary = [name for name in machine.rotary if name in places]
    for branch in (machine.workpiece_branch, machine.tool_branch):
        inner = [name for name in branch if name in rotary]
        if len(inner) == 2:
            one, two = inner
            across = np.cross(machine.axis(one).direction, machine.axis(two).direction)
            if np.linalg.norm(across) > 1e-3:
                across /= np.linalg.norm(across)
                weights = across @ (places[two] - places[one])
                if weights.any():
                    value, std = tell.one(weights)
                    text = f"along [{', '.join(f'{a + 0.0:.3g}' for a in across)}]"
                    found.append(Figure("offset", f"{two} to {one}", value * 1e3, std * 1e3, "µm", None, text))
    return found


def _reference(line: _Line) -> tuple[Array, Array]:
    """→ (3, p) rad, turn of the reference line, and (3, p) mm, its displacement; machine frame."""
    p = line.inter.shape[1]
    bend, off = np.zeros((3, p)), np.zeros((3, p))
    j, k = _across(line)
    if line.axis.kind == "linear":
        # a line that climbs by s along k is turned by −s about j; one that climbs along j by +s about k
        bend[k] = line.sense * _straight(line, line.along[j])[0]
        bend[j] = -line.sense * _straight(line, line.along[k])[0]
    else:
        (off[j], off[k]), _ = _turned(line, (line.along[j], line.along[k]))
        (bend[j], bend[k]), _ = _turned(line, (line.along[3 + j], line.along[3 + k]))
    return line.frame.T @ bend, line.frame.T @ off


def _pair(one: Axis, two: Axis, first: Array, second: Array, tell: _Tell) -> list[Figure]:
    a, b = np.array(one.direction), np.array(two.direction)
    cosine, sine = float(a @ b), float(np.linalg.norm(np.cross(a, b)))
    if sine < PARALLEL:
        found = []
        helper = np.eye(3)[int(np.argmin(np.abs(a)))]
        u = np.cross(helper, a) / np.linalg.norm(np.cross(helper, a))
        for plane in (u, np.cross(a, u)):
            # turn about `plane` that takes the first line to the second
            weights = np.cross(a, np.eye(3)) @ plane @ (np.sign(cosine) * second - first)
            if weights.any():
                value, std = tell.one(weights)
                text = f"turn about [{', '.join(f'{c + 0.0:.3g}' for c in plane)}]"
                found.append(Figure("parallelism", f"{two.name} to {one.name}", value * 1e6, std * 1e6, "µm/m", None, text))
        return found
    if abs(cosine) > PARALLEL and "linear" in (one.kind, two.kind):
        return []
    weights = -(b @ first + a @ second) / sine
    if not weights.any():
        return []
    value, std = tell.one(weights)
    kind = "squareness" if abs(cosine) < PARALLEL else "angle"
    text = f"angle minus {np.degrees(np.arccos(cosine)):.4g}°"
    return [Figure(kind, f"{two.name} to {one.name}", value * 1e6, std * 1e6, "µm/m", None, text)]
