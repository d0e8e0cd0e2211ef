"""The Macro-B family: G31 that says nothing when it misses, #506x, DPRNT. One `Words` table a dialect, the steps are shared.

Four pieces of macro text do everything near the table (`_macro_b_text.py`):

    1  protected move: G31 to X Y Z, alarm when it stops short
    2  measuring move: G31 from I J K to X Y Z; #110 = 1 contact, 0 none, 2 early; #111 … machine coordinates
    3  record of touch T, spindle at S
    4  rotary axes A B C have arrived

They stand in the program wherever they are needed (`macros: inline`: nothing to load, runs from memory and drip-fed), or once, as
O-programs before the main program (`macros: called`: a quarter of the size, but only from memory). Before, because controls
stop reading a file at M30 (3201#6): what stands there would be missing, or be somebody else's program of that number. A called
program says which set it belongs to (#121), and leaves the number of its set (#122), which is compared after each call.

All targets are machine coordinates. G31 lives in the work frame, so the constant difference of both is read once with the axes
at rest (#101 …) and taken off; each touch reads it again and stops when it has changed.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from tango_cnc.gate import TOUCH
from tango_cnc.records import InputError

from . import _common as common
from . import _macro_b_text as text
from ._alive import proving
from ._base import Job, Leg, Option, comment, is_endless, number
from ._macro_b_text import FLAG, FRAME, MISSES, Words

AXIS_NUMBERS = "number of each axis in #5021 #5041 #5061, e.g. {X: 1, Y: 2, Z: 3, B: 4, C: 5}; empty: in the order X Y Z A B C"
LENGTH = "the program stops if a tool length is on (#4008 is not 49), before it moves: G49 alone may move Z; false: no test"
MUST_BE_OFF = (
    "#40nn and the G code in it that ends the program at once: scaling, polar coordinates, mirror image; {}: nothing is asked"
)
PROBE_STATE = "number of the variable that is not 0 while the probe is deflected, e.g. 1004; none: G31 itself has to end at once"
STATES = (*range(1000, 1064), *range(11000, 11064))  # inputs; the latter on a Haas NGC
WANTED, RAN = 121, 122  # number of the set of macros: that of the program, that of the macro which has run last
MACROS = ("inline", "called")
POSITIONS = "what #5021 #5041 #5061 of X Y Z come in, whatever G21 says; inch: the program makes mm of them, records too"
ALARM = (
    "tidy: an alarm first jumps (GOTO) to blocks that switch the probe off and close the port; at once: it does not, for controls "
    "that refuse GOTO in a drip-fed program"
)
WAITING = "block behind which #5021 is read with the axes at rest: G53, G103 P1 with two empty blocks, or a builder's M word"
SKIPS = re.compile(r"G31(\.[1-4])?( P[1-9]\d?)?")
WAITS = re.compile(r"G53|G103 P1|G4 [PX]\d*\.\d*|M[1-9]\d{1,3}")
ROLLOVER = (
    "angles of 0 to 360 for rotary axes without limits (auto) or for all that can stand there (always); never: as planned; "
    "signed: as auto where the sign is the sense of the turn"
)

OPTIONS: tuple[Option, ...] = (
    Option("program_number", 7700, "O number of the program; macros take the next four", verified=True),
    Option("macros", "inline", "where the macro text stands: in every touch, or called, before the program", True, MACROS),
    Option("alarm", "tidy", ALARM, True, ("tidy", "at once")),
    Option("skip", "G31", "word of the move that the probe ends; G31 P1 where the control has several skip inputs", codes=True),
    Option("wait", "G53", WAITING, codes=True),
    Option(
        "reset", "G17 G40 G49 G69 G80 G90 G94 M5", "modal state besides G21; the control must know every word of it", codes=True
    ),
    Option("length_check", True, LENGTH),
    Option("must_be_off", {4011: 51, 4017: 16, 4022: 51.1}, MUST_BE_OFF),
    Option("probe_on", "", "words that switch the probe on, e.g. G65 P9832", codes=True),
    Option("probe_off", "", "words that switch the probe off, e.g. G65 P9833", codes=True),
    Option("probe_state", 0, PROBE_STATE, none=0, must=True),
    common.showing("#3006"),
    Option("orient", "M19 R", "word before the angle that orients the spindle; empty: the spindle is not turned", codes=True),
    Option("axis_numbers", {}, AXIS_NUMBERS),
    Option("position_unit", "mm", POSITIONS, True, ("mm", "inch")),
    Option("rollover", "auto", ROLLOVER, choices=("auto", "always", "never", "signed")),
    *common.clamping("M11", "M10"),
    Option("print_format", "44", "digits before and after the point of a printed coordinate", choices=("44", "43", "53")),
    Option("decimals", 3, "decimals of axis words: the least input increment", verified=True, choices=(3, 4)),
    Option("positioning_feed", 3000.0, "mm/min of protected moves", verified=True),
    common.TOLERANCE,
    common.MISSED,
)

AT_ONCE = "G31 ends at once when the probe is deflected"
SKIPS_SO = f"{AT_ONCE} and stores the end point in #506x when nothing is met"
READS_SO = "G31 and a block with G53 alone stop the control from reading ahead"
COMMON = (  # to the whole family; the other three are settled on some of it, and each post says on which
    "G53 G0 turns a rotary axis in machine coordinates",
    "#506x, #502x and #504x of axes at rest differ by constants, and come in millimetres after G21",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)
DOUBTS = (SKIPS_SO, READS_SO, *COMMON)


@dataclass(frozen=True)
class _Steps:
    """The steps of the family for the words of one dialect."""

    words: Words

    def stem(self, job: Job) -> str:
        return f"O{job.options['program_number']:0{self.words.o_digits}d}"

    def begin(self, job: Job) -> Iterator[str]:
        plan, machine = job.plan, job.machine
        _check(job, self.words)
        yield "%"
        if job.options["macros"] == "called":
            yield from self._programs(job)
        yield f"{self.stem(job)}(TANGO {comment(machine.name, 40)})"
        yield f"(PROGRAM {job.mark} PLAN {job.plan_mark})"
        for remark in common.counted(job):
            yield f"({remark})"
        yield "(START WITH THE PROBE IN THE SPINDLE SWITCHED ON AND CLEAR OF THE TABLE)"
        for remark in (*common.AFTER, *common.kept_in_mind(job), *_left_on(job, self.words)):
            yield f"({remark})"
        for remark in common.doubted(job, 80):
            yield f"({remark})"
        if job.options["length_check"]:
            yield f"IF[#4008NE49]THEN{self.words.stop(4, 'CANCEL TOOL LENGTH FIRST')}"
        for group, code in job.options["must_be_off"].items():
            yield f"IF[#{group}EQ{code:g}]THEN{self.words.stop(5, f'CANCEL G{code:g} FIRST')}"
        yield from self.words.tried(job)
        yield from ("G21", job.options["reset"])  # Fanuc wants G21 in a block of its own
        yield "(MACHINE MINUS WORK COORDINATES)"
        yield from text.waited(job)
        for name, axis in common.axis_numbers(job).items():
            yield f"#{FRAME + axis}={text.at(job, 5020, name, axis)}-{text.at(job, 5040, name, axis)}({name})"
        yield f"#{MISSES}=0"
        if job.options["macros"] == "called":
            yield f"#{WANTED}={self._set(job)}"
        yield from self.words.open
        yield f"#{FLAG}={len(plan.touches)}"
        yield f"DPRNT[TANGO*START*{job.mark}*#{FLAG}[60]]"

    def retract(self, job: Job, leg: Leg) -> Iterator[str]:
        if not leg.came:  # nothing has moved yet
            yield from text.stepped(job, self.words)
        yield "(NEAR)" if leg.kind == "near" else "(UP)"
        yield from self._protected(job, leg)

    def clear(self, job: Job, leg: Leg) -> Iterator[str]:
        yield "(OVER)"
        yield from self._protected(job, leg)

    def approach(self, job: Job, leg: Leg) -> Iterator[str]:
        label = f"N{leg.touch.number}" if leg.touch.number < text.TRIED else ""  # from there on are the ways out
        yield f"{label}(TOUCH {leg.touch.number} FACET {comment(leg.touch.facet, 20)})"
        yield from self._protected(job, leg)

    def _protected(self, job: Job, leg: Leg) -> Iterator[str]:
        values = common.words(job, leg.to)
        yield from self._macro(job, 1, values | {"F": number(job.options["positioning_feed"])})

    def index(self, job: Job, leg: Leg) -> Iterator[str]:
        options = job.options
        yield f"({common.indexed(leg)})"
        if "S" in leg.target and options["orient"]:
            yield f"{options['orient']}{common.spindle(job, leg.target['S'])}"
        turned = {}
        for name in job.machine.rotary:
            if name in leg.target:
                turned[name] = common.angle(job, name, leg.target[name])
                yield from common.unclamped(job, name, f"G90 G53 G0 {name}{_signed(job, leg, name, turned[name])}")
        if turned:
            yield from self._macro(job, 4, turned)

    def probe(self, job: Job, leg: Leg) -> Iterator[str]:
        yield from self._measured(job, leg, job.plan.strategy.approach.feed)
        yield self._off(job, leg)

    def _off(self, job: Job, leg: Leg) -> str:
        numbers = common.axis_numbers(job)
        off = {
            name: f"[{text.at(job, 5020, name, numbers[name])}{step}-#{FRAME + numbers[name]}]"
            for name, step in common.off(job, leg).items()
        }
        return f"G1 {' '.join(name + value for name, value in off.items())} F{number(job.options['positioning_feed'])}(OFF)"

    def _measured(self, job: Job, leg: Leg, feed: float) -> Iterator[str]:
        start = common.standoff(job, leg)
        values = common.words(job, leg.to) | dict(zip("IJK", common.words(job, start).values(), strict=True))
        yield from self._macro(job, 2, values | {"F": number(feed)})

    def gate(self, job: Job, leg: Leg) -> Iterator[str]:
        proof = proving(job)
        if common.stops_for(job, leg):
            yield f"#3006=1({TOUCH})"
        yield self.words.shown.format(common.proves(job, leg))
        yield from self._measured(job if job.options["macros"] == "called" else proof, leg, proof.plan.strategy.approach.feed)
        yield self.words.unless(job, f"#{FLAG}EQ0", text.UNPROVEN)
        if leg.kind == "prove":
            yield self._off(job, leg)
            return
        yield self.words.shown.format(common.LETTING_GO)
        yield self.words.dwell.format(common.RELEASE)
        yield from self._protected(job, replace(leg, to=leg.came))

    def back(self, job: Job, leg: Leg) -> Iterator[str]:
        yield "(BACK)"
        yield from self._protected(job, leg)

    def record(self, job: Job, leg: Leg) -> Iterator[str]:
        yield from self._macro(job, 3, {"T": number(leg.touch.number), "S": common.spindle(job, leg.to["S"])})

    def end(self, job: Job) -> Iterator[str]:
        yield f"#{FLAG}={len(job.plan.touches)}"
        yield f"DPRNT[TANGO*END*{job.mark}*#{FLAG}[60]]"
        yield from self.words.close
        yield from self.words.ways_out(job, numbers_of_stops(job, self.words))
        yield self.words.end
        yield "%"

    def _programs(self, job: Job) -> Iterator[str]:
        """The pieces as O-programs: each refuses a main program of another set, and leaves the number of its own."""
        own = self._set(job)
        for which, (title, piece) in enumerate(text.PIECES, 1):
            yield f"O{job.options['program_number'] + which:0{self.words.o_digits}d}({title})"
            lines = [self.words.unless(job, f"#{WANTED}NE{own}", 8), *piece(job, self.words, None)]
            yield from lines
            yield f"#{RAN}={own}"
            jumps = [n for n in text.STOPS if any(line.endswith(f"]GOTO{text.OUT + n}") for line in lines)]
            yield from self.words.ways_out(job, jumps)
            yield "M99"

    def _set(self, job: Job) -> int:
        """→ number of the set of macros of this job, whatever feed and distances a step has."""
        lines = [*(line for _, piece in text.PIECES for line in piece(job, self.words, None)), *self.words.tidies(job)]
        whole = "\n".join(lines)
        return int(hashlib.sha256(whole.encode()).hexdigest(), 16) % 900_000 + 100_000

    def _macro(self, job: Job, which: int, arguments: Mapping[str, str]) -> Iterator[str]:
        """number of a piece, {letter: number as text} → its call, or its lines."""
        if job.options["macros"] == "called":
            yield f"#{RAN}=0"
            yield f"G65 P{job.options['program_number'] + which} {common.joined(arguments)}"
            yield self.words.unless(job, f"#{RAN}NE{self._set(job)}", 9)
        else:
            yield from text.PIECES[which - 1][1](job, self.words, arguments)


def steps(words: Words) -> dict[str, Any]:
    """words of a dialect → the steps of its post."""
    family = _Steps(words)
    on, off = common.switches("(%s)", words.settle)
    return {
        "stem": family.stem,
        "begin": family.begin,
        "probe_on": on,
        "retract": family.retract,
        "clear": family.clear,
        "index": family.index,
        "approach": family.approach,
        "probe": family.probe,
        "record": family.record,
        "back": family.back,
        "probe_off": off,
        "end": family.end,
        "gate": family.gate,
    }


def numbers_of_stops(job: Job, words: Words) -> list[int]:
    """job, words of its dialect → numbers of the stops that its main program may jump to."""
    called = job.options["macros"] == "called"
    asked = [6] if job.options["probe_state"] and not words.look else []
    proven = [] if job.options.get("gate") == "none" else [text.UNPROVEN]
    return sorted([0, *([9] if called else [1, 2, 3]), *asked, *proven, 10, 11])


def _left_on(job: Job, words: Words) -> Iterator[str]:
    """What is left as it is by an alarm of the control itself, and by one of ours in a program that cannot jump to a tidy end."""
    by = "A RESET" if words.tidies(job) else "A STOP"
    if job.options["probe_off"]:
        yield f"{by} LEAVES THE PROBE ON - {job.options['probe_off']} IN MDI SWITCHES IT OFF"
    for close in words.close:
        yield f"{by} LEAVES THE PORT OPEN - {close} IN MDI CLOSES IT"


def _check(job: Job, words: Words) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    common.fits(job, most=8)
    approach = job.plan.strategy.approach
    feeds = {"controller.positioning_feed": job.options["positioning_feed"], "strategy.yaml: approach.feed": approach.feed}
    if approach.find is not None:
        feeds["strategy.yaml: approach.find.feed"] = approach.find.feed
    for where, feed in feeds.items():
        if feed > words.fastest:
            raise InputError(f"{where}: found {feed:g} mm/min; allowed: at most {words.fastest:g} for a G31 of this control")
    for group, code in job.options["must_be_off"].items():
        known = isinstance(code, int | float) and not isinstance(code, bool) and 0 <= code < 1000
        if group not in range(4001, 4023) or not known:
            raise InputError(f"controller.must_be_off: found {group!r}: {code!r}; allowed: 4001 … 4022 and a G code, e.g. 4011: 51")
    if not words.look and job.options["probe_state"] not in (0, *STATES):
        raise InputError(f"controller.probe_state: found {job.options['probe_state']}; allowed: none, 1000 … 1063, 11000 … 11063")
    for key, pattern, allowed in (
        ("skip", SKIPS, "G31, G31.1 to G31.4, or G31 with P, e.g. G31 P1"),
        ("wait", WAITS, "G53, G103 P1, a dwell such as G4 P0.1, or an M word"),
    ):
        if not pattern.fullmatch(job.options[key]):
            raise InputError(f"controller.{key}: found {job.options[key]!r}; allowed: {allowed}")
    if not 1 <= job.options["program_number"] <= 9995:
        raise InputError(f"controller.program_number: found {job.options['program_number']}; allowed: 1 … 9995")


def _signed(job: Job, leg: Leg, name: str, value: str) -> str:
    """0 … 360 as text → with the sign of the turn that the plan has in mind, where the control wants it (1008#1 RAB; 0 is 360)."""
    change = math.remainder(leg.target[name] - leg.came.get(name, leg.target[name]), math.tau)
    if job.options["rollover"] != "signed" or not is_endless(job.machine, name) or change >= 0:
        return value
    return "-360." if value == "0." else f"-{value}"
