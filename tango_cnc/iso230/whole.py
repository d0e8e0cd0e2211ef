"""The machine with every error motion of every axis, fitted to the same touches: what a figure must not be mixed with.

A fitted set of terms is a choice. The machine has all its error motions, and one that the set lacks lands in the others. So the
figures are read off a fit that has them all. No plan sees them all: each carries a standard deviation `WIDTH` before the touches
are looked at, far wider than any machine in service. What the touches do not decide keeps that width, and the figures that
depend on it are withheld. Source: Bayesian linear model with a wide prior (Gelman et al., Bayesian Data Analysis, 14.8).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from types import MappingProxyType

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import linalg

from ..estimate import Estimate
from ..identify import Selection
from ..kinematics import Slot, slot_name
from ..model import STYLUS, Model, known, linearise
from ..records import COMPONENTS, Array, Machine, TangoError
from ..terms import GAP, Coefficient, backlash, cause, causes, error_motion, inter_axis
from ..touches import Touches
from .drift import drifting, is_drift

DEGREE, ORDER = 3, 4  # of polynomials; highest harmonic of rotary axes
ORDERS = ((2, 2), (DEGREE, ORDER), (4, 4), (5, 5), (6, 6))  # degree and harmonics that are compared
WIDTH = (0.1, 3e-4)  # mm and rad, of an error motion at the end of its touched range
PLACED = (2.0, 1e-2)  # mm and rad, of axis locations, stylus and table
FINEST = 1e-5  # mm: beside a finer scatter the widths of all error motions leave the matrix without an inverse
FAINT = 0.01  # share of a harmonic: where the touches show less (sin 4C at every 45°), it is not fitted; see `unseen`
ROUNDS = (4, *[2] * 14)  # most steps with one weight of the touches; a machine that is far from the fitted terms needs many
SETTLED = 3e-3  # of the scatter: rounds end where the weight of the touches changes by no more
STILL = 1e-3  # of a standard deviation: no coefficient moves more in a step that is the last, as the gaps are all but linear
ALONE = 0.02  # share of a touch's own error that is left of it, below which no other touch says what it should be
UNFELT = 0.1  # of its size before the touches: less is what a stylus shows that is a few µm beside the spindle axis
TURN = 5  # component of a turn about Z, the direction of the spindle in every topology
BALLS, RADIUS = "ERball", 2e-3  # mm: what nobody knows of the effective radius of a tip; late readings make it smaller
SHORTEST = 1e-3  # mm or rad: what moves less stands still
Drifts = Mapping[str, float]  # coefficients of `drifting`, their standard deviations, mm
STANDS_STILL: Drifts = MappingProxyType({})
Block = tuple[str, NDArray[np.intp], Array]  # an error motion, its coefficients, the pseudo-inverse of their covariance


@dataclass(frozen=True)
class Tip:
    """Where the tip of the first stylus is along the spindle, beside a machine of p coefficients: its length, above all."""

    coefficient: Coefficient
    value: float  # mm
    variance: float  # mm²
    across: Array  # (p,) covariance with the coefficients of the machine
    gain: Array  # (n + m,) how gaps of the touches and known distances, mm, move it
    draws: Array | None = None  # (d,) in the machines that are drawn


@dataclass(frozen=True)
class Whole:
    """All machine coefficients of a topology as the touches leave them."""

    touches: Touches
    coefficients: tuple[Coefficient, ...]
    motions: tuple[str, ...]  # (p,) the error motion that each belongs to: EYX, EX0C, EXXb
    values: Array  # (p,)
    covariance: Array  # (p, p)
    sigma: float  # mm, standard deviation of a touch
    freedom: float  # touches less the directions that they decide
    order: tuple[int, int] = (DEGREE, ORDER)  # degree of the polynomials, highest harmonic
    criterion: float = 0.0  # AICc: the smaller, the better this order predicts touches that were not made
    gain: Array | None = None  # (p, n + m) how gaps of the touches and known distances, mm, move the values
    leave: Array | None = None  # (n, n + m) what is left of them in the residuals; of machines that are drawn: if nothing drifted
    widths: Array | None = None  # (p,) standard deviations before the touches are looked at; 0: not in this fit
    left_out: float = np.nan  # mm, rms by which each touch is off what all others predict of it
    free: NDArray[np.bool_] | None = None  # (p,) of machines that are drawn: what the touches alone decide, no size of its kind
    draws: Array | None = None  # (p, d) machines that the touches leave possible; None: values and covariance are all
    tip: Tip | None = None  # of the first stylus; None: no touch of it is here
    residuals: Array | None = None  # (n,) mm, what this fit leaves of the touches, likewise
    scatter: float | None = None  # mm, of a touch in the machines that are drawn; None: sigma
    drifts: Drifts = field(default_factory=dict)  # standard deviations of what drifts beside the error motions, mm
    drifted: tuple[float, ...] = ()  # mm, how far the table went in x y z of the machine frame, largest minus smallest

    @cached_property
    def unfelt(self) -> dict[str, bool]:
        """→ error motions that no touch feels, and whether each turns about the spindle axis, on which a stylus stays in place."""
        if self.widths is None:
            return {}
        fitted = np.flatnonzero(self.widths > 0)
        shown = np.abs(
            self.covariance[np.ix_(fitted, fitted)] / np.outer(self.widths[fitted], self.widths[fitted]) - np.eye(len(fitted))
        )
        felt = {self.motions[i] for i, most in zip(fitted, shown.max(axis=1), strict=True) if most > UNFELT}
        slots = {self.motions[i]: self.coefficients[i].slot for i in fitted}
        return {name: slot.stage == "intra" and slot.component == TURN for name, slot in slots.items() if name not in felt}

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """→ each error motion in this fit, its coefficients (k,), the pseudo-inverse (k, k) of their covariance."""
        return blocks_of(self.motions, self.covariance)


def blocks_of(motions: Sequence[str], covariance: Array) -> tuple[Block, ...]:
    """(p,) the error motion of each coefficient, covariance (p, p) → as `Whole.blocks`."""
    names, fitted = np.array(motions), np.diag(covariance) > 0
    found = [(name, np.flatnonzero((names == name) & fitted)) for name in dict.fromkeys(motions)]
    return tuple((n, own, np.asarray(np.linalg.pinv(covariance[np.ix_(own, own)], rcond=1e-10))) for n, own in found if len(own))


def disturbed(w: Whole, all_of: Sequence[Array], beside_scatter: Sequence[Array]) -> tuple[Whole, float]:
    """machine, factors (n + m, k) mm of a budget, those of them that the scatter does not contain → machine, scatter to expect, mm.

    What disturbs each touch by itself is in the scatter already. Drift, lobing and the like act on many touches alike: the fit
    takes them for machine, and the scatter does not tell of them. Source: JCGM 102:2011, 6 (linear propagation).
    """
    assert w.leave is not None
    left = sum(float(np.sum((w.leave @ factor) ** 2)) for factor in all_of)
    return moved(w, beside_scatter), float(np.sqrt(left / w.freedom))


def moved(w: Whole, factors: Sequence[Array]) -> Whole:
    """machine, factors (n + m, k) mm of what moves many touches alike → the same machine, as uncertain as that makes it."""
    assert w.gain is not None
    covariance, draws, tip, rng = w.covariance.copy(), w.draws, w.tip, np.random.default_rng(2307)
    for factor in factors:
        way = w.gain @ factor
        covariance += way @ way.T
        some = None if draws is None else rng.standard_normal((way.shape[1], draws.shape[1]))
        draws = draws if draws is None or some is None else draws + way @ some
        if tip is not None:
            own = tip.gain @ factor
            drawn = tip.draws if tip.draws is None or some is None else tip.draws + own @ some
            tip = replace(tip, variance=tip.variance + float(own @ own), across=tip.across + way @ own, draws=drawn)
    return replace(w, covariance=covariance, draws=draws, tip=tip)


def orders(result: Estimate, drifts: Drifts = STANDS_STILL) -> list[tuple[Whole, float]]:
    """estimate, what drifts → the same touches with every error motion at each of `ORDERS`, and how much each is worth, the best
    first.

    Akaike weights with the correction for few touches; what counts as fitted is what the touches decide beside the prior (Burnham
    and Anderson, Model Selection and Multimodel Inference, 2.9). Raises TangoError where too few touches are left for any.
    """
    first, at = _fitted(result, DEGREE, ORDER, None, None, drifts)
    found = [first]
    for degree, order in ORDERS:
        if (degree, order) != (DEGREE, ORDER):
            with suppress(TangoError):
                fit, at = _fitted(result, degree, order, None, at, drifts)
                found.append(fit)
    least = min(w.criterion for w in found)
    worth = np.array([np.exp(-(w.criterion - least) / 2) for w in found])
    return sorted(zip(found, (worth / worth.sum()).tolist(), strict=True), key=lambda pair: -pair[1])


def whole(
    result: Estimate, degree: int = DEGREE, order: int = ORDER, scatter: float | None = None, drifts: Drifts = STANDS_STILL
) -> Whole:
    """estimate, degree, highest harmonic, scatter (mm; None: what is left), what drifts → the same touches with every error
    motion.

    Raises TangoError where too few touches are left.
    """
    return _fitted(result, degree, order, scatter, None, drifts)[0]


def _fitted(
    result: Estimate,
    degree: int,
    order: int,
    scatter: float | None = None,
    near: tuple[dict[str, float], float] | None = None,
    drifts: Drifts = STANDS_STILL,
) -> tuple[Whole, tuple[dict[str, float], float]]:
    """as `whole`; every unknown by name and scatter (mm) of another order, near which this one begins → machine, its own."""
    model, p = with_all(result.model, degree, order)
    touches = model.touches
    of_terms = dict(zip(result.model.names, result.values.tolist(), strict=True))
    start = np.array([of_terms.get(name, 0.0) for name in model.names])
    known_there, sigma = near or (of_terms, result.sigma)
    values = np.array([known_there.get(name, 0.0) for name in model.names])
    width = widths(model, drifts=drifts)
    seen = width > 0
    n, sigma = len(touches), max(scatter or sigma, FINEST)
    for steps in ROUNDS:  # the scatter beside all error motions is that of these, not of the fitted terms
        for _ in range(steps):
            gaps, jacobian = linearise(model, values)
            offsets, rows, uncertainty = known(model, values)
            matrix = np.vstack([jacobian / sigma, rows / uncertainty[:, None]])[:, seen] * width[seen]
            right = np.concatenate([gaps / sigma, offsets / uncertainty])
            normal = matrix.T @ matrix + np.eye(matrix.shape[1])
            factor = linalg.cho_factor(normal, lower=True, overwrite_a=False, check_finite=False)
            change = linalg.cho_solve(factor, matrix.T @ right + values[seen] / width[seen], check_finite=False)
            values = values.copy()
            values[seen] -= width[seen] * change
            if change @ normal @ change < STILL**2:
                break
        gaps = linearise(model, values)[0]
        decided = len(normal) - float(np.sum(np.tril(linalg.lapack.dtrtri(factor[0], lower=1)[0]) ** 2))  # less trace of inverse
        freedom = n + len(uncertainty) - decided
        if freedom < 3:
            raise TangoError(
                f"iso230: found {n} touches, which leave {freedom:.1f} degrees of freedom beside all error motions of the axes; "
                "allowed: 3 or more; touch more indexations"
            )
        before = sigma
        sigma = max(float(np.sqrt(gaps @ gaps / freedom)), FINEST) if scatter is None else sigma
        if abs(np.log(sigma / before)) < SETTLED:
            break
    # How far the table is turned about its rotary axis, few touches tell: a fit may have it 0.01 rad off. Figures are of a table
    # that is not. Beside the turned one, what cancels on theirs would leave some µm.
    _, rows, uncertainty = known(model, start)
    matrix = np.vstack([linearise(model, start)[1] / sigma, rows / uncertainty[:, None]])[:, seen] * width[seen]
    inverse = linalg.inv(matrix.T @ matrix + np.eye(len(normal)))
    scales = np.outer(width[seen], width[seen])
    covariance = np.zeros((len(values), len(values)))
    covariance[np.ix_(seen, seen)] = scales * (inverse + inverse.T) / 2
    found = model.coefficients[:p]
    names, few = tuple(motion_of(c) for c in found), max(n - decided - 1, 1.0)
    criterion = n * np.log(max(float(gaps @ gaps) / n, FINEST**2)) + 2 * decided + 2 * decided * (decided + 1) / few
    inputs = np.append(np.full(n, 1 / sigma), 1 / uncertainty)
    ways, own = width[seen, None] * (inverse @ matrix.T) * inputs, int(seen[:p].sum())
    gain = np.zeros((p, ways.shape[1]))
    gain[seen[:p]] = ways[:own]
    leave = np.eye(n, ways.shape[1]) - sigma * matrix[:n] @ (ways / width[seen, None])
    free = np.diag(leave)
    told = free > ALONE  # what is left of touches that the others say nothing of is no prediction
    left_out = float(np.sqrt(np.mean((gaps[told] / free[told]) ** 2))) if told.any() else np.nan
    tip, t = None, place_of_tip(model, seen)
    if t is not None:
        tip = Tip(model.coefficients[t], float(values[t]), covariance[t, t], covariance[:p, t], ways[int(seen[:t].sum())])
    covariance, own_width, of = covariance[:p, :p], width[:p], (degree, order)
    fit = Whole(
        *(touches, found, names, values[:p], covariance, sigma, freedom, of, float(criterion), gain, leave, own_width, left_out),
        tip=tip,
        residuals=gaps,
        drifts=drifts,
    )
    return fit, (dict(zip(model.names, values.tolist(), strict=True)), sigma)


def foreseen(selection: Selection) -> Whole:
    """selection for touches that nobody has made yet → what they will leave undecided, at the stated repeatability of the probe."""
    model, p = with_all(selection.model)
    sigma = max(model.touches.machine.probe.repeatability, FINEST)
    values, width = np.zeros(len(model.names)), widths(model)
    seen = width > 0
    _, jacobian = linearise(model, values)
    _, rows, uncertainty = known(model, values)
    matrix = np.vstack([jacobian / sigma, rows / uncertainty[:, None]])[:, seen]
    root = np.linalg.qr(np.vstack([matrix, np.diag(1 / width[seen])]), mode="r")
    inverse = linalg.solve_triangular(root, np.eye(len(root)))
    covariance = np.zeros((len(values), len(values)))
    covariance[np.ix_(seen, seen)] = inverse @ inverse.T
    freedom = len(model.touches) + len(rows) - float(np.sum((matrix @ inverse) ** 2))
    found = model.coefficients[:p]
    motions = tuple(motion_of(c) for c in found)
    return Whole(model.touches, found, motions, values[:p], covariance[:p, :p], sigma, freedom, widths=width[:p])


def understood(w: Whole) -> tuple[float, int]:
    """machine → how many of the numbers that describe its errors the touches decide, of how many that they may feel."""
    assert w.widths is not None
    seen = w.widths > 0
    return float(np.sum(1 - np.diag(w.covariance)[seen] / w.widths[seen] ** 2)), int(seen.sum())


def with_all(fitted: Model, degree: int = DEGREE, order: int = ORDER) -> tuple[Model, int]:
    """fitted model, degree, highest harmonic → the same touches with every error motion, number of the machine's coefficients."""
    own = [c for c in fitted.coefficients if c.slot.axis not in ("t", "w") and not error_motion.PATTERN.fullmatch(c.name)]
    setup = [c for c in fitted.coefficients if c.slot.axis in ("t", "w")]
    names = {c.name for c in own}
    extra = [c for c in every(fitted.touches, degree, order) if c.name not in names]
    beside = (*drifting(fitted.touches), *_radius(fitted.touches))
    return Model(fitted.touches, (*own, *extra, *setup, *beside)), len(own) + len(extra)


def _radius(touches: Touches) -> tuple[Coefficient, ...]:
    """touches → how much larger tip and balls are together than stated, mm; () where no ball was touched.

    Facets are as high as they are, and take the tip's own radius. A ball has its stated size: a tip that is 1 µm larger would be
    read as backlash, which comes to it from all sides alike.
    """
    on_ball = np.array([touches.artefact.facets[f].ball is not None for f in touches.facet], dtype=bool)
    return (Coefficient(BALLS, "mm", GAP, _on_balls),) if on_ball.any() else ()


def _on_balls(touches: Touches) -> Array:
    return -np.array([touches.artefact.facets[f].ball is not None for f in touches.facet], dtype=float)


def every(touches: Touches, degree: int = DEGREE, order: int = ORDER) -> Iterator[Coefficient]:
    """touches, degree, highest harmonic → every coefficient of the topology that these touches may feel, each name once."""
    machine, names = touches.machine, set()
    for c in (*_candidates(machine, order), *_series(touches, degree)):
        if c.name not in names:
            names.add(c.name)
            yield c


def _candidates(machine: Machine, highest: int) -> Iterator[Coefficient]:
    yield from inter_axis.coefficients(machine, DEGREE)
    yield from backlash.coefficients(machine, DEGREE)
    for axis in machine.rotary:
        for order in range(1, highest + 1):
            yield from waves(machine, axis, order)


def waves(machine: Machine, axis: str, order: int) -> Iterator[Coefficient]:
    """machine, rotary axis, order → cosine and sine of every error motion of that axis at this harmonic, mm and rad."""
    for name, known_cause in causes().items():
        if known_cause.turning:
            yield from cause(name, machine, {"axis": axis, "order": order})


def _series(touches: Touches, highest: int) -> Iterator[Coefficient]:
    """touches, degree → Legendre polynomials over the touched range of every error motion of every axis, mm and rad.

    Powers of a command far from zero are all but alike: a width on each would say nothing of the curve they make together.
    """
    machine = touches.machine
    for axis in (*machine.linear, *machine.rotary):
        low, high = float(touches.axis(axis).min()), float(touches.axis(axis).max())
        if high - low < SHORTEST:
            continue
        value = _polynomials(axis, highest, low, high)
        for component, letter in enumerate(COMPONENTS):
            slot = Slot(axis, "motion") if letter == axis else Slot(axis, "intra", component)
            for degree in range(1, highest + 1):
                regressor = partial(value, degree)
                yield Coefficient(f"E{letter}{axis}.P{degree}", "mm" if component < 3 else "rad", slot, regressor)


def _polynomials(axis: str, highest: int, low: float, high: float) -> Callable[[int, Touches], Array]:
    """axis, highest degree, mm or rad → degree, touches → (n,) that Legendre polynomial at each touch.

    The touches that were asked about last are remembered: six error motions of an axis have the same polynomials.
    """
    last: list[tuple[Touches, Array]] = []

    def value(degree: int, touches: Touches) -> Array:
        if not last or last[0][0] is not touches:
            at = (2 * touches.axis(axis) - low - high) / (high - low)
            last[:] = [(touches, np.asarray(legendre.legvander(at, highest), dtype=np.float64))]
        return np.asarray(last[0][1][:, degree])

    return value


def place_of_tip(model: Model, seen: NDArray[np.bool_]) -> int | None:
    """model, (p,) whether a touch feels an unknown → which one is the place of the first stylus' tip along the spindle, if any."""
    place = model.names.index(STYLUS[2]) if STYLUS[2] in model.names else None
    return place if place is not None and seen[place] else None


def motion_of(c: Coefficient) -> str:
    """coefficient → the error motion that it is a part of, by its ISO 230-1 symbol; backlash keeps its own name."""
    return c.name if backlash.PATTERN.fullmatch(c.name) else slot_name(c.slot)


def widths(model: Model, hidden: bool = False, drifts: Drifts | float = STANDS_STILL) -> Array:
    """model, whether with motions that show in no touch, what drifts (mm, or one size of all) → (p,) standard deviation of
    every unknown before the touches are looked at; 0 for what moves no axis here.
    """
    machine, found = model.touches.machine, np.full(len(model.names), PLACED[0])
    for j, c in enumerate(model.coefficients):
        size = float(np.max(np.abs(model.regressors[j])))
        if is_drift(c):
            found[j] = 0.0 if size == 0 else drifts if isinstance(drifts, float) else drifts.get(c.name, 0.0)
            continue
        if c.name == BALLS:
            found[j] = RADIUS
            continue
        if hidden and size <= FAINT and c.slot.stage in ("motion", "intra"):
            size = 1.0  # a wave of a rotary axis that is zero wherever it was touched
        turns = c.slot.axis in machine.rotary if c.slot.stage == "motion" else c.slot.component >= 3
        wide = PLACED if c.slot.stage in ("inter", "stylus", "table") else WIDTH
        found[j] = wide[int(turns)] / size if size > FAINT else 0.0
    return found
