"""Fagor 8060, 8065 and 8070: G100, variables V.A. of positions, records by #WRITE.

G100 moves until contact in programmed coordinates, so the constant difference between machine and programmed positions is read once
with the axes at rest (P1 P2 P3) and taken off every target; each touch reads it again and stops when it has changed. What stands
near the table is always asked: has the move arrived, did the probe see anything. A stop is #ERROR with its text and M30 behind it.
#WRITE takes five identifiers: those of a record are its coordinates, so that its flag is in the text and it has no sum.

Local parameters only:  P1 P2 P3 frame · P4 flag · P5 touches without contact · P6 P7 P8 contact · P9 P10 P11 rotary axes
P12 P13 P14 distances
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from tango_cnc.gate import INCH, MIRRORED, STEP, STEP_FEED, step
from tango_cnc.records import InputError

from . import _common as common
from ._alive import proving
from ._base import Job, Leg, Option, Post, degrees, early_distance, named, number, rolled
from ._remedies import FAGOR

VARIABLE = re.compile(r"V\.A\.[A-Z]{2,12}")
STATE = re.compile(r"(V\.[A-Z0-9.]{2,20})?")
FILE = re.compile(r"[A-Z]:(\\[A-Z0-9_-]{1,20}){1,5}\.[A-Z]{3}")
ARRIVED = 0.000087  # sine of half of 0.01 deg: the names of rounding functions differ between the controls
ON_ITS_WAY = "PROBE MET SOMETHING ON ITS WAY OR A FRAME IS ACTIVE"
CHANGED = 0.005  # mm; the sum of three differences of positions that may come rounded to 0.001
MEASURES = '#MSG ["TANGO MEASURES"]'  # the next text takes the one before off the screen; a word that clears it is not known
LAG = 1.0  # mm that the axes may have run on between the contact and their stop
FRAME = {"X": "P1", "Y": "P2", "Z": "P3"}
FOUND = ("P6", "P7", "P8", "P9", "P10", "P11")
FLAG, MISSES, SHORT, WAY, GAP = "P4", "P5", "P12", "P13", "P14"
FLAGS = (1, 2, 0)  # contact, early, none

OPTIONS = (
    Option("reset", "G17 G40 G53 G71 G80 G90 G94 M5", "modal state; the control must know every word of it", codes=True),
    Option(
        "off", "MCS CS ACS RTCP TLC HSC", "functions #... that are switched OFF; leave out what the control has not", codes=True
    ),
    Option("probe_input", 0, "#SELECT PROBE of this number; 0: the input that is selected anyway", choices=(0, 1, 2)),
    Option("contact", "V.A.ATIPMEAS", "variable of the position at the contact, without its axis letter"),
    Option("contact_frame", "programmed", "coordinates of contact", choices=("programmed", "machine")),
    Option(
        "met", "V.A.MEASOK", "variable that is 1 after a contact and 0 after none, without its axis letter; empty: none is asked"
    ),
    Option(
        "machine_position",
        "V.A.POS",
        "variable of the machine position of an axis, without its letter: all rests on it, compare it with the display",
    ),
    Option("programmed_position", "V.A.ATIPPOS", "variable of the position in programmed coordinates, without its axis letter"),
    Option("probe_state", "V.G.PRBST1", "variable that is 0 while the probe is free; empty: the control's own error is trusted"),
    Option("conversion", "D", "letter behind % in #WRITE for a number; it must come with four decimals", codes=True),
    Option("output", "C:\\CNC8070\\USERS\\PRG\\TANGO.TXT", "file for the records, which are appended"),
    Option("orient", "M19 S", "word before the angle that orients the spindle; empty: the spindle is not turned", codes=True),
    common.ROLLOVER,
    *common.clamping("M11", "M10"),
    *common.PROBE_SWITCHES,
    Option("decimals", 3, "decimals of axis words: the least input increment", verified=True, choices=(3, 4)),
    Option("positioning_feed", 2000.0, "mm/min of protected moves", verified=True),
    common.TOLERANCE,
    common.MISSED,
)

DOUBTS = (
    "G100 that meets nothing goes on from its end without an error",
    "G100 with a deflected probe ends at once or is an error",
    "variables V.A. of positions wait for the axes: the control does not read them ahead",
    "D0 takes the tool offset away, and #MCS before G0 turns a rotary axis in machine coordinates",
    "no mirror image, scaling or polar coordinates are on: nothing here cancels them",
    "$IF and $ENDIF stand alone, brackets are square, #ERROR stops until reset",
    "#OPEN with A appends, #WRITE takes five numbers in one line and prints them with a decimal point",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)


def begin(job: Job) -> Iterator[str]:
    """Header, modal reset, probe at rest, frame, file, start mark."""
    plan, options = job.plan, job.options
    _check(job)
    yield f"%{named(job, 'TANGO')}"
    yield from common.titled(job, "; %s")
    yield from common.warned(job, "; %s", "NOT TRIED ON ANY FAGOR. LOOK UP EVERY LINE BELOW IN THE MANUALS OF THE CONTROL FIRST")
    for word in options["off"].split():
        yield f"#{word} OFF"
    yield options["reset"]
    yield "D0"
    if options["probe_input"]:
        yield f"#SELECT PROBE [{options['probe_input']}]"
    yield f'#OPEN ["{options["output"]}","A"]'
    yield from _at_rest(job)
    for name, parameter in FRAME.items():
        yield f"{parameter}={_machine(job, name)}-{_programmed(job, name)}"
    yield f"{MISSES}=0"
    yield f'#WRITE ["TANGO START {job.mark} {len(plan.touches)}"]'


probe_on, probe_off = common.switches("; %s")


def move(job: Job, leg: Leg) -> Iterator[str]:
    """Protected move: a G100 that has to arrive and to meet nothing."""
    place = common.words(job, leg.to)
    yield from _at_rest(job)
    yield _measure(job, place, job.options["positioning_feed"])
    yield f"{SHORT}={_distance(job, place)}"
    yield from _stop_if(job, f"{SHORT}>{number(job.options['tolerance'])}", ON_ITS_WAY)
    yield from _met_nothing(job)


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other; each has arrived."""
    options = job.options
    yield f"; {common.indexed(leg)}"
    if "S" in leg.target and options["orient"]:
        yield f"{options['orient']}{common.spindle(job, leg.target['S'])}"
    for name in job.machine.rotary:
        if name in leg.target:
            there = common.angle(job, name, leg.target[name])
            yield from common.unclamped(job, name, f"#MCS G0 {name}{there}")
            yield f"{SHORT}=ABS[{there}-{_machine(job, name)}]"
            yield f"{SHORT}=ABS[SIN[{SHORT}/2.]]"
            yield from _stop_if(job, f"{SHORT}>{number(ARRIVED, 6)}", "ROTARY AXIS NOT IN PLACE")


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """Up along the tool; before the first one a step: positions in inches would make a wrong frame, and send it anywhere."""
    if not leg.came:
        name, by = step(job.plan)
        yield f"; A STEP OF {number(STEP)} MM SHOWS WHETHER POSITIONS COME IN MM"
        yield from _at_rest(job)
        yield f"{SHORT}={_machine(job, name)}"
        yield "G91"
        yield f"G100 {name}{number(by)} F{number(STEP_FEED)}"
        yield "G90"
        yield f"{SHORT}=[{_machine(job, name)}-{SHORT}]*{number(math.copysign(1.0, by))}"
        yield from _stop_if(job, f"ABS[{SHORT}-{number(STEP / INCH)}]<0.005", "POSITIONS ARE IN INCHES")
        beyond = STEP / 2 + float(job.options["tolerance"])
        yield from _stop_if(job, f"ABS[{SHORT}-{number(STEP / 2)}]>{number(beyond)}", MIRRORED)
        yield from _stop_if(job, f"ABS[{SHORT}-{number(STEP)}]>{number(job.options['tolerance'])}", ON_ITS_WAY)
        yield from _met_nothing(job)
    yield from move(job, leg)


clear = back = move
approach = common.approaching("; %s", move)


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, then the flag in P4 and machine coordinates in P6 and so on."""
    yield from _measured(job, leg)
    yield _off(job, leg)


def _off(job: Job, leg: Leg) -> str:
    off = {name: f"{_machine(job, name)}{step}" for name, step in common.off(job, leg).items()}
    return f"G1 {_targets(off)} F{number(job.options['positioning_feed'])}"


def _measured(job: Job, leg: Leg) -> Iterator[str]:
    start = common.words(job, common.standoff(job, leg))
    place, found = common.words(job, leg.to), _found(job)
    yield from _at_rest(job)
    yield _measure(job, place, job.plan.strategy.approach.feed)
    for name, parameter in found.items():
        yield f"{parameter}={_contact(job, name) if name in 'XYZ' else _machine(job, name)}"
    yield f"{GAP}={'+'.join(f'ABS[{_machine(job, n)}-{_programmed(job, n)}-{FRAME[n]}]' for n in FRAME)}"
    yield from _stop_if(job, f"{GAP}>{number(CHANGED)}", "WORK OFFSET CHANGED")
    yield f"{SHORT}={_distance(job, place)}"
    way = [f"[{found[name]}-{common.signed(value)}]" for name, value in start.items()]
    yield f"{WAY}=SQRT[{'+'.join(f'{part}*{part}' for part in way)}]"
    yield f"{GAP}={'+'.join(f'ABS[{found[name]}-{_machine(job, name)}]' for name in 'XYZ')}"
    yield f"{FLAG}=1"
    yield from _if(f"{WAY}<{number(early_distance(job.plan))}", f"{FLAG}=2")
    yield from _if(f"{SHORT}<{number(job.options['tolerance'])}", f"{FLAG}=0")
    if job.options["met"]:
        yield from _if(f"{_met(job)}==0", f"{FLAG}=0")
    yield from _if(f"{FLAG}==0", *(f"{found[name]}={_machine(job, name)}" for name in "XYZ"), f"{GAP}=0")
    yield from _stop_if(job, f"{GAP}>{number(LAG)}", "CONTACT DOES NOT FIT WHERE THE AXES STAND")
    yield f"{MISSES}={MISSES}+1"
    yield from _if(f"{FLAG}!=0", f"{MISSES}=0")
    yield from _stop_if(job, f"{MISSES}>={job.options['misses']}", "NO CONTACT. IS THE PROBE ALIVE")


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back; or a facet that proves the probe, and off it."""
    yield f'#MSG ["{common.proves(job, leg)}"]'
    yield from _measured(proving(job), leg)
    yield from _stop_if(job, f"{FLAG}==0", common.unproven(job))
    if leg.kind == "prove":
        yield _off(job, leg)
        yield MEASURES
        return
    yield f'#MSG ["{common.LETTING_GO}"]'
    yield f"G4 K{common.RELEASE}."
    yield from move(job, replace(leg, to=leg.came))
    yield MEASURES


def record(job: Job, leg: Leg) -> Iterator[str]:
    """One line, by its flag: touch, flag, machine coordinates, spindle."""
    found, letter = _found(job), job.options["conversion"]
    places = " ".join(f"{name}%{letter}" for name in found) + f" S{rolled(degrees(leg.to['S']), 4):.4f}"
    for flag in FLAGS:
        yield from _if(f"{FLAG}=={flag}", f'#WRITE ["P{leg.touch.number} H{flag} {places}",{",".join(found.values())}]')


def end(job: Job) -> Iterator[str]:
    """End mark, end of program."""
    if job.options["gate"] != "none":
        yield '#MSG ["TANGO HAS ENDED"]'
    yield f'#WRITE ["TANGO END {job.mark} {len(job.plan.touches)}"]'
    yield "#CLOSE"
    yield "M30"


def _at_rest(job: Job) -> Iterator[str]:
    """A probe that is deflected may have no edge to give: what follows would not be guarded."""
    if job.options["probe_state"]:
        yield from _stop_if(job, f"{job.options['probe_state']}!=0", "PROBE IS DEFLECTED")


def _stop_if(job: Job, condition: str, text: str) -> Iterator[str]:
    """No way out leaves the probe on or the file open."""
    off = filter(None, [job.options["probe_off"]])
    yield from _if(condition, *off, "#CLOSE", f'#ERROR ["TANGO {text}"]', "M30")


def _met_nothing(job: Job) -> Iterator[str]:
    """Behind a move that has arrived."""
    if job.options["met"]:
        yield from _stop_if(job, f"{_met(job)}!=0", common.IN_THE_AIR)


def _if(condition: str, *then: str) -> Iterator[str]:
    yield f"$IF {condition}"
    yield from then
    yield "$ENDIF"


def _machine(job: Job, name: str) -> str:
    return f"{job.options['machine_position']}.{name}"


def _programmed(job: Job, name: str) -> str:
    return f"{job.options['programmed_position']}.{name}"


def _contact(job: Job, name: str) -> str:
    """→ machine position at the contact: for programmed coordinates by the difference of now, which no convention can falsify."""
    plain = f"{job.options['contact']}.{name}"
    return f"{plain}+{_machine(job, name)}-{_programmed(job, name)}" if job.options["contact_frame"] == "programmed" else plain


def _met(job: Job) -> str:
    return "+".join(f"{job.options['met']}.{name}" for name in "XYZ")


def _measure(job: Job, place: Mapping[str, str], feed: float) -> str:
    return f"G100 {_targets(place)} F{number(feed)}"


def _targets(place: Mapping[str, str]) -> str:
    return " ".join(f"{name}[{value}-{FRAME[name]}]" for name, value in place.items())


def _distance(job: Job, place: Mapping[str, str]) -> str:
    """→ the expression for the distance in mm, axis by axis, between where the axes stand and their target."""
    return "+".join(f"ABS[{value}-{_machine(job, name)}]" for name, value in place.items())


def _found(job: Job) -> dict[str, str]:
    """→ {axis letter: parameter that holds where the touch was}."""
    return dict(zip(common.axes(job.machine), FOUND, strict=False))


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    options = job.options
    for key in ("contact", "machine_position", "programmed_position", *(["met"] if options["met"] else [])):
        if not VARIABLE.fullmatch(options[key]):
            raise InputError(
                f"controller.{key}: found {options[key]!r}; allowed: a variable of axes such as V.A.POS, without its letter"
            )
    if not STATE.fullmatch(options["probe_state"]):
        raise InputError(
            f"controller.probe_state: found {options['probe_state']!r}; allowed: a variable such as V.G.PRBST1, or nothing"
        )
    if not FILE.fullmatch(options["output"]):
        raise InputError(
            f"controller.output: found {options['output']!r}; allowed: a file such as C:\\CNC8070\\USERS\\PRG\\TANGO.TXT"
        )
    if not re.fullmatch(r"[A-Z]|\.4F", options["conversion"]):
        raise InputError(f"controller.conversion: found {options['conversion']!r}; allowed: a letter, or .4F")
    common.fits(job)


POST = Post(
    title="Fagor 8060, 8065 and 8070",
    extension="NC",
    language="fagor",
    links=("file", "remote", "modbus"),
    tcp_off=("off", "RTCP"),
    options=OPTIONS,
    summed=False,
    memory=512,
    remedies=FAGOR,
    doubts=DOUBTS,
    stem=lambda job: named(job, "TANGO"),
    **common.steps(globals()),
)
