"""Why a name that no shape beats is not named all the same; and which parameters move when it is."""

from __future__ import annotations

from ..estimate import Estimate
from ._catalogue import Chosen
from ._gain import Gain
from ._records import Size, Stability, Why

MAJORITY = 3  # of the subsets


def refused(c: Chosen, s: Size, g: Gain, back: Stability, everywhere: bool, few: bool = False, lonely: bool = False) -> Why | None:
    """a name, its size, gain, in how many subsets it came back, whether it gains in every scheme, whether the touches are too few
    for any name, whether it rests on one touch → why it is not named, or None.
    """
    if few and not c.candidate.learned:
        return "few"
    if lonely:
        return "one touch"
    if not g.real or not everywhere:
        return "no gain"
    # A shape that was learned has one free number; a new one may follow a subset better, as it was not learned without noise.
    if back.times < (min(MAJORITY, back.of) if c.candidate.learned else back.of):
        return "unstable"
    drifts = "tau" in c.candidate.setting  # of what has not settled, the size at the end is not known: it is not reported either
    if not drifts and s.amplitude_std > s.amplitude / 2:
        return "size"
    return None


def shift_of(before: Estimate, after: Estimate) -> dict[str, tuple[float, float, float]]:
    """→ parameters that move, largest move in standard deviations first."""
    old, new = before.parameters, after.parameters
    moved = {
        name: (p.value, new[name].value, (new[name].value - p.value) / p.std if p.std else 0.0)
        for name, p in old.items()
        if name in new
    }
    return dict(sorted(moved.items(), key=lambda item: -abs(item[1][2])))
