"""The first touch after an indexation or a pause reads differently."""

from __future__ import annotations

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label, need


def variants(touches: Touches) -> Variants:
    """touches → after an indexation; after pauses that stand out."""
    yield {"after": "indexation"}
    waits = np.diff(touches.time)
    if len(waits) and waits.max() > 3 * np.median(waits):
        usual = float(np.median(waits))
        for pause in (3 * usual, 10 * usual, 30 * usual):
            if 2 <= int((waits > pause).sum()) <= len(waits) // 4:
                yield {"after": "pause", "pause": pause}


def make(machine: Machine, after: str = "indexation", pause: float = 60.0) -> list[Coefficient]:
    """machine, after what, pause in s → coefficient in mm, read too early when positive."""
    need("first_touch", "after", after, ("indexation", "pause"))

    def pattern(t: Touches) -> Array:
        fresh = np.diff(t.indexation) > 0 if after == "indexation" else np.diff(t.time) > pause
        return np.concatenate([[True], fresh]).astype(float)

    return [early(label("first_touch", after, *((pause,) if after == "pause" else ())), pattern)]


TERM = Cause(
    text="the first touch after an indexation or a pause reads differently",
    source="probe wake-up and settling of clamps; ISO 230-10:2022, 5.4 (warm-up touches)",
    frame="probe",
    mistaken=("indexation_seating",),
    follows="first touch of an indexation",
    says="the first touch after every {after} reads {size} {early}",
    meaning="a habit of the probe or the clamps, not an error of parts; "
    "single touches that are used for setting work up have it too",
    advice="make one touch that does not count after every indexation, or keep the term",
    refine={},
    variants=variants,
    units={"pause": "s"},
    make=make,
)
