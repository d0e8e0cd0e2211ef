"""What an experiment is, and what it may look at."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..records import Plan


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
    answers: Mapping[str, bool] = field(default_factory=dict)  # {belief: what the person says}


@dataclass(frozen=True)
class Verdict:
    """PASS, FAIL or OPEN, in words, with a number where there is one."""

    verdict: str
    found: str
    value: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class Experiment:
    """One belief: how dangerous it is to be wrong (1 the most), how it is looked at, what to change when it is wrong."""

    belief: str
    danger: int
    says: str  # the belief in one sentence
    check: str  # how to look at it by hand
    advice: str  # what to change when it is wrong
    judge: Callable[[Seen], Verdict]
    stops: re.Pattern[str] = re.compile(r"(?!)")  # texts of stops that come when it is wrong
    settles: re.Pattern[str] = re.compile(r"(?!)")  # what of the list of unverified it proves
    question: str = ""  # what the person at the machine is asked


def answered(belief: str) -> Callable[[Seen], Verdict]:
    """belief → the judge of an experiment that a person answers."""

    def judge(seen: Seen) -> Verdict:
        if belief not in seen.answers:
            return Verdict("OPEN", "nobody was asked")
        return (
            Verdict("PASS", "said by the person at the machine") if seen.answers[belief] else Verdict("FAIL", "the person says no")
        )

    return judge
