"""Random machines drawn by other rules than those of `truth`: degrees to 5, harmonics to 5, one good or bad quality each.

python -m tests.support.iso_other 50 hu40t trunnion, and again with split fork_head huron +60 (a second stylus, 60 mm longer)

Sizes of motions differ by log-normal factors, coefficients have heavy tails, and three machines in ten have one motion that is
four times as large. The fit has degree 3 and four harmonics unless its criterion asks for more.
"""

from __future__ import annotations

import sys

import numpy as np

from tests.support import iso_coverage
from tests.support.truth import Truth

FIRST = 20000  # seed


class Other(Truth):
    """A machine as `Truth`, its errors drawn anew."""

    def draw(self, size: float) -> None:
        super().draw(size)
        rng = self.rng
        quality = float(np.exp(rng.normal(0, 0.5))) * size
        micron, second = 1e-3 * quality, 1e-6 * quality
        for n in self.linear:
            degree = int(rng.integers(3, 6))
            falling = 1 / np.arange(1, degree + 1) ** rng.uniform(0.8, 1.6)
            self.series[n] = np.zeros((6, 6))
            for c in range(6):
                large = (4 * micron if c < 3 else 8 * second) * np.exp(rng.normal(0, 0.6))
                self.series[n][c, 1 : degree + 1] = large * rng.standard_t(5, degree) * falling
            self.inter[n] = np.concatenate([np.zeros(3), rng.uniform(-60, 60, 3) * second])
            self.gain[n] = float(rng.uniform(-40, 40)) * second
            self.backlash[n] = float(rng.uniform(-4, 4)) * micron
        for n in self.rotary:
            self.waves[n] = np.zeros((6, 5, 2))
            for c in range(6):
                large = (2 * micron if c < 3 else 6 * second) * np.exp(rng.normal(0, 0.6))
                waves = large * rng.normal(size=(5, 2)) / np.arange(1, 6)[:, None] ** rng.uniform(0.8, 1.8)
                waves[int(rng.integers(3, 6)) :] = 0
                self.waves[n][c] = waves
            self.backlash[n] = float(rng.uniform(-10, 10)) * second
            self.inter[n] = np.concatenate([rng.uniform(-40, 40, 3) * micron, rng.uniform(-60, 60, 3) * second])
        if rng.uniform() < 0.3:
            self.series[self.linear[int(rng.integers(len(self.linear)))]][int(rng.integers(6))] *= 4


if __name__ == "__main__":
    longer = [float(word[1:]) for word in sys.argv[2:] if word.startswith("+")]
    chosen = tuple(w for w in sys.argv[2:] if not w.startswith("+")) or iso_coverage.TOPOLOGIES
    iso_coverage.main(int(sys.argv[1]), chosen, longer[0] if longer else None, Other, FIRST)
