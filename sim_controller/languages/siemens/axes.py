"""Axis words → moves of a Sinumerik-like control: frames, tool length, SUPA, modulo axes, MEAS and the position variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import ROUND_HALF_UP, Decimal
from typing import Literal

from tango_cnc.records import Machine

from ...motion import Motion
from .._shared.scales import TURN, commanded, endless, roll, shown
from .alarms import alarm

STILL = 1e-6  # mm or deg
FARTHEST = 1e9  # mm or deg


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control; every default is a guess that a real machine may refute."""

    axes: tuple[str, ...]
    increment: Decimal = Decimal("0.001")  # mm and deg, the computing resolution (MD10200, MD10210)
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg, active from the start
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # D → mm; D1 is active from the start
    rollover: tuple[str, ...] = ()  # modulo axes
    probe_input: int = 1  # that the probe is wired to, 1 or 2
    deflected: Literal["alarm", "ignore"] = "alarm"  # MEAS with a probe that is deflected: alarm, or a move without an edge
    status: bool = True  # $AC_MEA tells contact from none; else it is always 1
    mirrored: tuple[str, ...] = ()  # axes that a MIRROR before has left mirrored, until TRANS; SUPA suppresses that too
    supa_with_meas: bool = True  # SUPA acts in a block with MEAS; else that block moves in the work frame
    transformation: bool = False  # TRAORI is active from the start: SUPA does not undo it
    devices: tuple[str, ...] = ("/dev/ext/1", "/dev/v24")  # that EXTOPEN knows
    user: Mapping[str, int] = field(default_factory=dict)  # arrays of global user data (DEF NCK REAL …) and how many fields
    room: Decimal = Decimal("1000000")  # bytes of a file in the control (MD11420)


def default_profile(machine: Machine) -> Profile:
    """machine → profile with its axes; those that turn more than two turns are modulo axes."""
    return Profile((*machine.linear, *machine.rotary), rollover=endless(machine))


@dataclass(frozen=True)
class Target:
    """Value of one axis word, mm or deg, and how it is to be reached: '', AC, IC, DC, ACP, ACN."""

    value: float
    way: str = ""


class Axes:
    """The axes in mm and deg; what is read of them is as old as the last stop of preprocessing."""

    def __init__(self, motion: Motion, profile: Profile) -> None:
        self._motion, self._profile, self._machine = motion, profile, motion.machine
        self.tool, self.incremental, self.transformation = 1, False, profile.transformation
        self.settable, self.mirrored = True, profile.mirrored
        self._known = self._now()
        self._deflected = motion.deflected
        self._latched = dict.fromkeys(profile.axes, 0.0)
        self._status = self._seen = 0
        self._read = dict(self._latched)

    def settle(self) -> None:
        """Preprocessing waits for the axes: what is read from now on is true."""
        self._known, self._deflected = self._now(), self._motion.deflected
        self._read, self._seen = dict(self._latched), self._status

    def move(self, targets: Mapping[str, Target], feed: float | None, *, suppressed: bool) -> None:
        """axis → target, mm/min or None for rapid. Raises Alarm and MotionStop."""
        end = self._end(targets, suppressed)
        if feed is None:
            self._motion.rapid(end)
        else:
            self._motion.feed(end, feed)
        roll(self._motion, self._profile.rollover)

    def measure(self, targets: Mapping[str, Target], feed: float, *, suppressed: bool) -> None:
        """MEAS: the axes of this block are latched at the edge; without an edge nothing is, and nobody says so."""
        self._status = 0 if self._profile.status else 1
        suppressed = suppressed and self._profile.supa_with_meas
        if self._motion.deflected:
            if self._profile.deflected == "alarm":
                raise alarm("21700")
            self.move(targets, feed, suppressed=suppressed)
            return
        skip = self._motion.skip(self._end(targets, suppressed), feed)
        roll(self._motion, self._profile.rollover)
        if skip.hit:
            self._status = 1
            there = shown(self._motion, self._profile.axes, skip.position)
            self._latched |= {name: there[name] for name in targets}

    def variable(self, name: str, axis: str) -> float:
        """$AA_IM, $AA_IW, $AA_MM, $AA_MW of an axis. Raises Alarm for any other."""
        if axis not in self._profile.axes:
            raise alarm("12550", f"{name}[{axis}]")
        frame = self._frame(axis)
        table = {
            "$AA_IM": self._known[axis],
            "$AA_IW": self._known[axis] - frame,
            "$AA_MM": self._read[axis],
            "$AA_MW": self._read[axis] - frame,
        }
        if name not in table:
            raise alarm("12550", name)
        return table[name]

    @property
    def measured(self) -> int:
        """→ $AC_MEA of the input that was looked at last."""
        return self._seen

    @property
    def deflected(self) -> bool:
        """→ $A_PROBE of the input that the probe is wired to."""
        return self._deflected

    def _end(self, targets: Mapping[str, Target], suppressed: bool) -> dict[str, float]:
        now, found = self._now(), {}
        for name, target in targets.items():
            frame = self._length(name) if suppressed else self._frame(name)
            relative = target.way == "IC" or (self.incremental and not target.way)
            if name in self.mirrored and not suppressed:
                target = Target(-target.value, target.way)
            goal = now[name] + target.value if relative else self._turned(name, target, now[name], frame)
            if not abs(goal) < FARTHEST:
                raise alarm("10720", name)
            step = self._profile.increment
            found[name] = float(Decimal(repr(goal)).quantize(step, ROUND_HALF_UP))
        return commanded(self._motion, found)

    def _turned(self, name: str, target: Target, now: float, frame: float) -> float:
        if target.way not in ("DC", "ACP", "ACN"):
            return target.value + frame
        if name not in self._profile.rollover:
            raise alarm("16800", name)
        if not 0 <= target.value < TURN:
            raise alarm("16830", f"{name}={target.way}({target.value:g})")
        ahead = (target.value + frame - now) % TURN
        ahead = 0.0 if min(ahead, TURN - ahead) < STILL else ahead
        if target.way == "ACN" or (target.way == "DC" and ahead > TURN / 2):
            return now + (ahead - TURN if ahead else 0.0)
        return now + ahead

    def _frame(self, name: str) -> float:
        return (self._profile.g54.get(name, 0.0) if self.settable else 0.0) + self._length(name)

    def _length(self, name: str) -> float:
        """Tool length, and under a transformation the point of the tool: here a shift that nobody expects."""
        return (self._profile.tool_lengths[self.tool] if name == "Z" and self.tool else 0.0) + (
            50.0 if self.transformation else 0.0
        )

    def _now(self) -> dict[str, float]:
        return shown(self._motion, self._profile.axes)
