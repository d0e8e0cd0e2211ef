"""Machines that these touches leave possible, with every error motion to a high order and sizes that they show.

`whole` gives every error motion 100 µm or 300 µrad before the touches are looked at. That decides what is withheld: nothing may
rest on a guess. An interval about what is not withheld must not rest on it either: a curve that may be 100 µm large is read with
all the noise in it, so that its range is too large. Nor may it rest on one order of the model. A fit that lacks an order puts
what it lacks into the others, or into nothing, and its intervals know neither. So machines are drawn that have all orders. How
large the motions are is drawn with them: those of a kind share a size for each degree or harmonic, each motion is larger or
smaller than its kind, and single coefficients may stand out. One size that is only estimated would say too surely how large
what nobody sees is. Curves are smooth: before the touches are looked at, the size of a kind falls as its degree or harmonic rises.
One size for all degrees took the tilts that nobody sees for as small as bends that no machine has. Two or three of a kind say too
little of each other: gain and backlash of linear axes keep the wide size. So do locations: a size for them would draw every
squareness towards 0. A slope of straightness is the same to the touches as a location, and keeps the wide size with it.
Source: hierarchical linear model by Gibbs sampling (Gelman et al., Bayesian Data Analysis, 3rd ed., 11.6 and 15; variances scaled
inverse χ², coefficients with Student's t as a mixture of them, 17.2).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ..estimate import Estimate
from ..model import known, linearise
from ..records import Array, Machine, TangoError
from ..terms import Coefficient, backlash
from .drift import along, is_drift, path
from .whole import FINEST, WIDTH, Tip, Whole, motion_of, place_of_tip, waves, widths, with_all

HIGHEST = (9, 6)  # degree of polynomials, harmonics: of every machine that is drawn; a wave that is two and a half long needs 9
ALONE, MOTION, DEGREES = (
    2.0,
    2.0,
    3.0,
)  # degrees of freedom: a coefficient in its motion, a motion in its kind, a kind in its family
FIRST = 0.03  # of the wide size: where the chain begins
LEAST = (1e-4, 3e-7)  # mm and rad: no motion of a real machine is smaller
SMALLEST = 1e-5  # of the wide size: what a family is not smaller than, so that no number is lost
LARGEST = 10.0  # times the wide size: so few touches bound none of them, and nothing is that large
FALL = 2.0  # power by which the square of a size falls with degree or harmonic
BEGIN, STEPS, EACH = 60, 320, 2  # steps until the chain has forgotten where it began, steps after that, machines drawn in each
RENEW = 20  # steps with one scatter of a touch: many touches say what it is, and it hardly moves
PARTS = 16  # of the chain: how much their means differ says how well the chain knows the mean
DEGREE = re.compile(r".*\.P([1-9])")

Kind = tuple[str, bool, bool, int]  # family (wave, series; of a linear axis; a displacement, not a turn) and degree or harmonic
DRIFTS: Kind = ("drift", False, True, 1)


@dataclass(frozen=True)
class _Touched:
    """Touches as numbers: residuals are gaps + matrix @ unknowns, each in parts of its wide size."""

    gaps: Array  # (n,)
    matrix: Array  # (n, q)
    normal: Array  # (q, q) matrixᵀ matrix
    pull: Array  # (q,) matrixᵀ gaps
    stated: Array  # (q, q) what known distances say, their uncertainty in it
    stated_pull: Array  # (q,)


@dataclass(frozen=True)
class _Beside:
    """Equations at one scatter: k unknowns that share sizes, r that keep the wide one and are eliminated."""

    precision: Array  # (k, k) of the first, whatever the others are
    pull: Array  # (k,)
    lower: Array  # (r, r) root of the precision of the others
    across: Array  # (r, k) how they follow the first
    rest_pull: Array  # (r,)


class _Shares:
    """Which coefficients share a size, and the sizes at one step of the chain, as parts of the wide ones."""

    def __init__(self, kinds: Mapping[int, Kind], motions: Sequence[str]) -> None:
        self.own = np.array(list(kinds), dtype=int)
        every = list(dict.fromkeys(kinds.values()))
        families, parts = list(dict.fromkeys(k[:3] for k in every)), [(motions[j], kinds[j][0]) for j in kinds]
        each = list(dict.fromkeys(parts))
        self.kind = np.array([every.index(k) for k in kinds.values()], dtype=int)
        self.motion = np.array([each.index(m) for m in parts], dtype=int)
        self.family = np.array([families.index(k[:3]) for k in every], dtype=int)
        self.least = np.array([LEAST[not k[2]] / WIDTH[not k[2]] for k in every]) ** 2
        self.fall = np.array([k[3] for k in every], dtype=float) ** -FALL
        self.many = [np.bincount(of) for of in (self.kind, self.motion, self.family)]
        self.of_family, self.of_kind = np.full(len(families), FIRST**2), FIRST**2 * self.fall
        self.of_motion, self.of_one = np.ones(len(each)), np.ones(len(self.own))

    def variances(self) -> Array:
        """→ (k,) of the unknowns `own`, which share sizes."""
        found = np.maximum(self.of_kind, self.least)[self.kind] * self.of_one * self.of_motion[self.motion]
        return np.asarray(np.minimum(found, LARGEST**2))

    def step(self, drawn: Array, rng: np.random.Generator) -> None:
        """unknowns `own` (k,) → sizes that are likely beside them, drawn one level after the other."""
        if not len(self.own):
            return
        square, chi = drawn**2, rng.chisquare
        of_kind, of_motion = self.of_kind[self.kind], self.of_motion[self.motion]
        self.of_one = (ALONE + square / (of_kind * of_motion)) / chi(ALONE + 1, len(square))
        kinds, motions, families = self.many
        self.of_motion = (MOTION + np.bincount(self.motion, square / (of_kind * self.of_one))) / chi(MOTION + motions)
        summed = np.bincount(self.kind, square / (self.of_one * self.of_motion[self.motion]))
        self.of_kind = (DEGREES * self.of_family[self.family] * self.fall + summed) / chi(DEGREES + kinds)
        self.of_family = chi(DEGREES * families) / np.bincount(self.family, DEGREES * self.fall / self.of_kind)
        self.of_family = np.maximum(self.of_family, SMALLEST**2)
        for sizes in (self.of_one, self.of_motion, self.of_kind, self.of_family):
            np.minimum(sizes, LARGEST**2, out=sizes)


def learned(result: Estimate, wide: Whole) -> Whole:
    """estimate, the same machine under the wide sizes → machines of all orders that the touches leave possible, in `draws`;
    values and covariance are their mean and covariance, widths the sizes that were drawn, gain that at these sizes.

    Raises TangoError where the touches are so few that nothing can be drawn.
    """
    model, p = with_all(result.model, *HIGHEST)
    start, place = np.zeros(len(model.names)), {name: i for i, name in enumerate(model.names)}
    for name, value in zip(result.model.names, result.values, strict=True):
        if name in place:
            start[place[name]] = value
    width = widths(model, hidden=True, drifts=WIDTH[0])
    seen = np.flatnonzero(width > 0)
    gaps, jacobian = linearise(model, start)
    offsets, rows, uncertainty = known(model, start)
    matrix, stated = jacobian[:, seen] * width[seen], rows[:, seen] * width[seen] / uncertainty[:, None]
    gaps, offsets = gaps - jacobian @ start, (offsets - rows @ start) / uncertainty
    touched = _Touched(gaps, matrix, matrix.T @ matrix, matrix.T @ gaps, stated.T @ stated, stated.T @ offsets)
    found = model.coefficients[:p]
    motions = tuple(motion_of(c) for c in found)
    alike = {i: along(c) for i, c in enumerate(model.coefficients) if i >= p and is_drift(c)}
    machine = model.touches.machine
    order_of = {c.name: o for a in machine.rotary for o in range(1, HIGHEST[1] + 1) for c in waves(machine, a, o)}
    kinds = {
        j: kind
        for j, i in enumerate(seen)
        if i < p and (kind := _kind(found[i], machine, order_of.get(found[i].name, 0))) is not None
    }
    shared: dict[int, Kind] = kinds | {j: DRIFTS for j, i in enumerate(seen) if i in alike}
    try:
        named = [motions[i] if i < p else alike.get(int(i), "") for i in seen]
        drawn, variance, sigma = _chain(touched, _Shares(shared, named), wide.sigma)
    except linalg.LinAlgError:
        raise TangoError(f"ISO figures: {len(gaps)} touches bound no error motion of this machine; make the whole plan") from None
    own, t, tip = seen < p, place_of_tip(model, width > 0), None
    sizes = np.zeros(p)
    sizes[seen[own]] = width[seen[own]] * np.sqrt(variance[own])
    inverse = linalg.inv(touched.normal / sigma**2 + touched.stated + np.diag(1 / variance))
    every, gains = np.zeros((len(width), drawn.shape[1])), np.zeros((len(width), len(gaps) + len(uncertainty)))
    every[seen] = width[seen, None] * drawn
    ways = inverse @ np.hstack([matrix.T / sigma**2, stated.T / uncertainty])
    gains[seen] = width[seen, None] * ways
    leave, residuals = _standing_still(touched, stated.T / uncertainty, variance, sigma, [i not in alike for i in seen])
    both = every[:p] if t is None else np.vstack([every[:p], every[t]])
    values = both.mean(axis=1)
    covariance = np.cov(both) + 2 * _unsettled(both)
    if t is not None:
        tip = Tip(model.coefficients[t], float(values[p]), covariance[p, p], covariance[:p, p], gains[t], every[t])
    free = np.ones(p, dtype=bool)
    free[[seen[j] for j in kinds]] = False
    drifts = {model.names[i]: float(width[i] * np.sqrt(variance[j])) for j, i in enumerate(seen) if i in alike}
    gone = path(model.touches, {model.names[i]: float(every[i].mean()) for i in alike})
    return replace(
        wide,
        coefficients=found,
        motions=motions,
        values=values[:p],
        covariance=covariance[:p, :p],
        order=HIGHEST,
        gain=gains[:p],
        leave=leave,
        residuals=residuals,
        scatter=sigma,
        widths=sizes,
        free=free,
        draws=every[:p],
        tip=tip,
        drifts=drifts,
        drifted=tuple(np.ptp(gone, axis=0).tolist()),
    )


def _standing_still(touched: _Touched, known_ways: Array, variance: Array, sigma: float, still: list[bool]) -> tuple[Array, Array]:
    """touches, what known distances say (q, m), variances (q,), scatter (mm), which unknowns are no drift → as `Whole.leave` and
    `residuals`: what would be left if nothing drifted, by which it is judged whether something moved.
    """
    own = np.flatnonzero(still)
    matrix, together = touched.matrix[:, own], np.ix_(own, own)
    inverse = linalg.inv(touched.normal[together] / sigma**2 + touched.stated[together] + np.diag(1 / variance[own]))
    ways = inverse @ np.hstack([matrix.T / sigma**2, known_ways[own]])
    likely = -inverse @ (touched.pull[own] / sigma**2 + touched.stated_pull[own])
    return np.eye(len(touched.gaps), ways.shape[1]) - matrix @ ways, touched.gaps + matrix @ likely


def _chain(touched: _Touched, shares: _Shares, sigma: float) -> tuple[Array, Array, float]:
    """→ machines (q, d) as parts of the wide sizes, variances (q,) in the middle of the chain, scatter of a touch, mm.

    Unknowns that keep the wide size are drawn beside the others, and need no equations of their own until the scatter changes.
    """
    rng = np.random.default_rng(2306)
    n, q = touched.matrix.shape
    own, rest = shares.own, np.setdiff1d(np.arange(q), shares.own)
    found, logs, scatters = np.zeros((q, STEPS * EACH)), np.zeros(q), []
    one, every = np.zeros((q, EACH)), np.arange(len(own))
    for i in range(BEGIN + STEPS):
        if i % RENEW == 0:
            if i:
                left = touched.gaps + touched.matrix @ one[:, 0]
                sigma = max(float(np.sqrt(left @ left / rng.chisquare(n))), FINEST)
            beside = _beside(touched, own, rest, sigma)
        variance = shares.variances()
        precision = beside.precision.copy(order="F")
        precision[every, every] += 1 / variance
        lower, _ = linalg.cho_factor(precision, lower=True, overwrite_a=True, check_finite=False)
        ahead = linalg.solve_triangular(lower, -beside.pull, lower=True, check_finite=False)
        more = ahead[:, None] + rng.standard_normal((len(own), EACH))
        one[own] = linalg.solve_triangular(lower, more, lower=True, trans="T", check_finite=False)
        more = rng.standard_normal((len(rest), EACH)) - beside.rest_pull[:, None] - beside.across @ one[own]
        one[rest] = linalg.solve_triangular(beside.lower, more, lower=True, trans="T", check_finite=False)
        if i >= BEGIN:
            found[:, (i - BEGIN) * EACH : (i - BEGIN + 1) * EACH] = one
            logs[own] += np.log(variance) / STEPS
            scatters.append(sigma)
        shares.step(one[own, 0], rng)
    return found, np.exp(logs), float(np.mean(scatters))


def _beside(touched: _Touched, own: Array, rest: Array, sigma: float) -> _Beside:
    """touches, unknowns that share sizes, unknowns that keep the wide size, scatter (mm) → equations of the first alone."""
    full, pull = touched.normal / sigma**2 + touched.stated, touched.pull / sigma**2 + touched.stated_pull
    lower = linalg.cholesky(full[np.ix_(rest, rest)] + np.eye(len(rest)), lower=True)
    across = linalg.solve_triangular(lower, np.column_stack([full[np.ix_(rest, own)], pull[rest]]), lower=True)
    across, rest_pull = across[:, :-1], across[:, -1]
    return _Beside(full[np.ix_(own, own)] - across.T @ across, pull[own] - across.T @ rest_pull, lower, across, rest_pull)


def _unsettled(draws: Array) -> Array:
    """machines (p, d) in the order of the chain → (p, p) covariance of their mean, which neighbours in a chain make larger.

    By so much the mean is off, and by so much the machines differ too little. Source: batch means (Geyer, Statistical Science 7,
    1992, 3.2).
    """
    means = np.stack([part.mean(axis=1) for part in np.array_split(draws, PARTS, axis=1)], axis=1)
    return np.asarray(np.cov(means) / PARTS)


def _kind(c: Coefficient, machine: Machine, harmonic: int) -> Kind | None:
    """coefficient, machine, its harmonic or 0 → the kind with which it shares its size; None where it keeps the wide one."""
    series = DEGREE.fullmatch(c.name)
    if backlash.PATTERN.fullmatch(c.name) or c.slot.stage == "inter" or not (harmonic or series):
        return None
    linear, order = c.slot.axis in machine.linear, harmonic or (int(series[1]) if series else 0)
    if c.slot.stage == "motion":
        if linear and order == 1:
            return None
        return ("own wave" if harmonic else "own series", linear, linear, order)
    if linear and order == 1 and c.slot.component < 3:
        return None
    return ("wave" if harmonic else "series", linear, c.slot.component < 3, order)
