"""Whether what is left beside names is still noise: the best of all shapes, against the best that noise alone would reach.

A shape is reported when it is worth its price, which is meant for two thousand shapes with the same right. That less is
left proves no name. So the same shapes are asked once more, at a level: the residuals with signs at random go through the same
comparison, and the largest scores of that say what chance does. Each touch keeps the size of its own, so that facets that are
rough, or one wild touch, are no pattern (wild bootstrap: Davidson & Flachaire 2008).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..records import Array
from ._catalogue import Chosen
from ._contest import Outcome
from ._field import Field, begin, scores, whiten
from ._records import Remainder
from ._shapes import spread
from ._space import orthonormal

DRAWS = 100
BESIDE = 0.01  # probability that noise does as much anywhere, beside something that was found
ALONE = 0.001  # and where nothing was
EULER = 0.5772


def rest(field: Field, outcome: Outcome, y: Array, chosen: Sequence[Chosen], explained: bool, seed: int) -> list[Remainder]:
    """field, outcome, data (m,), names and single touches that stay, whether anything was found → what the rest follows, where
    noise does not do as much.
    """
    m = len(y)
    names = np.hstack([c.columns for c in chosen]) if chosen else np.empty((m, 0))
    s = begin(field, y, names)
    for p in outcome.picked:
        s = whiten(s, p.kernel, p.columns, s.seen(p.columns), p.tau, p.score)
    rng = np.random.default_rng([seed, m])
    left = field.basis @ s.y
    drawn = field.basis.T @ (left[:, None] * rng.choice([-1, 1], (len(left), DRAWS)))
    basis = orthonormal(names)
    best, at = scores(field, replace(s, y=np.column_stack([s.y, drawn - basis @ (basis.T @ drawn)])))
    pattern = np.array([not k.noise and not k.event for k in field.kernels])
    best = np.where(pattern[:, None], best, -np.inf)
    i, by_chance = int(np.argmax(best[:, 0])), best[:, 1:].max(axis=0)
    # The largest of many scores is distributed as Gumbel found; two moments of it give the tail.
    scale = float(np.std(by_chance)) * np.sqrt(6) / np.pi
    above = (float(best[i, 0]) - float(np.mean(by_chance))) / max(scale, 1e-9) + EULER
    if 1 - np.exp(-np.exp(-above)) > (BESIDE if explained else ALONE):
        return []
    kernel = field.kernels[i]
    size = spread(y, names, outcome.picked) * float(np.sqrt(at[i, 0]))
    return [Remainder(kernel.covariate, "none", "lack of fit" if explained else "no pattern", size, 0.0, np.zeros(1))]
