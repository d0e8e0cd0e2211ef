"""The shop breathes: air conditioning, sun, chiller; `n·(a cos ωt + b sin ωt)`, machine frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import Variants, displaced, fraction, label, times
from ._world import Effects, vector


def variants(touches: Touches) -> Variants:
    """touches → periods from a twelfth of the run to five sixths of it: of a cycle more than one has to be seen."""
    run = max(float(np.ptp(touches.time)), 1.0)
    frequency = np.arange(1.2, 12.01, 0.45)
    for f in frequency:
        yield {"period": float(run / f)}


def make(
    machine: Machine, period: float, direction: Sequence[float] | None = None, phase: float | None = None
) -> list[Coefficient]:
    """machine, period in s → cosine and sine of 2πt/period in x y z of the machine frame, mm."""
    stem = label("ambient_cycle", period)

    def turned(t: Touches) -> Array:
        return 2 * np.pi * t.time / period + np.radians(phase or 0.0)

    cosine = displaced(f"{stem}.cos", "machine", lambda t: np.cos(turned(t)), direction)
    sine = displaced(f"{stem}.sin", "machine", lambda t: np.sin(turned(t)), direction)
    return [*cosine, *sine]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → a cosine and a sine, each along its own direction (world.yaml)."""
    base = {"cause": "ambient_cycle", "period": setting["period"]}
    turned = float(setting.get("phase") or 0.0)
    if setting.get("direction") is not None:
        parts = [{"amplitude": float(v), "direction": list(setting["direction"])} for v in values]
    else:
        parts = [vector(values[:3]), vector(values[3:])]
    return [base | part | {"phase": turned + ahead} for part, ahead in zip(parts, (90.0, 0.0), strict=True)]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → waves in time, without its name."""
    time = fraction(touches.time)
    for cycles in np.arange(0.5, 12, 0.25):
        wave = np.column_stack([np.cos(2 * np.pi * cycles * time), np.sin(2 * np.pi * cycles * time)])
        yield "time", "machine", "periodic", times(wave, touches.machine_normal)


TERM = Cause(
    text="the machine breathes with a cycle of its surroundings (air conditioning, chiller, day and night)",
    source="ISO 230-3:2020 clause 5 (environmental temperature variation error)",
    frame="machine",
    mistaken=("thermal_drift", "encoder_harmonic"),
    says="the machine breathes {size} {towards} and back, once every {period}",
    meaning="parts made at different moments of the cycle differ by up to twice this",
    advice="find what switches with this period, shield the machine, or keep the term",
    refine={"period": "log"},
    once=True,  # of one axis: two of them together follow any curve
    variants=variants,
    units={"period": "s"},
    make=make,
    unnamed=unnamed,
    effects=effects,
)
