"""Touches that have no weight, and what is left to check a fit with: few touches to spare show no mistake, and small deviations.

A robust fit that drops touches until the others agree always finds some that agree. With hardly more of them than unknowns they
agree whatever is wrong, and the standard deviations come out small.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..judgement import Verdict
from ..texts import joined, say
from ..touches import Touches
from .data import Remark, listed

MANY = 0.1  # share of touches that do not fit, which makes a result doubtful
MOST = 0.35  # share without weight beyond which nobody knows which touches are right
FEWEST = 10  # touches to spare, below which a fit cannot show that it is wrong
FEW = 20  # the same where a large part of the touches was not used
LARGE = 0.2  # share of all planned touches that is a large part of them
SEVERAL = 3  # touches that are far off, and set aside, before somebody is asked to look why
TWO = 2  # the same on a facet of which no touch counts: one is a chip


def spare(result: Estimate, lost: int, alone: bool = True) -> Iterator[Remark]:
    """estimate, planned touches that are missing → remarks on touches without weight and on too few to spare.

    `alone`: the estimate rests on these touches only. Where it rests on earlier nights as well, each touch is one to spare.
    """
    n, out, idle = len(result.residuals), result.outliers, int(result.unused.sum())
    everything = tuple(c.name for c in result.model.coefficients)
    if idle > MOST * n or len(out) > MANY * n:
        text = say("plausible.judge.touches_do_not_fit", count=len(out), count2=n, numbers=listed(out.tolist()))
        if idle > len(out):
            text = say("plausible.judge.touches_without_weight", text=text, idle=idle, more=idle - len(out))
        most = idle > MOST * n
        yield Remark("implausible" if most else "doubtful", text, moves=everything)
    else:
        yield from _gross(result)
    unused = (idle + lost) / max(n + lost, 1)
    if alone and (result.dof < FEWEST or (result.dof < FEW and unused > LARGE)):
        yield Remark(
            "implausible" if idle > LARGE * n else "doubtful",
            say("plausible.judge.few_to_spare", used=n - idle, unknowns=len(result.values), dof=result.dof),
            incomplete=True,
            moves=everything,
        )


def _gross(result: Estimate) -> Iterator[Remark]:
    """A few touches that are far off moved nothing, but somebody should look why: a chip, a slip in a row, a hand.

    One or two are a note: a chip is nothing that a night is to be doubted for.
    """
    touches, n = result.model.touches, len(result.residuals)
    allowed = touches.machine.tolerances.scatter
    far = result.out & (np.abs(result.residuals) > allowed)
    numbers = tuple(int(i) for i in touches.number[far])
    if lost := [
        f for f, rows in _facets(touches) if rows.sum() >= SEVERAL and result.unused[rows].all() and far[rows].sum() >= TWO
    ]:
        text = say(
            "plausible.judge.facet_without_weight", facets=joined(", ", lost), numbers=listed(numbers), allowed=f"{allowed:g}"
        )
        yield Remark("doubtful", text, numbers)
    elif numbers:
        text = say("plausible.judge.gross_touches", count=len(numbers), count2=n, allowed=f"{allowed:g}", numbers=listed(numbers))
        verdict: Verdict = "doubtful" if len(numbers) >= SEVERAL else "trustworthy"
        yield Remark(verdict, text, numbers, "single_touches", "touch", say("mistake.single_touches.look_for_chips_there_for"))


def _facets(touches: Touches) -> list[tuple[str, NDArray[np.bool_]]]:
    """touches → (name, which of them) of each facet that is no part of a ball."""
    plain = touches.ball_index < 0
    return [(f, plain & (touches.facet_index == i)) for i, f in enumerate(touches.facets)]
