"""Touches that do not fit with a compensation in the control, and did before: a row of a table that is wrong does that, or a chip.

A robust fit gives them no weight. What it finds beside them says nothing of them, and may be as good as the promise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..loaded import HELPS
from .outcome import Outcome
from .space import Held

NAMED = 8  # touches that a sentence names
TOGETHER = 0.35  # of the way of an axis: touches within less of it lie together


def without_strays(found: Outcome, first: Estimate | None, result: Estimate, held: Sequence[Held]) -> Outcome:
    """outcome of a run that determines everything, estimates of the full run (None: not known) and of this one, what the target
    holds → the same; undecided where touches do not fit that did fit then.
    """
    rows = _new(first, result)
    if not len(rows) or found.verdict not in HELPS:
        return found
    numbers = result.model.touches.number[rows]
    listed = ", ".join(str(n) for n in numbers[:NAMED]) + (f" and {len(rows) - NAMED} more" if len(rows) > NAMED else "")
    one = len(rows) == 1
    largest = float(np.abs(result.residuals[rows]).max()) * 1e3
    text = (
        f"{'touch' if one else 'touches'} {listed} {'does' if one else 'do'} not fit, by up to {largest:.1f} µm, and did in the "
        f"run that the compensation was made from{_where(result, rows, held)}. A row of a table that is wrong does that, and so "
        "does a chip. Read the files back from the control into a copy of the folder and compare them by --check; clean the facets "
        f"and measure again. What the other touches say: {found.text}"
    )
    return replace(found, verdict="undecided", text=text, not_seen=(), left_if_none=None)


def _new(first: Estimate | None, result: Estimate) -> NDArray[np.int64]:
    """estimates of the full run and of this one → rows of touches without weight that had some then."""
    touches = result.model.touches
    before = set()
    if first is not None:
        then = first.model.touches
        before = {(int(then.number[i]), then.facet[i]) for i in np.flatnonzero(first.unused)}
    rows = [i for i in np.flatnonzero(result.unused) if (int(touches.number[i]), touches.facet[i]) not in before]
    return np.array(rows, dtype=np.int64)


def _where(result: Estimate, rows: NDArray[np.int64], held: Sequence[Held]) -> str:
    """estimate, rows of touches, what the target holds → where they lie, of the axis along which they are closest together; ''
    where they lie anywhere.

    An axis along which most of all touches lie together as well says nothing.
    """
    machine, position = result.model.touches.machine, result.model.touches.position
    best: tuple[float, str] | None = None
    for axis in dict.fromkeys(h.axis for h in held if h.axis is not None and h.at is not None):
        every = position[:, machine.column(axis)]
        low, high = float(every[rows].min()), float(every[rows].max())
        share = (high - low) / max(float(np.ptp(every)), 1e-9)
        alike = float(np.mean((every >= low) & (every <= high)))
        if len(rows) > 1 and share < TOGETHER and alike < 0.5 and (best is None or share < best[0]):
            scale, unit = (1.0, "mm") if axis in machine.linear else (180 / np.pi, "deg")
            best = share, f"; all of them lie where {axis} is {scale * low:.0f} to {scale * high:.0f} {unit}"
    return "" if best is None else best[1]
