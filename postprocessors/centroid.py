"""Centroid CNC11 and CNC12: protected moves of the control's own (M125), M115 with L1 for touches, M223 into a file.

M-Series operator's manual (M115 … M126, M120, M121, M223, M225, G53, formatted strings) and the macros that Centroid ships, which
use #9011 as P, #24301 … for the place of the contact and #25022 for whether there was one. M225 with a variable of 0 shows its text
until cycle start, with more for that many seconds: so in macros of Centroid and of builders. A program ends with its last line:
M2 and M30 send Z home and start again.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from tango_cnc.gate import INCH, MIRRORED, STEP, STEP_FEED, step
from tango_cnc.records import InputError

from . import _common as common
from ._alive import proving
from ._base import Job, Leg, Option, Post, early_distance, number
from ._remedies import CENTROID

FRAME, PLACE, FAR = 29100, 29110, 29130  # #29101 … machine minus work; #29111 … of the touch; #29131 … from the stand-off
FLAG, MISSES, SUM, SPINDLE, TOUCH, SECONDS = 29110, 29109, 29118, 29119, 29120, 29121
BIT, ON, FROM, SHOWN = 29122, 29123, 29124, 29125
WAIT = "IF #50010"  # reading an input stops the look-ahead
TRIPPED = "#25022"
ARRIVED = 0.000087  # sine of half of 0.01 deg
READ = 4  # s that a text stands on the screen
OLD = 1.0  # mm between the place of a contact and where the axes have stopped
LAST = 9999
STOPS = (
    "PROBE MET SOMETHING ON ITS WAY OR UNITS ARE NOT MM",
    "PLACE OF THE CONTACT IS AN OLD ONE",
    "NO CONTACT. IS THE PROBE ALIVE",
    "PROBE IS DEFLECTED",
    "ROTARY AXIS NOT IN PLACE",
    common.UNTOUCHED,
    "POSITIONS ARE IN INCHES",
    MIRRORED,
    common.IN_THE_AIR,
)
ON_THE_WAY, OLD_PLACE, DEAD, DEFLECTED, NOT_THERE, UNTOUCHED, INCHES, OTHERWISE, UNMET = range(9001, 9010)
OUTPUT = r"\AM9[45] ?/\d{1,3}\Z"  # an output of the PLC on (94) and off (95); / alone would skip a block
BARE = re.compile(r"\bM9[45](?! ?/\d)")
FILE = re.compile(r"[A-Za-z0-9_-]{1,60}\.[a-z]{1,4}")

SWITCHED = tuple(zip(common.PROBE_SWITCHES, ("M94 /1", "M95 /1"), strict=True))
OPTIONS = (
    Option("readings", "tango-readings.txt", "file of the records, in the folder of the program; M121 adds to it", verified=True),
    Option("reset", "G17 G21 G40 G49 G69 G80 G90 G94 M5", "modal state; the control must know every word of it", codes=True),
    *(replace(option, meaning=f"{option.meaning}, e.g. {word}", also=OUTPUT) for option, word in SWITCHED),
    Option(
        "orient",
        "M19 R",
        "word before the angle that orients the spindle: a macro of your own; empty: it is not turned",
        codes=True,
    ),
    Option(
        "axis_numbers",
        {},
        "number of each axis in #5021 #5041 #24301, e.g. {X: 1, Y: 2, Z: 3, B: 4, C: 5}; empty: in the order X Y Z A B C",
    ),
    common.ROLLOVER,
    *common.clamping("M11", "M10"),
    Option("positioning_feed", 3000.0, "mm/min of protected moves", verified=True),
    common.TOLERANCE,
    common.MISSED,
)
DOUBTS = (
    "no scaling or mirror image (G51) is on: nothing here cancels it",
    "#9011 is the input of the probe with the sign that P of M115 wants",
    "M125 cancels the job when the probe is on or comes on",
    "M115 with L1 goes on when nothing is met and #25022 shows it",
    "#24301 holds the machine coordinates of the contact",
    "#5021 #5041 #24301 come in millimetres after G21",
    "G53 turns a rotary axis in machine coordinates",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)


def begin(job: Job) -> Iterator[str]:
    """Header, modal reset, whether the probe is deflected, the frame, start mark."""
    plan = job.plan
    _check(job)
    yield from common.titled(job, "; %s")
    yield from common.warned(job, "; %s")
    yield job.options["reset"]
    yield WAIT
    yield f"#{BIT} = ABS[#9011]"
    yield f"IF [#{BIT} < 1000] THEN #{BIT} = [#{BIT} + 50000]"
    yield f"#{ON} = 1"
    yield f"IF [#9011 < 0] THEN #{ON} = 0"
    yield f"IF [#[#{BIT}] == #{ON}] THEN GOTO {DEFLECTED}"
    yield "; MACHINE MINUS WORK COORDINATES"
    for name, axis in _linear(job):
        yield f"#{FRAME + axis} = [#{5020 + axis} - #{5040 + axis}] ; {name}"
    yield f"#{MISSES} = 0"
    yield f"#{SECONDS} = 0"
    yield f'M121 "{job.options["readings"]}"'
    yield f'M223 "TANGO START {job.mark} {len(plan.touches)}\\n"'


probe_on, probe_off = common.switches("; %s")


def move(job: Job, leg: Leg) -> Iterator[str]:
    """A protected move: the control cancels the job at a contact; whatever else stops it short is found by its place."""
    goal = {name: leg.to[name] for name in "XYZ" if name in leg.target}
    yield f"M125 {_slashed(job, goal)} P#9011 F{number(job.options['positioning_feed'])}"
    short = _distance(job, goal, 5020)
    yield f"IF [[{short}] > {number(job.options['tolerance'])}] THEN GOTO {ON_THE_WAY}"
    yield f"IF [{TRIPPED} != 0] THEN GOTO {UNMET}"


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """Up along the tool; before the first one a step: positions in inches would make a wrong frame, and send it anywhere."""
    if not leg.came:
        name, by = step(job.plan)
        place = f"#{5020 + common.axis_numbers(job)[name]}"
        yield f"; A STEP OF {number(STEP)} MM SHOWS WHETHER POSITIONS COME IN MM"
        yield f"#{FROM} = {place}"
        yield "G91"
        yield f"M125 /{name}[{number(by)}] P#9011 F{number(STEP_FEED)}"
        yield "G90"
        yield f"#{FROM} = {f'{place} - #{FROM}' if by > 0 else f'#{FROM} - {place}'}"
        yield f"IF [ABS[#{FROM} - {number(STEP / INCH)}] < 0.005] THEN GOTO {INCHES}"
        beyond = f"ABS[#{FROM} - {number(STEP / 2)}] > {number(STEP / 2 + float(job.options['tolerance']))}"
        yield f"IF [{beyond}] THEN GOTO {OTHERWISE}"
        short = f"ABS[#{FROM} - {number(STEP)}] > {number(job.options['tolerance'])}"
        yield f"IF [{short}] THEN GOTO {ON_THE_WAY}"
        yield f"IF [{TRIPPED} != 0] THEN GOTO {UNMET}"
    yield from move(job, leg)


clear = back = move
approach = common.approaching("; %s", move)


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other, and whether they have arrived."""
    options = job.options
    yield f"; {common.indexed(leg)}"
    if "S" in leg.target and options["orient"]:
        yield f"{options['orient']}{common.spindle(job, leg.target['S'])}"
    turned = {name: common.angle(job, name, leg.target[name]) for name in job.machine.rotary if name in leg.target}
    for name, there in turned.items():
        yield from common.unclamped(job, name, f"G53 {name}{there}")
    if turned:
        yield WAIT
    for name, there in turned.items():
        away = f"#{5020 + common.axis_numbers(job)[name]} - {common.signed(there)}"
        yield f"IF [ABS[SIN[[{away}] / 2]] > {ARRIVED:f}] THEN GOTO {NOT_THERE}"


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, flag and machine coordinates."""
    yield from _measured(job, leg)
    yield _off(job, leg)


def _off(job: Job, leg: Leg) -> str:
    numbers = common.axis_numbers(job)
    off = {n: f"#{5020 + numbers[n]} {step[0]} {step[1:]} - #{FRAME + numbers[n]}" for n, step in common.off(job, leg).items()}
    return f"G1 {' '.join(f'{n}[{value}]' for n, value in off.items())} F{number(job.options['positioning_feed'])}"


def _measured(job: Job, leg: Leg) -> Iterator[str]:
    start = common.standoff(job, leg)
    goal = {name: leg.to[name] for name in "XYZ"}
    yield f"M115 {_slashed(job, goal)} P#9011 F{number(job.plan.strategy.approach.feed)} L1"
    for axis in common.axis_numbers(job).values():
        yield f"#{PLACE + axis} = #{5020 + axis}"
    for _, axis in _linear(job):
        yield f"IF [{TRIPPED} != 0] THEN #{PLACE + axis} = #{24300 + axis}"
    lag = " + ".join(f"ABS[#{PLACE + axis} - #{5020 + axis}]" for _, axis in _linear(job))
    yield f"IF [[{lag}] > {number(OLD)}] THEN GOTO {OLD_PLACE}"
    for i, (name, axis) in enumerate(_linear(job), 1):
        yield f"#{FAR + i} = [#{PLACE + axis} - {common.signed(number(start[name]))}]"
    way = " + ".join(f"[#{FAR + i} * #{FAR + i}]" for i in (1, 2, 3))
    yield f"#{FLAG} = 1"
    yield f"IF [SQRT[{way}] < {number(early_distance(job.plan))}] THEN #{FLAG} = 2"
    short = _distance(job, goal, PLACE)
    yield f"IF [[{TRIPPED} == 0] || [[{short}] < {number(job.options['tolerance'])}]] THEN #{FLAG} = 0"
    yield f"#{MISSES} = [#{MISSES} + 1]"
    yield f"IF [#{FLAG} != 0] THEN #{MISSES} = 0"
    yield f"IF [#{MISSES} >= {job.options['misses']}] THEN GOTO {DEAD}"


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back; or a facet that proves the probe, and off it."""
    if leg.kind == "prove":
        yield f"; {common.proves(job, leg)}"
    else:
        yield f"#{SHOWN} = {READ}"
        yield _shown(common.proves(job, leg))
    yield from _measured(proving(job), leg)
    yield f"IF [#{FLAG} == 0] THEN GOTO {UNTOUCHED}"
    if leg.kind == "prove":
        yield _off(job, leg)
        return
    yield _shown(common.LETTING_GO)
    yield f"G4 P{common.RELEASE}."
    yield from move(job, replace(leg, to=leg.came))


def _shown(text: str) -> str:
    """text for the person at the machine → the line that shows it, and goes on after some seconds."""
    return f'M225 #{SHOWN} "{text}"'


def record(job: Job, leg: Leg) -> Iterator[str]:
    """One line for the reader, with the sum of its numbers."""
    places = {name: f"#{PLACE + axis}" for name, axis in common.axis_numbers(job).items()} | {"S": f"#{SPINDLE}"}
    yield f"#{TOUCH} = {leg.touch.number}"
    yield f"#{SPINDLE} = {common.spindle(job, leg.to['S'])}"
    yield f"#{SUM} = [{' + '.join(places.values())}] ; CHECK SUM K"
    places["K"] = f"#{SUM}"
    form = " ".join(f"{name}%.4f" for name in places)
    yield f'M223 "P%.0f H%.0f {form}\\n" #{TOUCH} #{FLAG} {" ".join(places.values())}'


def end(job: Job) -> Iterator[str]:
    """End mark, and what the stops say."""
    yield f'M223 "TANGO END {job.mark} {len(job.plan.touches)}\\n"'
    yield f"GOTO {LAST}"
    for label, text in enumerate(STOPS, 9001):
        yield f"N{label}"
        yield from filter(None, [job.options["probe_off"]])
        yield f'M225 #{SECONDS} "TANGO STOPPED. {common.unproven(job) if label == UNTOUCHED else text}"'
        yield f"GOTO {LAST}"
    yield f"N{LAST}"


def _linear(job: Job) -> list[tuple[str, int]]:
    return [(name, axis) for name, axis in common.axis_numbers(job).items() if name in "XYZ"]


def _slashed(job: Job, goal: Mapping[str, float]) -> str:
    numbers = common.axis_numbers(job)
    return " ".join(f"/{name}[{number(value)} - #{FRAME + numbers[name]}]" for name, value in goal.items())


def _distance(job: Job, goal: Mapping[str, float], base: int) -> str:
    """→ the expression for the distance in mm, axis by axis, between variables and the goal."""
    numbers = common.axis_numbers(job)
    return " + ".join(f"ABS[#{base + numbers[name]} - {common.signed(number(value))}]" for name, value in goal.items())


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    for option, word in SWITCHED:
        if BARE.search(stated := job.options[option.name]):
            raise InputError(
                f"controller.{option.name}: found {stated!r}; allowed: e.g. {word}: the number of the output stands behind a "
                "slash, which no comment of a program shows"
            )
    if not FILE.fullmatch(job.options["readings"]):
        raise InputError(
            f"controller.readings: found {job.options['readings']!r}; allowed: a file name of letters, digits, _ and -"
        )
    common.fits(job, 6)


POST = Post(
    title="Centroid",
    extension="cnc",
    language="centroid",
    links=("file", "remote", "modbus"),
    options=OPTIONS,
    memory=512,
    remedies=CENTROID,
    doubts=DOUBTS,
    stem=lambda job: "tango",
    link="file",
    **common.steps(globals()),
)
