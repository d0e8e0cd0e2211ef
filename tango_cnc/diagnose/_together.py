"""Single touches that were set aside, and stand together: then they are no single touches, and nothing is explained."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..records import Array
from ..touches import Touches
from ._records import Remainder

LEAST = 3  # touches that can stand together
CHANCE = 0.01  # probability that single touches stand together so closely, over all that was looked at


def together(touches: Touches, away: Mapping[int, float]) -> list[Remainder]:
    """touches, rows of single ones that were set aside and how far they are away, mm → where they stand together.

    Touches that chance spoils are spoilt anywhere. That some of them share a place, a time, a facet or a direction is compared
    with draws of as many from all touches (scan statistic, Bonferroni over all that is looked at).
    """
    marked = np.array(sorted(away), dtype=np.int64)
    if len(marked) < LEAST:
        return []
    looks = list(_looks(touches))
    found = [(p, name, own) for name, values, ordered in looks for p, own in _closest(values, marked, ordered)]
    if not found:
        return []
    p, name, own = min(found, key=lambda one: one[0])
    if p * len(looks) > CHANCE:
        return []
    size = float(np.median([away[int(i)] for i in own]))
    numbers = ", ".join(str(int(touches.number[i])) for i in np.sort(own))
    return [Remainder(name, "none", "apart", size, 0.0, np.zeros(len(touches)), confirm=numbers)]


def _looks(touches: Touches) -> Iterator[tuple[str, Array, bool]]:
    """touches → covariates in which touches can stand together: name, values (n,), whether near values are neighbors."""
    yield "order", np.arange(len(touches), dtype=float), True
    for axis in (*touches.machine.linear, *touches.machine.rotary):
        place = touches.axis(axis)
        if np.ptp(place) > 1e-6:
            yield axis, np.round(place, 6), True
    yield "facet", np.unique(touches.facet, return_inverse=True)[1].astype(float), False
    yield "indexation", touches.indexation.astype(float), False
    for letter, side in zip("xyz", touches.machine_normal.T, strict=True):
        yield f"normal {letter}, machine", np.round(side, 3), False


def _closest(values: Array, marked: NDArray[np.int64], ordered: bool) -> Iterator[tuple[float, NDArray[np.int64]]]:
    """values (n,), rows → for every group of neighbors among them: probability by chance, the rows."""
    n, k = len(values), len(marked)
    place = np.sort(values)
    by = marked[np.argsort(values[marked], kind="stable")]
    for first in range(k):
        for last in range(first + LEAST - 1, k):
            low, high = values[by[first]], values[by[last]]
            if not ordered and low != high:
                break
            width = int(np.searchsorted(place, high, side="right") - np.searchsorted(place, low, side="left"))
            count = last - first + 1
            # One of them stands anywhere; that so many of the others stand within the same stretch of neighbors:
            p = float(special.bdtrc(count - 2, k - 1, min(1.0, (width - 1) / (n - 1))))
            yield p * k * (k - LEAST + 1), by[first : last + 1]
