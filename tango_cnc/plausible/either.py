"""A drift, or something that happened once: where a walk or seating was found, patterns compete with it for the same residuals.

A walk in all directions takes up most of a table that was knocked by 3 µm, of a center of rotation that drifts, of a
compensation that was switched. The parameters then follow a drift that was none. So each pattern is tried on white scatter,
without walk and seating: what it takes out of the residuals, less what its own unknowns and its place in the run would take out
by chance, is compared with what the walk does for its effective unknowns (information criterion of Akaike 1974). Where the
pattern does as well, nobody knows which it was, and what the two disagree on is not to be trusted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..estimate import Estimate
from ..records import Array
from ..texts import joined, say
from ..touches import Touches
from .data import Remark
from .lacking import FEWEST, LARGEST, MOVED, SHOWN, SPARE, TOUCHED, Left, left_over, moments, steady, stretches
from .shapes import candidates, movable

WORTH = 10.0  # that a pattern has to gain over white scatter
AS_WELL = 6.0  # by which it may do worse than the drift before it is out of the question: one in twenty
AGREED = -6.0  # the same where the touches are as was predicted before: it has to do better
DRIFTS = ("drift", "creeps", "center", "probe", "memory", "late", "radius", "yields")  # drifts, or nothing that a drift stands for


@dataclass(frozen=True)
class Rival:
    """A pattern that explains the residuals without a drift."""

    what: str
    axis: str
    first: int  # rows on which it acts, of the touches
    last: int
    gain: float  # of its information criterion over white scatter
    moved: Array  # by which it moves every unknown, from where white scatter alone leaves it


@dataclass(frozen=True)
class Drift:
    """A walk or seating that was found, beside which patterns are tried on white scatter."""

    white: Left  # what the unknowns leave under white scatter alone
    gain: float  # of the information criterion of walk and seating over white scatter


def drift_of(result: Estimate) -> Drift | None:
    """estimate by the noise of its residuals → its drift; None where none was found, a step was, or patterns are not tried."""
    noise = result.noise
    if noise is None or noise.columns is None or noise.step is not None or len(result.model.touches) > LARGEST:
        return None
    drifting = left_over(result)
    white = left_over(replace(result, noise=replace(noise, columns=None)))
    if drifting is None or white is None or drifting.spare < SPARE:
        return None
    taken = float(white.gaps @ white.gaps) - float(drifting.gaps @ drifting.gaps)
    return Drift(white, taken - 2 * (white.spare - drifting.spare))


def either(result: Estimate, drift: Drift, behind: float = AS_WELL) -> Iterator[Remark]:
    """estimate, its drift → a remark where what was taken for a drift may as well be a pattern that moves more.

    `behind`: by how much that pattern may do worse than the drift.
    """
    white, touches, least = drift.white, result.model.touches, max(WORTH, drift.gain - behind)
    p = len(result.model.coefficients)
    found = [rival for rival in _rivals(touches, white) if rival.gain > least]
    if not found:
        return
    back = to_white(result, white)
    moved = np.max([np.abs(back + rival.moved)[:p] / result.std[:p] for rival in found], axis=0)
    if moved.max(initial=0.0) < MOVED:
        return
    best = max(found, key=lambda rival: rival.gain)
    names = [result.model.names[int(j)] for j in np.argsort(-moved) if moved[j] > TOUCHED]
    number = touches.number
    text = say(
        "plausible.lacking.either",
        what=say(f"plausible.lacking.{best.what}", axis=best.axis, first=number[best.first], last=number[best.last]),
        names=joined(", ", [result.selection.label(n) for n in names[:SHOWN]]),
        size=f"{float(moved.max()):.0f}",
    )
    yield Remark("doubtful", text, moves=tuple(result.model.names[:p]))


def to_white(result: Estimate, white: Left) -> Array:
    """→ (p,) from the unknowns of the estimate to those that white scatter alone would give."""
    gaps = result.residuals[white.rows] * white.weight
    return -(white.back.T @ (white.basis.T @ gaps))


def _rivals(touches: Touches, white: Left) -> Iterator[Rival]:
    n = len(white.rows)
    begin, end = moments(touches, white)
    for what, axis, columns in movable(touches):
        tried = stretches(white, np.arange(n), columns, begin, end)
        if tried is None:
            continue
        gain = tried.gain - 2 * tried.free - 2 * np.log(len(tried.begin))
        i = int(np.argmax(gain))
        first, last = int(white.rows[tried.begin[i]]), int(white.rows[tried.end[i] - 1])
        name = what if tried.end[i] > n - FEWEST else f"{what}_while"
        yield Rival(name, axis, first, last, float(gain[i]), -(white.back.T @ (tried.inside[i] @ tried.beta[i])))
    shapes = [shape for shape in candidates(touches) if shape[0] not in DRIFTS]
    for what, axis, columns in shapes:
        taken, free, moved = steady(white, columns)
        yield Rival(what, axis, 0, len(touches) - 1, taken - 2 * free - 2 * float(np.log(len(shapes))), moved)
