"""A step of the machine within one run: what moved, by how much, and between which touches, where nothing else explains as much.

Tonight's touches against the prediction have the covariance S = H P Hᵀ + σ². A cause that acts from one touch on does to them what
it does in a whole night, and nothing before that touch. Every cause is tried from every touch on: sums from the end of the run
give all moments at once (generalised likelihood ratio; Willsky & Jones 1976).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from ..records import Array
from .filter import State, sigma_of
from .frame import Seen
from .naming import CLOSE, Hypothesis, Named

EDGE = 5  # touches before it, and after it, at least
SURE = 40.0  # of twice the logarithm of the likelihood, by which it explains more than any cause of the whole night
PLAIN = 20.0  # the same against any cause that grows evenly through the run: a machine that warms up
LEFT = 1e-3  # p-value of what it leaves, at least: it is the whole story, or it is not told
NEAR = 4.0  # of twice the logarithm of the likelihood: moments that fit as well as the best one


@dataclass(frozen=True)
class Within:
    """A step within the run: its cause with its size, and the last touch before it and the first after it that are certain."""

    named: Named
    before: int
    after: int


def stepped(state: State, what: Seen, time: Array, tried: Sequence[Hypothesis], scale: float) -> Within | None:
    """predicted state, what n touches say, (n,) s of the touches, causes, scale of quiet nights' statistic → the step within the
    run that explains them; None where a cause of the whole night, or one that grows, does nearly as well, and where more is left.
    """
    sigma, count = sigma_of(state), int(np.sum(what.touch > 0))
    own = what.rows @ state.root / sigma
    innovation = (what.value - what.rows @ state.mean) / sigma
    weight = linalg.inv(np.eye(len(own)) + own @ own.T) / max(scale, 1.0)
    total, seen = float(innovation @ weight @ innovation), what.touch > 0
    order = np.concatenate([np.flatnonzero(seen)[np.argsort(time, kind="stable")], np.flatnonzero(~seen)])
    weight, pull, rows = weight[np.ix_(order, order)], (weight @ innovation)[order], what.rows[order] / sigma
    grows = np.concatenate([np.linspace(-1.0, 1.0, count), np.zeros(len(order) - count)])
    found: list[tuple[float, Hypothesis, Array]] = []
    whole = steady = 0.0
    for h in tried:
        pattern = rows @ h.directions
        if not np.all(np.linalg.norm(pattern[:count], axis=0) > 1e-9):
            continue
        price = np.log(count) * pattern.shape[1]
        whole = max(whole, _gain(pattern, pull, weight) - price)
        steady = max(steady, _gain(np.hstack([pattern, pattern * grows[:, None]]), pull, weight) - price)
        acts = pattern.copy()
        acts[count:] = 0.0  # a certificate is no touch: it holds all night
        found.append((price, h, _gains(acts, pull, weight, count)))
    if not found:
        return None
    scores = [float(gains.max()) - price for price, _, gains in found]
    best = int(np.argmax(scores))
    price, h, gains = found[best]
    first = int(np.argmax(gains))
    rest = total - float(gains[first])
    left = float(special.chdtrc(max(len(order) - h.directions.shape[1] - 1, 1), max(rest, 0.0)))
    if scores[best] - whole < SURE or scores[best] - steady < PLAIN or left < LEFT:
        return None
    near = tuple(found[i][1].parameter for i in np.argsort(scores)[::-1] if i != best and scores[best] - scores[i] < CLOSE)
    acts = rows @ h.directions
    acts[:first] = acts[count:] = 0.0
    spread = linalg.pinvh(acts.T @ weight @ acts)
    size, std = spread @ acts.T @ pull, np.sqrt(np.diag(spread))
    certain = np.flatnonzero(gains > gains[first] - NEAR)
    touch = what.touch[order]
    named = Named(h, size, std, float(gains[first]), scores[best], left, near[:4])
    return Within(named, int(touch[certain[0] - 1]), int(touch[certain[-1]]))


def _gain(pattern: Array, pull: Array, weight: Array) -> float:
    """(n, m) what a cause does, (n,) weighted innovation, (n, n) weight → twice the logarithm of the likelihood that it gains."""
    along = pattern.T @ pull
    return float(along @ linalg.pinvh(pattern.T @ weight @ pattern) @ along)


def _gains(pattern: Array, pull: Array, weight: Array, count: int) -> Array:
    """as `_gain`, touches → (n,) what the cause gains that acts from each touch on; 0 too near to an end of the run.

    One touch more adds its row and its column of the weight, as far as the touches behind it go.
    """
    m = pattern.shape[1]
    along = np.cumsum((pattern * pull[:, None])[::-1], axis=0)[::-1]
    row, column = np.triu(weight) @ pattern, np.tril(weight, -1).T @ pattern
    more = pattern[:, :, None] * row[:, None, :] + column[:, :, None] * pattern[:, None, :]
    square = np.cumsum(more[::-1], axis=0)[::-1]
    at = np.arange(EDGE, count - EDGE + 1)
    at = at[np.all(np.einsum("naa->na", square)[at] > 1e-6, axis=1)]
    value, vector = np.linalg.eigh(square[at])
    size = np.abs(value)
    kept = size > m * np.finfo(float).eps * size.max(axis=1, keepdims=True)  # as `pinvh` has it
    told = np.einsum("nab,na->nb", vector, along[at])
    gains = np.zeros(len(pattern))
    gains[at] = np.sum(np.where(kept, told**2 / np.where(kept, value, 1.0), 0.0), axis=1)
    return gains
