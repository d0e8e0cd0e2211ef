"""The shop breathes: air conditioning, sun, chiller; `n·(a cos ωt + b sin ωt)`, machine frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, displaced, label

TEXT = "the machine breathes with a cycle of its surroundings (air conditioning, chiller, day and night)"
SOURCE = "ISO 230-3:2020 clause 5 (environmental temperature variation error)"
FRAME = "machine"
MISTAKEN = ("thermal_drift", "encoder_harmonic")
ADVICE = "find what switches with this period, shield the machine, or keep the term"
REFINE = {"period": "log"}


def variants(touches: Touches) -> Variants:
    """touches → periods from a twelfth to twice the run."""
    run = max(float(np.ptp(touches.time)), 1.0)
    frequency = np.arange(0.5, 12.01, 0.45)
    for f in frequency:
        yield {"period": float(run / f)}


def cause(
    machine: Machine, period: float, direction: Sequence[float] | None = None, phase: float | None = None
) -> list[Coefficient]:
    """machine, period in s → cosine and sine of 2πt/period in x y z of the machine frame, mm."""
    stem = label("ambient_cycle", period)

    def turned(t: Touches) -> Array:
        return 2 * np.pi * t.time / period + np.radians(phase or 0.0)

    cosine = displaced(f"{stem}.cos", "machine", lambda t: np.cos(turned(t)), direction)
    sine = displaced(f"{stem}.sin", "machine", lambda t: np.sin(turned(t)), direction)
    return [*cosine, *sine]
