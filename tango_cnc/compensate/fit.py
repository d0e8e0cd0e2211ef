"""Estimate, what a control can hold → the numbers that leave least error of the tool tip, and what they leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from .. import kinematics
from ..estimate import Estimate
from ..iso230.poses import at_poses, steady
from ..model import Model, errors
from ..records import Array, Machine, TangoError
from ..terms import Coefficient
from ..touches import Touches
from .space import LONGER, REACH, Held, Poses, direction_matrix, matrix

DRAWS = 1000
PROBABILITY = 0.95
EXACT, NONE = 0.995, 0.02  # share of a coefficient's effect on the tip that counts as held exactly, as not held
WORTH = 2e-3  # mm rms over the volume that a mm of correction is to take away: less is not worth a larger number
WIDTHS = np.geomspace(1e-4, 1e8, 481)  # variances that the prior of a direction may have, in units of its scatter
DEGREE = 6  # of the smooth functions of a table
Solve = Callable[[Array], Array]


@dataclass(frozen=True)
class Figure:
    """A number of µm with the interval that holds it with `PROBABILITY`."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Known:
    """The part of an estimate that depends on the pose alone: coefficients, values, covariance."""

    coefficients: tuple[Coefficient, ...]
    values: Array  # (p,)
    covariance: Array  # (p, p)

    def acting(self, touches: Touches, values: Array | None = None) -> dict[kinematics.Slot, Array]:
        """touches → error at every slot."""
        return errors(Model(touches, self.coefficients), self.values if values is None else values)

    def error(self, poses: Poses) -> Array:
        """poses → (n, 3) mm, actual minus nominal tip."""
        return np.asarray(kinematics.tip(poses.touches.chain, poses.touches.position, self.acting(poses.touches)) - poses.nominal)

    def levers(self, poses: Poses, *, still: bool = False) -> Array:
        """poses → (3n, p) mm per unit of every coefficient; `still`: without what depends on the last motion."""
        touches = at_poses(poses.machine, poses.touches.position, 0 * poses.touches.direction) if still else poses.touches
        return np.stack([(poses.slots[c.slot] * c.regressor(touches)[:, None]).ravel() for c in self.coefficients], axis=1)

    def reversal(self, poses: Poses) -> Array:
        """poses → (3n, p) mm per unit of every coefficient: what depends on the last motion alone."""
        return self.levers(poses) - self.levers(poses, still=True)

    @cached_property
    def root(self) -> Array:
        """→ (p, p) r with r rᵀ = covariance."""
        values, vectors = np.linalg.eigh(self.covariance)
        return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))

    def draws(self, count: int, seed: int = 1) -> Array:
        """n → (p, n) deviations from the estimate, as uncertain as it is."""
        return np.asarray(self.root @ np.random.default_rng(seed).normal(size=(len(self.values), count)))


def known(result: Estimate, poses: Poses) -> Known:
    """estimate → its part that a control could know. Raises TangoError when it holds no error of the machine."""
    model = result.model
    own = [i for i, c in enumerate(model.coefficients) if _posed(c, poses.touches)]
    if not own:
        raise TangoError(
            "compensate: the estimate contains no error of the machine, so there is nothing to compensate; ask for more terms "
            "(--terms S3), or see with 'tango check' why these touches determine nothing"
        )
    return Known(tuple(model.coefficients[i] for i in own), result.values[own], result.covariance[np.ix_(own, own)])


def _posed(c: Coefficient, touches: Touches) -> bool:
    return c.slot.stage not in ("stylus", "table") and steady(c, touches)


@dataclass(frozen=True)
class Share:
    """How much of one coefficient's effect on the tip a control can hold."""

    name: str
    effect_um: float  # rms over the volume, of the estimated value
    held: float  # 0 … 1
    word: str  # exactly, partly, not at all, set-up


@dataclass(frozen=True)
class Fit:
    """What a control is to hold, and what that leaves; lengths µm over the volume, set-up taken out."""

    held: tuple[Held, ...]
    change: Array  # (h,) mm rad mm/mm, rounded: what is added to the present values
    shares: tuple[Share, ...]
    rms_before: Figure
    rms_after: Figure
    largest_before: Figure  # 95 % of the volume are below
    largest_after: Figure
    rms_holdable: float  # rms of the part of the error that the control can hold
    direction_before: float  # µrad rms, direction of the tool
    direction_after: float
    rms_program: Figure  # with program compensation on top: reversal that the target does not hold, what nobody knows, and rounding
    rounding: float  # µm rms that rounding to the increment costs


def fit(found: Known, held: Sequence[Held], poses: Poses, present: Mapping[str, float], program_increment: float = 0.001) -> Fit:
    """what is known of the machine, what the control can hold, poses, the control's present numbers → the best numbers."""
    error = poses.free(found.error(poses).reshape(-1, 1))[:, 0]
    levers = poses.free(found.levers(poses))
    space = matrix(held, poses)
    weight = np.array([1.0 if h.kind == "length" else 1 / REACH for h in held])
    basis = smooth(held, poses.machine) * weight[:, None]
    solve = _ridge(space @ basis)
    direct = by_name(found, held, poses)
    # What the target takes away of every coefficient: by name first, the rest by fitted shapes.
    taken = space @ (direct + basis @ solve(levers - space @ direct))
    start = direct @ found.values
    exact = start + basis @ solve(error - space @ start)
    now = np.array([h.value(present.get(h.place, h.base)) for h in held])
    change = np.array([h.value(h.number(n + c)) - n for h, n, c in zip(held, now, exact, strict=True)])
    rounding = float(rms((space @ (change - exact))[:, None])[0]) if len(held) else 0.0

    nothing = np.zeros_like(taken)
    before = _sizes(_likely(found, levers, nothing))
    after = _sizes(_likely(found, levers - taken, taken) + (space @ (exact - change))[:, None])
    # Programs correct everything but what depends on the last motion; of that the target may have taken its part.
    reversing = np.where(found.reversal(poses).any(axis=0), levers - taken, 0.0)
    turned, left = _directions(found, held, poses, change)
    return Fit(
        tuple(held),
        change,
        _shares(found, levers, taken),
        _interval(_mean(before)),
        _interval(_mean(after)),
        _interval(_most(before)),
        _interval(_most(after)),
        float(rms((space @ exact)[:, None])[0]),
        turned,
        left,
        _program(_sizes(_likely(found, reversing, levers - reversing)), program_increment),
        rounding,
    )


def _likely(found: Known, left: Array, gone: Array) -> Array:
    """(3n, p) what a target leaves and what it takes of every coefficient → (3n, m) draws of the error that is truly left.

    What is taken was estimated, so its scatter stays; what is left was estimated, too, and its scatter makes it look larger than it
    is. In directions in which an estimate is no more than its own scatter it is therefore drawn towards zero. How far, the estimate
    itself cannot say for certain: a width that is calculated from it promises too much where it is one to three times its scatter.
    So the width is drawn, too. The prior is the Cauchy distribution as wide as the scatter (Jeffreys 1961, Theory of Probability,
    5.2): normal, with a variance of inverse gamma distribution.
    """
    root = found.root
    _, _, turn = np.linalg.svd(left @ root, full_matrices=False)
    way = root @ turn.T
    std = np.sqrt(np.diag(found.covariance))  # so that mm and rad weigh alike
    seen = np.linalg.lstsq(way / std[:, None], found.values / std, rcond=1e-12)[0]
    rng = np.random.default_rng(1)
    wide = _widths(seen, rng.random((len(seen), DRAWS)))
    kept = wide / (1 + wide)
    drawn = kept * seen[:, None] + np.sqrt(kept) * rng.normal(size=wide.shape)
    return np.asarray(left @ (way @ drawn) + gone @ (way @ (drawn - seen[:, None])))


def _widths(seen: Array, shares: Array) -> Array:
    """(p,) estimates and (p, m) shares 0 … 1 → (p, m) variances of their priors, drawn at these shares; scatter 1.

    Logarithms of the variances are evenly spaced, so that each weighs its density times itself.
    """
    weight = -0.5 * (np.log(WIDTHS * (1 + WIDTHS)) + 1 / WIDTHS + (seen**2)[:, None] / (1 + WIDTHS))
    most = np.cumsum(np.exp(weight - weight.max(axis=1, keepdims=True)), axis=1)
    at = [np.searchsorted(own, share * own[-1]) for own, share in zip(most, shares, strict=True)]
    return np.asarray(WIDTHS[np.minimum(np.array(at, dtype=np.intp).reshape(shares.shape), len(WIDTHS) - 1)])


def _program(sizes: Array, increment: float) -> Figure:
    rounded = 3 * (increment / np.sqrt(12)) ** 2  # three words of a block, each rounded
    return _interval(np.sqrt(np.mean(sizes**2, axis=0) + rounded) * 1e3)


def _sizes(vectors: Array) -> Array:
    """(3n, m) → (n, m) lengths; of more than one column, each at poses drawn anew: a volume is known by some of its poses."""
    sizes = np.linalg.norm(vectors.reshape(-1, 3, vectors.shape[1]), axis=1)
    if sizes.shape[1] == 1:
        return np.asarray(sizes)
    again = np.random.default_rng(2).integers(0, len(sizes), size=sizes.shape)
    # Draw by draw in one piece of memory: several times as fast as across the rows.
    return np.asarray(np.take_along_axis(np.ascontiguousarray(sizes.T), np.ascontiguousarray(again.T), axis=1).T)


def rms(vectors: Array) -> Array:
    """(3n, m) mm → (m,) µm, root mean square of the lengths of n vectors."""
    return _mean(_sizes(vectors))


def _mean(sizes: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(sizes**2, axis=0)) * 1e3)


def intervals(vectors: Array) -> Figure:
    """(3n, m) mm, m draws of an error → its rms with interval, µm."""
    return _interval(rms(vectors))


def _most(sizes: Array) -> Array:
    return np.asarray(np.quantile(sizes, 0.95, axis=0) * 1e3)


def _interval(draws: Array) -> Figure:
    low, middle, high = np.quantile(draws, [(1 - PROBABILITY) / 2, 0.5, (1 + PROBABILITY) / 2])
    return Figure(float(middle), float(low), float(high))


def smooth(held: Sequence[Held], machine: Machine) -> Array:
    """→ (h, b) directions in which numbers are fitted: a table as smooth functions of its axis, everything else by itself.

    Points fitted one by one would follow what the target cannot hold wherever poses happen to lie. Local shapes that are known
    by name are in the tables already, before anything is fitted.
    """
    columns = []
    tables: dict[tuple[str, int], list[int]] = {}
    for j, h in enumerate(held):
        if h.at is None:
            columns.append(np.eye(len(held))[j])
        elif not h.turns:  # a table of a rotary axis holds what is its own: to hide a shift it would turn the workpiece
            tables.setdefault((h.table, h.sense), []).append(j)
    for rows in tables.values():
        at = np.array([held[j].at for j in rows], dtype=float)
        width = float(np.ptp(at)) or 1.0
        shapes = list(np.polynomial.legendre.legvander(2 * (at - at.min()) / width - 1, min(DEGREE, len(at) - 1)).T)
        if held[rows[0]].axis in machine.rotary and len(at) > 2 * DEGREE:
            shapes += [f(k * at) for k in (1, 2) for f in (np.cos, np.sin)]
        for shape in shapes:
            column = np.zeros(len(held))
            column[rows] = shape
            columns.append(column)
    return np.array(columns).T.reshape(len(held), -1)


def _ridge(space: Array) -> Solve:
    """(3n, b) → function: (3n,) or (3n, m) → least-squares coefficients; a mm of them has to gain more than `WORTH`."""
    normal = space.T @ space
    factor = linalg.cho_factor(normal + len(space) / 3 * WORTH**2 * np.eye(len(normal)))

    def solve(right: Array) -> Array:
        return np.asarray(linalg.cho_solve(factor, space.T @ right))

    return solve


def by_name(found: Known, held: Sequence[Held], poses: Poses) -> Array:
    """→ (h, p): entries that stand for an error of the model by name take it over at their own place, per unit of coefficient."""
    names = [c.name for c in found.coefficients]
    result = np.zeros((len(held), len(names)))
    for j, h in enumerate(held):
        if h.coefficient in names:
            result[j, names.index(h.coefficient)] = 1.0
    rows = [j for j, h in enumerate(held) if h.slot is not None]
    if not rows:
        return result
    machine = poses.machine
    middle = np.median(poses.touches.position, axis=0)
    position = np.tile(middle, (2 * len(rows), 1))
    position[len(rows) :] += 0.37  # another pose: what depends on other axes than its own cannot be tabulated
    direction = np.zeros_like(position)
    for i, j in enumerate(rows):
        h = held[j]
        if h.axis is not None:
            position[[i, i + len(rows)], machine.column(h.axis)] = h.at
            direction[[i, i + len(rows)], machine.column(h.axis)] = h.sense
    at = at_poses(machine, position, direction)
    for k, c in enumerate(found.coefficients):
        own = c.regressor(at)
        for i, j in enumerate(rows):
            if held[j].slot == c.slot and abs(own[i] - own[i + len(rows)]) <= 1e-12 + 1e-9 * abs(own[i]):
                result[j, k] = own[i]
    return result


def _shares(found: Known, levers: Array, taken: Array) -> tuple[Share, ...]:
    left = levers - taken
    result = []
    whole = np.sqrt(np.sum(levers**2, axis=0))
    rest = np.sqrt(np.sum(left**2, axis=0))
    strongest = float(np.max(np.abs(found.values) * whole, initial=0.0))
    count = len(levers) / 3
    for c, value, w, r in zip(found.coefficients, found.values, whole, rest, strict=True):
        effect = abs(float(value)) * float(w) / np.sqrt(count) * 1e3
        held = 1.0 - float(r / w) if w > 0 else 1.0
        word = "exactly" if held >= EXACT else "not at all" if held <= NONE else "partly"
        if abs(value) * w <= 1e-9 * max(strongest, 1e-12) or w <= 1e-9:
            word = "set-up"
        result.append(Share(c.name, effect, max(0.0, held), word))
    return tuple(result)


def _directions(found: Known, held: Sequence[Held], poses: Poses, change: Array) -> tuple[float, float]:
    """→ µrad rms of the tool's direction against the table, before and after."""
    error = ((found.error(poses.longer) - found.error(poses)) / LONGER).ravel()
    turned = error - direction_matrix(held, poses) @ change

    def size(v: Array) -> float:
        # The workpiece may be set up turned: the best turn of it is taken out, as the set-up of the tip is.
        spindle = kinematics.spindle_axis(poses.touches.chain, poses.touches.position)
        turns = np.stack([np.cross(e, spindle).ravel() for e in np.eye(3)], axis=1)
        best = v - turns @ np.linalg.lstsq(turns, v, rcond=None)[0]
        return float(np.sqrt(np.sum(best**2) / len(poses)) * 1e6)

    return size(error), size(turned)
