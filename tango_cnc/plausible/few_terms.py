"""Whether a larger set of terms explains what the stated one leaves: axis locations or error motions that nobody asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from ..estimate import Estimate, estimate
from ..identify.selection import SUBSETS
from ..records import Cell, Readings, TangoError
from ..texts import say
from .bounds import bounds
from .data import Remark

LESS = 0.25  # of what a touch scattered by before, at most


def few_terms(cell: Cell, readings: Readings, result: Estimate, most: float) -> Iterator[Remark]:
    """cell with the terms of the estimate, readings, that estimate, mm that a touch may scatter by → a remark with the smallest
    set of terms that leaves no more.

    Nothing where the stated terms leave no more, where no larger set does, or where what it gives would be implausible. It is
    a plain fit by least squares: touches that do not fit leave more, and nothing is said then.
    """
    if result.sigma <= most:
        return
    own = [item for item in cell.terms if item not in SUBSETS]
    stated = max((SUBSETS.index(str(item)) for item in cell.terms if item in SUBSETS), default=-1)
    for name in SUBSETS[stated + 1 :]:
        with suppress(TangoError):
            found = estimate(cell.machine, cell.artefact, readings, (name, *own))
            if found.sigma <= min(most, LESS * result.sigma) and not any(b.beyond for b in bounds(found)):
                before = estimate(cell.machine, cell.artefact, readings, cell.terms).sigma  # as plain a fit as the other
                if found.sigma > LESS * before:
                    return
                text = say("plausible.few_terms.fit", terms=name, left=f"{found.sigma * 1e3:.3g}", before=f"{before * 1e3:.3g}")
                change = say("plausible.few_terms.write", terms=name)
                # Axis locations are asked for by nearly everybody; error motions may also take up another mistake.
                sure, moves = name != SUBSETS[-1], tuple(c.name for c in result.model.coefficients)
                yield Remark("doubtful", text, (), "few_terms", "terms", change, file="tango", sure=sure, moves=moves)
                return
