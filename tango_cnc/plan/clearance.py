"""Where rotary axes turn: a plane keeps the probe 20 mm from everything on the table, at all angles that are passed (`sweep.py`).

Before the first touch nobody knows at which angles the axes stand, and after the last one nobody knows where they will be turned:
there the plane keeps apart what table and probe sweep at any angles. Turning the spindle moves only the probe about its own axis
and is done at the same places.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import chain, pairwise

import numpy as np

from .. import check, kinematics
from ..check.bodies import TURN
from ..check.travel import travel_text
from ..records import Array, InputError, Touch, Turn
from . import preload, sweep
from .guard import TRAVEL, Faults, complaint, todo
from .guard import TURN as TURNING
from .places import Rows, Scene
from .sweep import Spans
from .turns import Turned

MARGIN = TURN  # mm between the probe and everything on the table when the probe is clear
MORE = (0.0, 25.0, 50.0, 100.0, 200.0, 400.0)  # mm beyond that, where something of the machine is in the way
TRIES = 8  # a lift that also moves what it is lifted from is approached step by step


class Clearance:
    """One machine with what stands on its table; answers where the probe goes between indexations."""

    def __init__(self, scene: Scene, level: Array) -> None:
        """machine with what is on its table, clear level (m,) mm of each indexation."""
        self._machine, self._chain = scene.machine, scene.chain
        self._level, self._station, self._spindle = level, scene.station, scene.up
        self._columns, self._guard = list(self._chain.linear_columns), scene.guard
        self._swivels = any(self._machine.axis(name).kind == "rotary" for name in self._machine.tool_branch)
        self._probe, self._table = sweep.probe(self._machine), sweep.table(scene.solid)
        # A spindle that only ever stands one way is not turned.
        self._orients = bool(np.ptp(self._station[:, self._machine.column("S")]))

    def turns(self, touches: Sequence[Touch], begins: Rows, name: Callable[[int], str], faults: Faults | None = None) -> Turned:
        """touches, rows of those before which axes turn, indexation → its name → the turns, and the parting retract.

        `faults`: takes those that are not possible; what stands in their place is not safe. Without it they raise InputError.
        """
        turns = (self._or_fault(touches[row - 1] if row else None, touches[row], name, faults) for row in begins.tolist())
        # The parting retract comes last, and so do its faults.
        parting = (self._or_fault(last, None, name, faults) for last in touches[-1:])
        return Turned(chain(turns, parting), len(begins) + 1, self._station.shape[1])

    def _or_fault(self, previous: Touch | None, touch: Touch | None, name: Callable[[int], str], faults: Faults | None) -> Turn:
        """touches before and after → the turn between them; where it is not possible and a fault can be noted, one on the spot."""
        start = previous or touch
        assert start is not None
        try:
            return self._parting(start, name) if touch is None else self._turn(previous, touch, name)
        except InputError as error:
            if faults is None:
                raise
            number, over = start.number + 1 if touch is None else touch.number, np.array(start.over)
            faults[number] = str(error)
        return Turn(number, _tuple(over), _tuple(over if touch is None else self._turned(over, touch.indexation)))

    def has_room(self, touch: Touch) -> bool:
        """touch → whether the travels leave a place above it at which the rotary axes may turn, whatever their angles are."""
        return not self.why_no_room(touch)

    def why_no_room(self, touch: Touch) -> str:
        """touch → why there is no such place, as a sentence without its point; empty where there is one."""
        try:
            self._parting(touch, self._angles)
        except InputError as error:
            return str(error).rstrip(". ")
        return ""

    def _angles(self, index: int) -> str:
        """indexation → its rotary angles, as 'A -60 C 180'."""
        at = self._station[index]
        return " ".join(f"{name} {math.degrees(at[self._machine.column(name)]):.6g}" for name in self._machine.rotary)

    def _parting(self, last: Touch, name: Callable[[int], str]) -> Turn:
        over, complaints = np.array(last.over), list[InputError]()
        for more in MORE if self._guard else MORE[:1]:
            try:
                place = self._place(over, last.indexation, self._up(last.indexation), name, more=more)
                if (pair := self._guard.turns(place, None, probe_alone=True)) is not None:
                    text = f"{complaint(pair, TURNING)} when axes are turned after the last touch. {todo(pair)}"
                    raise InputError(f"{self._before(last, name)}{text}")
                self._clear([(over, place)], last, name)
                return Turn(last.number + 1, _tuple(place), _tuple(place))
            except InputError as error:
                complaints.append(error)
        raise complaints[0]

    def _turn(self, previous: Touch | None, touch: Touch, name: Callable[[int], str]) -> Turn:
        start = previous or touch
        ways = self._ways(self._up(start.indexation), self._up(touch.indexation)) if previous else self._first_ways(start)
        complaints = []
        for alike in ways:
            found = []
            for up in alike:
                try:
                    found.append(self._turn_free(up, previous, start, touch, name))
                except InputError as error:
                    complaints.append(error)
            if found:
                return min(found, key=lambda turn: self._length(start, turn, touch))
        raise complaints[0]

    def _turn_free(self, up: Array, previous: Touch | None, start: Touch, touch: Touch, name: Callable[[int], str]) -> Turn:
        """The same as `_turn_towards`, lifted until it keeps off what is declared on the machine."""
        complaints = []
        for more in MORE if self._guard else MORE[:1]:
            try:
                turn = self._turn_towards(up, previous, start, touch, name, more)
                self._free(previous, turn, touch, name)
                return turn
            except InputError as error:
                complaints.append(error)
        raise complaints[0]

    def _free(self, previous: Touch | None, turn: Turn, touch: Touch, name: Callable[[int], str]) -> None:
        """Raises InputError where a turn, or a way to or from its place, comes too near what is declared on the machine."""
        if not self._guard:
            return
        before, after = np.array(turn.before), np.array(turn.after)
        within = None if previous is None else sweep.spans(self._machine, before, after)
        if (pair := self._guard.turns(after, within, probe_alone=previous is None)) is not None:
            raise InputError(f"{self._before(touch, name)}{complaint(pair, TURNING)} while the axes turn. {todo(pair)}")
        places = [after, *([np.array(turn.via)] if turn.via else []), np.array(touch.over)]
        self._clear(list(pairwise(places)) + ([(np.array(previous.over), before)] if previous else []), touch, name)

    def _clear(self, ways: list[tuple[Array, Array]], touch: Touch, name: Callable[[int], str]) -> None:
        met = self._guard.meets(np.array(ways), TRAVEL)
        for number in met[met >= 0][:1].tolist():
            pair = self._guard.pairs[number]
            raise InputError(f"{self._before(touch, name)}{complaint(pair, TRAVEL)} on the way to turn the axes. {todo(pair)}")

    def _before(self, touch: Touch, name: Callable[[int], str]) -> str:
        return f"indexation {touch.indexation + 1} ({name(touch.indexation)}): "

    def _length(self, start: Touch, turn: Turn, touch: Touch) -> float:
        """→ mm that the linear axes go from the touch before to the one after."""
        places = np.array([start.over, turn.before, turn.via or turn.before, touch.over])[:, self._columns]
        return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())

    def _ways(self, before: Array, after: Array) -> list[list[Array]]:
        """→ directions in which the probe may leave the table to turn: along the tool, or, if a head must, sideways of it.

        The shortest way out of the first of these lists in which there is one is taken.
        """
        if not self._swivels:
            return [[before]]
        across = np.cross(before, np.eye(3)[np.argmin(np.abs(before))])
        across /= np.linalg.norm(across)
        sideways = [across, np.cross(before, across)]
        middle = before + after
        size = np.linalg.norm(middle)
        between = [middle / size] if size > 0.1 else []
        upright = np.array(self._machine.spindle.direction)
        return [[before, after, upright, *between], *([way] for way in sideways), *([-way] for way in sideways)]

    def _first_ways(self, touch: Touch) -> list[list[Array]]:
        """→ directions in which one axis alone takes a probe clear that points nobody knows where: along the spindle if it can."""
        upright = self._up(touch.indexation)
        if not self._swivels:
            return [[upright]]
        upright = np.array(self._machine.spindle.direction)
        axes = [np.array(self._machine.axes[column].direction) for column in self._columns]
        ways = [way for axis in axes for way in (axis, -axis)]
        return [[way] for way in sorted(ways, key=lambda way: -float(way @ upright))]

    def _turn_towards(
        self, up: Array, previous: Touch | None, start: Touch, touch: Touch, name: Callable[[int], str], more: float = 0.0
    ) -> Turn:
        over = np.array(start.over)
        # Before the first turn nobody knows the angles. Where an axis stops short of its goal (`preload.stop`) is on its way.
        within = None if previous is None else sweep.spans(self._machine, over, self._turned(over, touch.indexation))
        before = self._place(over, start.indexation, up, name, within, more)
        after = self._turned(before, touch.indexation)
        via = None
        tip = kinematics.tip(self._chain, after[None])[0]
        if tip @ self._spindle[touch.indexation] < self._level[touch.indexation] - 1e-9:
            via = self._descend(np.array(touch.over), touch.indexation, up, after, name)
        first = None
        if previous is None:
            rotation, _ = sweep.pose(self._machine, self._machine.workpiece_branch, before)
            lift = self._along(before, rotation.T @ up)
            first = self._machine.names[self._columns[int(np.argmax(np.abs(lift[self._columns])))]]
        stop = self._preload(before, after, up) if first else preload.stop(self._machine, before, after)
        return Turn(touch.number, _tuple(before), _tuple(after), None if via is None else _tuple(via), first, stop)

    def _turned(self, place: Array, index: int) -> Array:
        """→ the place with the angles of an indexation."""
        return np.where(np.isin(np.arange(len(place)), self._columns), place, self._station[index])

    def _preload(self, before: Array, after: Array, up: Array) -> tuple[float, ...]:
        """→ a stop short of the place and the angles, from which every axis moves a little: nobody knows how it came there."""
        place = before.copy()
        for column in self._columns:
            for way in preload.ways(self._machine.axes[column], before[column], preload.LINEAR):
                aside = place.copy()
                aside[column] += way
                if self._apart(aside, up) > self._apart(place, up) - 1e-6:
                    place = aside
                    break
        turns = [name for name in self._machine.rotary] + ["S"] * self._orients
        for column in map(self._machine.column, turns):
            ways = preload.ways(self._machine.axes[column], after[column], preload.ROTARY)
            place[column] = after[column] + (ways[0] if ways else 0.0)
        for column in (self._machine.column(name) for name in ("S",) if not self._orients):
            place[column] = after[column]
        return _tuple(place)

    def _place(
        self, over: Array, index: int, up: Array, name: Callable[[int], str], within: Spans | None = None, more: float = 0.0
    ) -> Array:
        """position above a touch, its indexation, direction in the machine frame → where axes may turn, lifted that way.

        `more`: mm that it is lifted beyond that.
        """
        place, lift = over.copy(), self._lift(over, index, up, name)
        for _ in range(TRIES):
            missing = -self._apart(place, up, within)
            if missing <= 1e-9:
                break
            place = place + (missing + 1e-9) * lift
        if self._apart(place, up, within) < -1e-6:
            raise InputError(f"{_named(index, name)}: no lift takes the probe clear of what the rotary axes sweep")
        return self._reachable(place + more * lift, index, name)

    def _descend(self, over: Array, index: int, up: Array, after: Array, name: Callable[[int], str]) -> Array:
        """→ a place above the next touch at least as high as where the axes turned, in the direction `up`."""
        lift = self._lift(over, index, up, name)
        rotation, _ = sweep.pose(self._machine, self._machine.workpiece_branch, over)
        low, lifted, high = kinematics.tip(self._chain, np.array([over, over + lift, after])) @ (rotation.T @ up)
        return self._reachable(over + max((high - low) / (lifted - low), 0.0) * lift, index, name)

    def _reachable(self, place: Array, index: int, name: Callable[[int], str]) -> Array:
        beyond = check.outside(self._machine, place[None])[0]
        for column in np.flatnonzero(beyond):
            axis = self._machine.names[column]
            raise InputError(
                f"{_named(index, name)}: to turn the rotary axes clear of the table the probe needs "
                f"{travel_text(self._machine, axis, float(place[column]))}. "
                "A shorter probe, facets and balls nearer to the rotary axes or obstacles that reach less far would do it."
            )
        return place

    def _lift(self, over: Array, index: int, up: Array, name: Callable[[int], str]) -> Array:
        """→ (k,) displacement per mm upwards that does not bring the probe nearer to the table of this indexation."""
        rotation, _ = sweep.pose(self._machine, self._machine.workpiece_branch, over)
        direction = rotation.T @ up  # table frame
        spindle = self._spindle[index]
        leaving = direction @ spindle
        if leaving < 0:
            direction = direction - leaving * spindle
            size = np.linalg.norm(direction)
            if size < 1e-6:
                raise InputError(f"{_named(index, name)}: the probe turns right round and there is no free way for it")
            direction = direction / size
        return self._along(over, direction)

    def _along(self, position: Array, direction: Array) -> Array:
        """(k,), (3,) direction in the table frame → (k,) displacement of the linear axes that moves the tip 1 mm that way."""
        tip = kinematics.tip(self._chain, position[None])
        moved = kinematics.inverse(self._chain, position[None], tip + direction)[0]
        change = moved - position
        change[[i for i in range(len(position)) if i not in self._columns]] = 0.0
        return change

    def _up(self, index: int) -> Array:
        """indexation → direction from the tip to the spindle in the machine frame."""
        rotation, _ = sweep.pose(self._machine, self._machine.tool_branch, self._station[index])
        return rotation @ np.array(self._machine.spindle.direction)

    def _apart(self, position: Array, up: Array, within: Spans | None = None) -> float:
        """→ mm between probe and table along `up`, beyond the margin, while axes are within these spans, or at any angles."""
        top = sweep.reach(self._machine, self._machine.workpiece_branch, position, within, self._table, up)
        return -sweep.reach(self._machine, self._machine.tool_branch, position, within, self._probe, -up) - top - MARGIN


def _tuple(position: Array) -> tuple[float, ...]:
    return tuple(position.tolist())


def _named(index: int, name: Callable[[int], str]) -> str:
    """number of an indexation from 0, text of its angles → its name in a message: 'indexation 1 (B 30)'."""
    return f"indexation {index + 1} ({name(index)})"
