"""Errors of the tool tip night by night → how fast the machine rises now, and in how many nights it is at its limit.

Only the last fortnight counts, from the last step on: a knock is no pace, and what went on in spring is over.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..records import Array
from .days import days_between

RECENT = 14.0  # days that the pace is taken from, and nights that it may look ahead
LEAST = 5  # nights
SURE = 2.58  # standard deviations (99 %)
STEP = 4.0  # of what the other nights differ by, from where one difference is a step
BENT = 30.0  # variances by which two lines fit better than one, from where a stretch has a bend
SOON = 2.0  # nights: from here on, a machine may be at its limit before it is measured again


@dataclass(frozen=True)
class Ahead:
    """A machine that rises toward its limit: µm a night, nights to the limit (0: about now), the limit in µm."""

    rate: float
    nights: float
    limit: float


def pace(days: Array, value: Array, std: float) -> tuple[int, float]:
    """(n,) days, (n,) values, standard deviation of one → place where the last stretch begins, change a day in it; 0 for none.

    The stretch is at most a fortnight long and begins after the last step, or where it begins to go another way. Its change counts
    from `SURE` standard deviations on, by what a value is known to and by what the values scatter about their line, whichever is
    larger.
    """
    start = int(np.searchsorted(days, days[-1] - RECENT)) if len(days) else 0
    x, y = days[start:], value[start:]
    if len(x) < LEAST:
        return start, 0.0
    apart = np.abs(np.diff(y))
    usual = sorted(apart.tolist())[len(apart) // 2]  # a median of few numbers: of two hundred machines at once
    steps = np.flatnonzero(apart > max(SURE * np.sqrt(2) * std, STEP * usual))
    if len(steps):
        start += int(steps[-1]) + 1
        x, y = days[start:], value[start:]
    if len(x) < LEAST:
        return start, 0.0
    bend = _bend(x, y, std)
    start, x, y = start + bend, x[bend:], y[bend:]
    lever = x - x.mean()
    width = float(lever @ lever)
    slope = float(lever @ y) / width if width else 0.0
    scatter = float(np.sqrt(np.sum((y - y.mean() - slope * lever) ** 2) / (len(x) - 2)))
    return start, slope if abs(slope) * np.sqrt(width) > SURE * max(std, scatter) else 0.0


def by_chance(value: Array, first: float, last: float) -> float:
    """(n,) values, standard deviations of the first and of the last → standard deviation of the way between the two on a machine
    that only wanders: what both are known to, or what its steps from night to night make together, whichever is larger.
    """
    steps = np.diff(value)
    if len(steps) < 2:
        return float(np.hypot(first, last))
    rest = steps - steps.mean()
    own, next_to = float(rest @ rest), float(rest[1:] @ rest[:-1])  # a value that is off makes two steps, one back
    walked = (len(steps) * own + 2 * (len(steps) - 1) * next_to) / (len(steps) - 1)
    return float(np.sqrt(max(first**2 + last**2, walked)))


def _bend(x: Array, y: Array, std: float) -> int:
    """(n,) days, (n,) values of a stretch without a step, standard deviation of one → place from which it goes another way, as a
    machine that begins to drift; 0 where one line fits as well.
    """
    parts = {k: _off(x[: k + 1], y[: k + 1]) + _off(x[k:], y[k:]) for k in range(2, len(x) - LEAST + 1)}
    if not parts:
        return 0
    place = min(parts, key=parts.__getitem__)
    usual = max(std**2, parts[place] / max(len(x) - 4, 1))
    return place if _off(x, y) - parts[place] > BENT * usual else 0


def _off(x: Array, y: Array) -> float:
    """(n,) days, (n,) values → sum of squares beside their line."""
    lever, rest = x - x.mean(), y - y.mean()
    return float(rest @ rest - (lever @ rest) ** 2 / (lever @ lever))


def ahead(record: Mapping[str, Any], volumes: Mapping[str, float], today: str = "") -> Ahead | None:
    """last night that measured, {date: µm at the tool tip} of its nights and others, date of the page ('': of that night) → how
    soon it is at its limit; None where it does not rise, where that is more than a fortnight away, or where no limit is kept.
    """
    night, known = str(record.get("night")), record.get("volume") or {}
    limit = next((float(x["limit"]) for x in record.get("limits") or () if x.get("what") == "volume" and x.get("limit")), None)
    if limit is None or known.get("worst_um") is None or record.get("verdict") == "doubtful":
        return None
    dates = [d for d in sorted(volumes) if d <= night][-int(RECENT) - 1 :]
    value = np.array([volumes[d] for d in dates], dtype=float)
    days = np.array([days_between(dates[0], d) for d in dates], dtype=float) if dates else value
    gap = limit - float(known["worst_um"])
    _, rate = pace(days, value, float(known.get("std_um") or 1.0))
    if rate <= 0 or not 0 <= gap <= RECENT * rate:
        return None
    return Ahead(rate, max(gap / rate - days_between(night, today or night), 0.0), limit)
