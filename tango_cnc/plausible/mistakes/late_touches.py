"""Touches that read late, or early, by one distance: toward one side, in one part of the run, or some of all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from ...texts import say
from ...touches import Touches, from_readings
from ..data import listed
from ._case import Case, Hypothesis
from ._midway import FEWEST, SEEN, Left, along

TOWARD = 0.7  # cosine between a normal and an axis of the machine
MANY = 0.05  # share of all touches that some of all are
MOST = 0.6
SINGLE = 1.5  # price of each single touch that the hypothesis calls late
SIDE = 14.0  # χ² of a side, one of six, which its price and a suspicion ask for: backlash within its tolerance takes the rest
OFF = 0.02  # mm, and 20 times the repeatability: what is less is no latch
ROUNDS = 8


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → touches toward each side, of the part of the run where it explains most, and those that seem late by one distance."""
    touches = from_readings(case.machine, case.artefact, case.readings)
    left = Left(touches)
    ones = np.ones(len(touches))
    for i, axis in enumerate("XYZ"):
        for sign in (1.0, -1.0):
            mask = touches.machine_normal[:, i] * sign > TOWARD
            what = say("mistake.late_touches.toward", sign="-" if sign > 0 else "+", axis=axis)
            yield from _late(case, touches, left, mask, what, 4.0, SIDE)
    if (found := left.parts(ones)) is not None:
        part = found[0]
        number = touches.number[part.first : part.end]
        how = "from" if part.end == len(touches) else "between"
        what = say(f"mistake.late_touches.{how}", first=int(number[0]), last=int(number[-1]))
        yield from _late(case, touches, left, part.rows(len(touches)), what, 5.0 if how == "from" else 8.0)
    mask = _some(case, left)
    if MANY <= mask.mean() <= MOST:
        what = say("mistake.late_touches.some", count=int(mask.sum()), numbers=listed(touches.number[mask].tolist()))
        yield from _late(case, touches, left, mask, what, 4.0 + SINGLE * float(mask.sum()))


def _some(case: Case, left: Left) -> NDArray[np.bool_]:
    """→ (n,) those that are nearer to one distance than to none, in turn with that distance."""
    gaps: Array = case.stated.gaps
    far = np.abs(gaps) > _least(case)
    if far.sum() < FEWEST:
        return far
    size = float(np.median(gaps[far]))
    mask = np.abs(gaps - size) < np.abs(gaps)
    for _ in range(ROUNDS):
        if not FEWEST <= mask.sum() < len(mask):
            break
        size = left.size(mask.astype(float))[0]
        gaps = left.without(mask.astype(float)) + size * mask
        again = np.abs(gaps - size) < np.abs(gaps)
        if (again == mask).all():
            break
        mask = again
    return mask


def _least(case: Case) -> float:
    return max(OFF, 20 * case.machine.probe.repeatability)


def _late(
    case: Case, touches: Touches, left: Left, mask: NDArray[np.bool_], what: str, price: float, seen: float = SEEN
) -> Iterator[Hypothesis]:
    if not FEWEST <= mask.sum() <= len(mask) - FEWEST:
        return
    size, gain = left.size(mask.astype(float))
    if gain < seen or abs(size) < _least(case) / 2:
        return
    how = "late" if size < 0 else "early"
    numbers = tuple(int(t) for t in touches.number[mask])
    yield Hypothesis(
        say(f"mistake.late_touches.{how}", what=what, size=f"{abs(size) * 1e3:.0f}"),
        "readings",
        "touch",
        say("mistake.late_touches.change"),
        readings=along(case, touches, np.where(mask, -size, 0.0)),
        touches=numbers,
        price=price,
    )
