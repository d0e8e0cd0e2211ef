"""What no quick check can see, however it chooses its touches: a floor for the size of a change, and where that comes from.

Theory of operation. A change that moves the tip by s in direction u at a pose moves the estimate of it by s + N(0, σ²). A plan
whose worst standard deviation is σ has its limit at z₁ σ at least, z₁ the two-sided quantile of its false alarms in that direction
alone, and sees a change with its power where it is z₂ σ larger. So of σ ≥ σ₀ follows s ≥ (z₁ + z₂) σ₀. There are two such σ₀: the
bound of the relaxed design for the time of the plan, and what is left when every candidate is touched for ever. The latter is what
the full run left uncertain: no touch of a check takes it away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from ..records import Array
from .check import ALARMS, POWER, TIP
from .criterion import value
from .how_long import LONGEST, Quick
from .problem import Chosen, Problem

FOR_EVER = 1e6  # times that every candidate is touched
WISHED = 0.005  # mm: the change that a check is wished to see
FINE = 1.05  # of the minutes: as near are they looked for
STEPS = float(special.ndtri(1 - TIP * ALARMS / 2) + special.ndtri(POWER))  # z₁ + z₂


@dataclass(frozen=True)
class Floor:
    """mm: no check of this time sees less, none of any time does. Minutes in which a quick choice of touches sees `WISHED`."""

    now: float
    ever: float
    minutes: float | None


def floor(found: Chosen, size: float) -> Floor:
    """plan of a check with its bound, mm that it sees → what others could; no minutes where it sees `WISHED`, or none would do."""
    problem = found.problem
    sigma = problem.choice.sigma
    ever = STEPS * sigma * value(problem.criterion, endless(problem)) ** 0.5
    now = max(STEPS * sigma * max(found.bound, 0.0) ** 0.5, ever)
    minutes = None
    if size > WISHED > ever:
        minutes = _minutes(found, (WISHED / size) ** 2 * found.value)
    return Floor(now, ever, minutes)


def endless(problem: Problem) -> Array:
    """problem → (p, p) information when every candidate is touched for ever."""
    rows = problem.choice.rows
    return np.asarray(problem.held + FOR_EVER * (rows.T @ rows))


def _minutes(found: Chosen, phi: float) -> float | None:
    """plan, φ → minutes in which a quick choice of touches reaches it, for what touches and turns of the plan take."""
    look = Quick(found)

    def does(seconds: float) -> bool:
        chosen = look.chosen(seconds)
        return chosen is not None and value(look.light.criterion, chosen[0]) <= phi

    short, long = found.seconds, 2 * found.seconds
    while not does(long):
        short, long = long, 2 * long
        if long > 60 * LONGEST:
            return None
    while long > FINE * short:
        middle = math.sqrt(short * long)
        short, long = (short, middle) if does(middle) else (middle, long)
    return math.ceil(2 * long / 60) / 2


def lines(said: Floor, size: float) -> list[str]:
    """floor, mm that the plan sees → what a person reads of it."""
    found = [
        f"no check of this time whose touches and turns take as long sees a change below {1e3 * said.now:.1f} µm, and none of any "
        f"time one below {1e3 * said.ever:.1f} µm: that much the full run left uncertain"
    ]
    if size <= WISHED:
        return found
    if said.ever >= WISHED:
        why = "a full run that knows more ('tango design --goal volume'), or checks right after it (--again)"
        return [*found, f"{1e3 * WISHED:g} µm are not within reach of any check after this full run: they take {why}"]
    if said.minutes is not None:
        return [*found, f"{1e3 * WISHED:g} µm are seen in about {said.minutes:g} min, by a quick choice of touches (--minutes)"]
    return found
