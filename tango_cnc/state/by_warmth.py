"""How much of a night a machine that is warmer may have done, and whether one cause beside it says more of that night.

A temperature that moves every error as far as it likes explains any night. What counts is how far: errors per kelvin come from
what this machine has shown, or from what machines do, and all of one night are of one size. A step of one error that no machine
makes for so few kelvins costs more than a cause of its own (Bayes factor; MacKay 1992, Kass & Raftery 1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import linalg

from ..records import Array

SIZES = np.geomspace(1.0, 1 / 64, 13)  # times the most that a kelvin does: how much it does to all errors of one night
NEAR = 6.0  # of the evidence: what is nearer fits nearly as well


class BesideWarmth(NamedTuple):
    """A cause beside temperature: its place among those tried, whether it comes first, whether temperature fits nearly as well."""

    place: int
    first: bool
    near: bool


def rival(own: Array, patterns: Sequence[Array], white: Array, scale: float, learned: bool, beyond: Array) -> BesideWarmth | None:
    """(k, q) what temperature does at most to (k,) white innovations, (k, m) patterns of other causes, variance, whether this
    machine has shown what it does for each K, which of these causes are a step that no machine makes for so few → the cause that
    explains the night better than temperature does, or nearly as well, by itself or together with it; None where no cause does.

    Where nothing is known, one error may follow the temperature and no other: a cause beside it comes first for its size only.
    """
    y, a, price = white / np.sqrt(scale), own / np.sqrt(scale), np.log(len(white))
    warm, found = _evidence(a, y), []
    for place, pattern in enumerate(patterns):
        basis = linalg.orth(pattern)
        along = basis.T @ y
        alone = float(along @ along) - price * basis.shape[1]
        both = alone + _evidence(a - basis @ (basis.T @ a), y - basis @ along)
        found.append((max(alone, both - NEAR), place, alone))
    if not found:
        return None
    best, place, alone = max(found)
    if best <= warm and alone <= warm - NEAR:
        return None
    first = best > warm + NEAR and (learned or beyond[place] or alone >= best)
    return BesideWarmth(place, first or alone > warm - NEAR, best < warm + NEAR or not learned)


def _evidence(a: Array, y: Array) -> float:
    """(k, q) what each error does at most, (k,) innovations → twice the logarithm of how much likelier errors of one size, whatever
    that is, make them than none.
    """
    basis, size, _ = linalg.svd(a, full_matrices=False)
    power = (SIZES[:, None] * size) ** 2
    told = power / (1 + power) @ (basis.T @ y) ** 2 - np.sum(np.log1p(power), axis=1)
    return float(told.max())
