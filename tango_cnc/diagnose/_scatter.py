"""Noise as it is: heavy tails, and variances that differ by facet, direction, indexation or time, compared with each other.

Members of a grouping have variances drawn from a scaled inverse chi-squared distribution, which is integrated out (Gelman et
al., Bayesian Data Analysis, 2013, 2.6 and 5.4). Where every touch is a member of its own that is Student's t: heavy tails are
found by the same comparison, and are tamed before members are compared, so that no few wild touches make a group wild.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ..records import Array
from ..touches import Touches
from . import _variances
from ._contest import Outcome
from ._gain import blocks
from ._variances import Left

SHARED = np.geomspace(1.0, 300.0, 25)  # degrees of freedom of the distribution of the variances: few where they differ much
SCALES = np.geomspace(0.02, 3.0, 60)  # variance of a usual member over the mean square
CLEAR = 10.0  # evidence above which noise is not white and normal (Kass & Raftery 1995: very strong)
APART = 6.0  # by which a grouping must be better than every other one (strong)
SEEN = 0.2  # part of its own noise that must be left in a touch
FEWEST = 2.5  # degrees of freedom of a member
MIXED = 0.9  # part of its own noise in a touch below which the noise of others counts in it
WORTH = 0.0  # evidence from the residuals alone below which it is not asked what the mixing of their noise hides
WILD = 6.0  # usual standard deviations beyond which a touch counts as if it were that far away


@dataclass(frozen=True)
class Scatter:
    """What the size of the noise depends on."""

    by: str | None  # facet, direction, indexation or time; None where it depends on nothing
    evidence: float  # for it, against one variance for all
    apart: float  # evidence by which it is better than every other grouping
    tails: float | None  # degrees of freedom of Student's t where tails are heavy
    memory: float = 0.0  # correlation of neighbouring touches that the noise has
    rival: str | None = None  # what else it may depend on, where that does nearly as well

    @property
    def clear(self) -> bool:
        """→ whether no other grouping does nearly as well."""
        return self.by is not None and self.apart > APART


def uneven(s: Scatter) -> bool:
    """scatter that is left with names in the model → whether it speaks against them.

    A facet may be rough. Touches of one part of the test, one side or one indexation that scatter more beside a name are far
    more often touches that the name does not explain: no chance touches them, and to weigh them less would only hide it.
    """
    return s.by not in (None, "facet") and s.rival != "facet" and s.evidence > CLEAR


EVEN = Scatter(None, 0.0, 0.0, None)


def groupings(touches: Touches) -> Mapping[str, NDArray[np.int64]]:
    """touches → number of the member (n,) of every touch, by what touches may be grouped by."""
    normal = touches.machine_normal
    main = np.argmax(np.abs(normal), axis=1)
    side = (normal[np.arange(len(normal)), main] > 0).astype(np.int64)
    facets = {f: i for i, f in enumerate(dict.fromkeys(touches.facet))}
    return {
        "facet": np.array([facets[f] for f in touches.facet], dtype=np.int64),
        "direction": (main + 3 * side).astype(np.int64),
        "indexation": touches.indexation.astype(np.int64),
        "time": blocks(len(touches)),
    }


def scatter(
    left: Array, own: Array, members: Mapping[str, NDArray[np.int64]], space: Left | None = None, least: float = CLEAR
) -> Scatter:
    """residuals (n,), part of its own noise that is in each (n,), groupings, the space that they are from, evidence that is
    asked for → what it depends on.
    """
    use = own > SEEN
    if use.sum() < 30:
        return EVEN
    z, free = left[use] / np.sqrt(own[use]), own[use]
    usual = float(np.median(np.abs(z))) / 0.6745
    if not usual:
        return EVEN
    far = z - np.clip(z, -WILD * usual, WILD * usual)
    price = float(np.log(len(z)))
    heavy, freedom, calm = tamed(z - far)
    raw, tame = ({name: _by(member[use], free, v) - price for name, member in members.items()} for v in (z - far, calm))
    if space is not None and float(np.mean(own[use])) < MIXED:
        for scores, v in ((raw, z - far), (tame, calm)):
            more = np.zeros(len(own))
            more[use] = (z - v) / np.sqrt(free)
            for name in scores:
                if scores[name] > WORTH:
                    scores[name] = _variances.evidence(space.without(more), members[name]) - price
    # Either the members say more than wild touches do, or they still differ when the wild touches are tamed.
    total = {name: max(raw[name] - max(heavy - price, 0.0), tame[name]) for name in raw}
    best = max(total, key=lambda k: total[k])
    tails = freedom if heavy - price > CLEAR else None
    if total[best] < least:
        return Scatter(None, total[best], 0.0, tails)
    others = {k: v for k, v in raw.items() if k != best}
    other = max(others, key=lambda k: others[k])
    apart = raw[best] - others[other]
    tails = tails if total[best] == tame[best] else None
    return Scatter(best, total[best], apart, tails, rival=None if apart > APART else other)


def _by(member: NDArray[np.int64], free: Array, z: Array) -> float:
    """members, what is left of the noise and residuals (n,) → evidence that their variances differ."""
    count: Array = np.bincount(member, free).astype(float)  # a residual knows of its noise as much as is left of it
    square: Array = np.bincount(member, free * z**2).astype(float)
    return evidence(square[count > 0], count[count > 0]) if (count > FEWEST).sum() > 1 else 0.0


def evidence(square: Array, count: Array) -> float:
    """sum of squares and degrees of freedom (g,) of every member → twice the log likelihood ratio of variances that differ."""
    whole = float(square.sum() / count.sum())
    equal = -0.5 * float(count.sum()) * (1 + np.log(whole))
    nu = SHARED[:, None, None]
    s2 = (SCALES * whole)[None, :, None]
    value = (
        special.gammaln((nu + count) / 2)
        - special.gammaln(nu / 2)
        - 0.5 * count * np.log(nu * s2 / 2)
        - 0.5 * (nu + count) * np.log1p(square / (nu * s2))
    ).sum(axis=2)
    return float(2 * (value.max() - equal))


def tamed(z: Array) -> tuple[float, float, Array]:
    """(n,) residuals of one variance → evidence for Student's t, its degrees of freedom, and (n,) with the tails of a normal."""
    whole = float(np.mean(z**2))
    nu = SHARED[:, None, None]
    s2 = (SCALES * whole)[None, :, None]
    gammas = special.gammaln((nu + 1) / 2) - special.gammaln(nu / 2) - 0.5 * np.log(nu * s2 / 2)
    value = (gammas - 0.5 * (nu + 1) * np.log1p(z**2 / (nu * s2))).sum(axis=2)
    i, j = np.unravel_index(int(np.argmax(value)), value.shape)
    score = 2 * float(value[i, j]) + len(z) * (1 + float(np.log(whole)))
    freedom, size = float(SHARED[i]), float(SCALES[j] * whole)
    return score, freedom, z * np.sqrt((freedom + 1) / (freedom + z**2 / size))


def remembering(scatter: Scatter, outcome: Outcome) -> Scatter:
    """scatter, outcome of the contest → with the correlation of neighbouring touches that the noise with memory has."""
    white, kept = 1.0, 0.0
    for p in outcome.picked:
        if p.kernel.kind == "memory":
            columns = p.kernel.columns
            white += p.tau * float(np.mean(np.sum(columns**2, axis=1)))
            kept += p.tau * float(np.mean(np.sum(columns[1:] * columns[:-1], axis=1)))
    return replace(scatter, memory=kept / white)


__all__ = ["EVEN", "Scatter", "groupings", "remembering", "scatter"]
