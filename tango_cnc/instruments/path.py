"""Name of a test → what the machine is commanded to do, and in which directions an instrument looks.

| name | what moves | what is seen |
|---|---|---|
| `laser-X` … | one linear axis (ISO 230-2) | how far the tool goes |
| `circle-XY` … | two linear axes along a circle (ISO 230-4) | the radius, by ball bar |
| `rotary-C` … | a rotary axis; the linear axes keep the tip at one point of the table (ISO 10791-6) | three directions |

`K1` is the rotary axis nearest to the workpiece, `K2` the other one. `AK1` is the same on a machine with both rotary axes at the
tool, `BK1` with both at the workpiece, `CK1` with one at each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .. import kinematics
from ..iso230.trajectory import Reference, reference
from ..nearest import suggestion
from ..records import Array, InputError, Machine

INSTRUMENTS = ("ballbar", "rtest")
RADII = (150.0, 100.0, 75.0, 50.0, 25.0)  # mm: the largest whose path was touched is the default
SMALLEST = 1.0  # mm from the axis: nearer, radial and tangential have no direction
STEP = 1e-4  # mm or rad of the command, to tell which way an axis goes
TURNS = 72
TARGETS = 21


@dataclass(frozen=True)
class Wanted:
    """What a person chooses; None: what fits the touched ranges."""

    name: str
    instrument: str = "ballbar"
    radius: float | None = None  # mm
    length: float | None = None  # mm, of the tool or of the spindle to the ball
    at: Mapping[str, float] | None = None  # mm and rad, where axes stand or the centre lies


@dataclass(frozen=True)
class Path:
    """A test of q channels at n commands, table frame."""

    name: str
    text: str
    machine: Machine  # with the tool of the test
    reference: Reference
    command: Array  # (n,) mm or rad
    sense: Array  # (n,) 1 −1
    position: Array  # (n, k) mm rad
    direction: Array  # (n, k) −1 0 1
    channels: tuple[str, ...]
    ways: Array  # (q, n, 3) unit vectors: a reading is positive when the tool is off along its way
    joint: bool  # whether one place of the ball serves all channels
    outside: int  # commands where an axis is beyond what was touched
    radius: float | None = None  # mm, of the circle, or of the ball from an axis at the table

    @property
    def turns(self) -> bool:
        """→ whether its command is an angle."""
        return not self.name.startswith("laser")


def names_of(machine: Machine) -> list[str]:
    """machine → the tests that it can make."""
    found = [f"laser-{a}" for a in machine.linear]
    found += [f"circle-{a}{b}" for i, a in enumerate(machine.linear) for b in machine.linear[i + 1 :]]
    found += [f"rotary-{a}" for a in machine.rotary]
    return [*found, *_numbered(machine)]


def _numbered(machine: Machine) -> dict[str, str]:
    """→ {name after ISO 10791-6: rotary axis}, the axis nearest to the workpiece first."""
    order = [a for a in machine.workpiece_branch[::-1] if a in machine.rotary]
    order += [a for a in machine.tool_branch if a in machine.rotary]
    work = sum(a in machine.workpiece_branch for a in order)
    kind = "B" if work == len(order) else "A" if work == 0 else "C"
    found = {}
    for i, axis in enumerate(order):
        found[f"K{i + 1}"] = found[f"{kind}K{i + 1}"] = axis
    return found


def path_of(
    machine: Machine,
    over: Mapping[str, tuple[float, float]],
    wanted: Wanted,
    command: Array | None = None,
    sense: Array | None = None,
) -> Path:
    """machine, touched ranges (mm, rad), choice, commands (n,) and their senses (default: even steps there and back) → path.

    Raises InputError for a name, instrument, radius or place that cannot be.
    """
    allowed = names_of(machine)
    by_lower = {name.lower(): name for name in allowed}
    name = by_lower.get(wanted.name.strip().lower())
    if name is None:
        raise InputError(
            f"--test: found {wanted.name!r}; allowed on this machine: {', '.join(allowed)}.{suggestion(wanted.name, allowed)}"
        )
    if wanted.instrument not in INSTRUMENTS:
        raise InputError(f"--by: found {wanted.instrument!r}; allowed: {', '.join(INSTRUMENTS)}")
    at = reference(machine, over, wanted.length)
    at = replace(at, pose={**at.pose, **(wanted.at or {})})
    tool = replace(machine, probe=replace(machine.probe, length=at.length))
    at = replace(at, point=_place(tool, at.pose))
    axis = _numbered(machine).get(name)
    kind, _, letters = (f"rotary-{axis}" if axis else name).partition("-")
    own = letters if kind != "circle" else None
    if own is not None and own not in over:
        raise InputError(f"--test {name}: found no touches along {own}; allowed: axes that moved while the table was touched")
    if command is None or sense is None:
        command, sense = commanded(kind, over.get(letters, (0.0, 2 * np.pi)))
    if kind == "laser":
        return _laser(tool, over, at, name, letters, command, sense)
    sizes = RADII if wanted.radius is None else (wanted.radius,)
    for size in sizes:
        make = _circle if kind == "circle" else _rotary
        path = make(tool, over, at, name, letters, command, sense, size, wanted.instrument)
        if path.outside == 0:
            break
    return path


def commanded(kind: str, over: tuple[float, float]) -> tuple[Array, Array]:
    """kind of test, range (mm, rad) → commands (n,) and senses (n,), there and back."""
    low, high = over
    if kind == "laser":
        there = np.linspace(low, high, TARGETS)
    elif kind == "circle" or high - low >= 2 * np.pi * (1 - 1 / TURNS):
        there = low + np.arange(TURNS) * 2 * np.pi / TURNS
    else:
        there = np.linspace(low, high, max(2, round((high - low) / (2 * np.pi) * TURNS) + 1))
    return np.concatenate([there, there[::-1]]), np.repeat([1.0, -1.0], len(there))


def _place(tool: Machine, pose: Mapping[str, float]) -> tuple[float, float, float]:
    position = np.array([[pose.get(n, 0.0) for n in tool.names]])
    x, y, z = kinematics.tip(kinematics.chain(tool), position)[0]
    return float(x), float(y), float(z)


def _at(tool: Machine, at: Reference, n: int) -> Array:
    return np.tile([at.pose.get(name, 0.0) for name in tool.names], (n, 1))


def _followed(tool: Machine, position: Array, point: Array) -> Array:
    """(n, k), (n, 3) mm table frame → the same with linear axes that bring the nominal tip to the point."""
    chain, found = kinematics.chain(tool), position.copy()
    columns = [tool.column(a) for a in tool.linear]
    tip = kinematics.tip(chain, found)
    ways = []
    for j in columns:
        moved = found.copy()
        moved[:, j] += 1.0
        ways.append(kinematics.tip(chain, moved) - tip)
    found[:, columns] += np.linalg.solve(np.stack(ways, axis=2), (point - tip)[:, :, None])[:, :, 0]
    return found


def _outside(tool: Machine, over: Mapping[str, tuple[float, float]], position: Array) -> int:
    beyond = np.zeros(len(position), dtype=bool)
    for name in (*tool.linear, *tool.rotary):
        value, (low, high) = position[:, tool.column(name)], over.get(name, (0.0, 0.0))
        beyond |= (value < low - 1e-6) | (value > high + 1e-6)
    return int(beyond.sum())


def _going(ahead: Array, behind: Array, sense: Array) -> Array:
    """positions a step ahead and behind (n, k), senses (n,) → (n, k) direction of every axis."""
    change = ahead - behind
    change[np.abs(change) < 1e-6 * STEP] = 0.0
    return np.asarray(np.sign(change) * sense[:, None])


def _laser(
    tool: Machine, over: Mapping[str, tuple[float, float]], at: Reference, name: str, axis: str, command: Array, sense: Array
) -> Path:
    position = _at(tool, at, len(command))
    position[:, tool.column(axis)] = command
    direction = np.zeros_like(position)
    direction[:, tool.column(axis)] = sense
    ends = _at(tool, at, 2)
    ends[1, tool.column(axis)] += 1.0
    one, two = kinematics.tip(kinematics.chain(tool), ends)
    ways = np.tile(two - one, (1, len(command), 1))
    text = f"{axis} alone, from both sides, {len(np.unique(command))} positions"
    outside = _outside(tool, over, position)
    return Path(name, text, tool, at, command, sense, position, direction, ("deviation",), ways, True, outside)


def _circle(
    tool: Machine,
    over: Mapping[str, tuple[float, float]],
    at: Reference,
    name: str,
    plane: str,
    command: Array,
    sense: Array,
    radius: float,
    _: str,
) -> Path:
    columns = [tool.column(a) for a in plane]

    def go(angle: Array) -> Array:
        position = _at(tool, at, len(angle))
        position[:, columns] += radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return position

    position = go(command)
    tip = kinematics.tip(kinematics.chain(tool), position)
    spoke = tip - np.array(at.point)
    ways = (spoke / np.linalg.norm(spoke, axis=1)[:, None])[None]
    direction = _going(go(command + STEP), go(command - STEP), sense)
    text = f"circle of radius {radius:g} mm in {plane}, both ways round, 0° where {plane[0]} is furthest"
    outside = _outside(tool, over, position)
    return Path(name, text, tool, at, command, sense, position, direction, ("radial",), ways, True, outside, radius)


def _farther(tool: Machine, axis: str) -> str:
    """machine, rotary axis → what brings the ball away from that axis."""
    if axis in tool.workpiece_branch:
        return "give --radius"
    beyond = [a for a in tool.tool_branch[tool.tool_branch.index(axis) + 1 :] if a in tool.rotary]
    return f"tilt {beyond[0]}, e.g. --at {beyond[0]}=45" if beyond else "give another --tool-length"


def _rotary(
    tool: Machine,
    over: Mapping[str, tuple[float, float]],
    at: Reference,
    name: str,
    axis: str,
    command: Array,
    sense: Array,
    radius: float,
    instrument: str,
) -> Path:
    chain, column, n = kinematics.chain(tool), tool.column(axis), len(command)

    def spun(position: Array, angle: float) -> Array:
        moved = position.copy()
        moved[:, column] += angle
        return kinematics.tip(chain, moved)

    # the ball stands where the tip is at the reference; at the table it is moved off the axis until it is `radius` away
    start, point = _at(tool, at, 1), np.array([at.point])
    if axis in tool.workpiece_branch:
        for off in ([0.0, 0.0, 0.0], [radius, 0.0, 0.0], [0.0, radius, 0.0]):
            beside = _followed(tool, start, point + off)
            spoke = (spun(beside, 0.0) - spun(beside, np.pi)) / 2
            if np.linalg.norm(spoke) >= SMALLEST:
                break
        point = spun(beside, 0.0) - spoke + spoke / np.linalg.norm(spoke) * radius
    point = point[0]

    def go(angle: Array) -> Array:
        position = _at(tool, at, len(angle))
        position[:, column] = angle
        return _followed(tool, position, point)

    position = go(command)
    radial = (spun(position, 0.0) - spun(position, np.pi)) / 2
    size = np.linalg.norm(radial, axis=1)
    if size.min() < SMALLEST:
        raise InputError(
            f"--test {name}: found the ball {size.min():.2f} mm from {axis}; allowed: {SMALLEST:g} mm or more; "
            f"{_farther(tool, axis)}"
        )
    tangential = spun(position, np.pi / 2) - spun(position, -np.pi / 2)
    radial, tangential = radial / size[:, None], tangential / np.linalg.norm(tangential, axis=1)[:, None]
    ways = np.stack([radial, tangential, np.cross(radial, tangential)])
    channels, joint = ("radial", "tangential", "axial"), instrument == "rtest"
    if joint:
        channels, ways = ("x", "y", "z"), np.stack([np.tile(e, (n, 1)) for e in np.eye(3)])
    direction = _going(go(command + STEP), go(command - STEP), sense)
    x, y, z = point + 0.0
    text = (
        f"{axis} turns, both ways, and the linear axes keep the tip at [{x:.4g}, {y:.4g}, {z:.4g}] of the table frame, "
        f"{size.mean():.4g} mm from {axis}"
    )
    if not joint:
        near = int(np.argmin(np.abs(command)))
        ahead, up = (", ".join(f"{a + 0.0:.2f}" for a in np.round(way[near], 2)) for way in ways[1:])
        where = f"at {np.degrees(command[near]) + 0.0:.3g}°"
        text += f"; {where} tangential is positive along [{ahead}] of the table frame, axial along [{up}]"
    outside = _outside(tool, over, position)
    return Path(name, text, tool, at, command, sense, position, direction, channels, ways, joint, outside, radius)
