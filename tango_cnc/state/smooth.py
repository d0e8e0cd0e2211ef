"""What is known of past nights once later ones have been measured (Rauch, Tung & Striebel 1965)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import linalg

from ..records import Array


class Filtered(NamedTuple):
    """What was known after a night: (p,) mean, (p, p) covariance, day."""

    mean: Array
    covariance: Array
    day: float


class Smoothed(NamedTuple):
    """What is known of that night today."""

    mean: Array
    covariance: Array
    day: float


def smoothed(nights: Sequence[Filtered], rates: Array, opened: Sequence[int] = ()) -> tuple[Smoothed, ...]:
    """filtered nights, oldest first, (p,) variance a day, nights (places) before which something changed at once → smoothed.

    Nothing is carried back over a change: what a machine was before a knock is not learned from what it is after it.
    """
    last = nights[-1]
    result = [Smoothed(last.mean, last.covariance, last.day)]
    for place in range(len(nights) - 2, -1, -1):
        here, after = nights[place], result[-1]
        if place + 1 in opened:
            result.append(Smoothed(here.mean, here.covariance, here.day))
            continue
        ahead = here.covariance + np.diag(rates * max(after.day - here.day, 0.0))
        scale = np.sqrt(np.diag(ahead))
        factor = linalg.cho_factor(ahead / np.outer(scale, scale) + 1e-12 * np.eye(len(scale)))
        gain = (linalg.cho_solve(factor, (here.covariance / scale).T) / scale[:, None]).T
        covariance = here.covariance + gain @ (after.covariance - ahead) @ gain.T
        mean = here.mean + gain @ (after.mean - here.mean)
        result.append(Smoothed(mean, (covariance + covariance.T) / 2, here.day))
    return tuple(reversed(result))
