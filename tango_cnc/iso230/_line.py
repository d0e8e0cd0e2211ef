"""One axis moved alone: its error motions as matrices over the coefficients, and its reference line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..kinematics import axis_frame
from ..records import COMPONENTS, Array, Axis, Machine
from ..terms import Coefficient
from ..texts import say
from .poses import all_steady, at_poses

POINTS = 201


@dataclass(frozen=True)
class AxisLine:
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


def line_of(machine: Machine, axis: Axis, coefficients: Sequence[Coefficient], low: float, high: float) -> AxisLine:
    """machine, axis, coefficients, range (mm or rad) → that axis moved alone through it."""
    command = np.linspace(low, high, POINTS)
    rest = (low + high) / 2 if axis.kind == "linear" and not low <= 0 <= high else 0.0
    position = np.zeros((POINTS + 1, len(machine.names)))
    position[:, machine.column(axis.name)] = [*command, rest]
    still = at_poses(machine, position, np.zeros_like(position))
    forward = at_poses(machine, position, np.ones_like(position))
    p = len(coefficients)
    along = tuple(np.zeros((POINTS, p)) for _ in range(6))
    at_rest, inter, reversal = np.zeros((6, p)), np.zeros((6, p)), np.zeros(p)
    frame, base, sense = axis_frame(axis.name, axis.direction)
    own = base + (0 if axis.kind == "linear" else 3)
    mine = [j for j, c in enumerate(coefficients) if c.slot.axis == axis.name]
    for i, value in zip(*all_steady([coefficients[j] for j in mine], still), strict=True):
        j, c = mine[i], coefficients[mine[i]]
        if c.slot.stage == "inter":
            inter[c.slot.component, j] = value[-1]
            continue
        component = own if c.slot.stage == "motion" else c.slot.component
        along[component][:, j] = value[:-1]
        at_rest[component, j] = value[-1]
        if c.slot.stage == "motion":
            reversal[j] = (c.regressor(forward) - value)[0]
    return AxisLine(axis, np.eye(3) if frame is None else frame, base, sense, command, along, at_rest, inter, reversal)


def range_of(line: AxisLine) -> tuple[float, float]:
    """axis → its range in mm or degrees."""
    scale = 1.0 if line.axis.kind == "linear" else 180 / np.pi
    return float(line.command[0] * scale), float(line.command[-1] * scale)


def straight(line: AxisLine, curve: Array) -> tuple[Array, Array]:
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


def motions(line: AxisLine) -> list[Motion]:
    """→ the error motions of an axis, positioning first."""
    name, found = line.axis.name, []
    linear = line.axis.kind == "linear"
    own = line.base + (0 if linear else 3)
    if line.along[own].any():
        unit, factor = ("µm", 1e3) if linear else ("µrad", 1e6)
        found.append(
            Motion("positioning", f"E{name}{name}", say("iso_said.line.mean_bidirectional_range"), factor, unit, line.along[own])
        )
    if linear:
        for i in range(3):
            if i != line.base and line.along[i].any():
                curve = straight(line, line.along[i])[1]
                found.append(
                    Motion(
                        "straightness", f"E{COMPONENTS[i]}{name}", say("iso_said.line.about_least_squares_line"), 1e3, "µm", curve
                    )
                )
        for i in range(3):
            if line.along[3 + i].any():
                note = say("iso_said.line.roll") if i == line.base else say("iso_said.line.tilt_about", value="XYZ"[i])
                found.append(Motion("angular", f"E{COMPONENTS[3 + i]}{name}", note, 1e6, "µrad", line.along[3 + i]))
        return found
    j, k = across(line)
    if line.along[line.base].any():
        found.append(
            Motion("axial", f"E{COMPONENTS[line.base]}{name}", say("iso_said.line.along_axis"), 1e3, "µm", line.along[line.base])
        )
    for first, kind, factor, unit in ((0, "radial", 1e3, "µm"), (3, "tilt", 1e6, "µrad")):
        if line.along[first + j].any() or line.along[first + k].any():
            _, rest = turned(line, (line.along[first + j], line.along[first + k]))
            for i, curve in zip((j, k), rest, strict=True):
                found.append(
                    Motion(
                        kind, f"E{COMPONENTS[first + i]}{name}", say("iso_said.line.about_axis_average_line"), factor, unit, curve
                    )
                )
    return found


def turned(line: AxisLine, curves: tuple[Array, Array]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """two components across a rotary axis, body frame → (offset of the mean axis, error motion) along both fixed directions.

    In the fixed frame d(θ) = R(θ) · components = a + R(θ) b + rest: a places the axis average line, b is how the table sits
    on the axis (eccentricity, taken up by the facet offsets), the rest is the error motion (ISO 230-7).
    """
    angle = line.sense * line.command
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    fixed = np.vstack([cosine * curves[0] - sine * curves[1], sine * curves[0] + cosine * curves[1]])
    one, nil = np.ones_like(cosine), np.zeros_like(cosine)
    matrix = np.vstack([np.hstack([one, nil, cosine, -sine]), np.hstack([nil, one, sine, cosine])])
    fit = np.linalg.lstsq(matrix, fixed, rcond=None)[0]
    rest = fixed - matrix @ fit
    return (fit[0], fit[1]), (rest[:POINTS], rest[POINTS:])


def across(line: AxisLine) -> tuple[int, int]:
    """axis → the two base vectors across it."""
    return (line.base + 1) % 3, (line.base + 2) % 3


def reference(line: AxisLine) -> tuple[Array, Array]:
    """→ (3, p) rad, turn of the reference line, and (3, p) mm, its displacement; machine frame."""
    p = line.inter.shape[1]
    bend, off = np.zeros((3, p)), np.zeros((3, p))
    j, k = across(line)
    if line.axis.kind == "linear":
        # a line that climbs by s along k is turned by −s about j; one that climbs along j by +s about k
        bend[k] = line.sense * straight(line, line.along[j])[0]
        bend[j] = -line.sense * straight(line, line.along[k])[0]
    else:
        (off[j], off[k]), _ = turned(line, (line.along[j], line.along[k]))
        (bend[j], bend[k]), _ = turned(line, (line.along[3 + j], line.along[3 + k]))
    return line.frame.T @ bend, line.frame.T @ off
