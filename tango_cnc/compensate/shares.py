"""Of every part of a compensation the share that is in the control, from few touches and all that was known before them.

A short check has fewer touches than its machine has errors. It need not determine those: the full run that the compensation was
made from has done so. What is unknown besides is what may have changed since, and how much of every table is in the control:

    gap = J (x − x₀) + X e − M s + ε,   x ~ N(x₀, P₀ + Q),   e wide,   s ~ N(½, 1)

x₀, P₀: estimate of the full run with its covariance. Q: what a machine moves in the days between, as the nights take it, and where
the stylus is, which may be another one. e: where the table stands, and the radius of the tip. M: what each part does to the gaps.
A table that is not loaded has s = 0, one with the wrong sign −1, one that was entered twice 2.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from ..estimate import Estimate
from ..model import PLACEMENT, Model, linearise
from ..records import Array
from ..state.frame import WANDER, family
from ..touches import Touches
from .fit import posed
from .space import Held, Poses

TOGETHER = 8  # parts whose states are compared together, the least known ones
CERTAIN = 0.01  # standard deviation of a share that is taken for known
SHARE, SPREAD = 0.5, 1.0  # of what is in the control, before a touch: not at all and whole are as likely
LEAST_DAYS, MOST_DAYS = 4.0, 30.0  # that a machine wanders: as far as in four at least, as warmth moves it within one
STYLUS, TABLE, TURN, RADIUS, RUN = 0.2, 1.0, 2e-3, 0.05, 5e-3  # mm, mm, rad, mm, mm: anew in every run
SAME, LONGER = 2e-3, 0.02  # mm: a stylus that stayed in its holder, across and along it, which warmth makes longer
CALM = 1e-4  # mm at a touch by which a gain or an error motion, the shape of a guideway, wanders in a day at most
WIDELY = 30.0  # standard deviations of a touch: a direction that was as uncertain takes a touch, and says nothing of the fit
FACET = 2e-4  # mm: a facet that is cleaned before each run
ALONG = "EZt"  # coefficient: where the stylus is along the spindle
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
    mean: Array  # (p + g,) deviations of the unknowns from the full run, shares
    root: Array  # (p + g, k) of their covariance
    coefficients: int
    p_value: float  # of the touches' differences from what any share and any such machine predict
    off: tuple[tuple[int, float], ...]  # numbers of touches that fit least, standard deviations

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

    def draws(self, count: int, seed: int = 1) -> tuple[Array, Array]:
        """n → (p, n) deviations of the unknowns, (g, n) shares."""
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
    places: int  # (p) unknowns of the full run, the first ones
    parts: int  # (g), the last ones


def system(
    before: Before,
    touches: Touches,
    parts: Sequence[Part],
    shifted: Array | None = None,
    certain: Collection[str] = (),
    absent: Collection[str] = (),
) -> System:
    """what was known, touches of a check, parts of the compensation, (n,) mm that gaps differ by for certain → system.

    `certain`, `absent`: names of parts that are taken to be in the control, and not to be in it.
    """
    model = before.result.model
    own = Model(touches, model.coefficients)
    place = {name: j for j, name in enumerate(model.names)}
    new = [name for name in own.names if name not in place]
    at = np.array([before.result.values[place[name]] if name in place else 0.0 for name in own.names])
    gaps, jacobian = linearise(own, at)
    p, more = len(place), _anew(own)
    acts = [np.sum(part.moved(Poses(touches)) * touches.normal, axis=1) for part in parts]
    columns = {name: j for j, name in enumerate((*model.names, *new))}
    rows = np.zeros((len(touches), len(columns)))
    rows[:, [columns[name] for name in own.names]] = jacobian
    rows = np.hstack([rows, more, -np.array(acts).reshape(len(parts), -1).T])
    covariance = np.zeros((rows.shape[1],) * 2)
    covariance[:p, :p] = before.result.covariance
    wander = _wander(before)
    covariance[np.arange(p), np.arange(p)] += wander**2
    q = len(columns)
    covariance[np.arange(p, q), np.arange(p, q)] = NEW**2
    tip = SAME if before.same_stylus else RADIUS
    wide = np.array([TABLE, TABLE, TABLE, TURN, TURN, TURN, tip])[-more.shape[1] :]
    covariance[np.arange(q, q + len(wide)), np.arange(q, q + len(wide))] = wide**2
    last = np.arange(q + len(wide), rows.shape[1])
    there, away = (np.array([part.name in names for part in parts], dtype=np.bool_) for names in (certain, absent))
    covariance[last, last] = np.where(there | away, CERTAIN, SPREAD) ** 2
    mean = np.zeros(rows.shape[1])
    mean[last] = np.where(there, 1.0, np.where(away, 0.0, SHARE))
    return System(rows, _root(covariance), mean, gaps if shifted is None else gaps - shifted, p, len(parts))


def _anew(own: Model) -> Array:
    """model of a check → (n, 7) what the table does that was set up anew, and another tip; (n, 1) where it has a placement."""
    touches = own.touches
    radius = -np.ones((len(touches), 1))
    if any(c.name in PLACEMENT for c in own.coefficients):
        return radius
    return np.hstack([-touches.normal, -np.cross(touches.point, touches.normal), radius])


def _wander(before: Before) -> Array:
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
            wanders = days * WANDER[family(c.slot.axis, c.name, c.unit)]
            found[j] = min(wanders, CALM * days / max(size[j], 1e-9)) if c.unit not in ("mm", "rad") else wanders
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
    """as `system` → the shares."""
    ready = system(before, touches, parts, shifted, certain, absent)
    white = ready.rows @ ready.root / before.sigma
    value = -(ready.gaps + ready.rows @ ready.mean) / before.sigma
    inner = linalg.cholesky(np.eye(white.shape[1]) + white.T @ white, lower=True)
    change = linalg.cho_solve((inner, True), white.T @ value)
    root = ready.root @ linalg.solve_triangular(inner, np.eye(len(inner)), lower=True).T
    mean = ready.mean + ready.root @ change
    left = value - white @ change
    statistic = float(left @ left + change @ change)
    size = np.linalg.svd(white, compute_uv=False)
    told = float(np.sum(size**2 > WIDELY**2))
    chance = float(special.chdtrc(max(len(value) - told, 1.0), statistic))
    lever = np.sum(linalg.solve_triangular(inner, white.T, lower=True) ** 2, axis=0)
    off = np.abs(left) / np.sqrt(np.clip(1 - lever, 1e-3, None))
    worst = np.argsort(-off)[:3]
    keep = np.r_[0 : ready.places, len(mean) - ready.parts : len(mean)]
    numbers = tuple((int(touches.number[i]), float(off[i])) for i in worst)
    return Shares(tuple(part.name for part in parts), mean[keep], root[keep], ready.places, chance, numbers)


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
