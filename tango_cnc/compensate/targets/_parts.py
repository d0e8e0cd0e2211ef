"""What several targets hold: tables of one axis, centres and directions of axes, reversal values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...kinematics import Slot, axis_frame
from ...records import COMPONENTS, Array, Machine
from ..frame import component as own_component
from ..frame import of_control
from ..space import (
    EDGE,
    TURN,
    Held,
    Limits,
    Table,
    believed,
    by_slot,
    in_turn,
    knots,
    knots_of_turn,
    tabulated,
    turns_whole,
)
from . import Fact, Request

DEGREES = 180 / math.pi
HALVES = Fact(
    "half of a reversal value acts on either side; a control that adds all of it on one side moves the axis by half of it against "
    "the rotary axes",
    "memory",
    confirmed=False,
)


@dataclass(frozen=True)
class Turning:
    """How a control counts a rotary axis that turns once round or more, and what its tables may be."""

    endless: tuple[float, float]  # rad, rows of the file of an axis without travel: the control counts no further
    most: int | None = None  # rows that a table may have

    def ends(self, machine: Machine, axis: str) -> tuple[float, float]:
        """machine, rotary axis → (2,) rad that the rows of its file cover."""
        return machine.axis(axis).travel or self.endless

    def knots(self, request: Request, axis: str, points: int) -> tuple[Array, int]:
        """job, rotary axis, number → (n,) rad, points of a table over the volume, and how many a whole turn has.

        Fewer than asked for where each of them comes more often over the travel than the file may have rows.
        """
        low, high = self.ends(request.machine, axis)
        most = None if self.most is None else max(2, math.floor((self.most - 2) * TURN / (high - low)))
        return knots_of_turn(request.limits, axis, points, most)


MODULO = Turning((0.0, TURN))  # counts 0 to 360 degrees, and both ends are the same
BOTH_WAYS = (-TURN, TURN)  # right for a control that counts 0 to 360 degrees and for one that counts on, up to a turn either way
COUNTS_ON = "The tables of {axes} go from -360 to 360 degrees: turn no further. Beyond that their ends hold."


def scale_of(machine: Machine, axis: str) -> float:
    """axis → what mm or rad are multiplied by for the control: 1 or 180/π."""
    return 1.0 if axis in machine.linear else DEGREES


def trims(
    request: Request,
    name: str,
    out: str,
    by: str,
    points: int,
    *,
    senses: tuple[int, ...] = (0,),
    sign: int = 1,
    increment: float = 1e-6,
    turning: Turning | None = None,
) -> list[Held]:
    """job, table name, corrected axis, axis that it is read with, points → entries in mm or degrees.

    `turning`: of an axis that can turn once round the table comes again with each turn; its file has the rows of `in_file`.
    """
    machine = request.machine
    unit = "mm" if out in machine.linear else "deg"
    at, turn = knots(request.limits, by, points), 0
    if turning and turns_whole(machine, by):
        at, turn = turning.knots(request, by, points)
    table = Table(name, Slot(out, "motion"), by, at, senses, unit, scale_of(machine, out), sign, increment, turn=turn)
    return tabulated(table, machine)


def in_file(request: Request, axis: str, entries: Sequence[Held], points: int, turning: Turning) -> list[tuple[float, Held]]:
    """job, axis, entries of a table of it in one sense, points → rows of its file: mm or degrees, and the entry that holds there.

    Of an axis that can turn once round they cover its travel, or as far as the control counts.
    """
    if not turns_whole(request.machine, axis):
        scale = scale_of(request.machine, axis)
        return [(h.at * scale, h) for h in entries if h.at is not None]
    _, turn = turning.knots(request, axis, points)
    first, step = entries[0].at, TURN / turn
    assert first is not None
    begin = round(first / step)
    low, high = turning.ends(request.machine, axis)
    places = range(math.floor(low / step + EDGE), math.ceil(high / step - EDGE) + 1)
    return [(360.0 / turn * k, entries[in_turn(len(entries), turn, k - begin)]) for k in places]


def counting_on(machine: Machine) -> list[str]:
    """machine → a step for a person where rotary axes have no travel and tables of `BOTH_WAYS`; [] where they all have."""
    axes = [a for a in machine.rotary if machine.axis(a).travel is None]
    return [COUNTS_ON.format(axes=" and ".join(axes))] if axes else []


def reversal(request: Request, place: str, axis: str, *, half: bool = False, sign: int = 1, increment: float = 1e-6) -> Held:
    """job, place, axis → the reversal value (or half of it) that a control adds: positive where the axis stops short.

    `EXXb` is what the axis goes too far in the direction of its motion, so the control's number is its negative.
    """
    machine = request.machine
    factor = scale_of(machine, axis) * (1.0 if half else 2.0)
    return Held(
        place,
        "reversal values",
        "mm" if axis in machine.linear else "deg",
        "length" if axis in machine.linear else "angle",
        increment,
        by_slot(Slot(axis, "motion"), lambda t: t.sign(axis)),
        factor,
        -sign,
        turns=axis in machine.rotary,
    )


def centre(
    machine: Machine,
    axis: str,
    component: int,
    place: str,
    table: str,
    *,
    sign: int = 1,
    increment: float = 1e-3,
    base: float = 0.0,
) -> Held:
    """machine of the control, axis, x y z, place → where the control believes the line of the axis to be at the zero pose, mm.

    Raises InputError where its linear axes are not at right angles.
    """
    of_control(machine)
    lever = believed(axis, "point", np.eye(3)[component])
    return Held(place, table, "mm", "length", increment, lever, 1.0, sign, base, tcp=True, along=component)


def tilt(
    machine: Machine,
    axis: str,
    component: int,
    place: str,
    table: str,
    *,
    sign: int = 1,
    increment: float = 1e-9,
    base: float = 0.0,
) -> Held:
    """machine of the control, axis, x y z, place → a component of the direction that the control believes the axis to have.

    Raises InputError where its linear axes are not at right angles.
    """
    of_control(machine)
    return Held(place, table, "1", "angle", increment, believed(axis, "direction", np.eye(3)[component]), 1.0, sign, base, tcp=True)


def across(machine: Machine, axis: str) -> tuple[int, ...]:
    """axis → the components in which its line can be moved: all but the one along it, where it is parallel to one."""
    along = np.abs(np.array(machine.axis(axis).direction))
    return tuple(i for i in range(3) if along[i] < 1 - 1e-9)


def point_of(machine: Machine, axis: str) -> Array:
    """axis → (3,) mm, its point as machine.yaml has it."""
    return np.array(machine.axis(axis).point)


def component_errors(request: Request, points: int, increment: tuple[float, float]) -> list[Held]:
    """job, points of a table, increments of mm and rad → all component errors EXX … ECC, tables of the own axis."""
    machine = request.machine
    held: list[Held] = []
    for axis in (*machine.linear, *machine.rotary):
        for i, letter in enumerate(COMPONENTS):
            slot, sign = (Slot(axis, "motion"), 1) if letter == axis else own_component(request.described, axis, "intra", i)
            angle = i >= 3
            table = Table(
                f"E{letter}{axis}",
                slot,
                axis,
                knots(request.limits, axis, points),
                (0,),
                "rad" if angle else "mm",
                1.0,
                sign,
                increment[angle],
            )
            held += tabulated(table, machine)
    return held


def position_errors(request: Request, increment: tuple[float, float]) -> list[Held]:
    """job, increments of mm and rad → axis location errors EA0Y … EC0C of every axis."""
    machine = request.machine
    held: list[Held] = []
    for axis in (*machine.linear, *machine.rotary):
        base = axis_frame(axis, machine.axis(axis).direction)[1]
        for i, letter in enumerate(COMPONENTS):
            if axis in machine.linear and (i < 3 or i - 3 == base):
                continue  # a linear axis has a direction and no place
            if axis in machine.rotary and i % 3 == base:
                continue  # along and about itself is a matter of its zero
            slot, sign = own_component(request.described, axis, "inter", i)
            angle = i >= 3
            held.append(
                Held(
                    f"E{letter}0{axis}",
                    "axis locations",
                    "rad" if angle else "mm",
                    "angle" if angle else "length",
                    increment[angle],
                    by_slot(slot, lambda t: np.ones(len(t))),
                    sign=sign,
                    slot=slot,
                )
            )
    return held


def readout(machine: Machine, axis: str) -> Array:
    """axis → (3,) mm, what X, Y and Z show with the spindle on its line, all axes at zero; of a head: from the spindle to it."""
    return np.array(machine.axis(axis).point) - np.array(machine.spindle.point)


def rows(held: Sequence[Held], table: str) -> list[Held]:
    """entries, name → those of this table, in its order."""
    return [h for h in held if h.table == table]


def tables(held: Sequence[Held]) -> list[str]:
    """entries → the names of their tables, in order."""
    return list(dict.fromkeys(h.table for h in held))


def span(limits: Limits, machine: Machine, axis: str) -> tuple[float, float]:
    """volume, axis → its limits in mm or degrees."""
    low, high = limits[axis]
    scale = scale_of(machine, axis)
    return low * scale, high * scale


def rotary_order(machine: Machine) -> tuple[list[str], list[str]]:
    """machine → rotary axes under the workpiece from the foundation outwards, rotary axes of the tool likewise."""
    return (
        [a for a in machine.workpiece_branch if a in machine.rotary],
        [a for a in machine.tool_branch if a in machine.rotary],
    )


def parallel(machine: Machine) -> bool:
    """machine → whether every rotary axis is parallel to X, Y or Z."""
    return all(len(across(machine, axis)) == 2 for axis in machine.rotary)
