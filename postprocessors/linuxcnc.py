"""LinuxCNC 2.9 and later (g-code.adoc, o-code.adoc, tried with rs274 and the whole control).

A move that is no probing move is aborted by the control itself when the probe trips, so positioning is plain G53 G1. But only the
moment of tripping is noticed (control.c): a probe that is on already guards nothing. So every retract, the first move of all
among them, is a search (G38.3), which the control does not begin with the probe on. Probing is G38.3 too, which does not stop
the program when it misses; #5070 tells. Previews never trip the probe, so whatever ends a program looks at #<_task> first.

Before the first move the program itself looks at the probe: #<_hal[motion.probe-input]> is the pin that control.c looks at, and
M66 E0 L0 makes the reading of lines wait for what was commanded before (overview.adoc). EXISTS goes first: rs274 without the
control has no pins, and [RS274NGC]HAL_PIN_VARS = 0 forbids to read them; the control's refusal of the first search remains then.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace

from tango_cnc.records import InputError, Machine

from . import _common as common
from ._alive import proving
from ._base import Job, Leg, Option, Post, degrees, early_distance, is_endless, may_roll, number, rolled
from ._options import OBEYS
from ._remedies import LINUXCNC

PLACE = {name: i for i, name in enumerate("XYZABC")}  # of an axis in #5061 …
PATH = re.compile(r"[A-Za-z0-9._/-]{1,120}")
PROBE = "#<_hal[motion.probe-input]>"  # 1 while the stylus is deflected
RESET = "G17 G21 G40 G49 G61 G80 G90 G94 M5"  # G61: without it corners are rounded, by centimetres at high feeds

OPTIONS = (
    Option("log", "tango-readings.txt", "file for the records, on the control's disk", verified=True),
    Option("orient", True, "the spindle is oriented with M19 R (needs spindle.0.orient in HAL)"),
    Option("orient_time", 30, "seconds that M19 may take", verified=True),
    Option("wrapped", False, "rotary axes have WRAPPED_ROTARY = 1: 0 to 360, signed by the sense of the turn"),
    Option("unclamp", {}, "word before a rotary axis turns, e.g. {B: M64 P1}; a locking indexer needs none", verified=True),
    Option("clamp", {}, "word after a rotary axis has turned, e.g. {B: M65 P1}; a locking indexer needs none", verified=True),
    *common.PROBE_SWITCHES,
    Option("positioning_feed", 3000.0, "mm/min between touches", verified=True),
    common.MISSED,
    replace(OBEYS, default="acts", verified=True),  # tried on a real 2.9: a touch at 25 % takes four times as long
)
DOUBTS = ("a probe that is off stops nothing: guarded moves are guarded only while it is on",)


def begin(job: Job) -> Iterator[str]:
    """Header, the two subroutines, modal reset, the frame, start mark."""
    plan = job.plan
    _check(job)
    yield from common.titled(job, "(%s)")
    yield from common.warned(job, "(%s)")
    yield from _touch(job)
    yield from _record(job.machine)
    yield from _free(job)
    yield RESET
    yield "(MACHINE MINUS WORK COORDINATES)"
    for name in common.axes(job.machine):
        yield f"#<_tango_{name.lower()}> = [#<_abs_{name.lower()}> - #<_{name.lower()}>]"
    yield "#<_tango_misses> = 0"
    yield from _abort(job, "O100", "#[5210 + 20 * #5220] NE 0", "THE WORK FRAME IS ROTATED")
    yield f"(LOGOPEN,{job.options['log']})"
    yield f"(LOG,TANGO START {job.mark} {len(plan.touches)})"


def _touch(job: Job) -> Iterator[str]:
    """Subroutine: probes from #4 #5 #6 to #1 #2 #3 (machine coordinates) at #7; flag and machine coordinates in #<_tango_…>."""
    yield "O<tango_touch> SUB"
    target = " ".join(f"{name}[#{i} - #<_tango_{name.lower()}>]" for i, name in enumerate("XYZ", 1))
    yield f"G38.3 {target} F#7"
    for name in common.axes(job.machine):
        low = name.lower()
        yield f"#<_tango_at_{low}> = [#{5061 + PLACE[name]} + #<_abs_{low}> - #<_{low}>]"
    for name in "XYZ":
        low = name.lower()
        yield from _abort(
            job, f"O11{PLACE[name]}", f"ABS[#<_abs_{low}> - #<_{low}> - #<_tango_{low}>] GT 0.001", "WORK OFFSET CHANGED"
        )
    way = " + ".join(f"[#<_tango_at_{name.lower()}> - #{i}] ** 2" for i, name in enumerate("XYZ", 4))
    yield "#<_tango_flag> = 1"
    yield f"O120 IF [SQRT[{way}] LT {number(early_distance(job.plan))}]"
    yield "#<_tango_flag> = 2"
    yield "O120 ENDIF"
    yield "#<_tango_misses> = [#<_tango_misses> + 1]"
    yield "O130 IF [#5070 EQ 0]"
    yield "#<_tango_flag> = 0"
    yield "O130 ELSE"
    yield "#<_tango_misses> = 0"
    yield "O130 ENDIF"
    yield from _abort(job, "O140", f"#<_tango_misses> GE {job.options['misses']}", "NO CONTACT. IS THE PROBE ALIVE")
    yield "O<tango_touch> ENDSUB"


def _record(machine: Machine) -> Iterator[str]:
    """Subroutine: one line for touch #1 with the spindle at #2, and the sum of its coordinates."""
    yield "O<tango_record> SUB"
    first, *rest = common.axes(machine)
    yield f"#<_tango_k> = [{' + '.join(f'#<_tango_at_{name.lower()}>' for name in (first, *rest))} + #2]"
    values = f"{first}%.6f#<_tango_at_{first.lower()}> " + " ".join(f"{name}#<_tango_at_{name.lower()}>" for name in rest)
    yield f"(LOG,P%d#1 H#<_tango_flag> {values} S#2 K#<_tango_k>)"
    yield "O<tango_record> ENDSUB"


def _free(job: Job) -> Iterator[str]:
    """Subroutine: searches to #1 #2 #3 (machine coordinates) at #4 and is to find nothing."""
    yield "O<tango_free> SUB"
    yield f"G38.3 {' '.join(f'{name}[#{i} - #<_tango_{name.lower()}>]' for i, name in enumerate('XYZ', 1))} F#4"
    yield from _abort(job, "O150", "#5070 NE 0", "PROBE MET SOMETHING ON ITS WAY")
    yield "O<tango_free> ENDSUB"


def _abort(job: Job, label: str, condition: str, message: str) -> Iterator[str]:
    """Ends the program with a message, probe off and log closed; but never a preview, where nothing is ever touched.

    What is still in the queue when the message comes is thrown away, so M66 waits until the words of the probe are carried out.
    """
    yield f"{label} IF [[#<_task> EQ 1] AND [{condition}]]"
    if job.options["probe_off"]:
        yield job.options["probe_off"]
        yield "M66 E0 L0"
    yield "(LOGCLOSE)"
    yield f"(ABORT,{message})"
    yield f"{label} ENDIF"


_switch_on, probe_off = common.switches("(%s)")


def probe_on(job: Job) -> Iterator[str]:
    """The words of the profile, then the program ends if the probe is deflected."""
    yield from _switch_on(job)
    yield "M66 E0 L0"
    yield "#<_tango_on> = 0"
    yield f"O160 IF [EXISTS[{PROBE}]]"
    yield f"#<_tango_on> = {PROBE}"
    yield "O160 ENDIF"
    yield from _abort(job, "O161", "#<_tango_on> NE 0", "THE PROBE IS DEFLECTED")


def retract(job: Job, leg: Leg) -> Iterator[str]:
    """A search that is to find nothing, from where the machine stands; a way of no length is none, which newer versions refuse."""
    there = common.words(job, leg.to)
    if there == common.words(job, leg.came):
        yield from move(job, leg)
        return
    values = [there.get(name, f"#<_abs_{name.lower()}>") for name in "XYZ"]
    yield "O<tango_free> CALL " + " ".join(f"[{v}]" for v in (*values, number(job.options["positioning_feed"])))


def move(job: Job, leg: Leg) -> Iterator[str]:
    """A straight move in machine coordinates, which the control aborts when the probe trips."""
    yield f"G53 G1 {common.joined(common.words(job, leg.to))} F{number(job.options['positioning_feed'])}"


clear = back = move
approach = common.approaching("(%s)", move)


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then one rotary axis after the other, as a locking indexer wants it."""
    yield f"({common.indexed(leg)})"
    if "S" in leg.target and job.options["orient"]:
        yield f"M19 R{common.spindle(job, leg.target['S'])} Q{job.options['orient_time']}"
    for name in job.machine.rotary:
        if name in leg.target:
            wrapped = job.options["wrapped"] and may_roll(job.machine, name)
            there = _wrapped(job, leg, name) if wrapped else number(degrees(leg.target[name]))
            yield from common.unclamped(job, name, f"G53 G0 {name}{there}")


def _wrapped(job: Job, leg: Leg, name: str) -> str:
    """With WRAPPED_ROTARY the sign is the sense of the turn (ini-config.adoc), -0 too: the sense that the plan has in mind."""
    change = leg.target[name] - leg.came.get(name, leg.target[name])
    if is_endless(job.machine, name):
        change = math.remainder(change, math.tau)
    return ("-" if change < 0 else "") + number(rolled(degrees(leg.target[name]), 4))


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move by its subroutine."""
    start = common.standoff(job, leg)
    values = [number(place[name]) for place in (leg.to, start) for name in "XYZ"]
    yield "O<tango_touch> CALL " + " ".join(f"[{v}]" for v in (*values, number(job.plan.strategy.approach.feed)))


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow move up during which somebody touches the stylus, and back: a search, which the control refuses with the probe on."""
    yield f"(MSG,{common.proves(job, leg)})"
    yield from probe(proving(job), leg)
    yield from _abort(job, "O170", "#<_tango_flag> EQ 0", common.unproven(job))
    if leg.kind == "prove":
        return  # the subroutine has taken the probe off
    yield f"(MSG,{common.LETTING_GO})"
    yield f"G4 P{common.RELEASE}"
    yield from retract(job, replace(leg, to=leg.came))


def record(job: Job, leg: Leg) -> Iterator[str]:
    """The line of the touch by its subroutine."""
    yield f"O<tango_record> CALL [{leg.touch.number}] [{common.spindle(job, leg.to['S'])}]"


def end(job: Job) -> Iterator[str]:
    """End mark and end of program."""
    yield f"(LOG,TANGO END {job.mark} {len(job.plan.touches)})"
    yield "(LOGCLOSE)"
    yield "M2"


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the plan."""
    options = job.options
    if not PATH.fullmatch(options["log"]):
        raise InputError(f"controller.log: found {options['log']!r}; allowed: a path of letters, digits, . _ - and /")
    common.fits(job)


POST = Post(
    title="LinuxCNC",
    extension="ngc",
    language="rs274",
    links=("linuxcnc", "file", "remote", "modbus"),
    options=OPTIONS,
    remedies=LINUXCNC,
    doubts=DOUBTS,
    stem=lambda job: "tango",
    **common.steps(globals()),
)
