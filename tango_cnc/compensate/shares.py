"""Of every part of a compensation the share that is in the control, from few touches and all that was known before them.

A short check has fewer touches than its machine has errors. It need not determine those: the full run that the compensation was
made from has done so. What is unknown besides is what may have changed since, and how much of every table is in the control:

    gap = J (x − x₀) + h g + X e − M s + ε,   x ~ N(x₀, P₀ + Q),   g ~ N(0, K),   e wide,   s ~ N(½, 1)

x₀, P₀: estimate of the full run with its covariance. Q: what a machine moves in the days between, as the nights take it, and where
the stylus is, which may be another one. g: by how many K all linear axes have grown alike, K: how much warmer the machine may be
than in the full run; 0: it is as warm as then. h: what that does to the gaps. e: where the table stands, and the radius of the tip.
M: what each part does to the gaps. A table that is not loaded has s = 0, one with the wrong sign −1, one that was entered twice 2.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from ..estimate import Estimate
from ..model import PLACEMENT, Model, linearise, setup_coefficient
from ..records import Array
from ..state.frame import WANDER, WARM, family
from ..terms import SCALES, Coefficient
from ..terms.error_motion import scales
from ..touches import Touches
from .fit import posed
from .space import Held, Poses

TOGETHER = 8  # parts whose states are compared together, the least known ones
CERTAIN = 0.01  # standard deviation of a share that is taken for known
SHARE, SPREAD = 0.5, 1.0  # of what is in the control, before a touch: not at all and whole are as likely
LEAST_DAYS, MOST_DAYS = 4.0, 30.0  # that a machine wanders: as far as in four at least, as warmth moves it within one
STYLUS, TABLE, TURN, RADIUS, RUN = 2.0, 5.0, 2e-2, 0.05, 5e-3  # mm, mm, rad, mm, mm: anew in every run
SAME, LONGER = 2e-3, 0.02  # mm: a stylus that stayed in its holder, across and along it, which warmth makes longer
CALM = 1e-4  # mm at a touch by which a gain or an error motion, the shape of a guideway, wanders in a day at most
WIDELY = 30.0  # standard deviations of a touch: a direction that was as uncertain takes a touch, and says nothing of the fit
FACET = 2e-4  # mm: a facet that is cleaned before each run
GROWTH = "growth"  # no coefficient has this name
ALONG = "EZt"  # coefficient: where the stylus is along the spindle
GROWS = 11.5e-6  # mm/mm per K: of steel and cast iron, by which all axes become longer alike
APART = 2e-6  # mm/mm per K, by which one axis grows otherwise than all of them: nobody knows an expansion better
BENDS = 3e-4  # mm at a touch per K, by which warmth changes the shape of a guideway
STEPS, LINEAR = 6, 0.02  # steps at most; mm at a touch that is no longer a step
NEW = 1.0  # mm: a facet or ball that the full run has not touched


@dataclass(frozen=True)
class Part:
    """Numbers that are loaded together or not at all: a table, the centers of the rotary axes."""

    name: str
    held: tuple[Held, ...]
    sizes: tuple[float, ...]  # mm rad mm/mm, by which the compensation changes each

    def moved(self, poses: Poses) -> Array:
        """poses → (n, 3) mm of tip error that it takes away."""
        return np.asarray(sum(h.lever(poses) * size for h, size in zip(self.held, self.sizes, strict=True)))


@dataclass(frozen=True)
class Before:
    """What is known before the check: the estimate of the full run, and how long ago it was made."""

    result: Estimate
    days: float
    moves: float = 1.0  # times what it wanders in these days; 0: it is what it was
    same_stylus: bool = False  # it is that of the full run, and has not been out of its holder since
    warmer: float = 0.0  # K by which it may be warmer or colder than in the full run: what that moves is unknown
    grown: float = 0.0  # K that all its linear axes may have grown as by, alike

    @property
    def sigma(self) -> float:
        """→ mm, standard deviation of a touch."""
        return max(self.result.sigma, self.result.model.touches.machine.probe.repeatability, 1e-5)


def parts_of(
    held: Sequence[Held],
    numbers: Mapping[str, float],
    *,
    tcp: bool,
    singly: bool = False,
    files: Mapping[str, str] | None = None,
) -> list[Part]:
    """what a target holds, by how much each of its numbers changes → the parts that a run sees, those that change.

    `singly`: every number that belongs to no table of an axis is a part of its own, as a person may type one of them wrong.
    `files`: {place: name of its file}; then what one file holds is one part.
    """
    found: dict[str, list[tuple[Held, float]]] = {}
    for h in held:
        change = numbers.get(h.place, 0.0)
        if change and (tcp or not h.tcp):
            name = h.place if singly and h.axis is None else h.table
            name = name if files is None else files.get(h.place, name)
            found.setdefault(name, []).append((h, change * h.sign / h.factor))
    return [Part(name, tuple(h for h, _ in own), tuple(v for _, v in own)) for name, own in found.items()]


@dataclass(frozen=True)
class Shares:
    """What touches say beside what was known: how the unknowns of the full run and the share of each part are distributed."""

    names: tuple[str, ...]  # of the parts
    mean: Array  # (p + 1 + g,) deviations of the unknowns from the full run, K that all axes have grown as by, shares
    root: Array  # (p + 1 + g, k) of their covariance
    coefficients: int
    p_value: float  # of the touches' differences from what any share and any such machine predict
    off: tuple[tuple[int, float], ...]  # numbers of touches that fit least, standard deviations
    evidence: float  # twice the logarithm of how likely these touches are, but for what every fit of them has in common

    @property
    def share(self) -> Array:
        """→ (g,)."""
        return self.mean[-len(self.names) :]

    @property
    def std(self) -> Array:
        """→ (g,) standard deviations of the shares."""
        return np.sqrt(np.sum(self.root[-len(self.names) :] ** 2, axis=1))

    @property
    def covariance(self) -> Array:
        """→ (g, g) of the shares."""
        own = self.root[-len(self.names) :]
        return np.asarray(own @ own.T)

    @property
    def grown(self) -> tuple[float, float]:
        """→ K that all axes have grown as by, its standard deviation."""
        at = self.coefficients
        return float(self.mean[at]), float(np.sqrt(np.sum(self.root[at] ** 2)))

    def draws(self, count: int, seed: int = 1) -> tuple[Array, Array]:
        """n → (p + 1, n) deviations of the unknowns and K that all axes have grown as by, (g, n) shares."""
        normal = np.random.default_rng(seed).normal(size=(self.root.shape[1], count))
        drawn = self.mean[:, None] + self.root @ normal
        return drawn[: -len(self.names)], drawn[-len(self.names) :]


@dataclass(frozen=True)
class System:
    """Rows of touches, and the root of what is known before them: unknowns of the full run, what is new in each run, shares."""

    rows: Array  # (n, q) mm per unit
    root: Array  # (q, q)
    mean: Array  # (q,)
    gaps: Array  # (n,) mm at the estimate of the full run
    places: int  # (p) unknowns of the full run, the first ones; then come K that all axes have grown as by
    parts: int  # (g), the last ones


def system(
    before: Before,
    touches: Touches,
    parts: Sequence[Part],
    shifted: Array | None = None,
    certain: Collection[str] = (),
    absent: Collection[str] = (),
    start: Array | None = None,
) -> System:
    """what was known, touches of a check, parts of the compensation, (n,) mm that gaps differ by for certain → system.

    `certain`, `absent`: names of parts that are taken to be in the control, and not to be in it. `start`: deviations of what no
    share is, where gaps are linear over what is left; None: none.
    """
    model = before.result.model
    own = Model(touches, (*model.coefficients, *_placed(model)))
    place = {name: j for j, name in enumerate(model.names)}
    new = [name for name in own.names if name not in place]
    p = len(place)
    columns = {name: j for j, name in enumerate((*model.names, GROWTH, *new))}
    mine = [columns[name] for name in own.names]
    off = np.zeros(len(mine)) if start is None else start[mine]
    at = np.array([before.result.values[place[name]] if name in place else 0.0 for name in own.names]) + off
    gaps, jacobian = linearise(own, at)
    gaps = gaps - jacobian @ off
    acts = [np.sum(part.moved(Poses(touches)) * touches.normal, axis=1) for part in parts]
    rows = np.zeros((len(touches), len(columns)))
    rows[:, mine] = jacobian
    rows[:, p] = np.sum(growth(Poses(touches)) * touches.normal, axis=1)
    rows = np.hstack([rows, -np.ones((len(touches), 1)), -np.array(acts).reshape(len(parts), -1).T])
    covariance = np.zeros((rows.shape[1],) * 2)
    covariance[:p, :p] = before.result.covariance
    moved = wander(before)
    covariance[np.arange(p), np.arange(p)] += moved**2
    q = len(columns)
    covariance[p, p] = before.grown**2
    units = {name: TABLE if name[1] in "XYZ" else TURN for name in PLACEMENT}
    covariance[np.arange(p + 1, q), np.arange(p + 1, q)] = np.array([units.get(name, NEW) for name in new]) ** 2
    covariance[q, q] = (SAME if before.same_stylus else RADIUS) ** 2
    last = np.arange(q + 1, rows.shape[1])
    there, away = (np.array([part.name in names for part in parts], dtype=np.bool_) for names in (certain, absent))
    covariance[last, last] = np.where(there | away, CERTAIN, SPREAD) ** 2
    mean = np.zeros(rows.shape[1])
    mean[last] = np.where(there, 1.0, np.where(away, 0.0, SHARE))
    return System(rows, _root(covariance), mean, gaps if shifted is None else gaps - shifted, p, len(parts))


def growth(at: Poses) -> Array:
    """poses → (n, 3) mm of tip error of a machine whose linear axes have all grown as by 1 K."""
    parts = [at.slots[c.slot] * c.regressor(at.touches)[:, None] for c in scales(at.machine)]
    return np.asarray(GROWS * sum(parts, np.zeros((len(at), 3))))


def _placed(model: Model) -> list[Coefficient]:
    """model of the full run → where the table stands that was set up anew; nothing where the model has it."""
    known = {c.name for c in model.coefficients}
    return [setup_coefficient(name) for name in PLACEMENT if name not in known]


def wander(before: Before) -> Array:
    """→ (p,) standard deviations by which the unknowns of the full run may be others now, in their units.

    Axis locations, gains and backlashes as the nights take them; of an error motion, what it does to the touches.
    """
    model = before.result.model
    days = before.moves * float(np.sqrt(np.clip(before.days, LEAST_DAYS, MOST_DAYS)))
    size = np.sqrt(np.mean(before.result.jacobian[: len(model.touches)] ** 2, axis=0))
    found = np.full(len(model.names), FACET)
    for j, c in enumerate(model.coefficients):
        if c.slot.stage == "stylus":
            found[j] = STYLUS if not before.same_stylus else LONGER if c.name == ALONG else SAME
        elif c.name in PLACEMENT:
            found[j] = TABLE if c.unit == "mm" else TURN
        elif not posed(c, model.touches):
            found[j] = RUN / max(size[j], 1e-9)
        else:
            kind = family(c.slot.axis, c.name, c.unit)
            wanders = days * WANDER[kind]
            wanders = min(wanders, CALM * days / max(size[j], 1e-9)) if c.unit not in ("mm", "rad") else wanders
            warms = {"location": WARM["mm"], "angle": WARM["rad"], "gain": APART}.get(kind, 0.0)
            warms = min(warms, BENDS / max(size[j], 1e-9)) if kind == "gain" and c.name not in SCALES else warms
            found[j] = np.hypot(wanders, before.warmer * warms)
    return found


def _root(covariance: Array) -> Array:
    scale = np.sqrt(np.clip(np.diag(covariance), 1e-30, None))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.clip(values, 0.0, None)))


def foreseen(before: Before, touches: Touches, parts: Sequence[Part]) -> Array:
    """what was known, touches, parts → (g, g) covariance of the shares after such touches, whatever they find."""
    ready = system(before, touches, parts)
    white = ready.rows @ ready.root / before.sigma
    own = ready.root[-len(parts) :]
    return np.asarray(own @ np.linalg.solve(np.eye(white.shape[1]) + white.T @ white, own.T))


def shares(
    before: Before,
    touches: Touches,
    parts: Sequence[Part],
    shifted: Array | None = None,
    certain: Collection[str] = (),
    absent: Collection[str] = (),
) -> Shares:
    """as `system` → the shares.

    A ball is round: with a stylus or table that is elsewhere by a millimeter it is touched at another place, so what is far from
    the full run is found in several steps.
    """
    start: Array | None = None
    for _ in range(STEPS):
        ready = system(before, touches, parts, shifted, certain, absent, start)
        white = ready.rows @ ready.root / before.sigma
        value = -(ready.gaps + ready.rows @ ready.mean) / before.sigma
        inner = linalg.cholesky(np.eye(white.shape[1]) + white.T @ white, lower=True)
        change = linalg.cho_solve((inner, True), white.T @ value)
        mean = ready.mean + ready.root @ change
        found = mean[: len(mean) - ready.parts - 1]
        step = found if start is None else found - start
        if np.abs(ready.rows[:, : len(step)] @ step).max() < LINEAR:
            break
        start = found
    root = ready.root @ linalg.solve_triangular(inner, np.eye(len(inner)), lower=True).T
    left = value - white @ change
    statistic = float(left @ left + change @ change)
    size = np.linalg.svd(white, compute_uv=False)
    told = float(np.sum(size**2 > WIDELY**2))
    chance = float(special.chdtrc(max(len(value) - told, 1.0), statistic))
    lever = np.sum(linalg.solve_triangular(inner, white.T, lower=True) ** 2, axis=0)
    off = np.abs(left) / np.sqrt(np.clip(1 - lever, 1e-3, None))
    worst = np.argsort(-off)[:3]
    evidence = -statistic - 2 * float(np.sum(np.log(np.diag(inner))))
    keep = np.r_[0 : ready.places + 1, len(mean) - ready.parts : len(mean)]
    numbers = tuple((int(touches.number[i]), float(off[i])) for i in worst)
    return Shares(tuple(part.name for part in parts), mean[keep], root[keep], ready.places, chance, numbers, evidence)


def acting(share: Array, covariance: Array, margin: float) -> list[bool | None]:
    """(k,) shares, (k, k) covariance, least difference of squared distances → of each part whether it acts; None: not decided.

    A part is in the control whole, not at all, or with the wrong sign; all such states of all parts together are compared. Two
    parts that touches can hardly separate may still not be missing, neither alone nor both.
    """
    result: list[bool | None] = [None] * len(share)
    most = np.argsort(-np.diag(covariance))[:TOGETHER]
    precision = np.linalg.inv(covariance[np.ix_(most, most)])
    states = np.array(list(itertools.product((1.0, 0.0, -1.0) if len(most) < 5 else (1.0, 0.0), repeat=len(most))))
    off = share[most] - states
    distance = np.einsum("nk,kl,nl->n", off, precision, off)
    for column, part in enumerate(most):
        there = distance[states[:, column] == 1.0].min() - distance[states[:, column] != 1.0].min()
        result[int(part)] = None if abs(there) <= margin else bool(there < 0)
    for part in set(range(len(share))) - set(most.tolist()):
        away, near = (float((share[part] - at) ** 2 / covariance[part, part]) for at in (0.0, 1.0))
        result[part] = None if abs(away - near) <= margin else away > near
    return result


def apart(covariance: Array) -> Array:
    """(k, k) covariance of shares → (k,) standard deviation of telling each from none, alone or with others."""
    result = np.sqrt(np.diag(covariance))
    if not len(result):
        return result
    most = np.argsort(-np.diag(covariance))[:TOGETHER]
    precision = np.linalg.inv(covariance[np.ix_(most, most)])
    missing = np.array(list(itertools.product((0.0, 1.0), repeat=len(most))))[1:]
    size = np.einsum("nk,kl,nl->n", missing, precision, missing)
    for column, part in enumerate(most):
        result[part] = size[missing[:, column] == 1.0].min() ** -0.5
    return np.asarray(result)
