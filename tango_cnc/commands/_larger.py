"""Whether a larger set of terms, or higher degrees of it, gives an estimate that may be used."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..identify.selection import SUBSETS
from ..judgement import Judgement
from ..judging import judged
from ..records import Cell, Readings, TangoError, TermItem
from ._trust import status

LARGEST = SUBSETS[-1]
DEGREES = (3, 4, 6)  # of the polynomials of the largest set, tried in this order
BESIDE = "What is predicted with every error motion does not rest on the terms: --despite shows it, if the set-up is right"
TAKEN = (
    "with more terms the estimate is {verdict} and would be used: --terms {terms} --degree {degree}. They are all error motions to "
    f"that degree: they may also take up a mistake of the set-up. {BESIDE}"
)
NO_BETTER = f"{{terms}} to degree {{degree}} is no better: 'tango diagnose' looks for what the terms lack. {BESIDE}"


def larger(cell: Cell, readings: Readings, terms: Sequence[TermItem], degree: int, source: Path, judgement: Judgement) -> str:
    """cell, readings, terms and degree of an estimate that is not used, file of the readings, its judgement → a sentence: which
    terms give one that is used, or that none do; '' where a mistake of the set-up is suspected, since many terms take up much.
    """
    if judgement.incomplete or any(s.kind != "few_terms" for s in judgement.suspicions):
        return ""
    own = [item for item in terms if item not in SUBSETS]
    least = degree if LARGEST in terms else 0
    tried = [d for d in DEGREES if d > least]
    for d in tried:
        with suppress(TangoError):
            _, other = judged(cell, readings, (LARGEST, *own), d, source=source)
            if not status(other, despite=False):
                named = ",".join(map(str, (LARGEST, *own)))
                return TAKEN.format(verdict=other.verdict, terms=named, degree=d)
    return NO_BETTER.format(terms=LARGEST, degree=tried[-1] if tried else degree)
