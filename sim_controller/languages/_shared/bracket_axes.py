"""Axis words → moves of a control with one work offset, one tool length, roll-over axes and variables that may be too old."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import ROUND_HALF_UP, Decimal
from types import MappingProxyType

from ...motion import Motion, MotionStop, Skip
from .scales import by_sign, commanded, nearer, roll, shown

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
        scaled: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        """`offsets`: machine minus work position; `signed`: the sign of a roll-over axis' angle is its direction; `scaled`: factors
        of work coordinates, -1 is a mirror image."""
        self._scaled = scaled
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
        roll(self._motion, self._rollover)

    def skip(self, words: Mapping[str, float], feed: float) -> Skip:
        """axis → programmed position, mm/min → what the probe did; `skipped` is the machine position of a contact."""
        skip = self._motion.skip(self._end(words, None), feed)
        if skip.hit:
            self.skipped = shown(self._motion, self.names, skip.position)
        roll(self._motion, self._rollover)
        return skip

    def _end(self, words: Mapping[str, float], machine: bool | None) -> dict[str, float]:
        now, end = self._now(), {}
        for name, value in words.items():
            if not (self.machine if machine is None else machine):
                value *= self._scaled.get(name, 1.0)
            goal = now[name] + value if self.incremental else self._turned(name, value, machine, now[name])
            if not abs(goal) < FARTHEST:
                raise MotionStop("overtravel", f"{name} would leave its travel", name, 1 if goal > 0 else -1)
            goal = float(Decimal(repr(goal)).quantize(self._increment, ROUND_HALF_UP))
            end[name] = goal
        return commanded(self._motion, end)

    def _turned(self, name: str, value: float, machine: bool | None, now: float) -> float:
        """→ goal: a roll-over axis goes the nearer way, or that of the sign."""
        if name not in self._rollover:
            return value + self.shift(name, machine)
        if self._signed:
            return by_sign(abs(value) + self.shift(name, machine), now, value < 0)
        return nearer(value + self.shift(name, machine), now)

    def _now(self) -> dict[str, float]:
        return shown(self._motion, self.names)
