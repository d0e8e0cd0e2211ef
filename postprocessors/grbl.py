"""grblHAL and FluidNC with five axes, grbl 1.1 with three (sources of gnea/grbl, grblHAL/core, FluidNC).

grbl has no variables that could decide, so the program is the list of moves that `tango run` makes, one by one, and the driver
(`link/protocols/grbl.py`) has each confirmed and reads every answer: a miss is `[PRB:…:0]`, an early contact shows in its place,
a contact on the way ends the run, and the record of a touch is made there. Whatever moves the linear axes is a search (G38.3),
which stops at a contact; only the way off a facet is not, and that is short and relative. Sent by anything else, a contact where
none is planned still locks the control at the next line: a search that begins with the probe on is ALARM:4.

Targets are machine coordinates; `tango run` takes work offset, G92 and tool length off, as the control lists them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from tango_cnc.records import InputError

from ._alive import proving
from ._base import Job, Leg, Option, Post, degrees, number, rolled
from ._common import (
    LETTING_GO,
    PROBE_SWITCHES,
    RELEASE,
    approaching,
    fits,
    indexed,
    off,
    proves,
    steps,
    switches,
    titled,
    unclamped,
    warned,
)
from ._remedies import GRBL

RESET = "G17 G21 G40 G49 G80 G90 G94 M5"
ROOM = {"grblHAL": 255, "FluidNC": 127, "grbl": 79}  # characters of a line, comments apart
OWN = {*range(10), 19, 30, *range(48, 69), *range(70, 74), 98, 99}  # M codes of the controls themselves; many of them want a P
NO_P = " that a plugin of grblHAL knows: no P behind it"

OPTIONS = (
    Option("control", "grblHAL", "what the control runs; grbl 1.1 has X Y Z only", choices=("grblHAL", "FluidNC", "grbl")),
    Option("orient", "M19 R", "word before the angle that orients the spindle; empty: the spindle is not turned", codes=True),
    Option("unclamp", {}, f"M word before a rotary axis turns, e.g. {{B: M11}}{NO_P}", verified=True),
    Option("clamp", {}, f"M word after a rotary axis has turned, e.g. {{B: M10}}{NO_P}", verified=True),
    *PROBE_SWITCHES,
    Option("positioning_feed", 2000.0, "mm/min of guarded moves; feed in the port's URL has to be the same", verified=True),
)
LETTERS = "the letters of the rotary axes are those of the build"
DOUBTS = ("a probe that is off stops nothing and guarded moves are guarded only while it is on",)


def begin(job: Job) -> Iterator[str]:
    """Header, modal reset, start mark."""
    plan = job.plan
    _check(job)
    yield from titled(job, "(%s)")
    yield from warned(
        job,
        "(%s)",
        "SENT BY TANGO RUN LINE BY LINE. ANOTHER SENDER RECORDS NOTHING",
        "MACHINE COORDINATES. FOR ANOTHER SENDER WORK OFFSET G92 AND TOOL LENGTH HAVE TO BE ZERO",
    )
    if job.options["probe_on"] or job.options["probe_off"]:
        yield "(TANGO RUN DOES NOT SEND THE WORDS THAT SWITCH THE PROBE. SWITCH IT BY HAND)"
    for key in ("unclamp", "clamp"):  # the driver has these words from here: what was read and checked is what is sent
        yield from (f"({key.upper()} {name} {word})" for name, word in job.options[key].items())
    yield RESET
    yield f"(TANGO START {job.mark} {len(plan.touches)})"


probe_on, probe_off = switches("(%s)")


def move(job: Job, leg: Leg) -> Iterator[str]:
    """A search that is to find nothing."""
    yield _search(leg, job.options["positioning_feed"])


def index(job: Job, leg: Leg) -> Iterator[str]:
    """Spindle, then the rotary axes: together, or one after the other between the words that free and hold them."""
    yield f"({indexed(leg)})"
    if "S" in leg.target and job.options["orient"]:
        yield f"{job.options['orient']}{number(rolled(degrees(leg.target['S']), 3), 3)}"
    words = {name: f"{name}{number(degrees(leg.target[name]))}" for name in job.machine.rotary if name in leg.target}
    if job.options["unclamp"] or job.options["clamp"]:
        for name, word in words.items():
            yield from unclamped(job, name, f"G0 {word}")
    elif words:
        yield f"G0 {' '.join(words.values())}"


retract = clear = back = move
approach = approaching("(%s)", move)


def probe(job: Job, leg: Leg) -> Iterator[str]:
    """The measuring move, then off the facet, far enough for the probe to come free."""
    yield _search(leg, job.plan.strategy.approach.feed)
    yield "G21 G91"
    words = " ".join(f"{name}{step.lstrip('+')}" for name, step in off(job, leg, 2).items())
    yield f"G1 {words} F{number(job.options['positioning_feed'])}"
    yield "G90"


def gate(job: Job, leg: Leg) -> Iterator[str]:
    """A slow search up during which somebody touches the stylus, and back."""
    yield f"({proves(job, leg)})"
    if leg.kind == "prove":
        yield from probe(job, leg)
        return
    yield _search(leg, proving(job).plan.strategy.approach.feed)
    yield f"({LETTING_GO})"
    yield f"G4 P{RELEASE}"
    yield _search(replace(leg, to=leg.came), job.options["positioning_feed"])


def record(job: Job, leg: Leg) -> Iterator[str]:
    """What the driver records here, as a remark."""
    yield f"(RECORD P{leg.touch.number} IS MADE OF THE ANSWER PRB)"


def end(job: Job) -> Iterator[str]:
    """End mark; a program for grbl needs no word at its end."""
    yield f"(TANGO END {job.mark} {len(job.plan.touches)})"


def _search(leg: Leg, feed: float) -> str:
    words = " ".join(f"{name}{number(leg.to[name])}" for name in "XYZ" if name in leg.target)
    return f"G38.3 {words} F{number(feed)}"


def _check(job: Job) -> None:
    """Raises InputError for options that do not fit the plan."""
    options, machine = job.options, job.machine
    if options["control"] == "grbl" and machine.rotary:
        raise InputError(
            f"controller.control: found grbl, which has X Y Z only; allowed for a machine with {' '.join(machine.rotary)}: "
            "grblHAL, FluidNC"
        )
    for key in ("probe_on", "probe_off"):
        if len(options[key]) > ROOM[options["control"]]:
            raise InputError(f"controller.{key}: found {len(options[key])} characters; allowed: {ROOM[options['control']]}")
    fits(job)
    for key in ("unclamp", "clamp"):
        for name, word in options[key].items():
            if options["control"] != "grblHAL" or not re.fullmatch(r"M[1-9]\d{0,2}", word) or int(word[1:]) in OWN:
                raise InputError(
                    f"controller.{key}: found {name!r}: {word!r}; allowed: with control: grblHAL, M words without P that a plugin "
                    "of it knows, none of its own codes, e.g. M10; FluidNC has none"
                )


POST = Post(
    title="grbl, grblHAL, FluidNC",
    extension="gcode",
    language="grbl",
    links=("grbl",),
    options=OPTIONS,
    remedies=GRBL,
    doubts=DOUBTS,
    further=lambda given: () if given.get("control") == "grbl" else (LETTERS,),
    stem=lambda job: "tango",
    **steps(globals()),
    link="grbl",
    filed=False,
)
