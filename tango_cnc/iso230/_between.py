"""Figures between axes: squareness, parallelism, angle and offset of their reference lines."""

from __future__ import annotations

import numpy as np

from ..records import Array, Axis, Machine
from ..texts import joined, say
from ._figure import Figure, Tell
from ._line import AxisLine, reference

PARALLEL = 1e-6


def between(machine: Machine, lines: dict[str, AxisLine], tell: Tell) -> list[Figure]:
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
            bend, off = reference(line)
            directions[name] = np.cross(turn + bend, np.array(line.axis.direction), axisa=0, axisc=0)
            places[name] = shift + off
            turn = turn + line.frame.T @ line.at_rest[3:]
            shift = shift + line.frame.T @ line.at_rest[:3]
    found = []
    names = [name for name in (*machine.linear, *machine.rotary) if name in directions]
    for i, one in enumerate(names):
        for two in names[:i]:
            carried = [name in machine.workpiece_branch for name in (one, two)]
            sense = -1.0 if carried[0] != carried[1] and {one, two} <= set(machine.linear) else 1.0
            found += _pair(machine.axis(two), machine.axis(one), directions[two], directions[one], tell, sense)
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
                    text = say("iso_said.between.along", names=", ".join(f"{a + 0.0:.3g}" for a in across))
                    found.append(
                        Figure("offset", say("iso_said.between.to", two=two, one=one), value * 1e3, std * 1e3, "µm", None, text)
                    )
    return found


def _pair(one: Axis, two: Axis, first: Array, second: Array, tell: Tell, sense: float) -> list[Figure]:
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
                text = say("iso_said.between.turn_about", names=", ".join(f"{c + 0.0:.3g}" for c in plane))
                found.append(
                    Figure(
                        "parallelism",
                        say("iso_said.between.to", two=two.name, one=one.name),
                        value * 1e6,
                        std * 1e6,
                        "µm/m",
                        None,
                        text,
                    )
                )
        return found
    if abs(cosine) > PARALLEL and "linear" in (one.kind, two.kind):
        return []
    # where one of two linear axes carries the workpiece, the tool goes on the part against that axis' own direction
    weights = -sense * (b @ first + a @ second) / sine
    if not weights.any():
        return []
    value, std = tell.one(weights)
    kind = "squareness" if abs(cosine) < PARALLEL else "angle"
    text = say("iso_said.between.angle_minus", degrees=f"{np.degrees(np.arccos(cosine)):.4g}")
    text = joined(
        "",
        (
            text,
            say("iso_said.between.on_part" if one.kind == two.kind == "linear" else "iso_said.between.between_axes_own_directions"),
        ),
    )
    return [Figure(kind, say("iso_said.between.to", two=two.name, one=one.name), value * 1e6, std * 1e6, "µm/m", None, text)]
