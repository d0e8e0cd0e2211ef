"""The state from night to night, in square-root form, and the one test of the night.

Covariances are carried as P = S Sᵀ. With x = m + S u the state is u ~ N(0, 1) before the touches, whatever the units are, and
one QR decomposition of [1; H S / σ] gives what is known after them (Bierman 1977; Kaminski, Bryson & Schmidt 1971).
The test asks whether the touches agree with what was predicted: νᵀ (H P Hᵀ + σ²)⁻¹ ν, one number for the whole machine. Beside it
the largest of the same numbers along single parameters (`Alone`): what moves alone is lost among forty directions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from ..records import Array
from ._root import rooted, triangle, widened
from .frame import CLOSED, WARM, WIDE, Frame, Seen

FALSE_ALARMS = 1 / 730  # a night: once in two years
TRUST = 60.0  # nights' worth of numbers that the stated repeatability counts for, and the first idea of how much wanders
MONTH = 30.0  # days
FREE = 30.0  # standard deviations that the machine may have moved, when single touches are judged
SHARED = 0.05  # of the variance of a touch: with less, its point may have moved as well as the touch be wrong
FAINT = 0.05  # standard deviations of a touch that one of the state makes: less says next to nothing
SMALLEST = 1e-5  # mm, of the standard deviation of a touch
FELT = 1e-6  # standard deviations a mm or rad: a parameter that tonight's touches feel less is not tried alone
UNKNOWN = 1e-8  # standard deviation of a coefficient per K that no night has opened
OFF = 1 / 6  # of what machines do for each K: what one does that is heated in another place than before
SURE = 3.0  # standard deviations of a learned coefficient
NOISY = FALSE_ALARMS / 3  # chance of the scatter of a night, below which its touches count for no more than that scatter says


@dataclass(frozen=True)
class State:
    """What is known of p unknowns at a moment: mean and root S of the covariance S Sᵀ."""

    names: tuple[str, ...]
    mean: Array  # (p,)
    root: Array  # (p, p) lower triangle
    day: float  # days since 1970-01-01 UTC
    rates: Array  # (p,) variance a day
    sigma: float  # mm, of a touch
    reference: float | None = None  # °C at which temperature counts as zero
    noise: tuple[float, float] = (0.0, 0.0)  # sum of squares mm², degrees of freedom: what σ is learned from
    agreement: tuple[float, float] = (0.0, 0.0)  # sum of the statistics of quiet nights under these rates, their degrees of freedom

    @cached_property
    def covariance(self) -> Array:
        """→ (p, p)."""
        return self.root @ self.root.T

    @cached_property
    def std(self) -> Array:
        """→ (p,) standard deviations."""
        return np.sqrt(np.sum(self.root**2, axis=1))

    def mean_of(self, places: tuple[int, ...]) -> tuple[float, float]:
        """places of unknowns → their mean and its standard deviation; a night asks for the same ones at every span."""
        if places not in self._means:
            spread = float(np.sqrt(self.covariance[np.ix_(places, places)].mean()))
            self._means[places] = float(np.mean(self.mean[list(places)])), spread
        return self._means[places]

    @cached_property
    def _means(self) -> dict[tuple[int, ...], tuple[float, float]]:
        return {}


class Alone(NamedTuple):
    """Parameters that may have moved alone: their (m,) places, and the nights that their rates are learned from."""

    places: NDArray[np.int64]
    nights: float


@dataclass(frozen=True)
class Tonight:
    """What the touches of a night say against what was predicted, before they are believed."""

    statistic: float
    dof: int
    p_value: float  # of the whole night: both tests together
    p_machine: float  # that the machine is as predicted
    p_noise: float  # that touches scatter no more than they did
    outliers: tuple[int, ...]  # numbers of single touches that fit nothing
    touches: int
    scale: float  # by which the statistic is divided, learned from quiet nights
    reduced: Array = field(repr=False)  # (k, p) of u
    innovation: Array = field(repr=False)  # (k,) standard deviations of a touch
    noise: tuple[float, float] = (0.0, 0.0)  # sum of squares mm², degrees of freedom
    wider: float = 1.0  # times as much as stated that touches scatter, where that is no chance
    alone: Alone | None = None  # what was tried by itself as well

    def alarm(self, rate: float = FALSE_ALARMS) -> bool:
        """false alarms a night → whether tonight is one."""
        return self.p_value < rate


def start(followed: Frame, day: float, temperature: float | None = None) -> State:
    """frame, day, °C → a state that knows nothing but certificates."""
    std = np.array([WIDE[f] for f in followed.families])
    fixed = std == 0
    std[fixed] = CLOSED
    for name, uncertainty in followed.certificates.items():
        std[followed.place[name]] = uncertainty
    sigma = max(followed.model.touches.machine.probe.repeatability, SMALLEST)
    return State(followed.names, np.zeros(len(std)), np.diag(std), day, followed.wander, sigma, temperature)


def predicted(state: State, day: float) -> State:
    """state, later day → what is known then without a touch. Days that run backwards count as none."""
    return replace(
        state, root=widened(state.root, np.diag(np.sqrt(state.rates * max(day - state.day, 0.0)))), day=max(day, state.day)
    )


def grown(state: State, day: float) -> State:
    """state, later day → what is taken for known then: as `predicted`, but a machine wanders no farther than in a month.

    After a year without a night anything would be expected, and a knock of 30 µm would pass as wander. So would it after a clock
    that has jumped by a year.
    """
    return replace(predicted(state, min(day, state.day + MONTH)), day=max(day, state.day))


def sigma_of(state: State) -> float:
    """state → mm, standard deviation of a touch: the stated one, more and more what was seen."""
    squares, dof = state.noise
    return float(np.sqrt((squares + TRUST * state.sigma**2) / (dof + TRUST)))


def judge(
    state: State,
    what: Seen,
    points: NDArray[np.int64] | None = None,
    again: Sequence[int] = (),
    alone: Alone | None = None,
) -> Tonight:
    """predicted state, what the touches say → the one test of the night. Single touches that fit nothing are set apart.

    `points`: places of facets and balls among the unknowns. The only touch of a point is set apart too when it is far off: a chip
    is more likely than a facet that has moved. `again`: touches of points where that was so the last time; now they count.
    `alone`: parameters that are tried one by one as well, with half of what the test of the machine has of the false alarms.
    """
    sigma = sigma_of(state)
    outliers = _outliers(state, what, sigma, points, again)
    used = what.without(outliers)
    reduced, innovation, left, dof = _reduced(state, used, sigma)
    total, nights = state.agreement
    scale = max((total + TRUST) / (nights + TRUST), 0.5)
    statistic, p_machine = _machine(state, reduced, innovation, scale, nights + TRUST, alone)
    seen_dof = state.noise[1] + TRUST
    p_noise = float(special.fdtrc(dof, seen_dof, left / dof)) if dof > 0 else 1.0
    wider = max(float(np.sqrt(left / dof)), 1.0) if p_noise < NOISY else 1.0
    found = _both(p_machine, p_noise), p_machine, p_noise, outliers, len(what.value), scale, reduced, innovation
    return Tonight(statistic, len(innovation), *found, (left * sigma**2, float(dof)), wider, alone)


def as_scattered(state: State, what: Seen, tonight: Tonight) -> Tonight:
    """predicted state, what the touches say, their judgement → the judgement of the machine by touches that scatter as they did
    tonight, where that is no chance: by the stated scatter those of a bad probe would say that everything has moved.
    """
    if tonight.wider == 1:
        return tonight
    reduced, innovation, _, _ = _reduced(state, what.without(tonight.outliers).wider(tonight.wider), sigma_of(state))
    sure = min(state.agreement[1] + TRUST, tonight.noise[1])  # that scatter is known from the touches of one night
    statistic, p = _machine(state, reduced, innovation, tonight.scale, sure, tonight.alone)
    judged = replace(tonight, statistic=statistic, p_value=_both(p, tonight.p_noise), p_machine=p)
    return replace(judged, reduced=reduced, innovation=innovation, dof=len(innovation))


def _machine(
    state: State, reduced: Array, innovation: Array, scale: float, sure: float, alone: Alone | None
) -> tuple[float, float]:
    """predicted state, (k, p) rows of u, (k,) innovations, scale of the statistic, its degrees of freedom, what is tried alone →
    statistic, p-value of the machine: that of all directions together and that of the parameter which stands out most.
    """
    k = len(innovation)
    if not k:
        return 0.0, 1.0
    root = np.asarray(np.linalg.cholesky(np.eye(k) + reduced @ reduced.T), dtype=float)
    white = linalg.solve_triangular(root, innovation, lower=True)
    statistic = float(white @ white)
    p = float(special.fdtrc(k, sure, statistic / k / scale))
    return statistic, p if alone is None else _both(p, _alone(state, reduced, root, white, scale, sure, alone))


def _alone(state: State, reduced: Array, root: Array, white: Array, scale: float, sure: float, alone: Alone) -> float:
    """predicted state, (k, p) rows of u, (k, k) root of what is predicted of the innovations, these made white, as `_machine` →
    p-value of the parameter that stands out most, all that are tried paid for (Bonferroni).

    What is predicted rests on rates that are known from so many nights only. So far as it makes what chance may do, chance has
    the tails of Student's t with as many degrees of freedom (Welch and Satterthwaite: GUM, G.4.1).
    """
    inside = linalg.solve_triangular(state.root, np.eye(len(state.names))[:, alone.places], lower=True)
    along = linalg.solve_triangular(root, reduced @ inside, lower=True)
    size = np.linalg.norm(along, axis=0)
    along = along[:, size > FELT] / size[size > FELT]
    if not along.shape[1]:
        return 1.0
    far = np.abs(along.T @ white) / np.sqrt(scale)
    touched = np.sum(linalg.solve_triangular(root, along, lower=True, trans="T") ** 2, axis=0)  # share of the scatter of touches
    freedom = 1 / (1 / sure + (1 - touched) ** 2 / alone.nights)
    return min(1.0, float(np.min(2 * special.stdtr(freedom, -far))) * along.shape[1])


def _both(p_machine: float, p_noise: float) -> float:
    """p-values of the two tests → that of the night."""
    least = min(p_machine, p_noise)
    return float(-np.expm1(2 * np.log1p(-least))) if least < 1 else 1.0


def _whitened(state: State, what: Seen, sigma: float) -> tuple[Array, Array]:
    """→ (n, p) rows of u, (n,) innovations, both in standard deviations of a touch."""
    return what.rows @ state.root / sigma, (what.value - what.rows @ state.mean) / sigma


def _reduced(state: State, what: Seen, sigma: float) -> tuple[Array, Array, float, int]:
    """→ (k, p) rows of u, (k,) innovations along the k directions that the touches tell; sum of squares of the others, its dof.

    What a plan cannot see exactly it sees faintly at the places that were really touched, by the scatter of these very touches:
    such a direction would take the scatter for knowledge. It says next to nothing beside what was known before, and is left out.
    """
    own, ahead = _whitened(state, what, sigma)
    n, p = own.shape
    left = 0.0
    if n > p:
        both = triangle(np.column_stack([own, ahead]))
        own, ahead, left = both[:p, :p], both[:p, p], float(both[p, p] ** 2)
    basis, size, turned = np.linalg.svd(own, full_matrices=False)
    told = size > FAINT
    innovation = basis[:, told].T @ ahead
    left += max(float(ahead @ ahead - innovation @ innovation), 0.0)
    return size[told, None] * turned[told], innovation, left, n - int(told.sum())


def _outliers(state: State, what: Seen, sigma: float, points: NDArray[np.int64] | None, again: Sequence[int]) -> tuple[int, ...]:
    """→ numbers of touches that lie too far from all others even when the machine may have moved, the worst first.

    At most one in 25: more than that is a change and no slip.
    """
    found: list[int] = []
    most = max(1, len(what.value) // 25)
    limit = float(-special.ndtri(5e-5 / max(len(what.value), 1)))
    free = FREE * state.root
    fixed = free if points is None else free.copy()
    if points is not None:
        fixed[points] = state.root[points]
    while True:
        left = what.without(found)
        rest, share = _rest(left, state.mean, free, sigma)
        lone = (share <= SHARED) & ~np.isin(left.touch, list(again))
        if points is not None and np.any(lone):
            own, kept = _rest(left, state.mean, fixed, sigma)
            rest, share = np.where(lone, own, rest), np.where(lone, kept, share)
        size = np.where((share > SHARED) & (left.touch > 0), np.abs(rest) / np.sqrt(np.clip(share, SHARED, None)), 0.0)
        typical = max(1.0, 1.4826 * float(np.median(size[size > 0]))) if np.any(size > 0) else 1.0
        worst = int(np.argmax(size)) if len(size) else -1
        if worst < 0 or size[worst] / typical < limit:
            return tuple(found)
        if len(found) >= most:
            return ()  # so many that they are no slips
        found.append(int(left.touch[worst]))


def _rest(what: Seen, mean: Array, root: Array, sigma: float) -> tuple[Array, Array]:
    """what n touches say, (p,) mean, (p, p) root → what is left of each in standard deviations of a touch, and its variance."""
    inside = what.rows @ root / sigma
    lower = linalg.cholesky(np.eye(len(mean)) + inside.T @ inside, lower=True, check_finite=False)
    white = linalg.solve_triangular(lower, inside.T, lower=True, check_finite=False)
    right = (what.value - what.rows @ mean) / sigma
    return right - white.T @ (white @ right), 1 - np.einsum("ij,ij->j", white, white)


def updated(state: State, what: Seen, tonight: Tonight, quiet: bool = True) -> State:
    """predicted state, what the touches say, their judgement, whether the night was no alarm → what is known after them."""
    noise, agreement = state.noise, state.agreement
    if quiet:
        noise = (noise[0] + tonight.noise[0], noise[1] + tonight.noise[1])
        agreement = (agreement[0] + tonight.statistic, agreement[1] + tonight.dof)
    return replace(taken(state, what.without(tonight.outliers).wider(tonight.wider)), noise=noise, agreement=agreement)


def taken(state: State, what: Seen) -> State:
    """predicted state, what the touches say → what is known after them: mean and root."""
    own, ahead = _whitened(state, what, sigma_of(state))
    p = len(state.names)
    stacked = np.vstack([np.column_stack([np.eye(p), np.zeros(p)]), np.column_stack([own, ahead])])
    both = triangle(stacked)
    change = linalg.solve_triangular(both[:p, :p], both[:p, p])
    root = triangle(np.asarray(linalg.solve_triangular(both[:p, :p], state.root.T, trans="T"))).T
    return replace(state, mean=state.mean + state.root @ change, root=root)


def reopened(state: State, followed: Frame, directions: Array | None, temperature: bool = False) -> State:
    """predicted state, (p, m) directions that changed (None: whatever), whether with temperature → a state that lets them.

    Without it the filter would take nights to believe in a step.
    """
    if temperature:
        base = len(followed.model.names)
        columns = np.zeros((len(state.names), len(followed.warm)))
        columns[base : base + len(followed.warm)] = np.diag(per_kelvin(followed, state))
        return replace(state, root=widened(state.root, columns))
    if directions is None:
        free = {"location": 0.1, "angle": 3e-4, "gain": 1e-4, "backlash": 0.02, "stylus": 0.1, "table": 0.1, "fixed": 0.0}
        directions = np.diag([free[f] for f in followed.families])
    return replace(state, root=widened(state.root, directions))


def unknown(followed: Frame, state: State) -> bool:
    """frame, predicted state → whether nothing is known yet of what the machine does for each K."""
    own = _learned(followed, state)[1]
    return bool(len(own)) and bool(np.all(own < UNKNOWN))


def per_kelvin(followed: Frame, state: State) -> Array:
    """frame, predicted state → (q,) mm or rad, how far each error that follows the temperature may be from what is known of it, a
    K: where nothing is known what machines do.
    """
    most = np.array([WARM.get(followed.units[i], WARM[""]) for i in followed.warm])
    mean, std = _learned(followed, state)
    return np.where(std < UNKNOWN, most, np.minimum(most, OFF * most + 0.5 * np.abs(mean) + SURE * std))


def _learned(followed: Frame, state: State) -> tuple[Array, Array]:
    """→ (q,) coefficients per K, (q,) their standard deviations."""
    part = slice(len(followed.model.names), len(followed.model.names) + len(followed.warm))
    return state.mean[part], state.std[part]


def as_numbers(state: State) -> dict[str, object]:
    """state → plain numbers beside mean and covariance, for the record of a night."""
    return {
        "day": state.day,
        "sigma": state.sigma,
        "reference": state.reference,
        "noise": list(state.noise),
        "agreement": list(state.agreement),
        "rates": [float(r) for r in state.rates],
    }


def restored(names: tuple[str, ...], mean: Array, covariance: Array, numbers: Mapping[str, object]) -> State:
    """names, mean, covariance and the numbers of `as_numbers` → the state that was stored. Raises ValueError for other shapes."""
    rates = np.array(numbers["rates"], dtype=float)
    if not len(names) == len(mean) == len(covariance) == len(rates):
        raise ValueError("names, mean, covariance and rates are of different lengths")
    root = rooted(covariance)
    a, b = (numbers["noise"], numbers["agreement"])
    assert isinstance(a, (list, tuple)) and isinstance(b, (list, tuple))
    reference = numbers["reference"]
    return State(
        names,
        np.array(mean),
        root,
        float(numbers["day"]),  # type: ignore[arg-type]
        rates,
        float(numbers["sigma"]),  # type: ignore[arg-type]
        None if reference is None else float(reference),  # type: ignore[arg-type]
        (float(a[0]), float(a[1])),
        (float(b[0]), float(b[1])),
    )


def matched(state: State, followed: Frame) -> State:
    """stored state, frame of tonight → the state over the unknowns of the frame; what is new is unknown, what is gone is gone."""
    if state.names == followed.names:
        return state
    fresh = start(followed, state.day, state.reference)
    old = {name: i for i, name in enumerate(state.names)}
    rows: NDArray[np.int64] = np.array([old[n] for n in followed.names if n in old], dtype=np.int64)
    here = np.array([i for i, n in enumerate(followed.names) if n in old], dtype=np.int64)
    mean, covariance, rates = fresh.mean.copy(), fresh.covariance, fresh.rates.copy()
    mean[here], rates[here] = state.mean[rows], state.rates[rows]
    covariance[np.ix_(here, here)] = state.covariance[np.ix_(rows, rows)]
    root = rooted(covariance)
    return replace(fresh, mean=mean, root=root, rates=rates, noise=state.noise, agreement=state.agreement)
