"""A TNC-like control that runs Klartext, with its habits: system data are as old as the last FN 20, TCH PROBE 4 goes on with −1
when it meets nothing, the frame and the basic rotation turn, mirror and scale its direction, a deflected stylus is an error before
a probing move and in every other one, rotary axes go round the long way without M126, FN 16 prints nothing without its mask. The
texts of TCH PROBE and of the mask are unconfirmed, here as in the post."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from tango_cnc.records import InputError, Machine

from ...motion import Motion, MotionStop, Note
from .._shared.alarm import Silence
from .._shared.known import Controls, Shown
from .._shared.scales import TURN, commanded, endless, nearer, roll, shown
from . import cycle_444
from .expressions import error, formula, number, text_of
from .frame import Frame
from .printing import printed
from .program import bare, blocks_of, labels_of, place_of

__all__ = ["CONTROLS", "Control", "Profile", "default_profile"]

DEEPEST = 8  # subprograms in each other
COMPARE: dict[str, Callable[[float, float], bool]] = {
    "EQU": lambda a, b: a == b,
    "NE": lambda a, b: a != b,
    "GT": lambda a, b: a > b,
    "LT": lambda a, b: a < b,
}
CONDITION = {9: "EQU", 10: "NE", 11: "GT", 12: "LT"}
WITHOUT_EFFECT = (
    *("PLANE RESET STAY", "FUNCTION RESET TCPM"),
    *("CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 10.0 ROTATION", "CYCL DEF 11.0 SCALING"),
    "CYCL DEF 13.0 ORIENTATION",
    "CYCL DEF 9.0 DWELL TIME",
)
CYCLE = re.compile(r"CYCL DEF (7\.[123] [XYZ]\S+|8\.1(?: [XYZ])*|10\.1 ROT\S+|11\.1 SCL ?\S+|13\.1 ANGLE\S+|9\.1 DWELL \S+)")
PROBE = (
    r"4\.0 MEASURING IN 3-D",
    r"4\.1 Q(?P<result>\d+)",
    r"4\.2 IX(?P<x>\S+) IY(?P<y>\S+) IZ(?P<z>\S+)",
    r"4\.3 (?:DIST|ABST)(?P<distance>\S+) F(?P<feed>\S+) MB(?P<back>\S+) REFERENCE SYSTEM: (?P<system>[01])",
)


@dataclass(frozen=True)
class Profile:
    """What differs between machines with this control; every default is a guess that a real machine may refute."""

    axes: tuple[str, ...]
    numbered: str = "XYZABC"  # which axis the system data call 1, 2, 3 …
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg, the datum
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # of the tool in the spindle, number 1
    rotation: Mapping[str, float] = field(
        default_factory=dict
    )  # {C: deg}: basic rotation in the plane, which cycle 10 does not undo
    mirrored: tuple[str, ...] = ()  # axes that a program before has left mirrored
    scale: float = 1.0  # that a program before has left active
    axis_scale: Mapping[str, float] = field(default_factory=dict)  # the same of cycle 26, which cycle 11 does not undo
    rollover: tuple[str, ...] = ()  # rotary axes whose scale begins anew after a turn
    no_contact: Literal["silent", "error", "contact"] = "silent"  # TCH PROBE 4 that meets nothing
    probe_table: Mapping[str, float] = field(default_factory=dict)  # what differs from TABLE in the row of the probe
    calibration: Mapping[str, float] = field(default_factory=dict)  # {X Y Z: mm} from the spindle to the ball, for cycle 444
    length_ends: Literal["pole", "centre"] = "pole"  # where on the ball the tool length ends, and so what ID270 tells
    # Which touches leave their place in Q115 Q116 Q117: every one; not cycle 444; that one as calibrated; none, and no program can.
    q115: Literal["every", "first", "corrected", "locked"] = "every"

    def __post_init__(self) -> None:
        if unknown := sorted(set(self.probe_table) - set(cycle_444.TABLE)):
            raise InputError(f"--set probe_table: found {', '.join(unknown)}; allowed: {', '.join(cycle_444.TABLE)}")


CONTROLS = Controls(
    shown_by={"axis_numbers": Shown(("numbered",), "FN 18: SYSREAD, ID240: which axis IDX1 is, which one IDX2 …")},
    beside=re.compile(r"[^\\/]+\.A"),
)


def default_profile(machine: Machine) -> Profile:
    """machine → profile with its axes; those that turn more than two turns begin anew after one."""
    return Profile((*machine.linear, *machine.rotary), rollover=endless(machine))


class Control:
    """The control from switching on to switching off. `library` holds files: a line with a path begins one."""

    def __init__(
        self, motion: Motion, profile: Profile, punch: Callable[[bytes], None], note: Note, library: Iterable[str] = ()
    ) -> None:
        self._motion, self._profile, self._punch, self._note = motion, profile, punch, note
        self._machine = motion.machine
        self._files: dict[str, list[str]] = {}
        name = ""
        for line in library:
            if line.startswith("TNC:\\"):
                name = line
            self._files.setdefault(name, []).extend([] if line == name else [line])
        self._values: dict[int, float] = {}
        self._texts: dict[int, str] = {}
        self._known = self._now()
        self._nominal: dict[str, float] = {}
        self._feed, self._short_way, self._angle = 0.0, False, 0.0
        self._frame = Frame(mirrored=set(profile.mirrored), scale=profile.scale, own=dict(profile.axis_scale))

    def run(self, lines: Iterable[str], streamed: bool) -> None:
        """lines of one program, which is stored before it is executed. Raises Alarm and Silence."""
        blocks = blocks_of(lines)
        labels = labels_of(blocks)
        self._values, self._texts, self._feed, self._short_way = dict.fromkeys((115, 116, 117), 0.0), {}, 0.0, False
        returns: list[int] = []
        index = 1
        try:
            while not blocks[index].startswith("END PGM"):
                block = blocks[index]
                self._note("block", program="PGM", line=index, text=block)
                self._motion.reads(block)
                if re.match(r"(M30|M0?2)\b", block):
                    return
                index = self._execute(blocks, labels, returns, index)
        except MotionStop as stop:
            raise _as_error(stop) from None

    def _execute(self, blocks: list[str], labels: Mapping[str, int], returns: list[int], index: int) -> int:
        """Executes one block; → index of the next one."""
        block = bare(blocks[index])
        if match := re.fullmatch(r"FN (\d+): IF (\S+) ([A-Z]+) (\S+) GOTO LBL (\d+)", block):
            compare = match[3]
            if CONDITION.get(int(match[1])) != compare:
                raise error("NC BLOCK FAULTY", block)
            if COMPARE[str(compare)](number(match[2], self._values), number(match[4], self._values)):
                return place_of(labels, match[5])
        elif match := re.fullmatch(r"CALL LBL (\d+)", block):
            if len(returns) >= DEEPEST:
                raise error("TOO MANY SUBPROGRAMS", block)
            returns.append(index + 1)
            return place_of(labels, match[1])
        elif block == "LBL 0":
            if returns:
                return returns.pop()
        elif block.startswith("TCH PROBE 444"):
            self._cycle_444(block)
        elif block.startswith("TCH PROBE"):
            self._probe(blocks, index)
            return index + len(PROBE)
        elif block and not re.fullmatch(r"LBL \d+", block):
            self._statement(block, blocks[index])
        return index + 1

    def _statement(self, block: str, raw: str) -> None:
        if match := re.fullmatch(r"Q(\d+) = (.+)", block):
            if not (self._profile.q115 == "locked" and match[1] in ("115", "116", "117")):
                self._values[int(match[1])] = formula(match[2], self._values)
        elif match := re.fullmatch(r'DECLARE STRING QS(\d+) = "([^"]{0,255})"', block):
            self._texts[int(match[1])] = match[2]
        elif match := re.fullmatch(r"QS(\d+) = (.+)", block):
            self._texts[int(match[1])] = text_of(match[2], self._values, self._texts)
        elif match := re.fullmatch(r"FN 18: SYSREAD Q(\d+) = ID(\d+) NR(\d+)(?: IDX(\d+))?", block):
            self._values[int(match[1])] = self._system(int(match[2]), int(match[3]), int(match[4] or 0))
        elif match := re.fullmatch(r"FN 16: F-PRINT (\S+) / (\S+)", block):
            self._print(match[1], match[2])
        elif block == "FN 20: WAIT FOR SYNC":
            self._known = self._now()
        elif block.startswith("L "):
            self._line(block)
        elif match := CYCLE.fullmatch(block):
            self._cycle(match[1])
        elif block == "M19":
            self._motion.rapid({"S": math.radians(self._angle % TURN)})
        elif block in ("STOP", "M0"):
            self._known = self._now()
            self._note("stop", why="STOP", message=raw.partition(";")[2].strip())
        elif block in ("M126", "M127"):
            self._short_way = block == "M126"
        elif re.fullmatch(r"M\d+( M\d+)*", block):
            self._note("m", code=block)
        elif block not in WITHOUT_EFFECT:
            raise error("NC BLOCK FAULTY", block)

    def _cycle(self, words: str) -> None:
        """`7.1 X+0`, `8.1 X Y`, `10.1 ROT+0`, `11.1 SCL 1`, `13.1 ANGLE+5`: what the cycle says is so from now on."""
        which, *rest = words.split()
        if which == "8.1":
            self._frame.mirrored = set(rest)
            return
        match = re.fullmatch(r"([A-Z]+?)([+-]?[\dQ].*)", "".join(rest))
        if match is None:
            raise error("NC BLOCK FAULTY", words)
        value = number(match[2], self._values)
        if which == "9.1":
            self._motion.dwell(value)
            return
        if which.startswith("7."):
            self._frame.shift[match[1]] = value
        elif which == "10.1":
            self._frame.turned = value
        elif which == "11.1":
            self._frame.scale = value
        else:
            self._angle = value

    def _line(self, block: str) -> None:
        targets, rapid, machine = {}, False, False
        for word in block.split()[1:]:
            if word == "FMAX":
                rapid = True
            elif match := re.fullmatch(r"F(\d+\.?\d*)", word):
                self._feed = float(match[1])
            elif word == "M91":
                machine = True
            elif match := re.fullmatch(r"([A-Z])([+-].+)", word):
                if match[1] not in self._profile.axes:
                    raise error("AXIS NOT THERE", block)
                targets[match[1]] = number(match[2], self._values)
            elif word != "R0":
                raise error("NC BLOCK FAULTY", block)
        now = self._now()
        end = {}
        for name, value in targets.items():
            goal = value if machine else self._frame.place(name, value) + self._datum(name)
            end[name] = self._turned(name, goal, now[name])
        self._nominal |= end
        if rapid:
            self._motion.rapid(commanded(self._motion, end))
        elif self._feed <= 0:
            raise error("FEED RATE IS MISSING", block)
        else:
            self._motion.feed(commanded(self._motion, end), self._feed)
        roll(self._motion, self._profile.rollover)

    def _probe(self, blocks: list[str], index: int) -> None:
        """TCH PROBE 4.0 … 4.3: along a direction, results in four parameters."""
        found: dict[str, str] = {}
        for block, pattern in zip(blocks[index:], PROBE, strict=False):
            match = re.fullmatch(f"TCH PROBE {pattern}", bare(block))
            if match is None:
                raise error("NC BLOCK FAULTY", block)
            found |= match.groupdict()
        if self._motion.deflected:
            raise error("TOUCH PROBE IS DEFLECTED", blocks[index])
        value = {key: number(text, self._values) for key, text in found.items()}
        wanted = {name: value[name.lower()] for name in "XYZ"}
        size = math.hypot(*wanted.values())
        if size == 0 or value["feed"] <= 0 or value["distance"] <= 0:
            raise error("PROBING DIRECTION OR DISTANCE FAULTY", blocks[index])
        start = self._now()
        way = self._frame.along({name: w / size for name, w in wanted.items()}, self._profile.rotation.get("C", 0.0))
        end = {name: start[name] + value["distance"] * w for name, w in way.items()}
        self._nominal |= end
        skip = self._motion.skip(end, value["feed"])
        result = int(value["result"])
        if not skip.hit:
            if self._profile.no_contact == "error":
                raise error("TOUCH POINT INACCESSIBLE", blocks[index])
            self._values[result + 3] = 0.0 if self._profile.no_contact == "contact" else -1.0
            return
        place, stopped = shown(self._motion, self._profile.axes, skip.position), self._now()
        gone = math.dist([stopped[name] for name in way], [start[name] for name in way]) / math.hypot(*way.values())
        back = min(value["back"], gone)
        if back > 0:
            self._motion.feed({name: stopped[name] - back * w for name, w in way.items()}, 1000.0)
        for i, name in enumerate("XYZ"):
            self._values[result + i] = place[name] - (0.0 if value["system"] else self._datum(name))
        self._values[result + 3] = 0.0
        if self._profile.q115 != "locked":
            self._contact_at(place)

    def _cycle_444(self, block: str) -> None:
        """To its place before the point by way of the clearance height, then DIST towards it, and back to that place."""
        asked, table = cycle_444.asked(block, self._values), self._table()
        if self._frame.mirrored or self._frame.scale != 1 or {*self._frame.own.values()} - {1.0}:
            raise error("CYCLE NOT ALLOWED WITH MIRROR IMAGE OR SCALING", block)
        if self._motion.deflected:
            raise error("TOUCH PROBE IS DEFLECTED", block)
        place = cycle_444.contact(asked, table, self._motion, self._profile.axes, self._ball)
        zero = self._ball(dict.fromkeys("XYZ", 0.0))
        ball = {name: place[name] - zero[name] + self._profile.calibration.get(name, 0.0) for name in "XYZ"}
        self._values |= cycle_444.results(asked, table["R"], ball)
        if self._profile.q115 == "every":
            self._contact_at(place)
        elif self._profile.q115 == "corrected":
            self._contact_at({name: place[name] + self._profile.calibration.get(name, 0.0) for name in "XYZ"})

    def _table(self) -> dict[str, float]:
        return {**cycle_444.TABLE, **self._profile.probe_table}

    def _ball(self, place: Mapping[str, float]) -> dict[str, float]:
        """{axis: mm} of the ball centre in the program → of the axes: the tool length may end one radius below it."""
        up = self._table()["R"] if self._profile.length_ends == "pole" else 0.0
        at = {name: self._frame.place(name, value) + self._datum(name) for name, value in place.items()}
        return {name: value - (up if name == "Z" else 0.0) for name, value in at.items()}

    def _contact_at(self, place: Mapping[str, float]) -> None:
        """Q115 Q116 Q117: the axes at the contact from the datum, without radius and length of the stylus."""
        self._values |= {115 + i: place[name] - self._profile.g54.get(name, 0.0) for i, name in enumerate("XYZ")}

    def _system(self, group: int, which: int, axis: int) -> float:
        if group == 350 and (which, axis) in cycle_444.SYSTEM:
            return self._table()[cycle_444.SYSTEM[which, axis]]
        if group == 210 and which == 3:  # bits of the axes of cycle 8
            return float(sum(1 << "XYZ".index(name) for name in self._frame.mirrored))
        if group == 210 and which == 4 and 1 <= axis <= 3:  # the factor of an axis, of cycles 11 and 26
            return self._frame.scale * self._frame.own.get("XYZ"[axis - 1], 1.0)
        known = which == 1 or (group == 240 and which == 8)
        if group not in (240, 270) or not known or self._profile.numbered[axis - 1 : axis] not in self._profile.axes:
            raise error("SYSTEM DATUM NOT THERE", f"ID{group} NR{which} IDX{axis}")
        name = self._profile.numbered[axis - 1]
        if group == 240 and which == 1:  # iTNC 530 technical manual 7/2013 p. 1731: where the axis was told to go
            return {**self._known, **self._nominal}[name]
        return self._known[name] - (self._datum(name) if group == 270 else 0.0)

    def _print(self, mask: str, output: str) -> None:
        """One FN 16: the mask says what is printed; lines end with CR LF."""
        if mask not in self._files:
            raise error("FILE NOT FOUND", mask)
        for text in printed(self._files[mask], self._texts):
            self._files.setdefault(output, []).append(text)
            self._note("output", text=text)
            self._punch(text.encode("ascii", "replace") + b"\r\n")

    def _turned(self, name: str, goal: float, now: float) -> float:
        """→ where a rotary axis goes to: under M126 the short way, else as far as the figures say."""
        if name not in self._profile.rollover or not self._short_way:
            return goal
        return nearer(goal, now)

    def _datum(self, name: str) -> float:
        return self._profile.g54.get(name, 0.0) + (self._profile.tool_lengths[1] if name == "Z" else 0.0)

    def _now(self) -> dict[str, float]:
        return shown(self._motion, self._profile.axes)


def _as_error(stop: MotionStop) -> Exception:
    if stop.cause == "overtravel":
        return error("LIMIT SWITCH", f"{stop.axis}{'+' if stop.sign > 0 else '-'}: {stop}")
    if stop.cause == "collision":
        return error("TOUCH PROBE IS DEFLECTED", str(stop))
    return Silence() if str(stop) == "silence" else error("MACHINE ALARM", str(stop))
