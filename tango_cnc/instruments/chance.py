"""How far readings are from a prediction whose errors are correlated, and how often chance alone makes a true file so far off.

One error motion that is known badly moves all readings together: their rms is then one draw, not the mean of many. Along the
directions in which predictions err, a difference counts by what is expected there and on average; so neither one direction that
is known badly hides the others, nor one that is known very well decides alone.
Source: quadratic forms of normal variables, by drawing them (Imhof, Biometrika 48, 1961, treats the same sum of χ²).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..records import Array
from .predict import Predicted

RARE = 0.01  # of true files that are called different
DRAWS = 10_000
LIKELIER = 12.0, 6.0  # by which a distance falls where a mirrored channel is named, in a file that may be true, and that differs
FEWER = 4.0  # by which one more mirrored channel has to make it nearer
NOTHING = 0.2  # µm: an instrument that shows less than that everywhere has another unit
PER_MM = 1e3


@dataclass(frozen=True)
class Distance:
    """What is expected along each direction in which the readings of a test may be off."""

    ways: Array  # (k, q·n)
    variance: Array  # (k,) µm², of prediction and instrument
    weights: Array  # (k,) 1/µm²
    chances: Array  # (DRAWS,) sorted, the distance of true files

    def of(self, difference: Array) -> float:
        """(q·n,) µm → how far it is off; about half the number of directions where nothing is wrong."""
        return float(self.weights @ (self.ways @ difference) ** 2)

    def chance(self, difference: Array) -> float:
        """(q·n,) µm → share of true files that are as far off or farther."""
        beyond = len(self.chances) - int(np.searchsorted(self.chances, self.of(difference)))
        return (1 + beyond) / (1 + len(self.chances))


def distance(told: Predicted, expanded: float) -> Distance:
    """prediction, U (k = 2) of one reading, µm → what is expected of a true file."""
    own = (expanded / 2) ** 2 * told.free @ told.free.T
    size, vectors = np.linalg.eigh(told.covariance + own)
    size = np.clip(size, 0.0, None)
    usual = max(float(size.sum()) / max(float(np.trace(told.free)), 1.0), 1e-12)
    weights = 1 / (size + usual)
    share = size * weights
    many = share > 1e-4
    drawn = np.random.default_rng(1961).chisquare(1, (DRAWS, int(many.sum()))) @ share[many]
    return Distance(vectors.T, size, weights, np.sort(drawn))


def slip(told: Predicted, reading: Array, expected: Distance) -> str:
    """prediction, readings (q, n) µm, what is expected → the slip that explains a difference, for people; '' where none does."""

    def difference(read: Array) -> Array:
        return np.asarray(told.free @ read.reshape(-1) - told.value.reshape(-1))

    plain = difference(reading)
    as_is, far = expected.of(plain), expected.chance(plain) < RARE
    small = 0.0 < float(np.abs(reading).max()) < NOTHING
    larger = difference(PER_MM * reading)
    if (far or small) and expected.chance(larger) >= RARE:
        return "1000 times as large they agree: are they in mm? The columns have µm"
    names, found = told.path.channels, list[tuple[float, int, Sequence[int]]]()
    for many in range(1, len(names) + 1):
        for some in combinations(range(len(names)), many):
            sign = np.ones((len(names), 1))
            sign[list(some)] = -1.0
            other = difference(sign * reading)
            if expected.chance(other) >= RARE and as_is - expected.of(other) > LIKELIER[far]:
                found.append((expected.of(other) + FEWER * many, many, some))
    if not found:
        return ""
    wrong = [names[i] for i in min(found)[2]]
    what = f"the measured channel {wrong[0]} looks" if len(wrong) == 1 else f"the measured channels {' and '.join(wrong)} look"
    return f"{what} mirrored: with the other sign the readings agree. Compare with the sign that is printed above"
