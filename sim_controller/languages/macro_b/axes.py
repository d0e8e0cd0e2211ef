"""Axis words → moves: work and tool offsets, incremental and inch, roll-over, and the position variables."""

from __future__ import annotations

import math

from ... import probing
from ...motion import Motion
from .._shared.scales import by_sign, commanded, nearer, roll, shown
from .alarms import alarm
from .blocks import Word, axis_value
from .profile import Profile


class Axes:
    """The control axes in mm and deg. What #5021 and #5041 read is older than the axes after a move that was not waited for."""

    def __init__(self, motion: Motion, profile: Profile) -> None:
        self._motion, self._profile = motion, profile
        self._machine = motion.machine
        self._offsets = {54: {name: profile.g54.get(name, 0.0) for name in profile.axes}}
        self._length = 0.0
        self.inch, self.incremental, self.work = False, False, 54
        self._known = self._now()
        self.deflected = motion.deflected
        self._skipped = self._read = dict(self._known)
        self.limited, self._blank = False, 0  # G103 P1: one block is read ahead; blocks since the last motion
        roll(self._motion, self._profile.rollover)

    def passed(self, moved: bool) -> None:
        """A block has been carried out, and whether it moved: what is read ahead is as old as the block before the last one."""
        self._blank = 0 if moved else self._blank + 1
        if self.limited and self._blank >= 2:
            self._now_known()

    def settle(self) -> None:
        """The control has waited for the axes: what it knows of them and of the probe is true again."""
        if not self._profile.macros_ahead:
            self._now_known()

    def _now_known(self) -> None:
        self._known, self.deflected = self._now(), self._motion.deflected
        self._read = dict(self._skipped)

    def select_length(self, number: int, alone: bool) -> None:
        """G43 H, or 0 for G49; whether no axis stands beside it. Raises Alarm for an offset number that the control lacks."""
        if number and number not in self._profile.tool_lengths:
            raise alarm("PS0030", f"H{number}")
        before, self._length = self._length, self._profile.tool_lengths[number] if number else 0.0
        if alone and self._profile.length_moves:
            self._motion.rapid(commanded(self._motion, {"Z": self._now()["Z"] + self._length - before}))
            self._after_move()

    def rapid(self, found: list[Word]) -> None:
        """axis words → G00."""
        self._motion.rapid(self._target(found), straight=self._profile.straight_rapid)
        self._after_move()

    def feed(self, found: list[Word], feed: float) -> None:
        """axis words, mm/min → G01."""
        self._motion.feed(self._target(found), feed)
        self._after_move()

    def skip(self, found: list[Word], feed: float, elsewhere: bool = False) -> None:
        """axis words, mm/min → G31: the position at the trigger, or the end point, goes to #5061…; nothing tells which.

        `elsewhere`: the P of the block is another skip input than that of the probe.
        """
        done = self._motion.skip(self._target(found), feed, elsewhere=elsewhere)
        self._skipped = shown(self._motion, self._profile.axes, done.position)
        roll(self._motion, self._profile.rollover)
        self.settle()

    def machine_move(self, found: list[Word]) -> None:
        """axis words → G53: rapid in machine coordinates; ignored in G91. Waits for the axes."""
        if not self.incremental:
            values = {word.letter: self._value(word) for word in found}
            now = self._now()
            targets = {name: self._rolled(name, value, now[name], value < 0) for name, value in values.items()}
            self._motion.rapid(commanded(self._motion, targets), straight=self._profile.straight_rapid)
            self._after_move()
        self.settle()

    def reference(self, found: list[Word]) -> None:
        """axis words → G28: through that point to the reference position of those axes."""
        self.rapid(found)
        home = shown(self._motion, self._profile.axes, probing.home(self._machine))
        there = commanded(self._motion, {word.letter: home[word.letter] for word in found})
        self._motion.rapid(there, straight=self._profile.straight_rapid)
        self._after_move()

    def variable(self, number: int) -> float | None:
        """#5001…, #5021…, #5041…, #5061…, #5081…, #5201… → value in the present unit; None for any other."""
        base, index = (number - 1) // 20 * 20 + 1, (number - 1) % 20
        axes = self._profile.numbered or self._profile.axes
        if index >= len(axes):
            return None
        name = axes[index]
        if name not in self._known:
            return 0.0
        offset = self._offset(name) if self._profile.turn_shown else self._stored(name)
        length = self._length if name == "Z" else 0.0
        if 5221 <= base < 5341:
            value: float | None = self._stored(name, 54 + (base - 5221) // 20)
        else:
            value = {
                5001: self._now()[name] - offset - length if base == 5001 else None,
                5021: self._known[name],
                5041: self._known[name] - offset,
                5061: self._read[name] - offset,
                5081: length,
                5201: 0.0,
            }.get(base)
        if value is None:
            return None
        step = float(self._profile.increment)
        shown = round(value / step) * step if self._profile.counts else value
        return shown / (25.4 if self._profile.inch_positions and name in self._machine.linear else self._unit(name))

    def set_variable(self, number: int, value: float) -> bool:
        """number of a work offset (#5221…), value → whether it can be written and was."""
        work, index = 54 + (number - 5221) // 20, (number - 1) % 20
        axes = self._profile.numbered or self._profile.axes
        if not 54 <= work <= 59 or index >= len(axes):
            return False
        name = axes[index]
        self._offsets.setdefault(work, {})[name] = value * self._unit(name)
        return True

    def _target(self, found: list[Word]) -> dict[str, float]:
        now, targets = self._now(), {}
        for word in found:
            name, value = word.letter, self._value(word) * self._profile.scaled.get(word.letter, 1.0)
            if self.incremental:
                targets[name] = now[name] + value
            else:
                length = self._length if name == "Z" else 0.0
                targets[name] = self._rolled(name, value + self._offset(name) + length, now[name], value < 0)
        return commanded(self._motion, targets)

    def _rolled(self, name: str, target: float, now: float, negative: bool = False) -> float:
        """→ the target of a roll-over axis: the nearer way, or the way of the sign; half a turn goes in the positive direction."""
        if name not in self._profile.rollover:
            return target
        if self._profile.signed_direction:
            return by_sign(abs(target), now, negative)
        return nearer(target, now)

    def _after_move(self) -> None:
        roll(self._motion, self._profile.rollover)
        if not self._profile.read_ahead:
            self.settle()

    def _value(self, word: Word) -> float:
        return axis_value(word, self._profile.increment, self._profile.calculator) * self._unit(word.letter)

    def _unit(self, name: str) -> float:
        return 25.4 if self.inch and name in self._machine.linear else 1.0

    def _offset(self, name: str) -> float:
        """→ the work offset of an axis as moves see it: with a dynamic one, X and Y turned about the zero of the machine."""
        turns = self._profile.turned_with
        if not turns or name not in "XY":
            return self._stored(name)
        x, y, angle = self._stored("X"), self._stored("Y"), math.radians(self._now()[turns])
        along, across = math.cos(angle), math.sin(angle)
        return x * along - y * across if name == "X" else x * across + y * along

    def _stored(self, name: str, work: int | None = None) -> float:
        return self._offsets.get(self.work if work is None else work, {}).get(name, 0.0)

    def _now(self) -> dict[str, float]:
        return shown(self._motion, self._profile.axes)
