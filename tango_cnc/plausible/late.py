"""Touches without weight that are all late, or all early: a latch, a probe that settles, a wet table, not bad luck.

Wrong touches to one side pull every fit towards them. Where the noise found them all the same, they are named, with what they have
in common: a direction of the machine, a part of the run.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..records import Array
from ..texts import say
from .data import Remark, listed

MANY = 0.1  # share of all touches that they are
ONE_SIDED = 0.8  # share of them on one side: where most touches of a facet are late, the others seem early
AGREE = 4.0  # times the stated repeatability that the others may scatter by
FAR = 10.0  # times that which nine in ten of them are off by, at least: what begins at nothing is a shape
FEW = 0.1
ALIKE = 0.2  # of the median: those that are off by one distance
MORE = 0.4  # by how much the share of wrong touches is higher in a group than outside it before it is named


def late(result: Estimate) -> Iterator[Remark]:
    """estimate by the noise of its residuals → a remark where many touches read late, or early, while the others agree."""
    out = result.unused if result.rejected is None else result.rejected
    if result.noise is None or result.noise.step is not None or out.mean() < MANY:
        return
    white, repeats = result.noise.white, max(result.model.touches.machine.probe.repeatability, 1e-4)
    off = result.residuals[out]
    if white > AGREE * repeats or np.quantile(np.abs(off), FEW) < FAR * repeats:
        return
    behind = float(np.mean(off < 0))  # beyond the surface: the position was latched late
    numbers = tuple(int(i) for i in result.model.touches.number[out])
    own = np.abs(off) * 1000.0
    middle = float(np.median(own))
    alike = float(np.mean(np.abs(own - middle) < ALIKE * middle)) > ONE_SIDED
    if max(behind, 1 - behind) < ONE_SIDED and not alike:
        return
    size = _digits(middle) if alike else f"{_digits(float(np.quantile(own, 0.05)))} … {_digits(float(own.max()))}"
    yield Remark(
        "doubtful",
        say(
            f"plausible.late.{'late' if behind > 0.5 else 'early'}",
            count=len(numbers),
            total=len(out),
            size=size,
            white=f"{white * 1000.0:.2g}",
            numbers=listed(numbers),
            common=_common(result, out),
        ),
        numbers,
        "late_touches",
        "touch",
        say("plausible.late.change"),
        sure=True,
    )


def _digits(size: float) -> str:
    """µm → three digits, and never a power of ten."""
    return f"{size:.3g}" if size < 999.5 else f"{size:.0f}"


def _common(result: Estimate, out: NDArray[np.bool_]) -> str:
    """estimate, touches that are off → what most of them have in common, as a clause; empty where nothing stands out."""
    touches = result.model.touches
    normal: Array = touches.machine_normal
    half = np.argsort(np.argsort(touches.time)) >= len(out) / 2
    groups = {
        say("plausible.late.toward", sign="-" if sign > 0 else "+", axis=axis): normal[:, i] * sign > 0.7
        for i, axis in enumerate("XYZ")
        for sign in (1.0, -1.0)
    }
    groups |= {say("plausible.late.second_half"): half, say("plausible.late.first_half"): ~half}
    best, what = MORE, ""
    for said, group in groups.items():
        if 0 < group.sum() < len(group) and (apart := float(out[group].mean() - out[~group].mean())) > best:
            best, what = apart, said
    return say("plausible.late.common", what=what) if what else ""
