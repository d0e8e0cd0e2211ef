"""Whether the present model is too small a one: named causes then stand in for error motions that it lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..estimate import Estimate, estimate
from ..records import Readings, TangoError, TermItem

LARGEST = "S4"
SUBSETS = ("S1", "S2", "S3")


@dataclass(frozen=True)
class Richer:
    """The whole model instead of the present one."""

    terms: tuple[TermItem, ...]
    rms: float  # mm, what it leaves of a touch
    more: int  # parameters that it has more


def richer(
    after: Estimate, readings: Readings, terms: Sequence[TermItem], extended: Sequence[TermItem], degree: int = 3
) -> Richer | None:
    """the fit with what was found, readings, present terms, extended terms, degree of S4 → S4 where it is clearly better, or None.

    S4 is tried in the place of the present subset with and without what was found. It is better when the touches pay log n for
    every parameter (Schwarz 1978): noise that wanders makes an F test believe in S4 long before.
    """
    if not any(t in SUBSETS for t in terms if isinstance(t, str)):
        return None
    machine, artefact = after.model.touches.machine, after.model.touches.artefact
    found = None
    for items in (terms, extended):
        whole = (LARGEST, *(t for t in items if not (isinstance(t, str) and t in SUBSETS)))
        try:
            fit = estimate(machine, artefact, readings, whole, degree)
        except TangoError:  # too few touches for it
            continue
        if _score(fit) < _score(found[1] if found else after):
            found = whole, fit
    if found is None:
        return None
    rms = float(np.sqrt(np.mean(found[1].residuals ** 2)))
    return Richer(found[0], rms, len(found[1].values) - len(after.values))


def _score(fit: Estimate) -> float:
    n = len(fit.residuals)
    return float(n * np.log(np.mean(fit.residuals**2)) + len(fit.values) * np.log(n))
