"""Which records become readings: the control's word is checked against the plan before anything believes it.

A line without check sums delivers wrong digits that look right: of randomly corrupted records a strict grammar alone accepts
5–7 %. A reading is therefore compared with what the machine was told to do: it must lie on the line of its own measuring
move, between stand-off and search end, with the rotary axes where they were sent. Controls whose skip is silent (Fanuc's
G31 and its relatives) store the programmed end when nothing was touched: that is a miss whatever the flag says. The search
zone reaches as far before the nominal contact as the search goes beyond it; a contact before the zone is early.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Machine, Touch
from .client import Touched

FARTHEST = 100_000.0  # mm; controls print any place at a miss, but none beyond their scales
STEPS_AHEAD = 3  # records lost in a row before a touch number is more likely wrong than the ones between are lost


class Distrust(Exception):
    """A record that cannot be what it says; the message says why."""


@dataclass(frozen=True)
class Leeway:
    """How far a record may be from what was commanded before it is not believed."""

    sideways: float = 0.5  # mm from the line of the measuring move: contouring error, not contact
    turned: float = math.radians(0.1)  # of the rotary axes and the spindle
    resolution: float = 0.002  # mm, within which two positions are the same
    moved: float = 0.02  # mm between a touch and its repetition by --resume: more than a machine drifts while it waits


@dataclass(frozen=True)
class Believed:
    """A record that is believed."""

    status: str  # ok, miss, early
    position: Array  # (k,) mm, rad; columns of Machine.names; rotary axes in the plan's turn
    deviation: float | None  # µm of an ok contact from the nominal one along the outward normal


def judge(record: Touched, touch: Touch, machine: Machine, leeway: Leeway) -> Believed:
    """record, what was planned, machine → status, position, deviation. Raises Distrust."""
    position = _position(record, touch, machine)
    contact = np.array(touch.contact)
    turned = np.array([axis.kind != "linear" for axis in machine.axes])
    _possible(position, machine)
    if record.flag == 2:
        return Believed("early", position, None)
    if record.flag == 0:
        _missed(position, touch, turned, leeway)
        return Believed("miss", position, None)
    for i in np.flatnonzero(turned & (np.abs(position - contact) > leeway.turned)):
        said, sent = math.degrees(position[i]), math.degrees(contact[i])
        raise Distrust(f"{machine.names[i]} is {said:.4f} deg where {sent:.4f} was commanded")
    start, end = np.array(touch.standoff)[~turned], np.array(touch.end)[~turned]
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    went = position[~turned] - start
    way = float(went @ along)
    aside = float(np.linalg.norm(went - way * along))
    if aside > leeway.sideways:
        raise Distrust(f"{aside:.3f} mm beside the line of its measuring move, {leeway.sideways:g} mm are allowed")
    if not -leeway.sideways <= way <= length + leeway.sideways:
        raise Distrust(f"{way:.3f} mm along a measuring move of {length:.3f} mm")
    if way >= length - leeway.resolution:
        return Believed("miss", position, None)
    searched = float(np.linalg.norm(end - contact[~turned]))
    if way < max(length - 2 * searched, (length - searched) / 10) - leeway.resolution:
        return Believed("early", position, None)
    return Believed("ok", position, float((contact[~turned] - position[~turned]) @ along) * 1e3)


def _possible(position: Array, machine: Machine) -> None:
    """(k,) mm, rad → nothing. Raises Distrust for a place where no machine can be, whatever the flag says."""
    for value, axis in zip(position, machine.axes, strict=True):
        if axis.kind == "linear" and abs(value) > FARTHEST:
            raise Distrust(f"{axis.name} is {value:.6g} mm: no machine goes there")


def _missed(position: Array, touch: Touch, turned: NDArray[np.bool_], leeway: Leeway) -> None:
    """(k,) mm, rad of a record that says 'no contact'. Raises Distrust where only a contact can have stopped the machine.

    One bit makes a 0 of a 1. A control that misses stands at the end of its search, or says a place of any other move.
    """
    start, contact, end = (np.array(place)[~turned] for place in (touch.standoff, touch.contact, touch.end))
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    went = position[~turned] - start
    way = float(went @ along)
    searched = float(np.linalg.norm(end - contact))
    on_line = float(np.linalg.norm(went - way * along)) <= leeway.sideways and length - 2 * searched <= way
    if (
        on_line
        and way < length - leeway.sideways
        and bool((np.abs(position - np.array(touch.contact))[turned] <= leeway.turned).all())
    ):
        raise Distrust(f"its flag says that nothing was met, but the axes stand {length - way:.3f} mm before the end of the search")


def _position(record: Touched, touch: Touch, machine: Machine) -> Array:
    """mm, deg of the record → (k,) mm, rad; what it does not say (the spindle) as commanded; rotary axes in the plan's turn."""
    values = list(touch.contact)
    for i, axis in enumerate(machine.axes):
        if axis.name not in record.position:
            continue
        value = record.position[axis.name]
        if axis.kind == "linear":
            values[i] = value
        else:
            values[i] += math.remainder(math.radians(value) - values[i], 2 * math.pi)
    return np.array(values)


def next_in_order(number: int, numbers: tuple[int, ...], done: int) -> int:
    """touch number, numbers in the order of the program, how many of them are behind → its place. Raises Distrust."""
    if number not in numbers:
        raise Distrust(f"touch {number} is not in the program")
    place = numbers.index(number)
    if place < done:
        raise Distrust(f"touch {number} is repeated or out of order: touch {numbers[done - 1]} was the last one")
    if place > done + STEPS_AHEAD:
        raise Distrust(f"touch {number} came where touch {numbers[done]} was due")
    return place
