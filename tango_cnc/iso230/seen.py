"""What the touches tell of the whole machine: under the wide prior, under learned sizes, at other orders, with the budget."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..estimate import Estimate
from ..records import Array
from .onpart import Ask
from .sizes import sized
from .unseen import Unseen, unseen
from .whole import DEGREE, ORDER, Whole, disturbed, orders

WORTH = 0.01  # of an order of the model that counts


@dataclass(frozen=True)
class Budget:
    """What disturbs the readings, as factors (n + m, k) mm over gaps and known distances; `named`: the sources that it names."""

    factors: tuple[Array, ...]
    beside_scatter: tuple[Array, ...]  # of these, what acts on many touches alike
    named: tuple[str, ...]
    beside: tuple[str, ...]  # labels of `beside_scatter`


@dataclass(frozen=True)
class Seen:
    """One machine, seen by its touches."""

    wide: Whole  # decides what is withheld
    learned: Whole  # values and intervals
    others: tuple[tuple[Whole, float], ...]  # other orders under learned sizes, and what they are worth
    tried: tuple[tuple[tuple[int, int], float], ...]  # every order and what it is worth
    expected: float | None  # mm, scatter of a touch that the budget allows for
    unseen: Unseen  # harmonics that these touches do not tell
    left_out: tuple[float, ...]  # mm, of every order: by how much each touch is off what the others predict, rms

    def spread(self, asks: Sequence[Ask], again: Callable[[Whole], Sequence[Ask]]) -> dict[tuple[str, str], tuple[Array, ...]]:
        """figures, the same for a machine of another order → (kind, name): what other orders and unseen harmonics add to
        the uncertainty."""
        found = self.unseen.parts(asks, again(replace(self.learned, coefficients=self.unseen.coefficients)))
        values = {(a.kind, a.name): a.factor * a.curve @ self.learned.values for a in asks}
        for other, worth in self.others:
            for a in again(other):
                if (key := (a.kind, a.name)) in values:
                    found[key] = (*found.get(key, ()), worth**0.5 * (a.factor * a.curve @ other.values - values[key]))
        return found


def seen(result: Estimate, budget: Budget | None = None) -> Seen:
    """estimate, budget → the machine as its touches show it, at the order that predicts best.

    A lower order decides more only because it leaves out what the machine may have: it is compared and never used. Raises
    TangoError where there are too few touches.
    """
    compared = orders(result)
    full = [(w, worth) for w, worth in compared if w.order >= (DEGREE, ORDER)]
    wide, total = full[0][0], sum(worth for _, worth in full)
    learned, expected = sized(wide), None
    others = tuple((sized(w), worth / total) for w, worth in full[1:] if worth > WORTH * total)
    beside = unseen(wide, learned)
    if budget is not None:
        wide, expected = disturbed(wide, budget.factors, budget.beside_scatter)
        learned, _ = disturbed(learned, budget.factors, budget.beside_scatter)
    tried, left_out = tuple((w.order, worth) for w, worth in compared), tuple(w.left_out for w, _ in compared)
    return Seen(wide, learned, others, tried, expected, beside, left_out)


def root_of(curve: Array, covariance: Array) -> Array:
    """curve (m, p), covariance (p, p) → (m, k) root of the covariance of the curve."""
    size, vectors = np.linalg.eigh(curve @ covariance @ curve.T)
    keep = size > 1e-10 * size[-1]
    return np.asarray(vectors[:, keep] * np.sqrt(size[keep]))
