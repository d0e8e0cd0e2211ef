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

from tango_cnc.records import InputError, Machine

from ._base import Job, Leg, Option, Post, comment, degrees, early_distance, is_endless, may_roll, number, rolled

VARIABLE = re.compile(r"[A-Z]{2,6}\?(\[\d{1,4}\])?")  # ? stands for the axis letter
STATE = re.compile(r"([A-Z]{2,8}(\[\d{1,4}\])?)?")
FILE = re.compile(r"[A-Z]{2}\d:[A-Z0-9-]{1,16}\.[A-Z]{3}")
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
}  # at most 16 characters each: more are not shown
DEFLECTED, MET, DEAD, STALE, TURNED, RESTARTED, SHIFTED = STOPS
ROLLOVER = "angles of 0 to 360 for rotary axes without limits (auto) or for all that can stand there (always); never: as planned"

OPTIONS = (
    Option("skip", "G31", "word of the move that the probe ends", codes=True),
    Option(
        "contact", "VSAP?", "variable of the machine position at the contact, ? is the axis letter; some want an index: VSAP?[1]"
    ),
    Option("position", "VAPA?", "variable of the machine position of an axis, ? is the axis letter"),
    Option("wait", "G4 F0.05", "words after which variables are read with the axes at rest, not ahead", codes=True),
    Option("probe_state", "", "variable that is 0 while the probe is free, e.g. VDIN[1001]; empty: none is asked"),
    Option("machine_frame", "G15 H0", "words that make programmed positions machine positions", codes=True),
    Option("frame_check", True, "VACOD is 0 in machine coordinates; false: it is not asked"),
    Option("reset", "G10 G17 G21 G40 G53 G69 G80 G90 G94 G170", "modal state; the control must know each word", codes=True),
    Option("common", 101, "first of nine common variables VC that the program overwrites"),
    Option("output", "MD1:TANGO.TXT", "file of the control for the records, which are appended"),
    Option("places", 10, "places of a printed coordinate in PUT; it must come with four decimals", choices=(10, 11, 12)),
    Option("alarm", 992, "VDOUT that stops with the text of VUACM", choices=(990, 991, 992, 993)),
    Option("orient", "M19 RS", "word before = and the angle that orients the spindle; empty: it is not turned", codes=True),
    Option("rollover", "auto", ROLLOVER, choices=("auto", "always", "never")),
    Option("unclamp", {}, "word before a rotary axis turns, e.g. {B: M21}; empty: the control does it"),
    Option("clamp", {}, "word after a rotary axis has turned, e.g. {B: M20}; empty: the control does it"),
    Option("probe_on", "", "words that switch the probe on", codes=True),
    Option("probe_off", "", "words that switch the probe off", codes=True),
    Option("decimals", 3, "decimals of axis words: the least input increment", verified=True, choices=(3, 4)),
    Option("positioning_feed", 2000.0, "mm/min of protected moves", verified=True),
    Option("tolerance", 0.02, "mm from its target within which a move has not been stopped", verified=True),
    Option("misses", 3, "touches in a row without contact after which the program stops: the probe may be dead", verified=True),
)

DOUBTS = (
    "the skip move ends at the contact, at its end without alarm when there is none, and at once when the probe is deflected",
    "the contact variable is without length and calibration of the probe: compare one touch by hand",
    "G53 cancels the tool length here, and G0 turns a rotary axis in machine coordinates of H0",
    "subprograms may stand behind M02 in one file, CALL passes PX PY PZ PI PJ PK PT PS PA PB",
    "PUT of a number prints digits with a decimal point, blanks before them",
    "a probe that is off stops nothing: protected moves protect only while it is on. Try the first one with a finger at the probe",
)


def begin(job: Job) -> Iterator[str]:
    """Header, no restart, modal reset, machine coordinates, file, start mark."""
    plan, options = job.plan, job.options
    _check(job)
    yield "OTNGO"
    yield f"(TANGO {comment(job.machine.name, 40)})"
    yield f"(PROGRAM {job.mark} PLAN {job.plan_mark})"
    yield f"({len(plan.touches)} TOUCHES OF {comment(plan.artefact.name, 40)})"
    yield "(START WITH THE PROBE IN THE SPINDLE SWITCHED ON AND CLEAR OF THE TABLE)"
    yield "(NOT TRIED ON ANY OKUMA. LOOK UP EVERY LINE BELOW IN THE MANUALS OF THE MACHINE FIRST)"
    for doubt in job.unverified:
        yield f"(UNVERIFIED {comment(doubt, 100)})"
    yield f"IF[VRSTT EQ 128] {RESTARTED}"
    yield options["reset"]
    yield options["machine_frame"]
    yield options["wait"]
    if options["frame_check"]:
        yield f"IF[VACOD NE 0] {SHIFTED}"
    yield f"{_common(job, MISSES)}=0"
    yield f"FWRITC {options['output']};A"
    yield from _line(f"TANGO START {job.mark} {len(plan.touches)}")


def probe_on(job: Job) -> Iterator[str]:
    """The words of the profile, if there are any."""
    yield job.options["probe_on"] or "(NO WORDS STATED THAT SWITCH THE PROBE ON)"


def probe_off(job: Job) -> Iterator[str]:
    """The words of the profile, if there are any."""
    yield job.options["probe_off"] or "(NO WORDS STATED THAT SWITCH THE PROBE OFF)"


def move(job: Job, leg: Leg) -> Iterator[str]:
    """Protected move: a skip move that has to arrive. An axis that nobody has moved yet stays where it is."""
    place = _words(job, leg.to)
    yield from _skip(job, place, job.options["positioning_feed"])
    yield job.options["wait"]
    yield "CALL OTG1 " + " ".join(f"P{name}={place.get(name, _position(job, name))}" for name in "XYZ")


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other; each has arrived."""
    options = job.options
    where = " ".join(f"{name}{number(degrees(value))}" for name, value in leg.to.items() if name not in "XYZ")
    yield f"(INDEX {where})"
    if "S" in leg.target and options["orient"]:
        yield f"{options['orient']}={_spindle(job, leg.target['S'])}"
    for name in job.machine.rotary:
        if name in leg.target:
            angle = _angle(job, name, leg.target[name])
            yield from filter(None, [options["unclamp"].get(name)])
            yield f"G0 {name}{angle}"
            yield from filter(None, [options["clamp"].get(name)])
            yield options["wait"]
            yield f"CALL OTG4 PA={angle} PB={_position(job, name)}"


def approach(job: Job, leg: Leg) -> Iterator[str]:
    """Down to the stand-off."""
    yield f"(TOUCH {leg.touch.number} FACET {comment(leg.touch.facet, 20)})"
    yield from move(job, leg)


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, then OTG2 for flag and machine coordinates."""
    start = _words(job, dict(zip(job.machine.names, leg.touch.standoff, strict=True)))
    place = _words(job, leg.to)
    yield from _skip(job, place, job.plan.strategy.approach.feed)
    targets = " ".join(f"P{name}={value}" for name, value in place.items())
    starts = " ".join(f"P{letter}={value}" for letter, value in zip("IJK", start.values(), strict=True))
    yield f"CALL OTG2 {targets} {starts}"


def back(job: Job, leg: Leg) -> Iterator[str]:
    """To the stand-off the way it came, the only unguarded move."""
    yield f"G1 {_axis_words(_words(job, leg.to))} F{number(job.options['positioning_feed'])}"


def record(job: Job, leg: Leg) -> Iterator[str]:
    """The line of the touch by OTG3."""
    yield f"CALL OTG3 PT={leg.touch.number} PS={_spindle(job, leg.to['S'])}"


def end(job: Job) -> Iterator[str]:
    """End mark, end of program; behind it its stops and the subprograms with theirs."""
    yield from _line(f"TANGO END {len(job.plan.touches)}")
    yield "CLOSE C"
    yield "M02"
    yield from _stops(job, *([DEFLECTED] if job.options["probe_state"] else []), RESTARTED, SHIFTED)
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
    """A stop says its text again and again: an alarm that is cancelled does not let the program go on."""
    for label in labels:
        yield label
        yield f"VUACM[1]='{STOPS[label]}'"
        yield f"VDOUT[{job.options['alarm']}]={label[2:]}"
        yield f"GOTO {label}"


def _skip(job: Job, place: Mapping[str, str], feed: float) -> Iterator[str]:
    if job.options["probe_state"]:
        yield job.options["wait"]
        yield f"IF[{job.options['probe_state']} NE 0] {DEFLECTED}"
    yield f"{job.options['skip']} {_axis_words(place)} F{number(feed)}"


def _line(text: str) -> Iterator[str]:
    yield f"PUT '{text}'"
    yield "WRITE C"


def _common(job: Job, place: int) -> str:
    return f"VC{job.options['common'] + place}"


def _found(job: Job) -> dict[str, str]:
    """→ {axis letter: common variable that holds where the touch was}."""
    return {name: _common(job, FOUND + i) for i, name in enumerate(_axes(job.machine))}


def _contact(job: Job, name: str) -> str:
    return str(job.options["contact"]).replace("?", name)


def _position(job: Job, name: str) -> str:
    return str(job.options["position"]).replace("?", name)


def _short(job: Job) -> str:
    return "+".join(f"ABS[{_position(job, name)}-P{name}]" for name in "XYZ")


def _axis_words(place: Mapping[str, str]) -> str:
    return " ".join(f"{name}{value}" for name, value in place.items())


def _words(job: Job, place: Mapping[str, float]) -> dict[str, str]:
    """positions → {linear axis: number as text} of those that are known."""
    return {name: number(place[name], job.options["decimals"]) for name in "XYZ" if name in place}


def _angle(job: Job, name: str, value: float) -> str:
    """axis letter, rad → deg to command."""
    angle, rule, decimals = degrees(value), job.options["rollover"], job.options["decimals"]
    turns = (rule == "always" and may_roll(job.machine, name)) or (rule == "auto" and is_endless(job.machine, name))
    return number(rolled(angle, decimals) if turns else angle, decimals)


def _spindle(job: Job, value: float) -> str:
    """rad → angle of the spindle in [0, 360) as text."""
    return number(rolled(degrees(value), job.options["decimals"]), job.options["decimals"])


def _axes(machine: Machine) -> list[str]:
    return [name for name in machine.names if name != "S"]


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    machine, options = job.machine, job.options
    for key, pattern, allowed in (
        ("contact", VARIABLE, "a variable such as VSAP? or VSAP?[1], ? is the axis letter"),
        ("position", VARIABLE, "a variable such as VAPA?, ? is the axis letter"),
        ("probe_state", STATE, "a variable such as VDIN[1001], or nothing"),
        ("output", FILE, "a file such as MD1:TANGO.TXT"),
    ):
        if not pattern.fullmatch(options[key]):
            raise InputError(f"controller.{key}: found {options[key]!r}; allowed: {allowed}")
    for key in ("skip", "wait", "machine_frame"):
        if not options[key].strip():
            raise InputError(f"controller.{key}: found nothing; allowed: words of the control")
    if not 1 <= options["common"] <= 201 - COMMON:
        raise InputError(f"controller.common: found {options['common']}; allowed: 1 … {201 - COMMON}")
    if options["positioning_feed"] <= 0 or options["tolerance"] <= 0 or options["misses"] < 1:
        raise InputError("controller: found positioning_feed, tolerance or misses of 0 or less; allowed: more than 0")
    for key in ("unclamp", "clamp"):
        for name, word in options[key].items():
            if name not in machine.rotary or not (isinstance(word, str) and word.isascii() and word.isalnum() and word.isupper()):
                raise InputError(
                    f"controller.{key}: found {name!r}: {word!r}; allowed: a word such as M10 for {', '.join(machine.rotary)}"
                )
    turns = {round(touch.standoff[machine.column("S")], 9) for touch in job.plan.touches}
    if not options["orient"] and len(turns) > 1:
        raise InputError("controller.orient: found nothing; allowed: the word that orients the spindle, as this strategy turns it")


POST = Post(
    title="Okuma OSP",
    extension="MIN",
    options=OPTIONS,
    doubts=DOUBTS,
    stem=lambda job: "TANGO",
    begin=begin,
    probe_on=probe_on,
    retract=move,
    clear=move,
    index=index,
    approach=approach,
    probe=probe,
    back=back,
    record=record,
    probe_off=probe_off,
    end=end,
)
