"""Machines with two bad guides: two error motions of linear axes are large, all others are nothing.

python -m tests.support.iso_sparse 30 hu40t trunnion

Legendre polynomials of degree 2 or 3, 8 to 25 µm (of an angle: over 200 mm) over the touched range.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.polynomial import legendre

from tests.support import iso_coverage
from tests.support.truth import Truth

FIRST, LARGE, ARM = 140000, (8e-3, 25e-3), 200.0  # seed; mm; mm


class Sparse(Truth):
    """A machine as `Truth` of which two error motions are large and no other is."""

    def draw(self, size: float) -> None:
        self.bad: list[tuple[str, int, int, float]] = []
        super().draw(0.0)
        at = dict(zip(self.names, self.readings()["position"].T, strict=True))
        self.over = {n: (float(at[n].min()), float(at[n].max())) for n in self.linear}
        for _ in range(2):
            axis, component = self.linear[int(self.rng.integers(3))], int(self.rng.integers(6))
            degree, large = int(self.rng.integers(2, 4)), size * self.rng.uniform(*LARGE) * self.rng.choice([-1, 1]) / 1.5
            self.bad.append((axis, component, degree, float(large / (1.0 if component < 3 else ARM))))

    def motion(self, name: str, q: np.ndarray) -> np.ndarray:
        e = super().motion(name, q)
        for axis, component, degree, large in self.bad:
            if axis == name:
                low, high = self.over[axis]
                e[:, component] += large * legendre.Legendre.basis(degree)((2 * q - low - high) / (high - low))
        return e


if __name__ == "__main__":
    iso_coverage.main(int(sys.argv[1]), tuple(sys.argv[2:]) or ("hu40t", "trunnion"), None, Sparse, FIRST)
