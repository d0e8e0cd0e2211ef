"""Mach3: its G-code knows no conditions, so everything that moves is in macros of Basic that travel with the program.

Using Mach3Mill (G31, #2000 to #2005, M codes of one's own as mNNN.m1s in the macros folder of the profile) and public probing
macros, which look, wait and compare in the same way. The program states targets in variables and calls; all motion is in the
macros, because Mach3 skips an M code that has none: without them nothing moves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from tango_cnc.gate import STEP, STEP_FEED, step
from tango_cnc.records import InputError

from . import _common as common
from . import _mach3_macros as basic
from ._alive import proving
from ._base import Job, Leg, Option, Post, early_distance, number
from ._remedies import MACH3

CALLS = re.compile(rf"M({'|'.join(map(str, range(basic.START, basic.STEPS + 1)))})\b")
FILE = re.compile(r"[A-Z]:\\(?:[A-Za-z0-9_ -]{1,40}\\){0,6}[A-Za-z0-9_-]{1,40}\.[a-z]{1,4}")

OPTIONS = (
    Option(
        "readings",
        "C:\\Mach3\\tango-readings.txt",
        "file of the records on the control's disk; the macros add to it",
        verified=True,
    ),
    Option(
        "reset", "G15 G17 G21 G40 G49 G50 G69 G80 G90 G94 M5", "modal state; the control must know every word of it", codes=True
    ),
    *common.PROBE_SWITCHES,
    Option(
        "orient",
        "M19 R",
        "word before the angle that orients the spindle: a macro of your own; empty: it is not turned",
        codes=True,
    ),
    common.ROLLOVER,
    *common.clamping("M811", "M810"),
    Option("positioning_feed", 1500.0, "mm/min of protected moves", verified=True),
    common.TOLERANCE,
    common.MISSED,
)
DOUBTS = (
    "G31 moves X Y Z at once and stores #2000 #2001 #2002 in work coordinates, which some motion boards do not",
    "a macro is done before the next line of the program is carried out",
    "GetOEMDRO 83 to 88 are machine and 800 to 805 work positions in millimetres, GetOEMLED 825 the probe",
    "DoOEMButton 1003 stops the program",
    "Format writes a decimal point",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)


def begin(job: Job) -> Iterator[str]:
    """Header, modal reset, what the macros have to know."""
    plan, options = job.plan, job.options
    _check(job)
    yield from common.titled(job, "(%s)")
    needs = f"NEEDS ITS MACROS M{basic.START} TO M{basic.STEPS} IN THE MACROS FOLDER OF THE PROFILE"
    yield from common.warned(job, "(%s)", needs, "RECORDS END WITH THEIR CHECK SUM K")
    yield options["reset"]
    yield f"#{basic.EARLY}={number(early_distance(plan))}"
    yield f"#{basic.TOLERANCE}={number(options['tolerance'])}"
    yield f"#{basic.MISSES}={options['misses']}"
    yield f"#{basic.SET}={basic.set_number(job.machine, options['readings'], options['probe_off'])}"
    yield f"#{basic.DONE}=0"


switched_on, probe_off = common.switches("(%s)")


def probe_on(job: Job) -> Iterator[str]:
    """The words of the profile, then the start: a stop is acted on some lines later, and these must not be among them."""
    yield from switched_on(job)
    yield f"M{basic.START} (TANGO START {job.mark} {len(job.plan.touches)})"


def move(job: Job, leg: Leg) -> Iterator[str]:
    """A protected move by its macro. Raises InputError for a way that is too short for a G31."""
    way = [leg.to[name] - leg.came[name] for name in "XYZ" if name in leg.came]
    if leg.kind in ("retract", "clear") and len(way) == 3 and math.hypot(*way) < basic.SHORTEST:
        raise InputError(
            f"mach3: found a way of {math.hypot(*way):.3f} mm before touch {leg.touch.number}; "
            f"allowed: {basic.SHORTEST:g} mm or more, as G31 of Mach3 takes none so short. Let strategy.yaml begin with another "
            "indexation"
        )
    yield _three(basic.TARGET, leg.to)
    yield " ".join(f"#{basic.MOVES + i}={int(name in leg.target)}" for i, name in enumerate("XYZ"))
    yield f"#{basic.FEED}={number(job.options['positioning_feed'])}"
    yield f"M{basic.PROTECTED}"


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """Up along the tool; before the first one a step that shows whether positions come in mm."""
    if not leg.came:
        axis, by = step(job.plan)
        yield f"(A STEP OF {number(STEP)} MM SHOWS WHETHER POSITIONS COME IN MM)"
        yield _three(basic.TARGET, {name: by * (name == axis) for name in "XYZ"})
        yield f"#{basic.FEED}={number(STEP_FEED)}"
        yield f"M{basic.STEPS}"
    yield from move(job, leg)


clear = back = move
approach = common.approaching("(%s)", move)


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other by its macro."""
    yield f"({common.indexed(leg)})"
    if "S" in leg.target and job.options["orient"]:
        yield f"{job.options['orient']}{common.spindle(job, leg.target['S'])}"
    for name in job.machine.rotary:
        if name in leg.target:
            yield f"#{basic.ANGLE}={common.angle(job, name, leg.target[name])}"
            yield from common.unclamped(job, name, f"M{basic.TURN} P{basic.PLACE[name] + 1}")


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move by its macro, off the facet by another."""
    yield from _measured(job, leg)
    yield f"#{basic.FEED}={number(job.options['positioning_feed'])}"
    yield f"M{basic.FREE}"


def _measured(job: Job, leg: Leg) -> Iterator[str]:
    start = common.standoff(job, leg)
    yield _three(basic.TARGET, leg.to)
    yield _three(basic.STANDOFF, start)
    yield f"#{basic.FEED}={number(job.plan.strategy.approach.feed)}"
    yield f"M{basic.MEASURE}"


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back; the first miss stops here."""
    yield f"(MSG,{common.proves(job, leg)})"
    yield f"#{basic.MISSES}=1"
    yield from _measured(proving(job), leg)
    yield f"#{basic.MISSES}={job.options['misses']}"
    if leg.kind == "prove":
        yield f"#{basic.FEED}={number(job.options['positioning_feed'])}"
        yield f"M{basic.FREE}"
        return
    yield f"(MSG,{common.LETTING_GO})"
    yield f"G4 P{common.RELEASE}"
    yield from move(job, replace(leg, to=leg.came))


def record(job: Job, leg: Leg) -> Iterator[str]:
    """The line of the touch by its macro."""
    yield f"#{basic.SPINDLE}={common.spindle(job, leg.to['S'])}"
    yield f"M{basic.RECORD} P{leg.touch.number}"


def end(job: Job) -> Iterator[str]:
    """End mark and end of program."""
    yield f"M{basic.END} (TANGO END {job.mark} {len(job.plan.touches)})"
    yield "M30"


def counted(lines: Iterator[str]) -> Iterator[str]:
    """lines → the same; every call of a macro says how many there are with it, so that none is lost without a stop."""
    calls = 0
    for line in lines:
        if CALLS.match(line):
            calls += 1
            yield f"#{basic.CALL}={calls}"
        yield line


def _three(first: int, place: Mapping[str, float]) -> str:
    return " ".join(f"#{first + i}={number(place[name])}" for i, name in enumerate("XYZ") if name in place)


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    if not FILE.fullmatch(job.options["readings"]):
        raise InputError(
            f"controller.readings: found {job.options['readings']!r}; allowed: a path such as {OPTIONS[0].default}, "
            "of letters, digits, blanks, _ and -"
        )
    common.fits(job)
    common.spares(job, basic.START, basic.STEPS)


POST = Post(
    title="Mach3",
    extension="tap",
    language="mach3",
    links=("file", "remote", "modbus"),
    options=OPTIONS,
    remedies=MACH3,
    doubts=DOUBTS,
    stem=lambda job: "tango",
    link="file",
    finish=counted,
    companions=lambda job: basic.macros(job.machine, job.options["readings"], job.options["probe_off"]),
    **common.steps(globals()),
)
