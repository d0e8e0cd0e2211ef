"""Causes that are no shift but a spread: seating, rough facets, noise; and a wandering that has no name."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import special

from ..records import Array
from ..terms import scattering
from ..touches import Touches
from ._catalogue import columns_of
from ._explain import RANDOM, ROUGH, SHARE, Explanation, Rough, gain
from ._records import Finding, Remainder, Size
from ._space import level

LOUDER = 1.1  # times the stated repeatability: less than this nobody asks about


def findings(
    e: Explanation,
    touches: Touches,
    rough: Sequence[Rough],
    excluded: Collection[str],
    remains: Sequence[Remainder] = (),
    seats: bool = True,
    shown: float = 0.0,
    aside: bool = False,
) -> list[Finding]:
    """explanation, rough facets, shapes, whether seats compete best, evidence of the largest shape, whether moments were set aside
    → causes that show in the spread of the touches.

    What a shape without a name leaves of the unknown looks like a spread of all touches: beside it none is named. Rough facets
    are where they have more evidence than it, because they were compared with all shapes taken out.
    """
    result: list[Finding] = []
    unknown = SHARE * max((gain(e.place, e.chosen, c) for c in e.chosen if c.candidate.cause == ""), default=0.0)
    unknown = max(unknown, shown)
    rough = [r for r in rough if r.p_value < ROUGH and -2 * np.log(max(r.p_value, 1e-300)) > unknown]
    if seats and not remains and e.random[1] > max(RANDOM, unknown) and scattering("indexation") not in excluded:
        amplitude, std = _amplitude(e, 1)
        number = int(touches.indexation.max()) + 1
        p = float(0.5 * special.chdtrc(1, e.random[1]))
        result.append(
            _finding(scattering("indexation"), {"indexations": number}, {"frame": "machine"}, amplitude, std, p, len(touches))
        )
    if rough:
        facets = tuple(r.key for r in rough)
        largest = max(rough, key=lambda r: r.extra)
        each = {r.key: round(r.extra * 1e3, 3) for r in rough}
        count = sum(f == largest.key for f in touches.facet)
        p = min(r.p_value for r in rough)
        std = largest.extra / np.sqrt(2 * max(count - 1, 1))
        detail = {"facets": list(facets), "spread_um": each}
        result.append(_finding(scattering("facet"), {"facets": facets}, detail, largest.extra, std, p, len(touches)))
    stated = touches.machine.probe.repeatability
    dof = e.place.m - columns_of(e.place, e.chosen).shape[1]
    alone = not remains and not rough and not unknown and not aside  # what came and went has left the moments that were set aside
    if scattering("all") not in excluded and alone and stated > 0 and e.sigma > LOUDER * stated:
        p = float(special.chdtrc(dof, dof * (e.sigma / stated) ** 2))
        if p < 0.001:
            extra = float(np.sqrt(e.sigma**2 - stated**2))
            told = {"stated_um": stated * 1e3, "found_um": e.sigma * 1e3}
            result.append(_finding(scattering("all"), {}, told, extra, e.sigma**2 / extra / np.sqrt(2 * dof), p, len(touches)))
    return result


def wandering(e: Explanation, touches: Touches) -> list[Remainder]:
    """explanation → the drift without a pattern that is left, as structure without a name."""
    if e.random[0] <= RANDOM:
        return []
    amplitude, _ = _amplitude(e, 0)
    hours = float(np.ptp(touches.time)) / 3600
    return [Remainder("time", "machine", "random walk", amplitude * float(np.sqrt(hours)), 0.0, np.zeros(len(touches)))]


def _amplitude(e: Explanation, kernel: int) -> tuple[float, float]:
    """explanation, which kernel → its standard deviation in the unit of the residuals, and how well it is known."""
    ratio = e.ratios[kernel]
    if not ratio:
        return 0.0, 0.0
    amplitude = e.sigma * float(np.sqrt(ratio / e.place.scales[kernel]))
    selected = columns_of(e.place, e.chosen)

    def at(factor: float) -> float:
        ratios = tuple(r * factor if i == kernel else r for i, r in enumerate(e.ratios))
        return float(level(e.place, ratios, e.place.y, selected)[2][0])

    step = 0.3
    curvature = (2 * at(1.0) - at(np.exp(step)) - at(np.exp(-step))) / step**2
    # Log of the variance: half of its relative uncertainty is that of the standard deviation.
    return amplitude, amplitude * 0.5 / float(np.sqrt(max(curvature, 0.25)))


def _finding(
    cause: str, setting: Mapping[str, Any], detail: Mapping[str, Any], amplitude: float, std: float, p: float, n: int
) -> Finding:
    nothing: Array = np.empty(0)
    effect: dict[str, Any] = {"cause": cause, "amplitude": amplitude}
    if "facets" in setting:
        effect["facets"] = list(setting["facets"])
    s = Size(nothing, nothing, amplitude, float(std), detail, effect)
    return Finding(cause, setting, detail, s, p, None, {}, (), (), effect, np.zeros(n))
