"""Okuma OSP for mills (P300M and its like): G31 watched by position variables, records by FWRITC, PUT and WRITE C.

No manual of an OSP mill with a touch probe has been seen: which word moves until contact and which variables hold what is stated by
options, all unverified, and the program proves what it can while nothing is near: each protected move has to end at its target in
machine coordinates, each contact has to lie where the axes have stopped. A name that the control does not know is its own alarm at
the first protected move, high above the table.

Subprograms behind M02 look at what a move has come to:

    OTG1  a protected move to PX PY PZ has arrived
    OTG2  a measuring move from PI PJ PK to PX PY PZ: flag and machine coordinates in common variables
    OTG3  record of touch PT with the spindle at PS
    OTG4  a rotary axis that stands at PB has arrived at PA
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from tango_cnc.gate import STEP, STEP_FEED, TOUCH, step
from tango_cnc.records import InputError

from . import _common as common
from ._alive import proving
from ._base import Job, Leg, Option, Post, early_distance, number
from ._remedies import OKUMA

VARIABLE = re.compile(r"[A-Z]{2,6}\?(\[\d{1,4}\])?")  # ? stands for the axis letter
STATE = re.compile(r"([A-Z]{2,8}(\[\d{1,4}\])?)?")
TIMER = re.compile(r"VDIN\[100[0-4]\]")
FILE = re.compile(r"[A-Z]{2}\d:[A-Z0-9-]{1,16}\.[A-Z]{3}")
SKIP = re.compile(r"G(22|3[1-9]|[1-9]\d\d)")  # no word that homes, or changes what the moves behind it mean
ARRIVED = 0.01  # deg
LAG = 1.0  # mm that the axes may have run on between the contact and their stop
FLAG, MISSES, FOUND, SUM = 0, 1, 2, 8  # places among the common variables; FOUND: X Y Z and up to three rotary axes
COMMON = 9
STOPS = {
    "NS1": "PROBE DEFLECTED",
    "NS2": "CONTACT OR FRAME",
    "NS3": "NO PROBE CONTACT",
    "NS4": "CONTACT MISFITS",
    "NS5": "AXIS NOT TURNED",
    "NS6": "START AT THE TOP",
    "NS7": "NOT IN FRAME H0",
    "NS8": "NO FINGER FELT",
    "NS9": "MIRROR OR SCALED",
}  # at most 16 characters each: more are not shown
DEFLECTED, MET, DEAD, STALE, TURNED, RESTARTED, SHIFTED, UNTOUCHED, OTHERWISE = STOPS
UNOPENED = (RESTARTED, SHIFTED)  # stops before the file of the records is open
NO_FACET = "NO FACET FELT"

OPTIONS = (
    Option("skip", "G31", "word of the move that the probe ends", codes=True),
    Option(
        "contact", "VSAP?[1]", "variable of the machine position at the contact, ? is the axis letter; some have no index: VSAP?"
    ),
    Option("position", "VAPA?", "variable of the machine position of an axis, ? is the axis letter"),
    Option("wait", "G4 F0.05", "words after which variables are read with the axes at rest, not ahead", codes=True),
    Option("probe_state", "", "variable that is 0 while the probe is free, e.g. VDIN[11]; none: none", none="", must=True),
    Option("machine_frame", "G15 H0", "words that make programmed positions machine positions", codes=True),
    Option("frame_check", True, "VACOD is 0 in machine coordinates; false: it is not asked"),
    Option("reset", "G10 G17 G21 G40 G53 G69 G80 G90 G94 G170 M5", "modal state; the control must know each word", codes=True),
    Option("common", 101, "first of nine common variables VC that the program overwrites"),
    Option("output", "MD1:TANGO.TXT", "file of the control for the records, which are appended"),
    Option("places", 10, "places of a printed coordinate in PUT; it must come with four decimals", choices=(10, 11, 12)),
    Option("alarm", 992, "VDOUT that stops with the text of VUACM", choices=(990, 991, 992, 993)),
    Option("orient", "M19 RS", "word before = and the angle that orients the spindle; empty: it is not turned", codes=True),
    common.showing("M00"),
    common.ROLLOVER,
    *common.clamping("M21", "M20"),
    *common.PROBE_SWITCHES,
    Option("decimals", 3, "decimals of axis words: the least input increment", verified=True, choices=(3, 4)),
    Option("positioning_feed", 2000.0, "mm/min of protected moves", verified=True),
    common.TOLERANCE,
    common.MISSED,
)

DOUBTS = (
    "the skip move ends at the contact, at its end without alarm when there is none, and at once when the probe is deflected",
    "the contact variable is without length and calibration of the probe: compare one touch by hand",
    "G53 cancels the tool length here, and G0 turns a rotary axis in machine coordinates of H0",
    "no mirror image, scaling or polar coordinates are on: nothing here cancels them",
    "subprograms may stand behind M02 in one file, CALL passes PX PY PZ PI PJ PK PT PS PA PB",
    "PUT of a number prints digits with a decimal point, blanks before them",
    "a probe that is off stops nothing: protected moves protect only while it is on. Try the first one with a finger at the probe",
)


def begin(job: Job) -> Iterator[str]:
    """Header, no restart, modal reset, machine coordinates, file, start mark."""
    plan, options = job.plan, job.options
    _check(job)
    yield "OTNGO"
    yield from common.titled(job, "(%s)")
    yield from common.warned(job, "(%s)", "NOT TRIED ON ANY OKUMA. LOOK UP EVERY LINE BELOW IN THE MANUALS OF THE MACHINE FIRST")
    yield f"IF[VRSTT EQ 128] {RESTARTED}"
    yield options["reset"]
    yield options["machine_frame"]
    yield options["wait"]
    if options["frame_check"]:
        yield f"IF[VACOD NE 0] {SHIFTED}"
    yield f"{_common(job, MISSES)}=0"
    yield f"FWRITC {options['output']};A"
    yield from _line(f"TANGO START {job.mark} {len(plan.touches)}")


probe_on, probe_off = common.switches("(%s)")


def move(job: Job, leg: Leg) -> Iterator[str]:
    """Protected move: a skip move that has to arrive. An axis that nobody has moved yet stays where it is."""
    place = common.words(job, leg.to)
    yield from _skip(job, place, job.options["positioning_feed"])
    yield job.options["wait"]
    yield "CALL OTG1 " + " ".join(f"P{name}={place.get(name, _position(job, name))}" for name in "XYZ")


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other; each has arrived."""
    options = job.options
    yield f"({common.indexed(leg)})"
    if "S" in leg.target and options["orient"]:
        yield f"{options['orient']}={common.spindle(job, leg.target['S'])}"
    for name in job.machine.rotary:
        if name in leg.target:
            there = common.angle(job, name, leg.target[name])
            yield from common.unclamped(job, name, f"G0 {name}{there}")
            yield options["wait"]
            yield f"CALL OTG4 PA={there} PB={_position(job, name)}"


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """Up along the tool; before the first one a step: a mirror image would send it down into the table."""
    if not leg.came:
        name, by = step(job.plan)
        went, tolerance = _common(job, SUM), float(job.options["tolerance"])
        yield f"(A STEP OF {number(STEP)} MM SHOWS WHETHER A MIRROR IMAGE OR SCALING IS ON)"
        yield f"{went}={_position(job, name)}"
        yield "G91"
        yield from _skip(job, {name: number(by)}, STEP_FEED)
        yield "G90"
        yield job.options["wait"]
        yield f"{went}={f'{_position(job, name)}-{went}' if by > 0 else f'{went}-{_position(job, name)}'}"
        yield f"IF[ABS[{went}-{number(STEP / 2)}] GT {number(STEP / 2 + tolerance)}] {OTHERWISE}"
        yield f"IF[ABS[{went}-{number(STEP)}] GT {number(tolerance)}] {MET}"
    yield from move(job, leg)


clear = back = move
approach = common.approaching("(%s)", move)


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, then OTG2 for flag and machine coordinates."""
    yield from _measuring(job, leg)
    yield _off(job, leg)


def _off(job: Job, leg: Leg) -> str:
    off = " ".join(f"{name}={_position(job, name)}{step}" for name, step in common.off(job, leg).items())
    return f"G1 {off} F{number(job.options['positioning_feed'])}(OFF)"


def _measuring(job: Job, leg: Leg) -> Iterator[str]:
    start = common.words(job, common.standoff(job, leg))
    place = common.words(job, leg.to)
    yield from _skip(job, place, job.plan.strategy.approach.feed)
    targets = " ".join(f"P{name}={value}" for name, value in place.items())
    starts = " ".join(f"P{letter}={value}" for letter, value in zip("IJK", start.values(), strict=True))
    yield f"CALL OTG2 {targets} {starts}"


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back; or a facet that proves the probe, and off it."""
    if common.stops_for(job, leg):
        yield f"M00({TOUCH})"
    yield f"({common.proves(job, leg)})"
    yield from _measuring(proving(job), leg)
    yield f"IF[{_common(job, FLAG)} EQ 0] {UNTOUCHED}"
    if leg.kind == "prove":
        yield _off(job, leg)
        return
    yield f"({common.LETTING_GO})"
    yield f"G4 F{common.RELEASE}."
    yield from move(job, replace(leg, to=leg.came))


def record(job: Job, leg: Leg) -> Iterator[str]:
    """The line of the touch by OTG3."""
    yield f"CALL OTG3 PT={leg.touch.number} PS={common.spindle(job, leg.to['S'])}"


def end(job: Job) -> Iterator[str]:
    """End mark, end of program; behind it its stops and the subprograms with theirs."""
    yield from _line(f"TANGO END {job.mark} {len(job.plan.touches)}")
    yield "CLOSE C"
    yield "M02"
    yield from _stops(job, *([DEFLECTED] if job.options["probe_state"] else []), RESTARTED, SHIFTED, OTHERWISE, MET)
    yield from _stops(job, *([UNTOUCHED] if job.options["gate"] != "none" else []))
    yield "OTG1(PROTECTED MOVE TO PX PY PZ HAS ARRIVED)"
    yield from _arrived(job)
    yield "OTG2(MEASURING MOVE FROM PI PJ PK TO PX PY PZ)"
    yield from _measured(job)
    yield "OTG3(RECORD OF TOUCH PT WITH SPINDLE AT PS)"
    yield from _record(job)
    yield "OTG4(ROTARY AXIS AT PB HAS ARRIVED AT PA)"
    yield "TGT=ABS[PB-PA]"
    yield "TGT=ABS[TGT-360*FIX[TGT/360+0.5]]"
    yield f"IF[TGT GT {number(ARRIVED)}] {TURNED}"
    yield "RTS"
    yield from _stops(job, TURNED)


def _arrived(job: Job) -> Iterator[str]:
    for name, variable in _found(job).items():
        if name in "XYZ":  # a contact variable that the control does not have is to be noticed up here
            yield f"{variable}={_contact(job, name)}"
    yield f"TGS={_short(job)}"
    yield f"IF[TGS GT {number(job.options['tolerance'])}] {MET}"
    yield "RTS"
    yield from _stops(job, MET)


def _measured(job: Job) -> Iterator[str]:
    found, flag, misses = _found(job), _common(job, FLAG), _common(job, MISSES)
    yield job.options["wait"]
    for name, variable in found.items():
        yield f"{variable}={_contact(job, name) if name in 'XYZ' else _position(job, name)}"
    way = [f"[{found[name]}-P{start}]" for name, start in zip("XYZ", "IJK", strict=True)]
    yield f"TGS={_short(job)}"
    yield f"TGW=SQRT[{'+'.join(f'{part}*{part}' for part in way)}]"
    yield f"TGL={'+'.join(f'ABS[{found[name]}-{_position(job, name)}]' for name in 'XYZ')}"
    yield f"IF[TGS LT {number(job.options['tolerance'])}] NM2"
    yield f"IF[TGL GT {number(LAG)}] {STALE}"
    yield f"{misses}=0"
    yield f"{flag}=1"
    yield f"IF[TGW GE {number(early_distance(job.plan))}] NM1"
    yield f"{flag}=2"
    yield "NM1"
    yield "RTS"
    yield "NM2"
    for name in "XYZ":
        yield f"{found[name]}={_position(job, name)}"
    yield f"{flag}=0"
    yield f"{misses}={misses}+1"
    yield f"IF[{misses} GE {job.options['misses']}] {DEAD}"
    yield "RTS"
    yield from _stops(job, STALE, DEAD)


def _record(job: Job) -> Iterator[str]:
    """P H X Y Z … S K as one line: the sum tells lost and doubled characters."""
    places = _found(job)
    yield f"{_common(job, SUM)}={'+'.join(places.values())}+PS"
    yield "PUT 'P'"
    yield "PUT PT,6"
    yield "PUT ' H'"
    yield f"PUT {_common(job, FLAG)},1"
    for letter, variable in {**places, "S": "PS", "K": _common(job, SUM)}.items():
        yield f"PUT ' {letter}'"
        yield f"PUT {variable},{job.options['places'] + (letter == 'K')}"
    yield "WRITE C"
    yield "RTS"


def _stops(job: Job, *labels: str) -> Iterator[str]:
    """A stop says its text again and again: an alarm that is cancelled does not let the program go on.

    The file is closed once, before that: closed again, or not open yet, it may be an alarm of its own, which hides the text.
    """
    for stop in labels:
        label = stop
        yield label
        yield from filter(None, [job.options["probe_off"]])
        if stop not in UNOPENED:
            yield "CLOSE C"
            label = f"NR{stop[2:]}"
            yield label
        text = NO_FACET if stop == UNTOUCHED and job.options["gate"] == "facet" else STOPS[stop]
        yield f"VUACM[1]='{text}'"
        yield f"VDOUT[{job.options['alarm']}]={stop[2:]}"
        yield f"GOTO {label}"


def _skip(job: Job, place: Mapping[str, str], feed: float) -> Iterator[str]:
    if job.options["probe_state"]:
        yield job.options["wait"]
        yield f"IF[{job.options['probe_state']} NE 0] {DEFLECTED}"
    yield f"{job.options['skip']} {common.joined(place)} F{number(feed)}"


def _line(text: str) -> Iterator[str]:
    yield f"PUT '{text}'"
    yield "WRITE C"


def _common(job: Job, place: int) -> str:
    return f"VC{job.options['common'] + place}"


def _found(job: Job) -> dict[str, str]:
    """→ {axis letter: common variable that holds where the touch was}."""
    return {name: _common(job, FOUND + i) for i, name in enumerate(common.axes(job.machine))}


def _contact(job: Job, name: str) -> str:
    return str(job.options["contact"]).replace("?", name)


def _position(job: Job, name: str) -> str:
    return str(job.options["position"]).replace("?", name)


def _short(job: Job) -> str:
    return "+".join(f"ABS[{_position(job, name)}-P{name}]" for name in "XYZ")


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    options = job.options
    for key, pattern, allowed in (
        ("contact", VARIABLE, "a variable such as VSAP? or VSAP?[1], ? is the axis letter"),
        ("position", VARIABLE, "a variable such as VAPA?, ? is the axis letter"),
        ("probe_state", STATE, "a variable such as VDIN[11], or none"),
        ("output", FILE, "a file such as MD1:TANGO.TXT"),
        ("skip", SKIP, "a word such as G31: G22, G31 … G39, or one of the builder's own, G100 …"),
    ):
        if not pattern.fullmatch(options[key]):
            raise InputError(f"controller.{key}: found {options[key]!r}; allowed: {allowed}")
    if timer := TIMER.fullmatch(options["probe_state"]):
        raise InputError(
            f"controller.probe_state: found {timer[0]}, a timer of the control; allowed: an input, VDIN[1] to VDIN[38] (OSP-P200L "
            "5238-E p. 297)"
        )
    for key in ("wait", "machine_frame"):
        if not options[key].strip():
            raise InputError(f"controller.{key}: found nothing; allowed: words of the control")
    if not 1 <= options["common"] <= 201 - COMMON:
        raise InputError(f"controller.common: found {options['common']}; allowed: 1 … {201 - COMMON}")
    common.fits(job)


POST = Post(
    title="Okuma OSP",
    extension="MIN",
    language="osp",
    links=("dnc", "file", "remote", "modbus"),
    options=OPTIONS,
    memory=512,
    remedies=OKUMA,
    doubts=DOUBTS,
    stem=lambda job: "TANGO",
    **common.steps(globals()),
)
