"""Heidenhain Klartext for the TNC 640 and its relatives: TCH PROBE 4 in any direction, records by FN 16, positions with M91.

Three labels behind M30 do the work: a guarded move (a probing move that must meet nothing), a measuring move, a record. Their
arguments are Q parameters in mm and deg; positions are those of the machine (REF). With `cycle: 444` the second of two touches is
one of cycle 444 (`_klartext_444.py`). FN 16 prints the text in QS1 with a mask that has to be on the control once, as `mask()`
gives it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import count

from tango_cnc.gate import STEP, step
from tango_cnc.records import InputError

from . import _common as common
from . import _klartext_444 as cycle_444
from ._alive import proving
from ._base import (
    Job,
    Leg,
    Option,
    Post,
    degrees,
    finding,
    is_endless,
    named,
    number,
    of_approach,
    rolled,
    search_distance,
)
from ._klartext import (
    CANCELS,
    CYCLE,
    FINDING,
    FLAG,
    GATE,
    GUARDED,
    MEASURING,
    MISSES,
    RECORD,
    SCALED,
    SPINDLE,
    START,
    STOPS,
    TARGET,
    TOUCH,
    TURNED,
    UNSCALED,
    UNTOUCHED,
    declared,
    guarded,
    measuring,
    printed,
    reading,
    record_text,
)
from ._remedies import HEIDENHAIN

NAME = "TANGO"
FILE = re.compile(r"TNC:\\([A-Za-z0-9_]{1,16}\\){0,4}[A-Za-z0-9_]{1,16}\.[A-Za-z]{1,3}")
ARRIVED = 0.01  # deg

OPTIONS = (
    Option(
        "cycle",
        4,
        "TCH PROBE 4 measures; 444: cycle 444 does, after TCH PROBE 4 has found (approach.find)",
        verified=True,
        choices=(4, 444),
    ),
    cycle_444.LENGTH_ENDS,
    Option("mask", "TNC:\\TANGO.A", "mask file of FN 16 on the control; docs/dialects.md has its three lines"),
    Option("output", "TNC:\\TANGO.TXT", "file for the records, on the control's disk"),
    Option("axis_numbers", {}, "number of each axis in FN 18 and IDX, e.g. {X: 1, Y: 2, Z: 3, B: 5, C: 6}; empty: A B C are 4 5 6"),
    Option(
        "scaling_check",
        True,
        "FN 18 ID210 NR4 says the scaling factor of X Y Z, which cycle 26 may have left on, and NR3 which axes cycle 8 mirrors: "
        "other than 1, other than 0 end the program; false: it is not asked",
    ),
    Option("plane_reset", True, "PLANE RESET STAY leaves a tilted plane; false where the control has no tilting"),
    Option("tcpm_reset", True, "FUNCTION RESET TCPM and M129; false where the control has no TCPM"),
    Option("distance", "DIST", "word of the way in TCH PROBE 4.3; some English manuals have ABST", choices=("DIST", "ABST")),
    Option("orient", True, "cycle 13 and M19 orient the spindle; false: it is not turned"),
    Option("shortest", True, "endless axes get angles of 0 to 360 under M126, the short way; false: as planned"),
    common.showing("STOP"),
    *common.clamping("M11", "M10"),
    *common.PROBE_SWITCHES,
    Option("decimals", 4, "decimals of positions", verified=True, choices=(3, 4)),
    Option("positioning_feed", 2000.0, "mm/min of guarded moves; the control's probe table may allow less"),
    common.TOLERANCE,
    common.MISSED,
)

DOUBTS = (
    "the text of TCH PROBE 4, its results in three Q and -1 in the fourth without contact, REFERENCE SYSTEM 1 is the machine",
    "TCH PROBE 4 that meets nothing goes on from the end of DIST, MB backs it off after a contact, not farther than its start",
    "cycles 7 8 10 11 with the names that they have here and cycle 8 without an axis: no shift, mirror, rotation or scale is left",
    "nothing has left cycle 26 (a scale for each axis) on",
    "a deflected probe at the start of TCH PROBE 4 is an error of the control: no variable of it is asked",
    "TRACK of the probe table is off: the control does not turn the spindle before TCH PROBE 4",
    "results of TCH PROBE 4 are positions of the axes, without tool length and calibration of the probe",
    "FN 18 ID240 NR8 is where the axes are in machine coordinates, after FN 20 WAIT FOR SYNC; NR1 would be the nominal position",
    "the lines of the mask, and that FN 16 appends to its file",
    "a probe that is off stops nothing: guarded moves are guarded only while it is on",
)


def mask() -> tuple[str, ...]:
    """→ the lines of the mask file that FN 16 needs on the control."""
    return ("M_APPEND;", '"%S",QS1;', "M_CLOSE;")


def begin(job: Job) -> Iterator[str]:
    """Header, modal reset, start mark."""
    plan, options = job.plan, job.options
    _check(job)
    yield f"BEGIN PGM {named(job, NAME)} MM"
    yield from common.titled(job, "; %s")
    yield f"; MEASURING FEED {number(plan.strategy.approach.feed)} SEARCH {number(search_distance(_from_near(job).plan))}"
    if options["cycle"] == 444:
        yield f"; {cycle_444.table_text(_from_near(job))}"
    yield from common.warned(job, "; %s")
    if options["plane_reset"]:
        yield "PLANE RESET STAY"
    if options["tcpm_reset"]:
        yield from ("FUNCTION RESET TCPM", "M129")
    yield from CANCELS
    if options["scaling_check"]:
        yield from UNSCALED
    yield from ("M137", "M5")  # feeds in mm/min
    if options["shortest"] and any(is_endless(job.machine, name) for name in job.machine.rotary):
        yield "M126"  # without an endless axis it could only send one past its limit
    if options["cycle"] == 444:
        yield from cycle_444.table(_from_near(job))
    yield f"{MISSES} = 0"
    yield declared(f"TANGO START {job.mark} {len(plan.touches)}")
    yield printed(job)


probe_on, probe_off = common.switches("; %s")


def move(job: Job, leg: Leg) -> Iterator[str]:
    """Guarded move by its label; an axis that nobody has moved yet stays where it is."""
    if not all(name in leg.to for name in "XYZ"):
        yield "FN 20: WAIT FOR SYNC"
    for name, parameter in TARGET.items():
        yield f"{parameter} = {_number(job, leg.to[name])}" if name in leg.to else reading(job, parameter, name)
    yield f"CALL LBL {GUARDED}"


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """Up along the tool; before the first one a step: where something mirrors, scales or turns what is said, that one is seen."""
    if leg.came:
        yield from move(job, leg)
    else:
        name, by = step(job.plan)
        yield f"; A STEP OF {number(STEP)} MM SHOWS WHETHER A MOVE GOES WHERE IT IS SENT"
        yield "FN 20: WAIT FOR SYNC"
        for axis, parameter in TARGET.items():
            yield reading(job, parameter, axis)
        yield f"{TARGET[name]} = {TARGET[name]} {'+' if by > 0 else '-'} {abs(by):g}"
        yield f"CALL LBL {GUARDED}"
        for axis, value in leg.target.items():  # the others stay where they were read
            yield f"{TARGET[axis]} = {_number(job, value)}"
        yield f"CALL LBL {GUARDED}"


clear = back = move  # back: MB has taken the probe off the facet
approach = common.approaching("; %s", move)


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other; each has arrived."""
    options = job.options
    yield f"; {common.indexed(leg)}"
    if "S" in leg.target and options["orient"]:
        yield "CYCL DEF 13.0 ORIENTATION"
        yield f"CYCL DEF 13.1 ANGLE{_number(job, rolled(degrees(leg.target['S']), options['decimals']))}"
        yield "M19"
    for name in job.machine.rotary:
        if name in leg.target:
            angle = degrees(leg.target[name])
            if options["shortest"] and is_endless(job.machine, name):
                angle = rolled(angle, options["decimals"])
            yield from common.unclamped(job, name, f"L {name}{_number(job, angle)} R0 FMAX M91")
            yield "FN 20: WAIT FOR SYNC"
            yield reading(job, "Q35", name)
            yield f"Q35 = ABS ( Q35 {_number(job, -angle).replace('+', '+ ').replace('-', '- ')} )"
            yield "Q35 = ABS ( Q35 - 360 * INT ( Q35 / 360 + 0.5 ) )"
            yield f"FN 11: IF +Q35 GT +{ARRIVED} GOTO LBL {TURNED}"


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move by its label, to the search end: its length is the way from where it begins."""
    start = dict(zip(job.machine.names, leg.touch.standoff if leg.kind == "find" else job.plan.near(leg.touch), strict=True))
    for name in "XYZ":
        yield f"{START[name]} = {_number(job, start[name])}"
    for name in "XYZ":
        yield f"{TARGET[name]} = {_number(job, leg.to[name])}"
    measures = CYCLE if job.options["cycle"] == 444 else MEASURING
    yield f"CALL LBL {FINDING if leg.kind == 'find' else measures}"


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back, by the labels that find or measure."""
    if common.stops_for(job, leg):
        yield f"STOP ; {common.TOUCH}"
    yield f"; {common.proves(job, leg)}"
    start = dict(zip(job.machine.names, leg.touch.standoff, strict=True))
    for name in "XYZ":
        yield f"{START[name]} = {_number(job, start[name])}"
    for name in "XYZ":
        yield f"{TARGET[name]} = {_number(job, leg.to[name])}"
    yield f"CALL LBL {GATE}"
    yield f"FN 12: IF +{FLAG} LT +0.5 GOTO LBL {UNTOUCHED}"
    if leg.kind == "prove":
        return  # MB has taken the probe off
    yield f"; {common.LETTING_GO}"
    yield from ("CYCL DEF 9.0 DWELL TIME", f"CYCL DEF 9.1 DWELL {common.RELEASE}")
    yield from move(job, replace(leg, to=leg.came))


def record(job: Job, leg: Leg) -> Iterator[str]:
    """The line of the touch by its label."""
    yield f"{TOUCH} = {leg.touch.number}"
    yield f"{SPINDLE} = {_number(job, rolled(degrees(leg.to['S']), job.options['decimals']))}"
    yield f"CALL LBL {RECORD}"


def end(job: Job) -> Iterator[str]:
    """End mark, end of program; behind it the labels and the stops."""
    yield declared(f"TANGO END {job.mark} {len(job.plan.touches)}")
    yield printed(job)
    yield "M30"
    yield from guarded(job)
    stops = STOPS
    if job.options["gate"] != "none":
        yield from measuring(proving(job), GATE)
    if job.options["cycle"] == 444:
        yield from measuring(cycle_444.counting(finding(job)), FINDING, cycle_444.frame(), cycle_444.seen())
        yield from cycle_444.measuring(_from_near(job))
        stops = STOPS | cycle_444.stops(_from_near(job))
    else:
        yield from measuring(_from_near(job))
        if job.plan.strategy.approach.find is not None:
            yield from measuring(finding(job), FINDING)
    yield from record_text(job)
    for label, text in stops.items():
        if (label == UNTOUCHED and job.options["gate"] == "none") or (label == SCALED and not job.options["scaling_check"]):
            continue
        yield f"LBL {label}"
        yield from filter(None, [job.options["probe_off"]])
        yield f"STOP ; {common.unproven(job) if label == UNTOUCHED else text}"
        yield "M30"
        yield "LBL 0"
    yield f"END PGM {named(job, NAME)} MM"


def numbered(lines: Iterator[str]) -> Iterator[str]:
    """lines → the same with the block numbers from 0 that Klartext files carry; what goes on after a ~ has none."""
    number = count()
    return (line if line.startswith(" ") else f"{next(number)} {line}" for line in lines)


def _from_near(job: Job) -> Job:
    """job → the same with the place where the measuring move of a double touch begins as the stand-off."""
    approach = job.plan.strategy.approach
    if approach.find is None:
        return job
    return replace(job, plan=of_approach(job.plan, replace(approach, standoff=approach.find.retreat)))


def _number(job: Job, value: float) -> str:
    """→ with sign and all decimals: '+10.0000'."""
    decimals = job.options["decimals"]
    number(value, decimals)
    text = f"{value:+.{decimals}f}"
    return text.replace("-", "+") if float(text) == 0 else text


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    options = job.options
    for key, default in (("mask", "TNC:\\TANGO.A"), ("output", "TNC:\\TANGO.TXT")):
        if not FILE.fullmatch(options[key]):
            raise InputError(f"controller.{key}: found {options[key]!r}; allowed: a file such as {default}")
    if not options["mask"].upper().endswith(".A"):  # one called as the program or plan.csv would take its place in the folder
        raise InputError(f"controller.mask: found {options['mask']!r}; allowed: a file that ends in .A, as masks of FN 16 do")
    if options["output"].upper().endswith((".A", ".H")):
        raise InputError(
            f"controller.output: found {options['output']!r}; allowed: a file that is no mask (.A) and no program (.H), such as "
            "TNC:\\TANGO.TXT, because the records are added to it"
        )
    common.fits(job)
    if options["cycle"] == 444:
        cycle_444.fits(job)
    names, stated = common.axes(job.machine), options["axis_numbers"]
    if not stated and not set(names) <= set("XYZABC"):
        raise InputError(f"controller.axis_numbers: found nothing; allowed: a number for each of {', '.join(names)}")


POST = Post(
    title="Heidenhain Klartext",
    extension="H",
    language="klartext",
    links=("file", "remote", "lsv2", "modbus"),
    tcp_off=("tcpm_reset", ""),
    options=OPTIONS,
    remedies=HEIDENHAIN,
    doubts=DOUBTS,
    further=cycle_444.doubts,
    stem=lambda job: named(job, NAME),
    **common.steps(globals()),
    finish=numbered,
    companions=lambda job: {job.options["mask"].rpartition("\\")[2]: mask()},
)
