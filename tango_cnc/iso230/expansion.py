"""What an expansion of all scales does to figures: every linear axis goes farther by the same share of its command.

It is computed by moving the machine, figure by figure, so nothing is listed here: gain, positioning and the ranges of a volume
feel it; straightness, angles and squareness do not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..kinematics import Slot
from ..records import Array, Machine
from ..terms import Coefficient
from .onpart import Ask, asked
from .temperature import Known
from .trajectory import Reference
from .whole import Whole

FELT = 1e-6  # mm or rad for a scale of 1: less is rounding


def stretches(machine: Machine) -> tuple[Coefficient, ...]:
    """machine → one coefficient per linear axis, mm/mm: it goes farther by that share of its command."""
    return tuple(_stretch(name) for name in machine.linear)


def _stretch(axis: str) -> Coefficient:
    return Coefficient(f"expansion {axis}", "mm/mm", Slot(axis, "motion"), lambda touches: np.asarray(touches.axis(axis)))


def felt_by(machine: Machine, over: Mapping[str, tuple[float, float]], at: Reference) -> dict[tuple[str, str], Array]:
    """machine, ranges (mm, rad), reference → (kind, name): what a figure feels of a scale of 1, mm or rad, as a curve or number."""
    return {(a.kind, a.name): a.curve.sum(axis=-1) for a in asked(machine, stretches(machine), over, at)}


def with_column(ask: Ask, felt: Array) -> Ask:
    """figure (p), what it feels of a scale of 1 → figure (p + 1)."""
    return replace(ask, curve=np.concatenate([ask.curve, np.asarray(felt)[..., None]], axis=-1))


def feels(ask: Ask, felt: Array) -> bool:
    """figure, what it feels of a scale of 1 → whether an expansion changes it; an offset of all of a curve changes no range."""
    return bool((np.ptp(felt) if ask.curve.ndim == 2 else np.max(np.abs(felt))) > FELT)


def expanded(w: Whole, more: Known) -> Whole:
    """machine, what temperature adds to every scale (mm/mm) → the same with this as one coefficient more."""
    p = len(w.values)
    covariance = np.zeros((p + 1, p + 1))
    covariance[:p, :p], covariance[p, p] = w.covariance, more.std**2
    motions = (*w.motions, "the expansion of bar and machine")
    draws, free = w.draws, None if w.free is None else np.append(w.free, False)
    if draws is not None:
        drawn = more.value + more.std * np.random.default_rng(2308).standard_normal(draws.shape[1])
        draws = np.vstack([draws, drawn])
    return replace(w, motions=motions, values=np.append(w.values, more.value), covariance=covariance, draws=draws, free=free)
