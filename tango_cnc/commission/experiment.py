"""What an experiment is, and what it may look at."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..records import Plan
from .touching import Pivot

DIAL = 0.25  # of the feed override, while a second program tries what it does to a measuring move


@dataclass(frozen=True)
class Seen:
    """What came of the plan in the air: records by touch number (flag, {axis: mm or deg}), and what the control said last."""

    plan: Plan
    records: Mapping[int, tuple[int, Mapping[str, float]]]
    begun: bool  # the start mark has come
    ended: bool  # the end mark has come
    refused: tuple[str, ...] = ()  # lines that are no records
    said: str = ""  # the stop that stands on the screen
    seconds: float | None = None  # from the start mark to the end mark
    held: bool | None = None  # whether the program stopped while somebody held the stylus aside; None: not tried
    answers: Mapping[str, Mapping[str, bool]] = field(default_factory=dict)  # {belief: {what: what the person says of it}}
    unasked: bool = False  # --answers yes has answered: nobody has seen it
    pivots: Mapping[str, Pivot] | None = None  # of the rotary axes, where the table was touched
    late: float | None = None  # s by which positions are read late
    times: Mapping[int, float] = field(default_factory=dict)  # s at which each record has come, by touch number
    dialled: Mapping[int, float] | None = None  # the same with the feed override at `DIAL`; None: not tried
    feed: float = 3000.0  # mm/min of guarded moves
    stored: bool = True  # records come through a file that the control writes, not over a line
    kept: bool | None = None  # whether a second program left the records of the first in their file; None: not tried
    largest: float = 0.0  # mm or deg: the largest number of a record of the cell's own plan; 0: unknown
    marked: bool = False  # the end mark has come, whether or not every record was believed
    obeys: bool = False  # the profile says that the feed override acts on measuring moves
    anew: bool = False  # the profile says that each program begins the file of its records anew
    doubts: tuple[str, ...] = ()  # what the header of the program calls unverified
    unheard: bool = False  # the person has seen that the slow move up went on although the stylus was touched


@dataclass(frozen=True)
class Ruling:
    """PASS, FAIL or OPEN, in words, with a number where there is one."""

    verdict: str
    found: str
    value: float | None = None
    unit: str = ""
    do: str = ""  # what to change, where it is not what the experiment advises


@dataclass(frozen=True)
class Question:
    """What the person at the machine is asked, and the moves that this is about: before all of them are made there is no answer."""

    text: str
    moves: tuple[int, ...]  # touches of the plan in the air


def nothing(plan: Plan) -> dict[str, Question]:
    """plan → the questions of an experiment that asks nobody."""
    return {}


@dataclass(frozen=True)
class Experiment:
    """One belief: how dangerous it is to be wrong (1 the most), how it is looked at, what to change when it is wrong."""

    belief: str
    danger: int
    says: str  # the belief in one sentence
    check: str  # how to look at it by hand
    advice: str  # what to change when it is wrong
    judge: Callable[[Seen], Ruling]
    stops: re.Pattern[str] = re.compile(r"(?!)")  # texts of stops that come when it is wrong
    settles: re.Pattern[str] = re.compile(r"(?!)")  # what of the list of unverified it proves
    asks: Callable[[Plan], Mapping[str, Question]] = nothing  # plan in the air → {what: what the person at the machine is asked}
    rests: tuple[str, ...] = ()  # options of the profile that it depends on: another value, and it is to be tried again
    on: tuple[str, ...] = ()  # what else it depends on: linear (axes of machine.yaml), rotary, their points, port, overhead
    unrecorded: str = ""  # what is added where the program stopped for it before the first record
    raw: bool = False  # it also sees records without their decimal point, which say nothing to the others
    touches: bool = False  # it needs the table: no move in the air shows it


def unmade_of(asked: Mapping[str, Question], seen: Seen) -> list[str]:
    """questions, what came → those of them that are about a move without a record."""
    return [what for what, question in asked.items() if not set(question.moves) <= set(seen.records)]


def answered(belief: str, asks: Callable[[Plan], Mapping[str, Question]]) -> Callable[[Seen], Ruling]:
    """belief, what it asks → the judge of an experiment that a person answers: one no is a FAIL, a question left open is OPEN.

    What is said of a move that has no record counts for nothing: nobody can have seen it.
    """

    def judge(seen: Seen) -> Ruling:
        said, asked = seen.answers.get(belief, {}), asks(seen.plan)
        unmade = unmade_of(asked, seen)
        if not asked:
            return Ruling("PASS", "there is nothing of it on this machine that a person could see")
        wrong = [what for what in asked if what not in unmade and said.get(what) is False]
        if wrong:
            return Ruling("FAIL", f"{', '.join(wrong)}: the person at the machine says no")
        if unmade:
            return Ruling("OPEN", f"the moves of {', '.join(unmade)} were not made")
        if unsaid := [what for what in asked if what not in said]:
            return Ruling("OPEN", f"nobody has said it of {', '.join(unsaid)}")
        return Ruling(
            "PASS", "said by --answers yes, and no person was asked" if seen.unasked else "said by the person at the machine"
        )

    return judge
