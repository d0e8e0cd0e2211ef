"""The first touch after an indexation or a pause reads differently."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label, need


def variants(touches: Touches) -> Variants:
    """touches → after an indexation; after a turn of a rotary axis, where the spindle turns alone as well; after long pauses."""
    yield {"after": "indexation"}
    if np.any((np.diff(touches.indexation) > 0) & ~_turned(touches)):
        yield {"after": "turn"}
    waits = np.diff(touches.time)
    if len(waits) and waits.max() > 3 * np.median(waits):
        usual = float(np.median(waits))
        for pause in (3 * usual, 10 * usual, 30 * usual):
            if 2 <= int((waits > pause).sum()) <= len(waits) // 4:
                yield {"after": "pause", "pause": pause}


def _turned(touches: Touches) -> NDArray[np.bool_]:
    """→ (n − 1,) whether a rotary axis has turned since the touch before."""
    turns = [np.diff(touches.axis(name)) != 0 for name in touches.machine.rotary]
    return np.any(turns, axis=0) if turns else np.zeros(max(len(touches) - 1, 0), dtype=np.bool_)


def make(machine: Machine, after: str = "indexation", pause: float = 60.0) -> list[Coefficient]:
    """machine, after what, pause in s → coefficient in mm, read too early when positive."""
    need("first_touch", "after", after, ("indexation", "turn", "pause"))

    def pattern(t: Touches) -> Array:
        new = np.diff(t.indexation) > 0
        fresh = np.diff(t.time) > pause if after == "pause" else new & _turned(t) if after == "turn" else new
        return np.concatenate([[True], fresh]).astype(float)

    return [early(label("first_touch", after, *((pause,) if after == "pause" else ())), pattern)]


TERM = Cause(
    text="the first touch after an indexation or a pause reads differently",
    source="probe wake-up and settling of clamps; ISO 230-10:2022, 5.4 (warm-up touches)",
    frame="probe",
    mistaken=("indexation_seating", "move_length_memory"),
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
