"""Frames of an RS-274/NGC control: machine = rotated(work + G92) + G5x + tool length; mm and deg, linear axes also in inches."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tango_cnc.records import Array

from ...motion import Motion, Skip
from .._shared.scales import commanded, shown

INCH = 25.4


class Frames:
    """What the program says, in its units and frame, ↔ what the machine does."""

    def __init__(self, motion: Motion, g54: Mapping[str, float], rotation: float, tool_lengths: Mapping[int, float]) -> None:
        self.motion = motion
        self.axes = tuple(name for name in "XYZABC" if name in (*motion.machine.linear, *motion.machine.rotary))
        self.rotation = rotation  # deg, of XY about the origin of the work frame
        self.scaled: Mapping[str, float] = {}  # of work coordinates; -1 is a mirror image
        self.inch = self.relative = False
        self._g54 = {name: g54.get(name, 0.0) for name in self.axes}
        self.g92 = dict.fromkeys(self.axes, 0.0)
        self._lengths, self._length = tool_lengths, 0.0

    def unit(self, name: str) -> float:
        """axis letter → mm or deg of one unit of the program."""
        return INCH if self.inch and name in "XYZ" else 1.0

    def select_length(self, number: int) -> bool:
        """number of a tool length, 0 for none → whether there is one."""
        self._length = self._lengths.get(number, 0.0) if number else 0.0
        return not number or number in self._lengths

    def offset(self, name: str) -> float:
        """axis letter → its G54 offset, units of the program."""
        return self._g54[name] / self.unit(name)

    def machine(self, position: Array | None = None) -> dict[str, float]:
        """mm rad, or where the axes stand → {axis: mm deg}."""
        return shown(self.motion, self.axes, position)

    def work(self, place: Mapping[str, float] | None = None) -> dict[str, float]:
        """{axis: mm deg} of the machine → the same in the work frame, units of the program."""
        place = self.machine() if place is None else place
        rel = {name: place[name] - self._g54[name] - (self._length if name == "Z" else 0.0) for name in self.axes}
        rel |= self._turned(rel, -self.rotation)
        return {name: (value - self.g92[name]) / self.unit(name) for name, value in rel.items()}

    def target(self, words: Mapping[str, float], machine: bool = False) -> dict[str, float]:
        """{axis: program units} → {axis: mm rad} of the machine."""
        if machine:
            goal = {name: value * self.unit(name) for name, value in words.items()}
        else:
            here = self.work()
            there = {n: (here[n] if self.relative else 0.0) + v * self.scaled.get(n, 1.0) for n, v in words.items()}
            rel = {n: there.get(n, here[n]) * self.unit(n) + self.g92[n] for n in self.axes}
            rel |= self._turned(rel, self.rotation)
            told = {*words} | ({"X", "Y"} if self.rotation and {*words} & {"X", "Y"} else set())
            goal = {n: rel[n] + self._g54[n] + (self._length if n == "Z" else 0.0) for n in self.axes if n in told}
        return commanded(self.motion, goal)

    def probed(self, skip: Skip) -> dict[str, float]:
        """a probing move → where it was met, work frame, units of the program."""
        return self.work(self.machine(skip.position))

    def _turned(self, place: Mapping[str, float], angle: float) -> dict[str, float]:
        if not angle:
            return {}
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        return {"X": c * place["X"] - s * place["Y"], "Y": s * place["X"] + c * place["Y"]}
