"""One figure, and linear combinations of coefficients with their standard deviations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..records import Array
from .interval import of_range

ARCSECOND = 180 * 3600 / np.pi  # a radian


@dataclass(frozen=True)
class Figure:
    """One figure in the unit that people use; `range` in mm or degrees, None for a figure of several axes."""

    kind: str
    name: str
    value: float
    std: float
    unit: str  # µm, µrad, µm/m, ″
    range: tuple[float, float] | None = None
    note: str = ""
    interval: tuple[float, float] | None = None  # 95 % of a range, which cannot be less than 0; None: value ± std tells it

    @property
    def arcseconds(self) -> float | None:
        """→ ″ of a small angle, None for a length."""
        return self.value * 1e-6 * ARCSECOND if self.unit in ("µrad", "µm/m") and self.kind != "positioning gain" else None


@dataclass(frozen=True)
class Tell:
    """Linear combinations of the coefficients → values with standard deviations."""

    values: Array
    covariance: Array

    @cached_property
    def root(self) -> Array:
        """→ (p, p), times its transpose the covariance."""
        size, turned = np.linalg.eigh(self.covariance)
        return turned * np.sqrt(np.maximum(size, 0.0))

    def one(self, weights: Array) -> tuple[float, float]:
        """(p,) → weights · values and its standard deviation."""
        return float(weights @ self.values), float(max(float(weights @ self.covariance @ weights), 0.0) ** 0.5)

    def spread(self, curve: Array) -> tuple[float, float, tuple[float, float]]:
        """(m, p) → largest minus smallest of the curve, its standard deviation, its 95 % interval."""
        y = curve @ self.values
        value, std = self.one(curve[int(np.argmax(y))] - curve[int(np.argmin(y))])
        _, low, high = of_range(y, curve @ self.root)
        return value, std, (min(low, value), max(high, value))
