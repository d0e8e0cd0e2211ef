"""The Macro-B family: G31 that says nothing when it misses, #506x, DPRNT. One `Words` table a dialect, the steps are shared.

Main program and macros are O-programs of one file. A touch is six lines that a person can read; what they do is written once,
in four macros after the main program:

    P+1  protected move: G31 to X Y Z, alarm when it stops short
    P+2  measuring move: G31 from I J K to X Y Z; #110 = 1 contact, 0 none, 2 early; #111 … machine coordinates
    P+3  record of touch T, spindle at S
    P+4  rotary axes A B C have arrived

All targets are machine coordinates. G31 lives in the work frame, so the constant difference of both is read once with the axes
at rest (#101 …) and taken off; each touch reads it again and stops when it has changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tango_cnc.records import InputError

from ._base import Job, Leg, Option, comment, degrees, early_distance, number, rolled, rolls_over

ARGUMENT = {"A": 1, "B": 2, "C": 3, "I": 4, "J": 5, "K": 6, "F": 9, "S": 19, "T": 20, "X": 24, "Y": 25, "Z": 26}
FRAME = 100  # #101 …: machine minus work coordinate of axis 1 …
MISSES = 109  # #109: touches without contact in a row
FLAG = 110  # #110, then #111 …: flag and machine coordinates of the last touch

AXIS_NUMBERS = "number of each axis in #5021 #5041 #5061, e.g. {X: 1, Y: 2, Z: 3, B: 4, C: 5}; empty: in the order X Y Z A B C"


@dataclass(frozen=True)
class Words:
    """What differs between the dialects of the family."""

    open: tuple[str, ...] = ("POPEN",)
    close: tuple[str, ...] = ("PCLOS",)
    end: str = "M30"
    alarm: str = "#3000={number}({text})"
    first_alarm: int = 81
    o_digits: int = 4


OPTIONS = (
    Option("program_number", 8700, "O number of the program; its macros take the next four", verified=True),
    Option("reset", "G17 G21 G40 G49 G69 G80 G90 G94", "modal state that the control knows every word of", codes=True),
    Option("probe_on", "", "words that switch the probe on, e.g. G65 P9832", codes=True),
    Option("probe_off", "", "words that switch the probe off, e.g. G65 P9833", codes=True),
    Option("orient", "M19 R", "word before the angle that orients the spindle; empty: the spindle is not turned", codes=True),
    Option("axis_numbers", {}, AXIS_NUMBERS),
    Option("rollover", True, "a rotary axis that may stand anywhere takes angles of 0 … 360 the short way (ROA, param 1008#0)"),
    Option("unclamp", {}, "word before a rotary axis turns, e.g. {B: M11}; empty: the control does it"),
    Option("clamp", {}, "word after a rotary axis has turned, e.g. {B: M10}; empty: the control does it"),
    Option("print_format", "44", "digits before and after the point of a printed coordinate", choices=("44", "43", "53")),
    Option("decimals", 3, "decimals of axis words: the least input increment", verified=True, choices=(3, 4)),
    Option("positioning_feed", 3000.0, "mm/min of protected moves", verified=True),
    Option("tolerance", 0.02, "mm from its target within which a move has not been stopped", verified=True),
    Option("misses", 3, "touches in a row without contact after which the program stops: the probe may be dead", verified=True),
)

DOUBTS = (
    "G31 ends at once when the probe is deflected and stores the end point in #506X when nothing is met",
    "G53 G0 turns a rotary axis in machine coordinates",
    "#506X #502X #504X of axes at rest differ by constants",
    "the probe must be on: nothing but its signal stops a protected move",
)


def steps(words: Words) -> dict[str, Any]:
    """words of a dialect → the steps of its post."""

    def alarm(offset: int, text: str) -> str:
        return words.alarm.format(number=words.first_alarm + offset, text=text)

    def begin(job: Job) -> Iterator[str]:
        plan, machine = job.plan, job.machine
        _check(job)
        yield "%"
        yield f"O{_macro(job, 0):0{words.o_digits}d}(TANGO {comment(machine.name, 40)})"
        yield f"(PROGRAM {job.mark} PLAN {job.plan_mark})"
        yield f"({len(plan.touches)} TOUCHES OF {comment(plan.artefact.name, 40)})"
        yield "(START WITH THE PROBE IN THE SPINDLE SWITCHED ON AND CLEAR OF THE TABLE)"
        for text in job.unverified:
            yield f"(UNVERIFIED {comment(text, 70)})"
        yield job.options["reset"]
        yield "G53"
        yield "(MACHINE MINUS WORK COORDINATES)"
        for i, axis in _numbers(job).items():
            yield f"#{FRAME + axis}=#{5020 + axis}-#{5040 + axis}({i})"
        yield f"#{MISSES}=0"
        yield from words.open
        yield f"#{FLAG}={len(plan.touches)}"
        yield f"DPRNT[TANGO*START*{job.mark}*#{FLAG}[60]]"

    def probe_on(job: Job) -> Iterator[str]:
        yield job.options["probe_on"] or "(NO WORDS STATED THAT SWITCH THE PROBE ON)"

    def probe_off(job: Job) -> Iterator[str]:
        yield job.options["probe_off"] or "(NO WORDS STATED THAT SWITCH THE PROBE OFF)"

    def protected(job: Job, leg: Leg) -> Iterator[str]:
        yield f"G65 P{_macro(job, 1)} {_xyz(job, leg.to)} F{number(job.options['positioning_feed'])}"

    def index(job: Job, leg: Leg) -> Iterator[str]:
        decimals = job.options["decimals"]
        where = " ".join(f"{name}{number(degrees(value))}" for name, value in leg.to.items() if name not in "XYZ")
        yield f"(INDEX {where})"
        if "S" in leg.target and job.options["orient"]:
            yield f"{job.options['orient']}{number(rolled(degrees(leg.target['S']), decimals), decimals)}"
        turned = []
        for name in job.machine.rotary:
            if name not in leg.target:
                continue
            turned.append(f"{name}{number(_angle(job, name, leg.target[name]), decimals)}")
            yield from filter(None, [job.options["unclamp"].get(name)])
            yield f"G90 G53 G0 {turned[-1]}"
            yield from filter(None, [job.options["clamp"].get(name)])
        if turned:
            yield f"G65 P{_macro(job, 4)} {' '.join(turned)}"

    def approach(job: Job, leg: Leg) -> Iterator[str]:
        yield f"N{leg.touch.number}(TOUCH {leg.touch.number} FACET {comment(leg.touch.facet, 20)})"
        yield from protected(job, leg)

    def probe(job: Job, leg: Leg) -> Iterator[str]:
        start = dict(zip(job.machine.names, leg.touch.standoff, strict=True))
        decimals = job.options["decimals"]
        ijk = " ".join(f"{letter}{number(start[name], decimals)}" for letter, name in zip("IJK", "XYZ", strict=True))
        yield f"G65 P{_macro(job, 2)} {_xyz(job, leg.to)} {ijk} F{number(job.plan.strategy.approach.feed)}"

    def back(job: Job, leg: Leg) -> Iterator[str]:
        place = {name: number(leg.to[name], job.options["decimals"]) for name in "XYZ"}
        numbers = _numbers(job)
        words_ = " ".join(f"{name}[{place[name]}-#{FRAME + numbers[name]}]" for name in "XYZ")
        yield f"G1 {words_} F{number(job.options['positioning_feed'])}"

    def record(job: Job, leg: Leg) -> Iterator[str]:
        angle = rolled(degrees(leg.to["S"]), job.options["decimals"])
        yield f"G65 P{_macro(job, 3)} T{number(leg.touch.number)} S{number(angle, job.options['decimals'])}"

    def end(job: Job) -> Iterator[str]:
        yield f"#{FLAG}={len(job.plan.touches)}"
        yield f"DPRNT[TANGO*END*#{FLAG}[60]]"
        yield from words.close
        yield words.end
        yield from macros(job)
        yield "%"

    def macros(job: Job) -> Iterator[str]:
        tolerance = number(job.options["tolerance"])
        axis = _numbers(job)
        xyz = [(ARGUMENT[name], axis[name], 30 + i) for i, name in enumerate("XYZ", 1)]
        short = "+".join(f"[#{5060 + a}-#{w}]*[#{5060 + a}-#{w}]" for _, a, w in xyz)
        yield f"O{_macro(job, 1):0{words.o_digits}d}(PROTECTED MOVE TO MACHINE X Y Z AT F)"
        for argument, a, _ in xyz:
            yield f"IF[#{argument}EQ#0]THEN#{argument}=#{5020 + a}"
        for argument, a, work in xyz:
            yield f"#{work}=#{argument}-#{FRAME + a}"
        yield "G31 X#31 Y#32 Z#33 F#9"
        yield f"IF[SQRT[{short}]GT{tolerance}]THEN{alarm(0, 'PROBE MET SOMETHING ON ITS WAY')}"
        yield "M99"
        yield f"O{_macro(job, 2):0{words.o_digits}d}(MEASURING MOVE FROM MACHINE I J K TO X Y Z AT F)"
        for argument, a, work in xyz:
            yield f"#{work}=#{argument}-#{FRAME + a}"
        yield "G31 X#31 Y#32 Z#33 F#9"
        for name, a in axis.items():
            yield f"#{FLAG + a}=#{5060 + a}+#{5020 + a}-#{5040 + a}({name})"
        for _, a, _ in xyz:
            moved = f"ABS[#{5020 + a}-#{5040 + a}-#{FRAME + a}]"
            yield f"IF[{moved}GT0.001]THEN{alarm(1, 'WORK OFFSET CHANGED')}"
        start = "+".join(f"[#{FLAG + a}-#{4 + i}]*[#{FLAG + a}-#{4 + i}]" for i, (_, a, _) in enumerate(xyz))
        yield f"#{FLAG}=1"
        yield f"IF[SQRT[{start}]LT{number(early_distance(job.plan))}]THEN#{FLAG}=2"
        yield f"IF[SQRT[{short}]LT{tolerance}]THEN#{FLAG}=0"
        yield f"#{MISSES}=#{MISSES}+1"
        yield f"IF[#{FLAG}NE0]THEN#{MISSES}=0"
        yield f"IF[#{MISSES}GE{job.options['misses']}]THEN{alarm(2, 'NO CONTACT. IS THE PROBE ALIVE')}"
        yield "M99"
        yield f"O{_macro(job, 3):0{words.o_digits}d}(RECORD OF TOUCH T WITH SPINDLE AT S)"
        form = job.options["print_format"]
        coordinates = "*".join(f"{name}#{FLAG + a}[{form}]" for name, a in axis.items())
        yield f"DPRNT[P#20[60]*H#{FLAG}[10]*{coordinates}*S#19[{form}]]"
        yield "M99"
        yield f"O{_macro(job, 4):0{words.o_digits}d}(ROTARY AXES HAVE ARRIVED AT A B C)"
        yield "G53"
        for name in job.machine.rotary:
            argument, a = ARGUMENT[name], axis[name]
            yield f"IF[#{argument}EQ#0]THEN#{argument}=#{5020 + a}"
            yield f"#31=ABS[#{5020 + a}-#{argument}]"
            yield "#31=ABS[#31-360*FIX[#31/360+0.5]]"
            yield f"IF[#31GT0.01]THEN{alarm(3, 'ROTARY AXIS NOT IN PLACE')}"
        yield "M99"

    return {
        "stem": lambda job: f"O{_macro(job, 0):0{words.o_digits}d}",
        "begin": begin,
        "probe_on": probe_on,
        "retract": protected,
        "clear": protected,
        "index": index,
        "approach": approach,
        "probe": probe,
        "back": back,
        "record": record,
        "probe_off": probe_off,
        "end": end,
    }


def _macro(job: Job, which: int) -> int:
    return int(job.options["program_number"]) + which


def _numbers(job: Job) -> dict[str, int]:
    """job → {axis letter: its number in the system variables}, spindle left out."""
    names = [name for name in job.machine.names if name != "S"]
    stated: Mapping[str, Any] = job.options["axis_numbers"]
    return {name: int(stated[name]) for name in names} if stated else {name: i for i, name in enumerate(names, 1)}


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the machine or the plan."""
    machine, options = job.machine, job.options
    stated = options["axis_numbers"]
    names = [name for name in machine.names if name != "S"]
    if stated and (sorted(stated) != sorted(names) or sorted(set(stated.values())) != sorted(stated.values())):
        raise InputError(f"controller.axis_numbers: found {stated!r}; allowed: a number of its own for each of {', '.join(names)}")
    if any(not isinstance(n, int) or not 1 <= n <= 8 for n in stated.values()):
        raise InputError(f"controller.axis_numbers: found {stated!r}; allowed: whole numbers 1 … 8")
    if not 1 <= options["program_number"] <= 9995:
        raise InputError(f"controller.program_number: found {options['program_number']}; allowed: 1 … 9995")
    for key in ("unclamp", "clamp"):
        for name, word in options[key].items():
            if name not in machine.rotary or not isinstance(word, str) or not word.replace(" ", "").isalnum():
                raise InputError(
                    f"controller.{key}: found {name!r}: {word!r}; allowed: a word such as M10 for {', '.join(machine.rotary)}"
                )
    turns = {round(touch.standoff[machine.column("S")], 9) for touch in job.plan.touches}
    if not options["orient"] and len(turns) > 1:
        raise InputError("controller.orient: found nothing; allowed: the word that orients the spindle, as this strategy turns it")


def _angle(job: Job, name: str, value: float) -> float:
    angle = degrees(value)
    return rolled(angle, job.options["decimals"]) if job.options["rollover"] and rolls_over(job.machine, name) else angle


def _xyz(job: Job, place: Mapping[str, float]) -> str:
    """Axis words of the linear axes whose place is known."""
    return " ".join(f"{name}{number(place[name], job.options['decimals'])}" for name in "XYZ" if name in place)
