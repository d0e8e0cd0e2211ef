"""Limits and no time → the shortest plan that was found to keep them.

A whole search takes ten times as long as a quick choice of touches. So quick choices say where to look: they are made for what
touches and turns of a first, quick plan take. Whole searches follow near that time alone.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from ..records import InputError
from . import choose
from .criterion import value
from .enough import SPARE, believed, promised, spare, to_spare, widened
from .how_long import LONGEST, Quick
from .problem import Chosen, Problem

BEGIN = 300.0  # s that are looked at first
TRIES, ENOUGH = 8, 6  # times that are searched at most, and at most from the first one on that has a plan
LEAST, FINE = 30.0, 1.05  # s below which no quick choice looks; of its times, as near are they looked for
NEAR = 0.06  # of the time: nearer to the least one is near enough
STEP = 0.1  # of the time by which the next search is longer at least
FAR = 0.8  # of the time that a plan seems to need: the next search takes no more; nearer, half of the way goes there
HOLDS = 0.85  # of the touches of a plan: where an estimate needs as many of them, it is they that keep it from being shorter
LATER = 4.0  # times as many seconds as before are looked at, at most


def shortest(problem: Problem) -> Chosen:
    """problem with limits → the shortest plan that was found to keep them. Raises InputError where none does."""
    problem.say("how long it takes to keep the limits, by quick plans")
    seconds = _begin(problem)
    short, best, last = 0.0, None, None
    since = 0
    for _ in range(TRIES):
        found = None
        with suppress(choose.NoTime):
            found = last = choose.chosen(problem.of_time(seconds))
        if found is not None and keeps(found):
            best = found if best is None or found.seconds < best.seconds else best
        else:
            short = max(short, seconds)
        since += best is not None
        if best is not None and (since >= ENOUGH or best.seconds - short < NEAR * best.seconds):
            break
        seconds = _next(seconds, short, best, found)
    if best is None:
        far = ""
        if last is not None and promised(last) > 1:
            far = f"; the worst is {promised(last) ** 0.5:.2g} times its limit in {last.seconds / 60:.0f}"
        raise InputError(
            f"--goal: no plan of up to {short / 60:.0f} minutes keeps these limits{far}. "
            "Allow more, or state --minutes for the best plan of that time"
        )
    return best


def keeps(found: Chosen) -> bool:
    """plan → whether it keeps its limits, and has touches enough to spare."""
    return promised(found) <= 1 and believed(found)


def needs(found: Chosen) -> float:
    """plan → times its seconds in which it would just keep its limits and have touches enough to spare, about.

    Variances fall as the time for touches grows, and touches grow with it.
    """
    touches = len(found.rows)
    return max(promised(found), (touches + SPARE - to_spare(found)) / touches)


def touches_hold(found: Chosen) -> bool:
    """plan for limits → whether it is the number of its touches that keeps it from being shorter, and not its limits."""
    touches = len(found.rows)
    needed = (touches + SPARE - to_spare(found)) / touches
    return needed > HOLDS and promised(found) < needed


def _next(seconds: float, short: float, best: Chosen | None, found: Chosen | None) -> float:
    """s that were searched, longest that did not do, best and last plan → s to search next."""
    if best is None:
        return min(seconds * max(1 + STEP, 2.0 if found is None else 1.02 * needs(found)), LATER * seconds)
    if not short:
        shorter = max(1.05 * needs(best), 0.25)
        return best.seconds * min(shorter if shorter < FAR else shorter**0.5, 1 - NEAR)
    return max((short + best.seconds) / 2, short * (1 + NEAR / 2))


def _begin(problem: Problem) -> float:
    """problem → s in which a quick choice of touches keeps the limits; the longest that are looked at where none does."""
    seconds, found = BEGIN, None
    while found is None and seconds < 60 * LONGEST:
        with suppress(choose.NoTime):
            found = choose.quick(problem.of_time(seconds))
        seconds *= 1 if found else 2
    if found is None:
        return 60 * LONGEST
    look = Quick(found)
    short, long = LEAST, seconds
    while not _does(look, long) and long < 60 * LONGEST:
        short, long = long, min(2 * long, 60 * LONGEST)
    while long > FINE * short:
        middle = float(np.sqrt(short * long))
        short, long = (short, middle) if _does(look, middle) else (middle, long)
    return long


def _does(look: Quick, seconds: float) -> bool:
    """quick choices, s → whether that of this time keeps the limits with touches enough to spare."""
    chosen = look.chosen(seconds)
    if chosen is None:
        return False
    told, facets = chosen
    widens = widened(look.light.choice, facets)
    return value(look.light.criterion, told) * widens**2 <= 1 and spare(look.light.choice, facets) >= SPARE
