"""The estimate as a function of its inputs: gain, covariance, correlation and budget (GUM uncertainty framework).

U_y = C U_x Cᵀ (JCGM 102:2011, 6.2 and 6.3; thesis eq. 8-3) with C = −(JᵀWJ)⁻¹JᵀW, the very weights of `estimate`: touches
count alike, a known distance counts as much more as its uncertainty is smaller than a touch scatters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ..model import Model, known, linearise
from ..records import Array, TangoError
from .inputs import Part, gaussian

STEP = 1e-11  # mm: no touch moves by more in the last step
ITERATIONS = 30


@dataclass(frozen=True)
class Study:
    """A converged estimate with everything that makes it uncertain."""

    model: Model
    values: Array  # (p,)
    gain: Array  # (p, n + m): change of the unknowns per deviation of the inputs
    weight: Array  # (m,) of the known distances against a touch
    parts: tuple[Part, ...]

    @property
    def count(self) -> int:
        """→ n, number of touches."""
        return len(self.model.touches)

    @cached_property
    def outputs(self) -> NDArray[np.int64]:
        """→ places of the unknowns that are reported: machine, stylus and placement, without facets and balls."""
        return np.arange(len(self.model.coefficients))

    @property
    def names(self) -> tuple[str, ...]:
        """→ their names."""
        return tuple(c.name for c in self.model.coefficients)

    @cached_property
    def machine(self) -> NDArray[np.int64]:
        """→ places of the machine's own coefficients, the measurands."""
        own = [i for i, c in enumerate(self.model.coefficients) if c.slot.axis not in ("t", "w")]
        return np.array(own, dtype=np.int64)

    @cached_property
    def covariance(self) -> Array:
        """→ (p, p) of the unknowns."""
        result = np.zeros((len(self.values), len(self.values)))
        for part in self.parts:
            moved = self.gain @ part.factor
            result += moved @ moved.T
        return result

    @cached_property
    def std(self) -> Array:
        """→ (p,) standard uncertainties."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """→ (q, q) of the outputs."""
        return correlation(self.covariance[np.ix_(self.outputs, self.outputs)])

    @cached_property
    def shares(self) -> Array:
        """→ (parts, q) variance that each line of the budget contributes to each output."""
        gain = self.gain[self.outputs]
        return np.array([np.sum((gain @ part.factor) ** 2, axis=1) for part in self.parts])

    @cached_property
    def dof(self) -> Array:
        """→ (q,) effective degrees of freedom (Welch–Satterthwaite, JCGM 100:2008 G.4), infinite where nothing was repeated."""
        inverse = np.array([1 / part.dof for part in self.parts])
        return welch_satterthwaite(self.shares, inverse)

    @cached_property
    def sampling(self) -> tuple[Array, tuple[Part, ...]]:
        """→ what `inputs.draw` needs."""
        return gaussian(self.parts)


def correlation(covariance: Array) -> Array:
    """(q, q) covariance → (q, q) correlation, unit diagonal; 0 beside an output without uncertainty."""
    std = np.sqrt(np.diag(covariance))
    safe = np.where(std > 0, std, 1.0)
    result: Array = covariance / np.outer(safe, safe)
    np.fill_diagonal(result, 1.0)
    return result


def welch_satterthwaite(variances: Array, inverse_dof: Array) -> Array:
    """(l, q) variances, (l,) 1/degrees of freedom → (q,) effective degrees of freedom (JCGM 100:2008 eq. G.2b)."""
    total = variances.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(total > 0, total**2 / (inverse_dof @ variances**2), np.inf))


def propagate(sensitivity: Array, covariance: Array) -> Array:
    """(q, N) sensitivity coefficients, (N, N) covariance of the inputs → (q, q) of the outputs (JCGM 102:2011 eq. 3)."""
    return np.asarray(sensitivity @ covariance @ sensitivity.T)


def system(model: Model, values: Array, weight: Array | None = None, sigma: float = 0.0) -> tuple[Array, Array, Array]:
    """model, unknowns → residuals (n + m,), Jacobian (n + m, p), both weighted, and the weights (m,); `sigma` mm of a touch."""
    gaps, jacobian = linearise(model, values)
    offsets, rows, uncertainty = known(model, values)
    weight = sigma / uncertainty if weight is None else weight
    return np.concatenate([gaps, offsets * weight]), np.vstack([jacobian, rows * weight[:, None]]), weight


def study(model: Model, values: Array, sigma: float, parts: tuple[Part, ...]) -> Study:
    """model, converged unknowns (p,), sigma mm of a touch, budget → study. Raises TangoError for open directions."""
    _, jacobian, weight = system(model, values, sigma=sigma)
    scale = np.linalg.norm(jacobian, axis=0)
    q, r = np.linalg.qr(jacobian / np.where(scale > 0, scale, 1.0))
    size = np.abs(np.diag(r))
    if size.min() < 1e-10 * size.max():
        worst = model.names[int(np.argmin(size))]
        raise TangoError(
            f"uncertainty: these touches leave {worst} (with others) undetermined, so that it has no finite uncertainty; "
            "use fewer terms (--terms) or touch more facets"
        )
    gain = -linalg.solve_triangular(r, q.T) / scale[:, None]
    gain[:, len(model.touches) :] *= weight
    return Study(model, values, gain, weight, parts)


def solve(model: Model, start: Array, weight: Array, deviation: Array | None = None) -> Array:
    """model, first guess (p,), weights (m,), deviations of the inputs (n + m,) mm → unknowns (p,), full Gauss–Newton.

    Raises TangoError when the iteration does not settle.
    """
    values, n = start, len(model.touches)
    extra = np.zeros(n + len(weight)) if deviation is None else np.concatenate([deviation[:n], deviation[n:] * weight])
    for _ in range(ITERATIONS):
        right, jacobian, _ = system(model, values, weight)
        scale = np.linalg.norm(jacobian, axis=0)
        q, r = np.linalg.qr(jacobian / scale)
        moved = q.T @ (right + extra)
        values = values - linalg.solve_triangular(r, moved) / scale
        if float(np.max(np.abs(q @ moved))) < STEP:
            return values
    raise TangoError(f"uncertainty: an estimation did not settle in {ITERATIONS} steps: the plan hardly determines these terms")
