"""Siemens 840D sl and ONE: MEAS, $AA_MM and $AA_IM in machine coordinates, records by WRITE (PG 03/2006, PG 12/2019).

Before anything moves the control says whether a frame is left and whether its own units are mm. Then a step of 0.5 mm, whose
target is written as that of the first move is, shows that such a move goes where it is sent. An incremental one (IC) would show
less: by SD42440 and SD42442 it may make good what a frame or a tool length has changed.

Every block near the table is `SUPA D0 G1 MEAS=…`: SUPA takes all frames away for this block, D0 the tool length, so what is
programmed and what is read are machine coordinates. A move that ends short of its target, or with the probe's edge seen, goes
to a stop behind M30. The program stands in the control's memory: its jumps go to its end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from tango_cnc.gate import STEP, STEP_FEED, step
from tango_cnc.records import InputError

from . import _common as common
from . import _siemens_handshake as handshake
from ._alive import proving
from ._base import Job, Leg, Option, Post, degrees, early_distance, is_endless, number, rolled
from ._options import OBEYS
from ._remedies import SIEMENS

DEVICE = re.compile(r"/dev/[a-z0-9/]{1,24}")
FILE = re.compile(r"(/?_N_[A-Z0-9_]{1,24}/?)+")
AXIS = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
ARRIVED = 0.01  # deg
CLEARED = "MSG()"  # takes the text off the screen, which would stand there to the end of the program
SETTLES = 0.2  # s after which an axis stands where its encoder will say that it does
LAG = 1.0  # mm that the axes may have run on between the edge and their stop
STOPS = (
    "PROBE IS DEFLECTED",
    "PROBE MET SOMETHING ON ITS WAY OR A FRAME IS ACTIVE",
    "NO CONTACT. IS THE PROBE ALIVE",
    "LATCHED POSITION DOES NOT FIT",
    "ROTARY AXIS NOT IN PLACE",
    "RECORD COULD NOT BE WRITTEN",
    common.UNTOUCHED,
    "A TRANSFORMATION WORK OFFSET OR FRAME IS ON",
    "CONTROL IS SET TO INCHES",
    common.IN_THE_AIR,
)
DEFLECTED, MET, DEAD, STALE, TURNED, UNWRITTEN, UNTOUCHED, FRAMED, INCHES, UNMET = range(1, len(STOPS) + 1)
FRAME = (("TR", ""), ("FI", ""), ("RT", ""), ("SC", "-1."))  # component of a frame, what makes it 0 where no frame is on
LEFT = 0.0001  # mm, deg: a smaller frame counts as none
OUTPUT = "device (/dev/ext/1: LF is written) or file of the control (_N_TANGO_MPF: the control ends the lines) for the records"

AT_THE_PANEL = ("DRY RUN OFF - IT ACTS ON MEAS MOVES AND MAKES THE SLOW ONES FAST",)
FRAMELESS = ("G500", "TRANS")  # no work offset and no programmable frame: were SUPA nothing beside MEAS, no move went elsewhere
OPTIONS = (
    Option("reset", "G17 G40 G60 G601 G710 G90 G94 M5", "modal state; the control must know every word of it", codes=True),
    Option("trafoof", True, "TRAFOOF switches a five-axis transformation off; false where the control has none"),
    Option("cycle800", True, "CYCLE800() leaves a swivelled plane; false where the control has no swivelling"),
    Option(
        "frame_check",
        True,
        "$P_TRAFO says what transformation, $P_ACTFRAME what basic frame, work offset, rotation, scaling or mirror image is left: "
        "any ends the program; false: SUPA alone is trusted",
    ),
    Option(
        "metric_check",
        True,
        "$MN_SCALING_SYSTEM_IS_METRIC says whether the control's own units are mm: inches end the program; false: G710 is trusted",
    ),
    Option(
        "rotary_position",
        "$VA_IM",
        "where rotary axes stand: $VA_IM is what the encoder says; $AA_IM, where the control sent them, if it does not take $VA_IM",
        choices=("$VA_IM", "$AA_IM"),
    ),
    Option(
        "machine_axes",
        {},
        "names of machine axes in $VA_IM and $AA_MM, e.g. {X: X1, Y: Y1, Z: Z1, B: B1}; empty: the letters of the channel",
    ),
    Option("probe_input", 1, "input of the probe: MEAS=1 or MEAS=2", choices=(1, 2)),
    Option("probe_state", True, "$A_PROBE shows whether the probe is deflected; false: the control's own alarm is trusted"),
    Option("output", "/dev/ext/1", OUTPUT),
    Option(
        "handshake",
        handshake.NONE,
        "R700: records go into R700 to R716, or an array of global user data by its name, for OPC UA (docs/link.md)",
        verified=True,
    ),
    Option("alarm", 65001, f"first of {len(STOPS)} SETAL alarms that stop until reset; 0: the message and M0 only"),
    Option("orient", True, "SPOS orients the spindle; false: it is not turned"),
    Option(
        "rotary",
        "auto",
        "DC (0 to 360, the short way) for endless axes (auto), for all, or AC for all",
        choices=("auto", "DC", "AC"),
    ),
    *common.clamping("M11", "M10"),
    *common.PROBE_SWITCHES,
    Option("decimals", 3, "decimals of axis words: the control's computing resolution", verified=True, choices=(3, 4)),
    Option("positioning_feed", 3000.0, "mm/min of protected moves", verified=True),
    common.TOLERANCE,
    common.MISSED,
    replace(OBEYS, default="acts"),  # MEAS blocks are G1
)

DOUBTS = (
    "MEAS goes on without alarm when it meets nothing, and $AC_MEA is 0 then",
    "SUPA and MEAS may stand in one block, SUPA and D0 make its target a machine position",
    "$AA_IM of X Y Z after STOPRE is where the axes stand, $AA_MM is latched for every axis named in the block",
    "SPRINT with %.4F and %D prints plain numbers",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)


def begin(job: Job) -> Iterator[str]:
    """Header, variables, modal reset, probe at rest, start mark."""
    plan, options = job.plan, job.options
    _check(job)
    yield from common.titled(job, "; %s")
    yield from common.warned(job, "; %s", *AT_THE_PANEL)
    yield "DEF INT TG_ERROR,TG_CLOSED,TG_FLAG,TG_MISSES"
    yield f"DEF REAL TG_SHORT,TG_WAY,TG_LAG,TG_TURN,TG_SUM,{','.join(f'TG_{name}' for name in common.axes(job.machine))}"
    if not handshake.used(options["handshake"]):
        yield "DEF STRING[200] TG_TEXT"
    yield options["reset"]
    yield "D0"
    yield from FRAMELESS
    if options["trafoof"]:
        yield "TRAFOOF"
    if options["cycle800"]:
        yield "CYCLE800()"
    yield from _unframed(job)
    yield from _at_rest(job)
    yield "TG_MISSES=0"
    if _is_device(job):
        yield f'EXTOPEN(TG_ERROR,"{options["output"]}","SYN","EXCL")'
        yield from _stop_if("TG_ERROR<>0", UNWRITTEN)
    if handshake.used(options["handshake"]):
        yield from _stop_if(handshake.ahead(options["handshake"]), UNWRITTEN)
        values = {**handshake.marked(job.mark, len(plan.touches)), "flag": "0", "sum": "0", "point": "0"}
        yield from handshake.handed(options["handshake"], values)
        return
    yield from _write(job, f'"TANGO START {job.mark} {len(plan.touches)}"')


probe_on, probe_off = common.switches("; %s")


def move(job: Job, leg: Leg) -> Iterator[str]:
    """Protected move: measures all the way and stops when anything was met."""
    place = common.words(job, leg.to)
    yield from _at_rest(job)
    yield _measure(job, place, job.options["positioning_feed"])
    yield "STOPRE"
    yield f"TG_SHORT={_distance(place)}"
    yield from _stop_if(f"($AC_MEA[{job.options['probe_input']}]<>0) OR (TG_SHORT>{number(job.options['tolerance'])})", MET)


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """Up along the tool; before the first one a step: were SUPA or the positions not as believed, that one would go anywhere."""
    if not leg.came:
        name, by = step(job.plan)
        yield f"; A STEP OF {number(STEP)} MM SHOWS WHETHER A MOVE GOES WHERE IT IS SENT - IF IT GOES ON PRESS FEED HOLD"
        yield from _at_rest(job)
        yield f"TG_WAY=$AA_IM[{name}]"
        yield f"SUPA D0 G1 MEAS={job.options['probe_input']} {name}=TG_WAY{by:+g} F{number(STEP_FEED)}"
        yield "STOPRE"
        yield f"TG_WAY={f'$AA_IM[{name}]-TG_WAY' if by > 0 else f'TG_WAY-$AA_IM[{name}]'}"
        yield from _stop_if(f"ABS(TG_WAY-{number(STEP)})>{number(job.options['tolerance'])}", MET)
        yield from _stop_if(f"$AC_MEA[{job.options['probe_input']}]<>0", UNMET)
    yield from move(job, leg)


clear = back = move
approach = common.approaching("; %s", move)


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other; all have arrived."""
    options = job.options
    yield f"; {common.indexed(leg)}"
    if "S" in leg.target and options["orient"]:
        yield f"SPOS={_spindle(leg)}"
    for name in job.machine.rotary:
        if name in leg.target:
            word, angle = _angle(job, name, leg.target[name])
            yield from common.unclamped(job, name, f"SUPA D0 G0 {name}={word}({angle})")
            yield f"G4 F{SETTLES}"
            yield "STOPRE"
            yield f"TG_TURN=ABS({_stands(job, name)}-{_signed(angle)})"
            yield "TG_TURN=ABS(TG_TURN-360.*TRUNC(TG_TURN/360.+0.5))"
            yield from _stop_if(f"TG_TURN>{number(ARRIVED)}", TURNED)


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, then flag and machine coordinates in TG_FLAG, TG_X, … ."""
    yield from _measured(job, leg)
    yield _off(job, leg)


def _off(job: Job, leg: Leg) -> str:
    off = " ".join(f"{name}=$AA_IM[{name}]{step}" for name, step in common.off(job, leg).items())
    return f"SUPA D0 G1 {off} F{number(job.options['positioning_feed'])}"


def _measured(job: Job, leg: Leg) -> Iterator[str]:
    start = common.words(job, common.standoff(job, leg))
    place = common.words(job, leg.to)
    yield from _at_rest(job)
    yield _measure(job, place, job.plan.strategy.approach.feed)
    yield "STOPRE"
    for name in common.axes(job.machine):
        yield f"TG_{name}={f'$AA_MM[{_named(job, name)}]' if name in 'XYZ' else _stands(job, name)}"
    yield f"TG_SHORT={_distance(place)}"
    yield f"TG_WAY=SQRT({'+'.join(f'POT(TG_{name}-{_signed(value)})' for name, value in start.items())})"
    yield f"TG_LAG={'+'.join(f'ABS(TG_{name}-$AA_IM[{name}])' for name in 'XYZ')}"
    yield "TG_FLAG=1"
    yield from _if(f"TG_WAY<{number(early_distance(job.plan))}", "TG_FLAG=2")
    missed = f"($AC_MEA[{job.options['probe_input']}]==0) OR (TG_SHORT<{number(job.options['tolerance'])})"
    yield from _if(missed, "TG_FLAG=0", *(f"TG_{name}=$AA_IM[{name}]" for name in "XYZ"))  # $AA_MM: of the contact before
    yield from _stop_if(f"(TG_FLAG<>0) AND (TG_LAG>{number(LAG)})", STALE)
    yield "TG_MISSES=TG_MISSES+1"
    yield from _if("TG_FLAG<>0", "TG_MISSES=0")
    yield from _stop_if(f"TG_MISSES>={job.options['misses']}", DEAD)


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back; or a facet that proves the probe, and off it."""
    yield f'MSG("{common.proves(job, leg)}")'
    yield from _measured(proving(job), leg)
    yield from _stop_if("TG_FLAG==0", UNTOUCHED)
    if leg.kind == "prove":
        yield _off(job, leg)
        yield CLEARED
        return
    yield f'MSG("{common.LETTING_GO}")'
    yield f"G4 F{common.RELEASE}"
    yield from move(job, replace(leg, to=leg.came))
    yield CLEARED


def record(job: Job, leg: Leg) -> Iterator[str]:
    """One line: touch, flag, machine coordinates, spindle, their sum."""
    names = common.axes(job.machine)
    places = " ".join(f"{name}%.4F" for name in names)
    values = ",".join(f"TG_{name}" for name in names)
    spindle = _spindle(leg)
    yield f"TG_SUM={'+'.join(f'TG_{name}' for name in names)}+{spindle}"
    if handshake.used(job.options["handshake"]):
        values_of = {name: f"TG_{name}" for name in names} | {"S": spindle, "sum": "TG_SUM", "flag": "TG_FLAG"}
        yield from handshake.handed(job.options["handshake"], {**values_of, "point": str(leg.touch.number)})
        return
    yield f'TG_TEXT=SPRINT("P{leg.touch.number} H%D {places} S{spindle} K%.4F",TG_FLAG,{values},TG_SUM)'
    yield from _write(job, "TG_TEXT")


def end(job: Job) -> Iterator[str]:
    """End mark, end of program, and behind it the stops."""
    if handshake.used(job.options["handshake"]):
        yield from handshake.handed(job.options["handshake"], {"flag": "0", "sum": "0", "point": str(handshake.END)})
    else:
        yield from _write(job, f'"TANGO END {job.mark} {len(job.plan.touches)}"')
    if _is_device(job):
        yield f'EXTCLOSE(TG_CLOSED,"{job.options["output"]}")'
    yield "M30"
    for which, text in enumerate(STOPS, 1):
        if not _may_stop(job, which):
            continue
        if which == UNWRITTEN and handshake.used(job.options["handshake"]):
            text = handshake.AHEAD
        yield f"TG_STOP_{which}:"
        yield from filter(None, [job.options["probe_off"]])  # no way out leaves the probe on or the device taken
        if _is_device(job):
            yield f'EXTCLOSE(TG_CLOSED,"{job.options["output"]}")'
        number = '<<" ERROR "<<TG_ERROR' if which == UNWRITTEN and text == STOPS[which - 1] else ""
        yield f'MSG("TANGO {common.unproven(job) if which == UNTOUCHED else text}"{number})'
        yield "STOPRE"  # the text is shown before the alarm ends the program
        if job.options["alarm"]:
            yield f"SETAL({job.options['alarm'] + which - 1})"
        yield "M0"
        yield "M30"


def _may_stop(job: Job, which: int) -> bool:
    """number of a stop → whether anything in this program jumps to it."""
    asked = {FRAMED: job.options["frame_check"], INCHES: job.options["metric_check"], UNTOUCHED: job.options["gate"] != "none"}
    return bool(asked.get(which, True))


def _unframed(job: Job) -> Iterator[str]:
    """Nothing is left that SUPA would have to take away, and the control's own units are mm: asked before anything moves."""
    if job.options["metric_check"]:
        yield from _stop_if("$MN_SCALING_SYSTEM_IS_METRIC<>1", INCHES)
    if job.options["frame_check"]:
        yield from _stop_if("$P_TRAFO<>0", FRAMED)
    for name in "XYZ" if job.options["frame_check"] else "":
        yield f"TG_WAY={'+'.join(f'ABS($P_ACTFRAME[{name},{part}]{less})' for part, less in FRAME)}+ABS($AC_DRF[{name}])"
        yield from _stop_if(f"(TG_WAY>{number(LEFT, 4)}) OR ($P_ACTFRAME[{name},MI]<>0)", FRAMED)
    if job.options["frame_check"] and job.machine.rotary:
        shifts = "+".join(f"ABS($P_ACTFRAME[{name},{part}])" for name in job.machine.rotary for part in ("TR", "FI"))
        yield from _stop_if(f"{shifts}>{number(LEFT, 4)}", FRAMED)
    yield "STOPRE"
    for name in "XYZ":  # a control that does not take a name of these says so here, before anything moves
        yield f"TG_{name}=$AA_MM[{_named(job, name)}]"
    for name in job.machine.rotary:
        yield f"TG_{name}={_stands(job, name)}"


def _named(job: Job, name: str) -> str:
    """axis letter → its name as a machine axis."""
    return str(job.options["machine_axes"].get(name, name))


def _stands(job: Job, name: str) -> str:
    """rotary axis → the variable that says where it stands."""
    which = job.options["rotary_position"]
    return f"{which}[{_named(job, name) if which == '$VA_IM' else name}]"


def _at_rest(job: Job) -> Iterator[str]:
    """A probe that is deflected has no edge to give: what follows would not be guarded."""
    if job.options["probe_state"]:
        yield "STOPRE"
        yield from _stop_if(f"$A_PROBE[{job.options['probe_input']}]<>0", DEFLECTED)


def _stop_if(condition: str, which: int) -> Iterator[str]:
    yield f"IF {condition} GOTOF TG_STOP_{which}"


def _if(condition: str, *then: str) -> Iterator[str]:
    yield f"IF {condition}"
    yield from then
    yield "ENDIF"


def _write(job: Job, text: str) -> Iterator[str]:
    """A device gets its line feed from us, a file from the control."""
    line_feed = "<<\"'H0A'\"" if _is_device(job) else ""
    yield f'WRITE(TG_ERROR,"{job.options["output"]}",{text}{line_feed})'
    yield from _stop_if("TG_ERROR<>0", UNWRITTEN)


def _is_device(job: Job) -> bool:
    return DEVICE.fullmatch(job.options["output"]) is not None and not handshake.used(job.options["handshake"])


def _measure(job: Job, place: Mapping[str, str], feed: float) -> str:
    return f"SUPA D0 G1 MEAS={job.options['probe_input']} {common.joined(place)} F{number(feed)}"


def _distance(place: Mapping[str, str]) -> str:
    """→ the expression for the distance in mm, axis by axis, between where the axes stand and their target."""
    return "+".join(f"ABS($AA_IM[{name}]-{_signed(value)})" for name, value in place.items())


def _angle(job: Job, name: str, value: float) -> tuple[str, str]:
    """axis letter, rad → DC or AC, deg."""
    rule, decimals = job.options["rotary"], job.options["decimals"]
    word = ("DC" if is_endless(job.machine, name) else "AC") if rule == "auto" else rule
    angle = degrees(value)
    return word, number(rolled(angle, decimals) if word == "DC" else angle, decimals)


def _signed(value: str) -> str:
    return f"({value})" if value.startswith("-") else value


def _spindle(leg: Leg) -> str:
    return f"{rolled(degrees(leg.to['S']), 4):.4f}"


def alarms(options: Mapping[str, Any]) -> dict[str, str]:
    """options → {number of a SETAL alarm: what it says}: the text may not be on the screen any more."""
    first = options["alarm"]
    return {str(first + i): text for i, text in enumerate(STOPS)} if first else {}


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    options = job.options
    if not (DEVICE.fullmatch(options["output"]) or (len(options["output"]) <= 32 and FILE.fullmatch(options["output"]))):
        raise InputError(f"controller.output: found {options['output']!r}; allowed: a device /dev/… or a file _N_NAME_MPF")
    if options["alarm"] and not 65000 <= options["alarm"] <= 65999 - len(STOPS):
        raise InputError(f"controller.alarm: found {options['alarm']}; allowed: 0, or 65000 … {65999 - len(STOPS)}")
    handshake.used(options["handshake"])
    letters = common.axes(job.machine)
    for axis, named in options["machine_axes"].items():
        if axis not in letters or not (isinstance(named, str) and AXIS.fullmatch(named)):
            raise InputError(
                f"controller.machine_axes: found {axis!r}: {named!r}; allowed: a name such as X1 for {', '.join(letters)}"
            )
    names = [options["machine_axes"].get(letter, letter) for letter in letters]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"controller.machine_axes: found {twice!r} for two axes; allowed: a name of its own for each axis")
    common.fits(job)


POST = Post(
    title="Siemens 840D sl and ONE",
    extension="MPF",
    language="siemens",
    links=("file", "remote", "opcua", "modbus"),
    tcp_off=("trafoof", ""),
    options=OPTIONS,
    memory=512,
    alarms=alarms,
    remedies=SIEMENS,
    doubts=DOUBTS,
    further=lambda given: handshake.doubts(given.get("handshake", handshake.NONE)),
    stem=lambda job: "TANGO",
    **common.steps(globals()),
)
