"""The probe triggers later in some directions than in others: `√(n_sx² + n_sy²) cos(mθ + φ)` in the spindle frame."""

from __future__ import annotations

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import GAP, Cause, Coefficient
from ._cause import Variants, label, wave

ORDERS = (2, 3, 4, 6)  # order 1 is the stylus offset


def variants(touches: Touches) -> Variants:
    """touches → orders 2, 3, 4 and 6."""
    for order in ORDERS:
        yield {"order": order}


def make(machine: Machine, order: int = 3) -> list[Coefficient]:
    """machine, order → cosine and sine, mm."""

    def azimuth(t: Touches) -> Array:
        result: Array = order * np.arctan2(t.spindle_normal[:, 1], t.spindle_normal[:, 0])
        return result

    def across(t: Touches) -> Array:
        result: Array = np.hypot(t.spindle_normal[:, 0], t.spindle_normal[:, 1])
        return result

    return wave(label("probe_lobing", order), GAP, azimuth, "mm", across)


TERM = Cause(
    text="the probe's pre-travel depends on the direction around its axis",
    source="ISO 230-10:2022, 6.4 (2D probing error); thesis section 7.3",
    frame="spindle",
    mistaken=("backlash",),
    says="the probe reads with {order} lobes around its axis, {size} early on a lobe and as much late between",
    meaning="a matter of the probe, not of parts; bores and bosses measured with it are out of round by twice this",
    advice="orient the spindle so that the probe always touches on the same side, use a strain-gauge probe, or keep the term",
    refine={},
    variants=variants,
    over="probe",
    make=make,
)
