"""Axis words → moves of a control with one work offset, one tool length, roll-over axes and variables that may be too old."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import ROUND_HALF_UP, Decimal

from tango_cnc.records import Array

from ..motion import Motion, MotionStop, Skip

TURN = 360.0
FARTHEST = 1e7  # mm or deg


class Axes:
    """The axes in mm and deg. `machine`: programmed positions are machine positions, but for the tool length."""

    def __init__(
        self,
        motion: Motion,
        axes: tuple[str, ...],
        increment: Decimal,
        offsets: Mapping[str, float],
        rollover: tuple[str, ...],
        signed: bool,
    ) -> None:
        """`offsets`: machine minus work position; `signed`: the sign of a roll-over axis' angle is its direction."""
        self._motion, self.names, self._increment, self._offsets = motion, axes, increment, offsets
        self._rollover, self._signed = rollover, signed
        self.machine, self.incremental, self.length = False, False, 0.0
        self._known = self._now()
        self.skipped = dict(self._known)

    def settle(self) -> None:
        """The control has waited for its axes: what it knows of them is true."""
        self._known = self._now()

    def known(self, name: str) -> float:
        """axis letter → machine position as old as the last wait."""
        return self._known[name]

    def shift(self, name: str, machine: bool | None = None) -> float:
        """axis letter → machine minus programmed position."""
        frame = 0.0 if (self.machine if machine is None else machine) else self._offsets.get(name, 0.0)
        return frame + (self.length if name == "Z" else 0.0)

    def move(self, words: Mapping[str, float], feed: float | None, machine: bool | None = None) -> None:
        """axis → programmed position, mm/min or None for rapid. Raises MotionStop."""
        end = self._end(words, machine)
        if feed is None:
            self._motion.rapid(end)
        else:
            self._motion.feed(end, feed)
        self._roll()

    def skip(self, words: Mapping[str, float], feed: float) -> Skip:
        """axis → programmed position, mm/min → what the probe did; `skipped` is the machine position of a contact."""
        skip = self._motion.skip(self._end(words, None), feed)
        if skip.hit:
            self.skipped = self._degrees(skip.position)
        self._roll()
        return skip

    def _end(self, words: Mapping[str, float], machine: bool | None) -> dict[str, float]:
        now, end = self._now(), {}
        for name, value in words.items():
            goal = now[name] + value if self.incremental else self._turned(name, value, machine, now[name])
            if not abs(goal) < FARTHEST:
                raise MotionStop("overtravel", f"{name} would leave its travel", name, 1 if goal > 0 else -1)
            goal = float(Decimal(repr(goal)).quantize(self._increment, ROUND_HALF_UP))
            end[name] = goal if name in self._motion.machine.linear else math.radians(goal)
        return end

    def _turned(self, name: str, value: float, machine: bool | None, now: float) -> float:
        """→ goal: a roll-over axis goes the nearer way, or that of the sign."""
        if name not in self._rollover:
            return value + self.shift(name, machine)
        if self._signed:
            ahead = (abs(value) + self.shift(name, machine) - now) % TURN
            return now + (ahead - TURN if value < 0 and ahead else ahead)
        change = (value + self.shift(name, machine) - now) % TURN
        return now + (change - TURN if change > TURN / 2 else change)

    def _roll(self) -> None:
        for name in self._rollover:
            angle = self._now()[name]
            if not 0 <= angle < TURN:
                self._motion.set_position(name, math.radians(angle % TURN))

    def _now(self) -> dict[str, float]:
        return self._degrees(self._motion.position)

    def _degrees(self, position: Array) -> dict[str, float]:
        machine = self._motion.machine
        places = {name: float(position[machine.column(name)]) for name in self.names}
        return {name: v if name in machine.linear else math.degrees(v) for name, v in places.items()}
