"""Random machines as a workshop has them: each warms up by 5 to 15 µm while it is touched, and its tip is not as large as stated.

python -m tests.support.iso_shop 30 hu40t trunnion, and again with split fork_head +60 (a second stylus, 60 mm longer)

The table goes along some direction with a time constant of a sixth to two runs. The radius of the tip is off by 2 µm (standard
deviation), as late readings make it. Nothing of this is stated: there is no uncertainty.yaml.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from tests.support import iso_coverage
from tests.support.iso_every import Every
from tests.support.truth import translation

FIRST = 70000  # seed
LARGE, RADIUS = (0.005, 0.015), 0.002  # mm


class Shop(Every):
    """A machine as `Every`, which drifts while it is touched."""

    gone: np.ndarray | None = None  # (n, 3) mm, the table along x y z of the machine at each touch; None: it stands still
    tip = 0.0  # mm, how much larger the tip is than stated

    def draw(self, size: float) -> None:
        super().draw(size)
        direction = self.rng.normal(size=3)
        self.along = self.rng.uniform(*LARGE) * direction / np.linalg.norm(direction)
        self.quick = float(np.exp(self.rng.uniform(np.log(0.5), np.log(6))))  # runs over time constant
        self.tip = float(self.rng.normal(0, RADIUS))

    def readings(self) -> dict[str, Any]:
        if hasattr(self, "along"):  # not while the places are looked for that are touched
            n = sum(len(i["facets"]) for i in self.strategy["indexations"])
            self.gone = (1 - np.exp(-self.quick * np.arange(n) / n))[:, None] * self.along
        try:
            return super().readings()
        finally:
            self.gone = None

    def body(self, name: str, q: np.ndarray, sign: np.ndarray, errors: bool) -> np.ndarray:
        found = super().body(name, q, sign, errors)
        return found if self.gone is None or not errors or name != self.work[0] else translation(self.gone) @ found

    def _gap(self, facet: Any, tip: np.ndarray, point: np.ndarray, normal: np.ndarray) -> float:
        return super()._gap(facet, tip, point, normal) - self.tip


if __name__ == "__main__":
    longer = [float(word[1:]) for word in sys.argv[2:] if word.startswith("+")]
    chosen = tuple(w for w in sys.argv[2:] if not w.startswith("+")) or iso_coverage.TOPOLOGIES
    iso_coverage.main(int(sys.argv[1]), chosen, longer[0] if longer else None, Shop, FIRST)
