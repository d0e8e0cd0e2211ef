"""Figures of the tool relative to the workpiece, each as it depends on the coefficients: nothing is decided here.

Straightness has three definitions (ISO 230-1:2012, 3.4.9): about the least-squares line, about the line through the end points, and
the minimum zone. Squareness is the angle between two trajectories on the part, less 90°, and the symbol E_C(0X)Y: the turn about
the machine's base vector that takes the perpendicular of X to Y.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..records import COMPONENTS, Array, Machine
from ..terms import Coefficient
from ..texts import say
from ._line import AxisLine, across, line_of, motions
from .trajectory import Reference, Trajectory, relative, trajectory

PERPENDICULAR = 1e-6
LEVELS = 5  # poses along each linear axis
ROTARY = 2  # of the points of a rotary axis every second one: both ends of what was touched are among them


@dataclass(frozen=True)
class Ask:
    """One figure: a range of `curve` (m, p), the longest of vectors (m, 3, p), or a number with weights (p,).

    `factor` takes mm or rad to `unit`.
    """

    kind: str
    name: str
    unit: str
    factor: float
    curve: Array
    own: str  # the error motion whose name it bears
    range: tuple[float, float] | None = None
    note: str = ""
    zone: bool = False  # the minimum zone of the curve over its axis
    command: Array | None = None
    length: float | None = None  # mm, of the tool: it sums the errors of all linear axes over a volume

    @property
    def is_range(self) -> bool:
        """→ whether it is largest minus smallest, or the longest: never less than 0."""
        return self.curve.ndim > 1

    @property
    def turned(self) -> bool:
        """→ whether it is how far a rotary axis turns beside its command."""
        return self.kind == "positioning" and self.own[2:] in ("A", "B", "C")


def asked(
    machine: Machine, coefficients: Sequence[Coefficient], over: Mapping[str, tuple[float, float]], at: Reference
) -> list[Ask]:
    """machine, coefficients, ranges (mm, rad), reference → every figure."""
    lines = {n: trajectory(machine, machine.axis(n), coefficients, *over[n], at) for n in machine.linear if n in over}
    found = [ask for line in lines.values() for ask in _of_axis(line)]
    names = list(lines)
    for i, two in enumerate(names):
        found += [ask for one in names[:i] for ask in _square(lines[one], lines[two])]
    for name in machine.rotary:
        if name in over:
            line = line_of(machine, machine.axis(name), coefficients, *over[name])
            degrees = (float(np.degrees(over[name][0])), float(np.degrees(over[name][1])))
            moves = motions(line)
            found += [Ask(m.kind, m.name, m.unit, m.factor, m.curve[::ROTARY], m.name, degrees, m.note) for m in moves]
            found += _total(name, line, degrees)
    if len(names) == 3:
        found += _volumetric(machine, coefficients, over, at)
    return found


def _total(name: str, line: AxisLine, over: tuple[float, float]) -> list[Ask]:
    """Radial and tilt error motion in the rotating sensitive direction: what a tool or feature that turns with the axis sees.

    An indicator that turns with the axis reads one component of the body. Its polar plot loses the least-squares circle, which is
    1, cos and sin of the angle (ISO 230-7:2015), over the angles that there are. The axis average line is found from both fixed
    directions together: only over whole turns is the rest of both the same. What tilts along a direction turns about the other one.
    """
    j, k = across(line)
    angle = line.sense * line.command
    circle = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    part = np.ones((len(angle), 1))  # of the record: half a step at either end, so that the circle is that of the curve
    part[[0, -1]] = np.sqrt(0.5)
    found = []
    for kind, i, unit, factor in (("radial", j, "µm", 1e3), ("tilt", 3 + k, "µrad", 1e6)):
        body = line.along[i]
        if not body.any():
            continue
        curve = (body - circle @ np.linalg.lstsq(part * circle, part * body, rcond=None)[0])[::ROTARY]
        note = say("iso_said.onpart.rotating" if kind == "radial" else "iso_said.onpart.tilting", axis="XYZ"[j], about="XYZ"[k])
        own = f"E{COMPONENTS[i]}{name}"
        found.append(Ask(kind, say("iso_said.onpart.turning", axis=name), unit, factor, curve, own, over, note))
    return found


def _volumetric(
    machine: Machine, coefficients: Sequence[Coefficient], over: Mapping[str, tuple[float, float]], at: Reference
) -> list[Ask]:
    """Ranges of position and orientation over the touched ranges of X Y Z, the workpiece aligned by least squares."""
    grid = np.array(list(product(*(np.linspace(*over[n], LEVELS) for n in machine.linear))))
    position = np.tile([at.pose.get(name, 0.0) for name in machine.names], (len(grid), 1))
    position[:, [machine.column(n) for n in machine.linear]] = grid
    seen = relative(machine, coefficients, position, at.length)
    arm = seen.nominal - seen.nominal.mean(axis=0)
    lever = np.zeros((len(grid), 3, 6))
    lever[:, :, :3] = np.eye(3)
    for i in range(3):
        lever[:, :, 3 + i] = np.cross(np.eye(3)[i], arm)
    flat, moved = lever.reshape(-1, 6), seen.shift.reshape(len(grid) * 3, -1)
    rest = (moved - flat @ np.linalg.lstsq(flat, moved, rcond=None)[0]).reshape(seen.shift.shape)
    over_what = say("iso_said.onpart.poses", count=LEVELS)
    aligned = say("iso_said.onpart.aligned", count=LEVELS)
    longest = say("iso_said.onpart.longest", count=LEVELS)
    curves = [(c, "µm", 1e3, rest[:, i], aligned) for i, c in enumerate("XYZ")]
    curves += [(c, "µrad", 1e6, seen.turn[:, i], over_what) for i, c in enumerate("ABC")]
    curves.append(("", "µm", 1e3, rest, longest))
    return [
        Ask("volumetric", f"V{c}", unit, factor, at_all, "", None, note, length=at.length)
        for c, unit, factor, at_all, note in curves
    ]


def _slope(command: Array, curve: Array) -> tuple[Array, Array]:
    matrix = np.column_stack([np.ones_like(command), command - command.mean()])
    fit = np.linalg.lstsq(matrix, curve, rcond=None)[0]
    return fit[1], curve - matrix @ fit


def _of_axis(t: Trajectory) -> list[Ask]:
    name, over = t.axis.name, (float(t.command[0]), float(t.command[-1]))
    own = int(np.argmax(np.abs(t.way)))
    ahead = np.einsum("i,mip->mp", t.way, t.shift)
    slope, rest = _slope(t.command, ahead)
    motion = f"E{name}{name}"
    found = [
        Ask(
            "positioning",
            f"{motion} M",
            "µm",
            1e3,
            ahead,
            motion,
            over,
            say("iso_said.line.mean_bidirectional_range"),
            command=t.command,
        ),
        Ask("positioning gain", motion, "µm/m", 1e6, slope, motion, over, say("iso_said.onpart.farther")),
        Ask("linearity", motion, "µm", 1e3, rest, motion, over, say("iso_said.onpart.own_line")),
    ]
    back = t.way @ t.reversal
    if back.any():
        found.append(
            Ask("reversal", f"{motion} B", "µm", 1e3, 2 * back, f"{motion}b", over, say("iso_said.motions.negative_lost_motion"))
        )
    for i in range(3):
        if i == own:
            continue
        motion = f"E{COMPONENTS[i]}{name}"
        curve = t.shift[:, i, :]
        part = np.linspace(0, 1, len(curve))[:, None]
        ends = curve - (1 - part) * curve[0] - part * curve[-1]
        about = _slope(t.command, curve)[1]
        found.append(Ask("straightness", motion, "µm", 1e3, about, motion, over, say("iso_said.line.about_least_squares_line")))
        found.append(Ask("straightness", f"{motion} ends", "µm", 1e3, ends, motion, over, say("iso_said.onpart.ends")))
        found.append(
            Ask(
                "straightness",
                f"{motion} zone",
                "µm",
                1e3,
                about,
                motion,
                over,
                say("iso_said.onpart.zone"),
                zone=True,
                command=t.command,
            )
        )
    for i in range(3):
        motion, note = (
            f"E{COMPONENTS[3 + i]}{name}",
            say("iso_said.line.roll") if i == own else say("iso_said.line.tilt_about", value="XYZ"[i]),
        )
        found.append(Ask("angular", motion, "µrad", 1e6, t.turn[:, i, :], motion, over, note))
    return found


def _square(one: Trajectory, two: Trajectory) -> list[Ask]:
    if abs(one.way @ two.way) > PERPENDICULAR:
        return []
    first, second = (np.array([_slope(t.command, t.shift[:, i, :])[0] for i in range(3)]) for t in (one, two))
    angle = -(two.way @ first + one.way @ second)
    a, b = one.axis.name, two.axis.name
    about = ({0, 1, 2} - {int(np.argmax(np.abs(one.way))), int(np.argmax(np.abs(two.way)))}).pop()
    # both lines as seen along their base vectors, whatever the sense of the command
    base = [np.eye(3)[int(np.argmax(np.abs(t.way)))] for t in (one, two)]
    turned = [np.cross(b, w * (t.way @ b), axisb=0, axisc=0) for b, w, t in zip(base, (first, second), (one, two), strict=True)]
    turn = (turned[1] - turned[0])[about]
    symbol = f"E{'ABC'[about]}(0{a}){b}"
    text = say("iso_said.onpart.on_part")
    return [
        Ask("squareness", f"{b} to {a}", "µm/m", 1e6, angle, symbol, None, text),
        Ask(
            "squareness",
            symbol,
            "µm/m",
            1e6,
            turn,
            symbol,
            None,
            say("iso_said.onpart.turn", about="ABC"[about], one=a, two=b),
        ),
    ]


def minimum_zone(command: Array, curve: Array) -> float:
    """positions (m,), curve (m,) → the least distance, along the curve's unit, of two parallel lines that hold it."""
    from scipy.spatial import ConvexHull, QhullError  # a tenth of a second to load, and few results ask for a zone

    if np.ptp(curve) < 1e-15:
        return 0.0
    x, y = (command - command.mean()) / np.ptp(command), curve / np.ptp(curve)
    try:
        hull = ConvexHull(np.column_stack([x, y])).vertices
    except QhullError:
        return 0.0
    best = np.inf
    for i, j in zip(hull, np.roll(hull, -1), strict=True):
        if abs(x[j] - x[i]) > 1e-9:
            best = min(best, float(np.ptp(y - (y[j] - y[i]) / (x[j] - x[i]) * x)))
    return best * float(np.ptp(curve))
