"""Fagor 8060, 8065 and 8070: G100, variables V.A. of positions, records by #WRITE.

G100 moves until contact in programmed coordinates, so the constant difference between machine and programmed positions is read once
with the axes at rest (P1 P2 P3) and taken off every target; each touch reads it again and stops when it has changed. What stands
near the table is always asked: has the move arrived, did the probe see anything. A stop is #ERROR with its text and M30 behind it.

Local parameters only:  P1 P2 P3 frame · P4 flag · P5 touches without contact · P6 P7 P8 contact · P9 P10 P11 rotary axes
P12 P13 P14 distances · P15 sum
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from tango_cnc.records import InputError, Machine

from ._base import Job, Leg, Option, Post, comment, degrees, early_distance, is_endless, may_roll, named, number, rolled

VARIABLE = re.compile(r"V\.A\.[A-Z]{2,12}")
STATE = re.compile(r"(V\.[A-Z0-9.]{2,20})?")
FILE = re.compile(r"[A-Z]:(\\[A-Z0-9_-]{1,20}){1,5}\.[A-Z]{3}")
ARRIVED = 0.01  # deg
CHANGED = 0.001  # mm
LAG = 1.0  # mm that the axes may have run on between the contact and their stop
FRAME = {"X": "P1", "Y": "P2", "Z": "P3"}
FOUND = ("P6", "P7", "P8", "P9", "P10", "P11")
FLAG, MISSES, SHORT, WAY, GAP, SUM = "P4", "P5", "P12", "P13", "P14", "P15"
ROLLOVER = "angles of 0 to 360 for rotary axes without limits (auto) or for all that can stand there (always); never: as planned"

OPTIONS = (
    Option("reset", "G17 G40 G53 G71 G80 G90 G94", "modal state; the control must know every word of it", codes=True),
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
    Option("rollover", "auto", ROLLOVER, choices=("auto", "always", "never")),
    Option("unclamp", {}, "word before a rotary axis turns, e.g. {B: M11}; empty: the control does it"),
    Option("clamp", {}, "word after a rotary axis has turned, e.g. {B: M10}; empty: the control does it"),
    Option("probe_on", "", "words that switch the probe on", codes=True),
    Option("probe_off", "", "words that switch the probe off", codes=True),
    Option("decimals", 3, "decimals of axis words: the least input increment", verified=True, choices=(3, 4)),
    Option("positioning_feed", 2000.0, "mm/min of protected moves", verified=True),
    Option("tolerance", 0.02, "mm from its target within which a move has not been stopped", verified=True),
    Option("misses", 3, "touches in a row without contact after which the program stops: the probe may be dead", verified=True),
)

DOUBTS = (
    "G100 that meets nothing goes on from its end without an error",
    "G100 with a deflected probe ends at once or is an error",
    "variables V.A. of positions wait for the axes: the control does not read them ahead",
    "D0 takes the tool offset away, and #MCS before G0 turns a rotary axis in machine coordinates",
    "$IF and $ENDIF stand alone, brackets are square, #ERROR stops until reset",
    "#OPEN with A appends, #WRITE takes as many numbers in one line as a record has and prints them with a decimal point",
    "a probe that is off stops nothing: protected moves protect only while it is on",
)


def begin(job: Job) -> Iterator[str]:
    """Header, modal reset, probe at rest, frame, file, start mark."""
    plan, options = job.plan, job.options
    _check(job)
    yield f"%{named(job, 'TANGO')}"
    yield f"; TANGO {comment(job.machine.name, 40)}"
    yield f"; PROGRAM {job.mark} PLAN {job.plan_mark}"
    yield f"; {len(plan.touches)} TOUCHES OF {comment(plan.artefact.name, 40)}"
    yield "; START WITH THE PROBE IN THE SPINDLE SWITCHED ON AND CLEAR OF THE TABLE"
    yield "; NOT TRIED ON ANY FAGOR. LOOK UP EVERY LINE BELOW IN THE MANUALS OF THE CONTROL FIRST"
    for doubt in job.unverified:
        yield f"; UNVERIFIED {comment(doubt, 100)}"
    for word in options["off"].split():
        yield f"#{word} OFF"
    yield options["reset"]
    yield "D0"
    if options["probe_input"]:
        yield f"#SELECT PROBE [{options['probe_input']}]"
    yield from _at_rest(job)
    for name, parameter in FRAME.items():
        yield f"{parameter}={_machine(job, name)}-{_programmed(job, name)}"
    yield f"{MISSES}=0"
    yield f'#OPEN ["{options["output"]}","A"]'
    yield f'#WRITE ["TANGO START {job.mark} {len(plan.touches)}"]'


def probe_on(job: Job) -> Iterator[str]:
    """The words of the profile, if there are any."""
    yield job.options["probe_on"] or "; NO WORDS STATED THAT SWITCH THE PROBE ON"


def probe_off(job: Job) -> Iterator[str]:
    """The words of the profile, if there are any."""
    yield job.options["probe_off"] or "; NO WORDS STATED THAT SWITCH THE PROBE OFF"


def move(job: Job, leg: Leg) -> Iterator[str]:
    """Protected move: a G100 that has to arrive and to meet nothing."""
    place = _words(job, leg.to)
    yield from _at_rest(job)
    yield _measure(job, place, job.options["positioning_feed"])
    yield f"{SHORT}={_distance(job, place)}"
    yield from _stop_if(f"{SHORT}>{number(job.options['tolerance'])}", "PROBE MET SOMETHING ON ITS WAY OR A FRAME IS ACTIVE")
    if job.options["met"]:
        yield from _stop_if(f"{_met(job)}!=0", "PROBE MET SOMETHING ON ITS WAY")


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other; each has arrived."""
    options = job.options
    where = " ".join(f"{name}{number(degrees(value))}" for name, value in leg.to.items() if name not in "XYZ")
    yield f"; INDEX {where}"
    if "S" in leg.target and options["orient"]:
        yield f"{options['orient']}{_spindle(job, leg.target['S'])}"
    for name in job.machine.rotary:
        if name in leg.target:
            angle = _angle(job, name, leg.target[name])
            yield from filter(None, [options["unclamp"].get(name)])
            yield f"#MCS G0 {name}{angle}"
            yield from filter(None, [options["clamp"].get(name)])
            yield f"{SHORT}=ABS[{angle}-{_machine(job, name)}]"
            yield f"{SHORT}=ABS[{SHORT}-360.*FIX[{SHORT}/360.+0.5]]"
            yield from _stop_if(f"{SHORT}>{number(ARRIVED)}", "ROTARY AXIS NOT IN PLACE")


def approach(job: Job, leg: Leg) -> Iterator[str]:
    """Down to the stand-off."""
    yield f"; TOUCH {leg.touch.number} FACET {comment(leg.touch.facet, 20)}"
    yield from move(job, leg)


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, then the flag in P4 and machine coordinates in P6 and so on."""
    start = _words(job, dict(zip(job.machine.names, leg.touch.standoff, strict=True)))
    place, found = _words(job, leg.to), _found(job)
    yield from _at_rest(job)
    yield _measure(job, place, job.plan.strategy.approach.feed)
    for name, parameter in found.items():
        yield f"{parameter}={_contact(job, name) if name in 'XYZ' else _machine(job, name)}"
    yield f"{GAP}={'+'.join(f'ABS[{_machine(job, n)}-{_programmed(job, n)}-{FRAME[n]}]' for n in FRAME)}"
    yield from _stop_if(f"{GAP}>{number(CHANGED)}", "WORK OFFSET CHANGED")
    yield f"{SHORT}={_distance(job, place)}"
    way = [f"[{found[name]}-{_signed(value)}]" for name, value in start.items()]
    yield f"{WAY}=SQRT[{'+'.join(f'{part}*{part}' for part in way)}]"
    yield f"{GAP}={'+'.join(f'ABS[{found[name]}-{_machine(job, name)}]' for name in 'XYZ')}"
    yield f"{FLAG}=1"
    yield from _if(f"{WAY}<{number(early_distance(job.plan))}", f"{FLAG}=2")
    yield from _if(f"{SHORT}<{number(job.options['tolerance'])}", f"{FLAG}=0")
    if job.options["met"]:
        yield from _if(f"{_met(job)}==0", f"{FLAG}=0")
    yield from _if(f"{FLAG}==0", *(f"{found[name]}={_machine(job, name)}" for name in "XYZ"), f"{GAP}=0")
    yield from _stop_if(f"{GAP}>{number(LAG)}", "CONTACT DOES NOT FIT WHERE THE AXES STAND")
    yield f"{MISSES}={MISSES}+1"
    yield from _if(f"{FLAG}!=0", f"{MISSES}=0")
    yield from _stop_if(f"{MISSES}>={job.options['misses']}", "NO CONTACT. IS THE PROBE ALIVE")


def back(job: Job, leg: Leg) -> Iterator[str]:
    """To the stand-off the way it came, the only unguarded move."""
    yield f"G1 {_targets(_words(job, leg.to))} F{number(job.options['positioning_feed'])}"


def record(job: Job, leg: Leg) -> Iterator[str]:
    """One line: touch, flag, machine coordinates, spindle, their sum."""
    found, spindle, letter = _found(job), _spindle(job, leg.to["S"]), job.options["conversion"]
    places = " ".join(f"{name}%{letter}" for name in found)
    yield f"{SUM}={'+'.join(found.values())}+{spindle}"
    text = f"P{leg.touch.number} H%{letter} {places} S{rolled(degrees(leg.to['S']), 4):.4f} K%{letter}"
    yield f'#WRITE ["{text}",{",".join((FLAG, *found.values(), SUM))}]'


def end(job: Job) -> Iterator[str]:
    """End mark, end of program."""
    yield f'#WRITE ["TANGO END {len(job.plan.touches)}"]'
    yield "#CLOSE"
    yield "M30"


def _at_rest(job: Job) -> Iterator[str]:
    """A probe that is deflected may have no edge to give: what follows would not be guarded."""
    if job.options["probe_state"]:
        yield from _stop_if(f"{job.options['probe_state']}!=0", "PROBE IS DEFLECTED")


def _stop_if(condition: str, text: str) -> Iterator[str]:
    yield from _if(condition, f'#ERROR ["TANGO {text}"]', "M30")


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


def _signed(value: str) -> str:
    return f"[{value}]" if value.startswith("-") else value


def _found(job: Job) -> dict[str, str]:
    """→ {axis letter: parameter that holds where the touch was}."""
    return dict(zip(_axes(job.machine), FOUND, strict=False))


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
    title="Fagor 8060, 8065 and 8070",
    extension="NC",
    options=OPTIONS,
    doubts=DOUBTS,
    stem=lambda job: named(job, "TANGO"),
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
