"""Estimate, what a control can hold → the numbers that leave least error of the tool tip, and what they leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from .. import kinematics
from ..estimate import Estimate
from ..iso230.poses import at_poses, steady
from ..model import Model, errors
from ..records import Array, Machine, TangoError
from ..terms import Coefficient
from ..touches import Touches
from .promise import Figure, likely, mean, most, there, with_programs
from .space import LONGER, REACH, Held, Poses, direction_matrix, matrix
from .unparted import Unparted, Widened, no_less, wider

EXACT, NONE = 0.995, 0.02  # share of a coefficient's effect on the tip that counts as held exactly, as not held
WORTH = 2e-3  # mm rms over the volume that a mm of correction is to take away: less is not worth a larger number
SHOWN = 0.05  # mm at a touch that a mm of a center (or the angle that is as much at `REACH`) has to make for a touch to show it
DEGREE = 4  # of the smooth functions of a table, for what it does not hold by name
Solve = Callable[[Array], Array]


@dataclass(frozen=True)
class Known:
    """The part of an estimate that depends on the pose alone: coefficients, values, covariance."""

    coefficients: tuple[Coefficient, ...]
    values: Array  # (p,)
    covariance: Array  # (p, p)
    freedom: float | None = None  # degrees of freedom of the scatter behind it; None: it is known
    drawn: Array | None = None  # (p, d) deviations of machines that are possible; None: the covariance is all that is known

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

    def doubted(self, sizes: Array) -> Known:
        """(p,) by how much what no touch shows may move each: as likely by any part of it → as uncertain as that."""
        return replace(self, covariance=self.covariance + np.diag(sizes**2 / 3))

    def draws(self, count: int, seed: int = 1) -> Array:
        """n → (p, n) deviations from the estimate, as uncertain as it is."""
        if self.drawn is not None:
            some = np.arange(count) % self.drawn.shape[1]
            return np.asarray(self.drawn[:, some])
        return np.asarray(self.root @ np.random.default_rng(seed).normal(size=(len(self.values), count)))


def known(result: Estimate, poses: Poses, command: str = "compensate", so: str = "there is nothing to compensate") -> Known:
    """estimate → its part that a control could know. Raises TangoError, by the command, when it holds no error of the machine."""
    model = result.model
    own = [i for i, c in enumerate(model.coefficients) if posed(c, poses.touches)]
    if not own:
        raise TangoError(result.selection.without_machine(command, so))
    return Known(
        tuple(model.coefficients[i] for i in own), result.values[own], result.covariance[np.ix_(own, own)], max(result.dof, 1)
    )


def posed(c: Coefficient, touches: Touches) -> bool:
    """coefficient, poses → whether it is an error of the machine that depends on the pose alone."""
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
    widened: Widened | None = None  # where touches took the place of the spindle for the stylus' own: what is promised then

    @property
    def promised(self) -> Fit | Widened:
        """→ the figures that are promised; those of the fit itself are what its touches can see."""
        return self if self.widened is None else self.widened


@dataclass(frozen=True)
class Holding:
    """What a control can hold of the errors that a model has, over poses, set-up taken out; whatever their sizes are."""

    held: tuple[Held, ...]
    poses: Poses
    levers: Array  # (3n, p) mm per unit of every coefficient
    taken: Array  # (3n, p) mm of them that the control takes away
    reversal: NDArray[np.bool_]  # (p,) whether a coefficient depends on the last motion
    space: Array  # (3n, h) mm that a unit of every number takes away
    best: Array  # (h, p) numbers per unit of every coefficient
    pinned: NDArray[np.bool_]  # (h,) which keep their present value, as no touch shows them
    lost: Array | None = None  # (3n,) mm that the files take away less than their numbers say, without the set-up; None: not known

    def numbers(self, found: Known, present: Mapping[str, float], unseen: Array | None = None) -> tuple[Array, Array]:
        """what is known, the control's present numbers → (h,) best changes, exact and as the control can store them.

        `unseen`: (h,) what the control takes away already and the readings do not contain.
        """
        exact = self.best @ found.values
        if unseen is not None:
            exact = np.where(self.pinned, 0.0, exact - unseen)
        now = np.array([h.value(present.get(h.place, h.base)) for h in self.held])
        stored = [h.value(h.number(n + c)) - n for h, n, c in zip(self.held, now, exact, strict=True)]
        return exact, np.where(self.pinned, 0.0, stored)

    def now(self, found: Known, unseen: Array | None = None, spindle: Unparted | None = None) -> Array:
        """what is known, (h,) what the control takes away unseen → (k, m, n) mm, draws of the error as it is now.

        `spindle`: its place, where that is not known.
        """
        gone = None if unseen is None else self.space @ unseen
        return there(*_beside(found, self.levers, spindle), gone, found.freedom)

    def left(self, found: Known, rounded: Array, spindle: Unparted | None = None) -> Array:
        """what is known, (h,) what rounding takes off the numbers → (k, m, n) mm, draws of what is truly left."""
        rest = self.space @ rounded
        return self._stays(found, self.levers - self.taken, rest if self.lost is None else rest + self.lost, spindle)

    def by_program(self, found: Known, spindle: Unparted | None = None) -> Array:
        """what is known → (k, m, n) mm, draws of what programs leave that are compensated as well: they correct everything but
        what depends on the last motion. Of that the target may have taken its part."""
        return self._stays(found, np.where(self.reversal, self.levers - self.taken, 0.0), None, spindle)

    def _stays(self, found: Known, part: Array, rest: Array | None, spindle: Unparted | None) -> Array:
        stays = part if spindle is None else np.hstack([part, spindle.levers])
        values, covariance, levers = _beside(found, self.levers, spindle)
        return likely(values, covariance, levers, stays, rest, found.freedom)


def _beside(found: Known, levers: Array, spindle: Unparted | None) -> tuple[Array, Array, Array]:
    own = (found.values, found.covariance, levers)
    return own if spindle is None else spindle.with_own(*own)


def holding(found: Known, held: Sequence[Held], poses: Poses, touches: Touches | None = None) -> Holding:
    """coefficients of an estimate, what the control can hold, poses → what that is worth, before any size is known.

    `touches`: those of the estimate, where centers and directions that they do not show are to keep their values.
    """
    pinned = np.zeros(len(held), dtype=np.bool_) if touches is None else not_shown(held, Poses(touches))
    levers = poses.free(found.levers(poses))
    space = matrix(held, poses)
    weight = np.array([1.0 if h.kind == "length" else 1 / REACH for h in held])
    gauge = anchored(held)
    basis = gauge @ smooth(held, poses.machine) * weight[:, None]
    direct = gauge @ by_name(found, held, poses)
    basis[pinned] = direct[pinned] = 0.0
    # What the target takes away of every coefficient: by name first, the rest by fitted shapes where that is worth it. A fit of
    # what the target cannot hold finds a little of it in any table, and writes numbers that help nobody.
    rest = levers - space @ direct
    fitted = basis @ _ridge(space @ basis)(rest)
    gain = _size(rest) - _size(rest - space @ fitted)
    best = direct + np.where(gain > NONE * _size(levers), fitted, 0.0)
    reversing = np.asarray(found.reversal(poses).any(axis=0))
    return Holding(tuple(held), poses, levers, space @ best, reversing, space, best, pinned)


def fit(
    found: Known,
    holds: Holding,
    present: Mapping[str, float],
    program_increment: float = 0.0001,
    unseen: Array | None = None,
    spindle: Unparted | None = None,
    doubts: Array | None = None,
) -> Fit:
    """what is known of the machine, what the control can hold, the control's present numbers → the best numbers.

    `unseen`: (h,) what the control takes away already and the readings do not contain. `spindle`: its place, where no touch parts
    that from the runout of the stylus. `doubts`: (p,) by how much what no touch shows may move each coefficient.
    """
    exact, change = holds.numbers(found, present, unseen)
    levers, taken = holds.levers, holds.taken
    before = holds.now(found, unseen)
    after = holds.left(found, exact - change)
    programs = holds.by_program(found)
    turned, left = _directions(found, holds.held, holds.poses, change)
    best = Fit(
        holds.held,
        change,
        _shares(found, levers, taken),
        mean(before),
        mean(after),
        most(before),
        most(after),
        rms(holds.space @ exact),
        turned,
        left,
        with_programs(programs, program_increment),
        rms(holds.space @ (change - exact)),
    )
    unsure = doubts is not None and bool(doubts.any())
    if spindle is None and not unsure:
        return best
    more, both = (found.doubted(doubts) if doubts is not None and unsure else found), no_less if spindle is None else wider
    then, less = holds.now(more, unseen, spindle), holds.left(more, exact - change, spindle)
    widened = Widened(
        both(best.rms_before, mean(then)),
        both(best.rms_after, mean(less)),
        both(best.largest_before, most(then)),
        both(best.largest_after, most(less)),
        both(best.rms_program, with_programs(holds.by_program(more, spindle), program_increment)),
        0.0 if spindle is None else spindle.size,
        tuple(c.name for c, size in zip(found.coefficients, doubts, strict=True) if size) if doubts is not None else (),
    )
    return replace(best, widened=widened)


def covering(best: Fit, holds: Holding, found: Known, present: Mapping[str, float], unseen: Array, other: Array) -> Fit:
    """fit, what the control can hold, what is known, its present numbers, (h,) what it takes away unseen by the answer about tool
    center point control that was given, and by the other one → the same fit, whose promise holds whichever of both is true."""
    exact, change = holds.numbers(found, present, unseen)
    wrong = np.where(holds.pinned, 0.0, unseen - other)
    now, left, seen = holds.now(found, other), holds.left(found, exact - change + wrong), best.promised
    return replace(
        best,
        widened=Widened(
            wider(seen.rms_before, mean(now)),
            wider(seen.rms_after, mean(left)),
            wider(seen.largest_before, most(now)),
            wider(seen.largest_after, most(left)),
            seen.rms_program,
            0.0 if best.widened is None else best.widened.size,
            () if best.widened is None else best.widened.doubted,
            rms(holds.space @ wrong),
        ),
    )


def not_shown(held: Sequence[Held], at: Poses) -> NDArray[np.bool_]:
    """entries, touches → (h,) centers and directions that no touch shows: the axis hardly turned, or the set-up takes them out.

    A number fitted to what others leave would be written there, and act where the axis turns further.
    """
    found = np.zeros(len(held), dtype=np.bool_)
    for j, h in enumerate(held):
        if h.tcp:
            felt = at.free(h.lever(at).reshape(-1, 1))
            found[j] = np.sqrt(np.sum(felt**2) / len(at)) < SHOWN * (1.0 if h.kind == "length" else REACH)
    return found


def _size(columns: Array) -> Array:
    """(3n, p) → (p,) lengths of the columns."""
    return np.asarray(np.linalg.norm(columns, axis=0))


def rms(vectors: Array) -> float:
    """(3n,) mm → µm, root mean square of the lengths of n vectors."""
    return float(np.sqrt(np.mean(np.sum(vectors.reshape(-1, 3) ** 2, axis=1))) * 1e3)


def smooth(held: Sequence[Held], machine: Machine) -> Array:
    """→ (h, b) directions in which numbers are fitted: a table as smooth functions of its axis, everything else by itself.

    Points fitted one by one would follow what the target cannot hold wherever poses happen to lie. Local shapes that are known
    by name are in the tables already, before anything is fitted. So are reversals that depend on the place: of what has no name
    the same goes into both directions of motion, and one number more.
    """
    columns = []
    tables: dict[str, list[int]] = {}
    for j, h in enumerate(held):
        if h.at is None:
            columns.append(np.eye(len(held))[j])
        elif not h.turns:  # a table of a rotary axis holds what is its own: to hide a shift it would turn the workpiece
            tables.setdefault(h.table, []).append(j)
    for rows in tables.values():
        at = np.array([held[j].at for j in rows], dtype=float)
        sense = np.array([held[j].sense for j in rows], dtype=float)
        width, points = float(np.ptp(at)) or 1.0, len(np.unique(at))
        shapes = list(np.polynomial.legendre.legvander(2 * (at - at.min()) / width - 1, min(DEGREE, points - 1)).T)
        if held[rows[0]].axis in machine.rotary and points > 12:
            shapes += [f(k * at) for k in (1, 2) for f in (np.cos, np.sin)]
        if sense.any():
            shapes.append(sense)
        for shape in shapes:
            column = np.zeros(len(held))
            column[rows] = shape
            columns.append(column)
    return np.array(columns).T.reshape(len(held), -1)


def anchored(held: Sequence[Held]) -> Array:
    """→ (h, h): numbers → the same, with tables of lengths that are zero where the axis is that they are read with.

    Where a target has centers, a constant in such a table says the same as another center. Controls that count pitch errors from
    their reference point lose it, and the center with it: so it belongs to the center. Zero is that of machine coordinates, the
    reference point of most machines; a table that does not reach it is zero at the end that is nearer.
    """
    gauge = np.eye(len(held))
    if not any(h.kind == "length" and (h.tcp or (h.at is None and h.slot is not None and h.slot.stage == "inter")) for h in held):
        return gauge
    tables: dict[tuple[str, int], list[int]] = {}
    for j, h in enumerate(held):
        if h.at is not None and h.kind == "length":
            tables.setdefault((h.table, h.sense), []).append(j)
    for rows in tables.values():
        at = np.array([held[j].at for j in rows], dtype=float)
        gauge[np.ix_(rows, rows)] -= [np.interp(0.0, at, each) for each in np.eye(len(rows))]
    return gauge


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
