"""Do the touches contradict the fit that the figures rest on? It has every error motion; the terms of a cell have few.

A machine has more error motions than the terms of its cell, so that their fit is doubtful with reason. The figures do not rest on
it. What is left beside every error motion must be mere scatter: no touch far off, and no pattern of something that moved, drifted
or read late. The same patterns are looked for as in the residuals of the terms (`plausible/lacking.py`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..iso230.signed import Sheet
from ..iso230.whole import Whole
from ..judgement import Judgement
from ..plausible.lacking import LARGEST, LEVEL, SPARE, Left, found_in, place_words

FAR = 1e-3  # chance that a touch of a sound machine is called far off, all touches together
ALONE = 0.02  # share of its own error that is left of a touch, below which no other touch says what it should be
NAMED = 6


def by_figures(judgement: Judgement, rows: Judgement, sheet: Sheet) -> Judgement:
    """judgement by the terms of the cell, that of the readings without any fit, figures → judgement by the fit of the figures.

    Only a doubtful fit is judged again: what is wrong with the readings themselves, and what is implausible, stays as it is.
    """
    if judgement.verdict != "doubtful" or judgement.incomplete or rows.verdict != "trustworthy" or sheet.learned is None:
        return judgement
    if reasons := contradicting(sheet.learned):
        return replace(judgement, reasons=(*reasons, *judgement.reasons))
    degree, order = sheet.learned.order
    text = (
        f"judged by the fit that the figures rest on (every error motion, degree {degree}, {order} harmonics): the touches show "
        f"mere scatter beside it. The fit by the terms of the cell is doubtful, and no parameter of it is stated: "
        f"{'; '.join(judgement.reasons)}"
    )
    return replace(judgement, verdict="trustworthy", reasons=(), remarks=(*judgement.remarks, text))


def contradicting(w: Whole) -> tuple[str, ...]:
    """machines that the figures rest on → sentences on what its touches show beside it; () where they show mere scatter."""
    left = left_of(w)
    if left is None:
        return (f"{len(w.touches)} touches are too few, or too many, to judge the fit that the figures rest on",)
    far, found = _far(left), found_in(w.touches, left, LEVEL)
    reasons = []
    if found:
        what = place_words(w.touches, max(found, key=lambda f: f.score))
        reasons.append(f"no error motion of the machine explains what is left of the touches. It looks most as if {what}")
    if len(far):
        numbers = ", ".join(str(int(n)) for n in w.touches.number[far][:NAMED]) + (" …" if len(far) > NAMED else "")
        those = "touch" if len(far) == 1 else "touches"
        reasons.append(f"no error motion of the machine explains {those} {numbers}: look for chips there, and measure again")
    return tuple(reasons)


def left_of(w: Whole) -> Left | None:
    """fit with every error motion → what its unknowns leave of the touches; None where these are too few or too many to say."""
    n = len(w.touches)
    assert w.leave is not None and w.residuals is not None
    hat = np.eye(n) - w.leave[:, :n]
    spare = n - float(np.trace(hat))
    if spare < SPARE or n > LARGEST:
        return None
    size, turn = np.linalg.eigh((hat + hat.T) / 2)
    keep = size > 1e-9
    basis = turn[:, keep] * np.sqrt(size[keep])
    weight = np.full(n, 1 / max(w.scatter or w.sigma, float(np.sqrt(w.residuals @ w.residuals / spare))))
    return Left(np.arange(n), weight, basis, np.zeros((int(keep.sum()), 0)), w.residuals * weight, spare, np.zeros(0))


def _far(left: Left) -> NDArray[np.int64]:
    """→ touches that are farther off than any of so many is by chance (Student's t; Cook and Weisberg 1982)."""
    free = 1 - np.sum(left.basis**2, axis=1)
    told = free > ALONE
    off = np.zeros(len(free))
    off[told] = np.abs(left.gaps[told]) / np.sqrt(free[told])
    square = np.minimum(off**2, left.spare * (1 - 1e-9))
    student = np.sqrt(square * (left.spare - 1) / (left.spare - square))
    return np.flatnonzero(student > -float(special.stdtrit(left.spare - 1, FAR / 2 / len(free))))
