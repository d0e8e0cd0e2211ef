"""What the touches tell of the whole machine: under the wide prior, as machines that are possible, with the budget."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..estimate import Estimate
from ..records import Array
from .sizes import learned
from .unseen import Unseen, unseen
from .whole import DEGREE, ORDER, Whole, disturbed, moved, orders, whole

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
    plain: Whole  # the same at `DEGREE` and `ORDER`: decides it for figures of a volume
    learned: Whole  # values and intervals: machines of all orders, drawn
    tried: tuple[tuple[tuple[int, int], float], ...]  # every order and what it is worth
    expected: float | None  # mm, scatter of a touch that the budget allows for
    unseen: Unseen  # harmonics that these touches do not tell
    left_out: tuple[float, ...]  # mm, of every order: by how much each touch is off what the others predict, rms


def seen(result: Estimate, budget: Budget | None = None) -> Seen:
    """estimate, budget → the machine as its touches show it; what is withheld is decided at the order that predicts best.

    The machines that are possible say how large drift is; the fits that decide have it beside the error motions.

    A lower order decides more only because it leaves out what the machine may have: it is compared and never used. Raises
    TangoError where there are too few touches.
    """
    drawn = learned(result, whole(result))
    compared = orders(result, drawn.drifts)
    wide = next(w for w, _ in compared if w.order >= (DEGREE, ORDER))
    same = wide.order == (DEGREE, ORDER)
    plain = wide if same else whole(result, scatter=wide.sigma, drifts=wide.drifts)  # what it lacks is no scatter
    drawn, expected = replace(drawn, sigma=wide.sigma, freedom=wide.freedom, criterion=wide.criterion, left_out=wide.left_out), None
    open_to = unseen(wide, drawn)
    if budget is not None:
        plain = moved(plain, budget.beside_scatter)
        wide, expected = disturbed(wide, budget.factors, budget.beside_scatter)
        drawn = moved(drawn, budget.beside_scatter)
    tried, left_out = tuple((w.order, worth) for w, worth in compared), tuple(w.left_out for w, _ in compared)
    return Seen(wide, plain, drawn, tried, expected, open_to, left_out)


def root_of(curve: Array, covariance: Array) -> Array:
    """curve (m, p), covariance (p, p) → (m, k) root of the covariance of the curve."""
    size, vectors = np.linalg.eigh(curve @ covariance @ curve.T)
    keep = size > 1e-10 * size[-1]
    return np.asarray(vectors[:, keep] * np.sqrt(size[keep]))
