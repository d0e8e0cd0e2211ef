"""Random machines of which each error motion has its own order: degrees to 6 over the touched range, harmonics to 4.

python -m tests.support.iso_every 30 hu40t trunnion, and again with split fork_head +60 (a second stylus, 60 mm longer)

No order of a fit suits all motions of such a machine. Sizes differ by log-normal factors, and one motion in twelve is three times
as large. `large` (a subclass) adds 4 µm of degree 5 to EYX.
"""

from __future__ import annotations

import sys

import numpy as np

from tests.support import iso_coverage
from tests.support.truth import AXES, Truth

FIRST = 60000  # seed
DEGREE, ORDER = 6, 4


class Every(Truth):
    """A machine as `Truth`, its errors drawn anew."""

    large = 0.0  # mm, degree 5 of EYX

    def draw(self, size: float) -> None:
        super().draw(0.0)
        at = dict(zip(self.names, self.readings()["position"].T, strict=True))  # of a machine without errors: what is touched
        super().draw(size)
        rng, axes = self.rng, self.machine["axes"]
        quality = float(np.exp(rng.normal(0, 0.35))) * size
        for n in self.linear:
            low, high = float(at[n].min()), float(at[n].max())
            beyond = 0.08 * (high - low) + 1e-3
            axes[n] = {**axes[n], "travel": [low - beyond, high + beyond]}
            self.series[n] = np.zeros((6, DEGREE + 1))
            for c in range(6):
                most, size_of = int(rng.integers(1, DEGREE + 1)), self._size(quality, (2.5e-3, 9e-6)[c > 2])
                self.series[n][c, 1 : most + 1] = size_of * rng.normal(size=most) * 0.75
            self.gain[n], self.backlash[n] = 0.0, float(rng.normal(0, 0.5e-3)) * quality
            self.inter[n] = np.concatenate([np.zeros(3), rng.normal(0, 2e-5, 3) * size])
        self.series["X"][AXES["Y"], 5] += self.large * rng.choice([-1, 1])
        for n in self.rotary:
            self.waves[n] = np.zeros((6, ORDER, 2))
            for c in range(6):
                most, size_of = int(rng.integers(1, ORDER + 1)), self._size(quality, (2e-3, 1e-5)[c > 2])
                self.waves[n][c, :most] = 0.8 * size_of * rng.normal(size=(most, 2))
            self.backlash[n] = float(rng.normal(0, 3e-6)) * quality
            self.inter[n] = np.concatenate([rng.normal(0, 0.02, 3), rng.normal(0, 2e-5, 3)]) * size

    def _size(self, quality: float, usual: float) -> float:
        large = 3.0 if self.rng.random() < 1 / 12 else 1.0
        return float(usual * quality * np.exp(self.rng.normal(0, 0.5)) * large)


class Large(Every):
    """The same, and 4 µm of degree 5 in EYX."""

    large = 4e-3


if __name__ == "__main__":
    longer = [float(word[1:]) for word in sys.argv[2:] if word.startswith("+")]
    chosen = tuple(w for w in sys.argv[2:] if not w.startswith("+")) or iso_coverage.TOPOLOGIES
    iso_coverage.main(int(sys.argv[1]), chosen, longer[0] if longer else None, Every, FIRST)
