"""A program, predicted: where the tip will be against where the program means it, how sure that is, and what makes it so."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from types import ModuleType

import numpy as np

from ..compensate.fit import Known
from ..compensate.space import Poses
from ..iso230.poses import at_poses
from ..records import Array, InputError, Machine
from ..touches import Touches
from .blocks import HEAD, MARK, marked
from .correct import Machinery
from .follow import Motion, Setup, arc_points, axes_beyond, beyond, follow, positions, senses

BATCH = 2000
PARTS = 4  # points of a line that are looked at
KEPT = 5000  # points that are kept for a picture
CHORD = 0.01  # mm, of arcs as they are looked at


@dataclass
class Way:
    """What was found along a program; lengths µm. `position` … `tool` are of at most `KEPT` points, evenly chosen."""

    blocks: int = 0
    points: int = 0
    outside: int = 0  # points beyond the touched range of an axis
    outside_by: dict[str, int] = field(default_factory=dict)  # the same of each axis that is
    largest: float = 0.0
    largest_std: float = 0.0  # of the point with the largest deviation
    largest_line: int = 0
    squares: float = 0.0
    direction: float = 0.0  # µrad, largest
    squares_direction: float = 0.0
    by_name: dict[str, float] = field(default_factory=dict)  # sum of squares of what each coefficient does, µm²
    position: list[Array] = field(default_factory=list)  # (3,) mm, table frame
    deviation: list[Array] = field(default_factory=list)  # (3,) µm
    extrapolated: list[bool] = field(default_factory=list)
    line: list[int] = field(default_factory=list)
    at: list[Array] = field(default_factory=list)  # (k,) mm rad, the axes there
    tool: list[float] = field(default_factory=list)  # mm, its length there
    assumed: set[str] = field(default_factory=set)  # rotary axes that are taken to be at 0, while something is cut
    unknown: dict[str, int] = field(default_factory=dict)  # M functions that may do anything: the line where each stands first
    zeros: dict[float, Machinery] = field(default_factory=dict)


def machinery(setup: Setup, known: Known, length: float) -> Machinery:
    """set-up, what is known, length of a tool → the machine with it."""
    return Machinery(setup.machine, known, length, positions(setup, [{}], [length])[0], senses(setup))


def along(
    lines: Iterable[str],
    language: ModuleType,
    setup: Setup,
    known: Known,
    touched: Mapping[str, tuple[float, float]],
    made_with: str = "",
) -> tuple[Way, dict[str, list[Motion]]]:
    """lines, language, set-up, what is known, touched range by axis (mm, rad) → the way, and motions by their label.

    Motions at feed are looked at; rapids cut nothing. Raises InputError by name for what cannot be followed, and for a program
    that is compensated: where it means the tip to be, its words no longer say. `made_with`: what the mark of one compensated
    with this estimate and zero says.
    """
    way, labels, source = Way(), dict[str, list[Motion]](), iter(lines)
    head = list(islice(source, HEAD))
    if (place := marked(head)) is not None:
        raise _compensated(place, same=bool(made_with) and made_with.upper() in head[place - 1].upper())
    motions = follow((line.rstrip("\r\n") for line in chain(head, source)), language, setup)
    while batch := list(islice(motions, BATCH)):
        way.blocks += len(batch)
        for m in batch:
            way.assumed |= set(m.assumed) if m.block.kind in ("feed", "arc") else set()
            for name in m.block.unknown:
                way.unknown.setdefault(name, m.block.number)
            if m.block.label and m.block.kind in ("feed", "arc", "rapid") and m.known:
                labels.setdefault(m.block.label, []).append(m)
        for length in {m.length for m in batch}:
            own = [m for m in batch if m.length == length and m.block.kind in ("feed", "arc")]
            if own:
                _look(own, way, setup, known, touched, length)
        if len(way.line) > 2 * KEPT:
            way.position, way.deviation = way.position[::2], way.deviation[::2]
            way.extrapolated, way.line = way.extrapolated[::2], way.line[::2]
            way.at, way.tool = way.at[::2], way.tool[::2]
    return way, labels


def _compensated(place: int, *, same: bool) -> InputError:
    by = (
        "It was compensated with this estimate and zero: by the errors that are known, rounding is all that is left"
        if same
        else "It was compensated with another estimate or another zero, and what they took out is not known here"
    )
    return InputError(
        f"line {place}: found the mark of a compensated program ({MARK}); allowed: the program before it was compensated. The "
        "words of this one are moved, so where it means the tip to be cannot be read from it: the correction itself would look "
        f"like an error. {by}. Predict the program that it was made from: that shows what is there without compensation. What is "
        "left after it, 'tango compensate PROGRAM -o FILE' says of the same program"
    )


def points_of(motion: Motion) -> list[dict[str, float]]:
    """motion → programmed coordinates of points on it, its end the last."""
    if motion.block.kind == "arc":
        return arc_points(motion, CHORD)
    start = {**motion.end, **motion.start}
    return [{n: start[n] + i / PARTS * (v - start[n]) for n, v in motion.end.items()} for i in range(1, PARTS + 1)]


def _look(
    own: Sequence[Motion], way: Way, setup: Setup, known: Known, touched: Mapping[str, tuple[float, float]], length: float
) -> None:
    if length not in way.zeros:
        way.zeros[length] = machinery(setup, known, length)
    mach = way.zeros[length]
    places, lines, added = [], [], []
    for m in own:
        points = points_of(m)
        places += points
        lines += [m.block.number] * len(points)
        added += [m.added] * len(points)
    at = positions(setup, places, added)
    deviation = mach.deviation(at) * 1e3
    size = np.linalg.norm(deviation, axis=1)
    outside = beyond(setup.machine, at, touched)
    for axis, there in axes_beyond(setup.machine, at, touched).items():
        if there.any():
            way.outside_by[axis] = way.outside_by.get(axis, 0) + int(there.sum())
    turned = np.linalg.norm(mach.directions(at), axis=1) * 1e6
    way.points += len(at)
    way.outside += int(outside.sum())
    way.squares += float(size @ size)
    way.squares_direction += float(turned @ turned)
    way.direction = max(way.direction, float(turned.max()))
    for name, part in zip((c.name for c in known.coefficients), _each(mach, at), strict=True):
        way.by_name[name] = way.by_name.get(name, 0.0) + part
    if size.max() > way.largest:
        worst = int(size.argmax())
        way.largest, way.largest_line = float(size[worst]), lines[worst]
        way.largest_std = float(scatter(mach, at[worst][None])[0]) * 1e3
    tips = mach.meant(at)
    for i in range(0, len(at), max(1, len(at) // 1000)):
        way.position.append(tips[i])
        way.deviation.append(deviation[i])
        way.extrapolated.append(bool(outside[i]))
        way.line.append(lines[i])
        way.at.append(at[i])
        way.tool.append(length)


def levers(mach: Machinery, at: Array) -> Array:
    """→ (n, 3, p) mm per unit of each coefficient, those at the workpiece's zero taken off."""
    machine = replace(mach.machine, probe=replace(mach.machine.probe, length=mach.length))
    both = np.vstack([at, mach.zero[None]])
    poses = Poses(at_poses(machine, both, mach.directions_of(both)))
    found = mach.known.levers(poses).reshape(len(both), 3, -1)
    return np.asarray(found[:-1] - found[-1])


def _each(mach: Machinery, at: Array) -> list[float]:
    effect = levers(mach, at) * mach.known.values * 1e3
    return [float(v) for v in np.sum(effect**2, axis=(0, 1))]


def scatter(mach: Machinery, at: Array) -> Array:
    """(n, k) → (n,) mm, standard deviation of the deviation in its most uncertain direction."""
    ways = levers(mach, at)
    spread = ways @ mach.known.covariance @ np.swapaxes(ways, 1, 2)
    return np.asarray(np.sqrt(np.clip(np.linalg.eigvalsh(spread)[:, -1], 0.0, None)))


def drawn(mach: Machinery, at: Array, count: int, seed: int = 4) -> Array:
    """(n, k) → (m + 1, n, 3) mm: the expected deviation, then m as uncertain as the estimate is.

    To first order, as features are: how a table is turned about its own axis no touch tells, and a fit has it several mrad off.
    With the second order of such a turn beside lengths of the first, a part was shorter by half its square, 5 to 20 µm/m.
    """
    ways = levers(mach, at)
    every = np.column_stack([mach.known.values, mach.known.values[:, None] + mach.known.draws(count, seed)])
    return np.moveaxis(ways @ every, 2, 0)


def touched_of(touches: Touches) -> dict[str, tuple[float, float]]:
    """touches → range of every axis but the spindle, mm and rad."""
    machine = touches.machine
    return {n: (float(touches.axis(n).min()), float(touches.axis(n).max())) for n in (*machine.linear, *machine.rotary)}


def degrees(machine: Machine, at: Array) -> dict[str, float]:
    """(k,) mm rad → {axis: mm or degrees}."""
    return {a.name: float(v) * (1.0 if a.kind == "linear" else 180 / math.pi) for a, v in zip(machine.axes, at, strict=True)}


def every(groups: Iterable[Sequence[Motion]]) -> Iterator[Motion]:
    """groups → their motions."""
    for group in groups:
        yield from group
