"""Axis words → moves of a Sinumerik-like control: frames, tool length, SUPA, modulo axes, MEAS and the position variables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import ROUND_HALF_UP, Decimal
from typing import Literal

from tango_cnc.records import Machine

from ...motion import Motion
from .._shared.known import Controls
from .._shared.scales import TURN, commanded, endless, roll, shown
from .alarms import alarm

STILL = 1e-6  # mm or deg
FARTHEST = 1e9  # mm or deg
INCH = 25.4  # mm


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control; every default is a guess that a real machine may refute."""

    axes: tuple[str, ...]
    increment: Decimal = Decimal("0.001")  # mm and deg, the computing resolution (MD10200, MD10210)
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg, active from the start
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # D → mm; D1 is active from the start
    rollover: tuple[str, ...] = ()  # modulo axes
    memory: int = 512  # kB free for a program; 0: it runs from a disk
    probe_input: int = 1  # that the probe is wired to, 1 or 2
    deflected: Literal["alarm", "ignore"] = "alarm"  # MEAS with a probe that is deflected: alarm, or a move without an edge
    status: bool = True  # $AC_MEA tells contact from none; else it is always 1
    mirrored: tuple[str, ...] = ()  # axes that a MIRROR before has left mirrored, until TRANS; SUPA suppresses that too
    basic: Mapping[str, float] = field(default_factory=dict)  # mm, basic frame: G500 and TRANS leave it, SUPA suppresses it
    drf: Mapping[str, float] = field(default_factory=dict)  # mm, of the handwheel: $AC_DRF shows it, SUPA suppresses it
    machine_axes: Mapping[str, str] = field(default_factory=dict)  # name of a machine axis that $VA_IM and $AA_MM want
    overlaid: Mapping[str, float] = field(default_factory=dict)  # mm, what no variable shows, suppressed by SUPA
    inches: bool = False  # the control's own units are inches, and positions come in them whatever G710 says
    supa_with_meas: bool = True  # SUPA acts in a block with MEAS; else that block moves in the work frame
    transformation: bool = False  # TRAORI is active from the start: SUPA does not undo it
    devices: tuple[str, ...] = ("/dev/ext/1", "/dev/v24")  # that EXTOPEN knows
    user: Mapping[str, int] = field(default_factory=dict)  # arrays of global user data (DEF NCK REAL …) and how many fields
    room: Decimal = Decimal("1000000")  # bytes of a file in the control (MD11420)


CONTROLS = Controls({"probe_input": "probe_input"})


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
        self._sent: dict[str, float] = {}  # deg: where rotary axes were sent, which is what $AA_IM says of them
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
        rotary = {name: math.degrees(value) for name, value in end.items() if name not in self._machine.linear}
        self._sent |= {name: angle % TURN if name in self._profile.rollover else angle for name, angle in rotary.items()}
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
        """$AA_IM (of a rotary axis where it was sent), $AA_IW, $AA_MM, $AA_MW, $VA_IM of an axis. Raises Alarm for any other."""
        named = self._profile.machine_axes
        if named and name in ("$VA_IM", "$AA_MM"):
            axis = next((letter for letter, own in named.items() if own == axis), "")
        if axis not in self._profile.axes:
            raise alarm("12550", f"{name}[{axis}]")
        if name == "$AC_DRF":
            return self._profile.drf.get(axis, 0.0)
        frame = self._frame(axis)
        table = {
            "$AA_IM": self._sent.get(axis, self._known[axis]),
            "$AA_IW": self._known[axis] - frame,
            "$AA_MM": self._read[axis],
            "$AA_MW": self._read[axis] - frame,
            "$VA_IM": self._known[axis],
        }
        if name not in table:
            raise alarm("12550", name)
        return table[name] / (INCH if self._profile.inches and axis in self._machine.linear else 1.0)

    def frame(self, axis: str, component: str) -> float:
        """$P_ACTFRAME[axis, component]: what is left of basic, settable and programmable frame. Raises Alarm for no component."""
        shift = self._profile.basic.get(axis, 0.0) + (self._profile.g54.get(axis, 0.0) if self.settable else 0.0)
        table = {"TR": shift, "FI": 0.0, "RT": 0.0, "SC": 1.0, "MI": float(axis in self.mirrored)}
        if axis not in self._profile.axes or component not in table:
            raise alarm("12550", f"$P_ACTFRAME[{axis},{component}]")
        return table[component]

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
        settable = self._profile.g54.get(name, 0.0) if self.settable else 0.0
        return (
            settable
            + self._profile.basic.get(name, 0.0)
            + self._profile.overlaid.get(name, 0.0)
            + self._profile.drf.get(name, 0.0)
            + self._length(name)
        )

    def _length(self, name: str) -> float:
        """Tool length, and under a transformation the point of the tool: here a shift that nobody expects."""
        return (self._profile.tool_lengths[self.tool] if name == "Z" and self.tool else 0.0) + (
            50.0 if self.transformation else 0.0
        )

    def _now(self) -> dict[str, float]:
        return shown(self._motion, self._profile.axes)
