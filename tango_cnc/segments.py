"""What may have changed while a run stood still: everything after `--resume` may sit somewhere else than before."""

from __future__ import annotations

import numpy as np

from .records import InputError, Readings, TermItem
from .terms import serving
from .touches import counted

FEWEST = 3  # touches of a segment below which its offset is not worth three unknowns


def offsets(readings: Readings, frame: str) -> tuple[TermItem, ...]:
    """readings, machine or table → a term for each segment but the first: a displacement in x y z of that frame, mm.

    Each is measured from the segment before, and begins at the first touch used of its own. Raises InputError when the
    readings have one segment only, or one with too few touches (a change-point model).
    """
    if readings.segment is None or len(set(readings.segment.tolist())) < 2:
        raise InputError(
            "--segment-offset: found readings of one run without interruption; allowed: readings with a column 'segment'"
        )
    used, count = readings.segment[readings.ok], counted(readings)[readings.ok]
    begins = np.flatnonzero(np.diff(used)) + 1
    for first, end in zip(begins, [*begins[1:], len(used)], strict=True):
        if end - first < FEWEST:
            raise InputError(
                f"--segment-offset: found {end - first} usable touches in segment {used[first]}; allowed: at least {FEWEST}, "
                "for their displacement in three directions. Estimate without its offset"
            )
    return tuple({"cause": serving("interruption"), "at": int(count[first]), "frame": frame} for first in begins)
