"""What came of the plan in the air → proofs: one experiment fails, others are open where the program did not get to them."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache

from ..records import Plan
from . import experiments as folder
from .digits import pointless
from .experiment import Experiment, Question, Ruling, Seen, unmade_of
from .lacking import NOT_KNOWN, lacking, mentioned, ruled

ELSEWHERE = (  # texts of stops that are no belief about the control, and what to look at
    (
        re.compile(r"OVERTRAVEL|OVER TRAVEL|LIMIT|TRAVEL RANGE|TRAVEL EXCEEDED|WORKING AREA|ALARM:[12]\b"),
        "compare travel of that axis in machine.yaml with the soft limits of the control; a rotary axis: state rollover where the "
        "post has that key, and nearer: true in machine.yaml where the control turns the nearer way and past the limit. Where a "
        "first step of 0.5 mm went up instead of down, a mirror image is on: switch it off. Where an axis went to its other end, "
        "its direction in machine.yaml is the wrong way round",
    ),
    (
        re.compile(r"VA_IM|AA_MM|\b(12550|17020)\b"),
        "a SINUMERIK that does not take $VA_IM or $AA_MM with the letter of an axis wants the name of its machine axis: state "
        "machine_axes under controller:, e.g. {X: X1, Y: Y1, Z: Z1, B: B1}, or rotary_position: $AA_IM",
    ),
    (
        re.compile(r"COULD NOT BE WRITTEN"),
        "the control cannot write its records: look at output under controller: in tango.yaml, at the device of that name on the "
        "control (SINUMERIK: its line in extdev.ini, the share, its password) and at the room there; docs/controls/",
    ),
    (
        re.compile(r"GOTO|\bDNC\b|TAPE MODE"),
        "the control refuses a jump in a drip-fed program: run it from the memory, or state alarm: at once under controller:, "
        "which leaves the probe on and the port open at an alarm",
    ),
    (
        re.compile(r"G31|SKIP|G38|\bMEAS\b"),
        "the control refuses the skip move itself: is its option there, is the feed of approach in strategy.yaml one that it "
        "allows, is a modal function on that forbids it?",
    ),
    (
        re.compile(r"HAS ENDED THE MOVE BY ITSELF"),
        "grblHAL ends a search so when its step buffer runs empty (stepper.c, motion_control.c). Its simulator does where -t is "
        "above 1 or the computer is busy: start it with -t 1, or build it with -DSEGMENT_BUFFER_SIZE=250. On a board look at $100 "
        "… $124 and at the drives",
    ),
    (
        re.compile(r"MACRO IS MISSING|NO SCRIPT|SEQUENCE NAME"),
        "a macro or subprogram that the program calls is not there: bring every file of program/ to the control, into the folder "
        "that docs/controls/ names",
    ),
    (re.compile(r"EMERGENCY|E-STOP|(?<!PLANE )(?<!FUNCTION )RESET|DOOR"), "the machine was stopped from outside: start again"),
)

LISTED = "look it up in the list of alarms of the control"
UNREAD = (
    "the control does not know a word of this block, or has no file or option of that name: write the whole block that stands on "
    "its screen behind the text (--said). Where the word comes from a key of the profile, the answer names the key"
)
LAST = 5  # behind every danger
UNKNOWN = (
    ". Nothing is recorded, so nobody knows yet whether the control hears the probe: if this was at the slow move up, while "
    "you touched the stylus, look at alive first"
)


@dataclass(frozen=True)
class Judged:
    """One experiment and what came of it."""

    experiment: Experiment
    verdict: Ruling


@cache
def experiments() -> tuple[Experiment, ...]:
    """→ all of them, the most dangerous belief first: the files of `experiments/`."""
    found = [
        importlib.import_module(f"{folder.__name__}.{m.name}").EXPERIMENT
        for m in pkgutil.iter_modules(folder.__path__)
        if not m.name.startswith("_")
    ]
    return tuple(sorted(found, key=lambda experiment: (experiment.danger, experiment.belief)))


def judge(seen: Seen) -> list[Judged]:
    """what came of it → every experiment with its verdict. A program that stopped blames one belief: that of its text.

    Without a text that is known, the one is blamed whose judge sees the trouble first, by danger. Before the first record what the
    person has seen counts more than the text: a control that makes an alarm of a miss says the same where the probe is dead.
    """
    every = experiments()
    nothing = not seen.records and not seen.refused
    spoilt = pointless(seen)
    legible = replace(seen, records={number: record for number, record in seen.records.items() if number not in spoilt})
    noticed = next((e for e in every if e.judge(seen).verdict == "FAIL"), None) if nothing else None
    unknown = lacking(seen.said, seen.doubts) if noticed is None else None
    owner = next((e for e in every if unknown and e.settles.search(unknown[1])), None)
    blamed = noticed or owner or next((e for e in every if seen.said and e.stops.search(seen.said.upper())), None)
    judged = []
    for experiment in every:
        verdict = experiment.judge(seen if experiment.raw else legible)
        if unknown is not None and experiment is owner:
            verdict = ruled(seen.said, *unknown)
        elif experiment is blamed and experiment is not noticed:
            doubt = "" if not nothing else UNKNOWN if experiment.danger > 1 else experiment.unrecorded
            verdict = Ruling("FAIL", f"the program stopped: {seen.said}{doubt}")
        elif blamed is not None and experiment is not blamed and verdict.verdict == "FAIL":
            verdict = Ruling("OPEN", f"the program stopped before: {seen.said}")
        judged.append(Judged(experiment, verdict))
    return judged


def stopped_by(said: str, doubts: Iterable[str] = (), program: str = "") -> str:
    """text of a stop that no experiment knows, doubts of the header, text of the program → what to look at."""
    text = said.upper()
    found = next((do for words, do in ELSEWHERE if words.search(text)), UNREAD if NOT_KNOWN.search(text) else LISTED)
    words = mentioned(said, tuple(doubts), program)
    return f"{said!r}: {words}: it may be what the control means. Otherwise {found}" if words else f"{said!r}: {found}"


def answerable(asked: Mapping[str, Mapping[str, Question]], seen: Seen) -> dict[str, dict[str, str]]:
    """questions, what came → {belief: {what: text}} of those whose moves were made: nobody can have seen the others."""
    made = {
        belief: {what: q.text for what, q in each.items() if what not in unmade_of(each, seen)} for belief, each in asked.items()
    }
    return {belief: each for belief, each in made.items() if each}


def questions(plan: Plan) -> dict[str, dict[str, Question]]:
    """plan in the air → {belief: {what: what the person at the machine is asked of it}}, of those that ask anything."""
    asked = {experiment.belief: dict(experiment.asks(plan)) for experiment in experiments()}
    return {belief: each for belief, each in asked.items() if each}


def by_danger(unverified: Iterable[str]) -> list[str]:
    """list of what is unverified → the same, the most dangerous first, last what no experiment settles; else in its order."""
    return sorted(unverified, key=_danger)


@lru_cache(4096)
def _danger(text: str) -> int:
    """a line of the list → the rank of the most dangerous belief that it is about: every program has the same few lines."""
    return min((e.danger for e in experiments() if e.settles.search(text)), default=LAST)


def remaining(unverified: Iterable[str], proven: Mapping[str, str]) -> list[tuple[Experiment | None, list[str]]]:
    """list of what is unverified, {belief: verdict} → the experiments without PASS by danger, each with what of the list it would
    settle; last, under None, what no experiment settles. A fact that several experiments settle needs all of them.
    """
    left = [e for e in experiments() if proven.get(e.belief) != "PASS"]
    texts: dict[str, list[str]] = {e.belief: [] for e in left}
    others = []
    for text in unverified:
        owners = [e for e in experiments() if e.settles.search(text)]
        first = next((e for e in owners if e.belief in texts), None)
        if first is not None:
            texts[first.belief].append(text)
        elif not owners:
            others.append(text)
    return [*((e, texts[e.belief]) for e in left), *([(None, others)] if others else [])]
