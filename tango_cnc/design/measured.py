"""Touches that were made → what they say of the unknowns that candidates have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import Model, known, linearise
from ..records import Array
from ..touches import Touches
from .candidates import WIDE, Candidates

STEPS = 4  # of Gauss and Newton; errors of a machine are small
FREEDOM = 20  # degrees of freedom from which the scatter that was seen counts


def noise(choice: Candidates, touches: Touches) -> float:
    """candidates, touches of a run → mm: what their residuals scatter by, never less than the machine's probe is said to."""
    gaps, rows = seen_at(choice, touches, fitted(choice, touches))
    size = np.linalg.svd(rows, compute_uv=False)
    freedom = len(touches) - int((size > 1e-6 * size.max(initial=1.0)).sum())
    return max(choice.sigma, float(np.sqrt(gaps @ gaps / freedom))) if freedom >= FREEDOM else choice.sigma


def fitted(choice: Candidates, touches: Touches) -> Array:
    """candidates, touches of a run → (p,) scaled estimate (Gauss and Newton), certificates taken in."""
    place = {name: j for j, name in enumerate(choice.selection.model.names)}
    p = len(place)
    found = np.zeros(p)
    for _ in range(STEPS):
        gaps, rows = seen_at(choice, touches, found)
        model = Model(touches, choice.selection.model.coefficients)
        own = [place[name] for name in model.names]
        left, certain, uncertainty = known(model, (found * choice.scale[:p])[own])
        weight = choice.sigma / uncertainty
        more = np.zeros((len(left), p))
        more[:, own] = certain * weight[:, None]
        rows, gaps = np.vstack([rows, more * choice.scale[:p]]), np.concatenate([gaps, left * weight])
        wide = (choice.sigma / WIDE) ** 2
        found = found - np.linalg.solve(wide * np.eye(p) + rows.T @ rows, rows.T @ gaps + wide * found)
    return found


def seen_at(choice: Candidates, touches: Touches, at: Array) -> tuple[Array, Array]:
    """candidates, touches, (p,) scaled unknowns → (n,) gaps mm, (n, p) rows there."""
    model = Model(touches, choice.selection.model.coefficients)
    place = {name: j for j, name in enumerate(choice.selection.model.names)}
    own: Sequence[int] = [place[name] for name in model.names]
    scale = choice.scale[: len(place)]
    gaps, jacobian = linearise(model, (at * scale)[own])
    rows = np.zeros((len(touches), len(place)))
    rows[:, own] = jacobian
    return gaps, rows * scale
