"""What an estimate of a plan will not be trusted with, whatever its touches read: what no touch of it could show.

Whether a bend, a drift or a step would show depends on where touches are and when, not on what they read. So the notes of
`tango estimate` on these are known before anything moves: those of a run of the plan with nothing wrong, whose touches scatter as
machine.yaml states.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate, Noise
from ..identify import Selection
from ..model import known, linearise
from .data import Remark
from .hidden_drift import hidden_drift
from .hidden_step import hidden_step
from .unseen import unseen


def hidden(result: Estimate) -> Iterator[Remark]:
    """estimate by the noise of its residuals → notes on bends, drifts and steps that its touches cannot show."""
    bent = list(unseen(result))  # it speaks of every error of position that is no gain, a step among them
    yield from bent
    yield from hidden_drift(result)
    if not bent:
        yield from hidden_step(result)


def foreseen(selection: Selection, sigma: float) -> Estimate:
    """model of touches that nobody has made yet, mm of their scatter → estimate of a run of them that reads what is nominal."""
    model = selection.model
    start, n = np.zeros(len(model.names)), len(model.touches)
    _, jacobian = linearise(model, start)
    offsets, rows, uncertainty = known(model, start)
    full, weights = np.vstack([jacobian, rows]), np.concatenate([np.ones(n), sigma / uncertainty])
    root = np.linalg.qr(full * weights[:, None], mode="r")
    half = np.linalg.inv(root)
    covariance = sigma**2 * half @ half.T
    dof, none, zero = n + len(offsets) - len(start), np.zeros(n, dtype=np.bool_), np.zeros(n)
    return Estimate(
        selection,
        start,
        covariance,
        zero,
        sigma,
        dof,
        0,
        full,
        np.zeros(len(offsets)),
        weights[n:],
        none,
        none,
        Noise(sigma),
    )
