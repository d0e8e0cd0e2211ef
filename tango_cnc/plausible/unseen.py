"""What these touches cannot show, however large: an axis that is bent looks like one that is not square, on a plan with few poses.

Where a machine turns nothing, a facet is always touched at the same place of every axis. What an axis errs by there, beside a
straight line, goes into squareness, gains and facets, and leaves nothing behind.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..texts import joined, say
from .data import Remark
from .lacking import left_over
from .shapes import places

SHARE = 0.02  # of a bend that the unknowns leave, below which no touch shows it
BEND = 0.01  # mm, at both ends of the travel that was touched
MOVED = 2.0  # standard deviations by which it moves a parameter that is named
NAMED = 6


def unseen(result: Estimate) -> Iterator[Remark]:
    """estimate by the noise of its residuals → a note on axes whose bend would go into the parameters and show nowhere."""
    left = None if result.noise is None else left_over(result)
    if left is None:
        return
    touches, p = result.model.touches, len(result.model.coefficients)
    normal, hidden, moved = touches.machine_normal, [], np.zeros(p)
    for axis, at in zip(touches.machine.linear, places(touches).T, strict=True):
        bends = [((at**2)[:, None] * normal[:, [i]])[left.rows, 0] * left.weight for i in range(3)]
        bends = [b for b in bends if float(b @ b) > 0]
        taken = [left.basis.T @ b for b in bends]
        if not bends or any(1 - float(t @ t) / float(b @ b) > SHARE for b, t in zip(bends, taken, strict=True)):
            continue
        hidden.append(axis)
        for t in taken:
            moved = np.maximum(moved, np.abs(left.back[:, :p].T @ t)[:p] * BEND / left.std[:p])
    names = [result.model.names[int(j)] for j in np.argsort(-moved) if moved[j] > MOVED]
    if names:
        text = say(
            "plausible.unseen.bend",
            axes=joined(", ", hidden),
            size=f"{1000 * BEND:g}",
            names=joined(", ", [result.selection.label(n) for n in names[:NAMED]]),
            moved=f"{float(moved.max()):.0f}",
        )
        yield Remark("trustworthy", text)
