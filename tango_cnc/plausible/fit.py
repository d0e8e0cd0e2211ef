"""How well a cell explains readings when everything keeps to what was known before: a robust fit with priors.

Each unknown (axis locations, scales, backlashes, stylus, facets, balls) has a normal prior of a quarter of its tolerance; each gap
and each distance beside the nominal contact counts with a Cauchy loss, so that a mistake in one facet or one indexation costs what
its touches cost and spoils nothing else (Student's t with one degree of freedom; Lange, Little, Taylor 1989). The start is the
cell as it is stated, where a right cell leaves less than its tolerances: no subset of touches has to be drawn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from .. import kinematics
from ..kinematics import Slot
from ..model import gap, setup_coefficient
from ..records import Array, Artefact, Machine, Readings
from ..touches import Touches, from_readings

STAGES = (0.5, 0.1, 0.03)  # mm: scales of the loss on the way to the final one
SPREAD = 4.0  # times what half of the touches are off: with it nearly all of them count
NARROW = 2.0  # mm: down to this the scale is halved before the first stage
STEPS = 12
ROUNDING = 1e-12  # of each element of the diagonal: touches that are all alike leave a matrix that rounding makes indefinite
BESIDE = 2.0  # mm: scale of the loss for touches beside their nominal contact
FREE = 1e4  # mm or rad: prior of an unknown that is given up
MOST = 0.9  # of the touches, that have to fit
WITHIN = 1.645  # standard deviations within which nine of ten are
ROUNDS = 6  # of linearising anew: a zero that is 5 mm off goes far round a ball
STRAIGHT = 0.01  # mm: after steps that move no touch by more than this the derivatives are the same
PRIOR = 4.0  # standard deviations of the prior that make a tolerance


@dataclass(frozen=True)
class Unknown:
    """One column: where it acts, with which regressor, and what is known of it before."""

    name: str
    prior: float  # one standard deviation, mm, rad or mm/mm


@dataclass(frozen=True)
class Explained:
    """What a cell leaves unexplained; `cost` is minus the logarithm of its likelihood but for a constant."""

    cost: float
    before: Array  # (n,) mm, gaps as the cell is stated
    gaps: Array  # (n,) mm, gaps after the fit
    beside: Array  # (n,) mm, how far beside the nominal contact the tip is, after the fit
    values: Mapping[str, float]

    @cached_property
    def size(self) -> float:
        """→ mm, root mean square of gap and way beside it, each at most 1000 mm."""
        return float(np.sqrt(np.mean(np.clip(self.gaps**2, 0, 1e6))))

    @cached_property
    def scatter(self) -> float:
        """→ mm, one standard deviation of nine touches in ten: single wrong touches are no reason to doubt the rest."""
        return float(np.quantile(np.abs(self.gaps), MOST) / WITHIN)

    @cached_property
    def astray(self) -> float:
        """→ mm, root mean square of the way beside the nominal contact: few touches that are far off count as well."""
        return float(np.sqrt(np.mean(self.beside**2)))

    @cached_property
    def away(self) -> float:
        """→ mm, nine touches in ten are nearer to their nominal contact than this, beside the gap."""
        return float(np.quantile(self.beside, MOST))


def unknowns(machine: Machine, touches: Touches, free: Sequence[str]) -> list[Unknown]:
    """machine, touches, names that are given up → unknowns with their priors."""
    known, table = machine.tolerances, touches.artefact.tolerances
    found = []
    for name in machine.rotary:
        own = kinematics.axis_frame(name, machine.axis(name).direction)[1] + 3
        found += [Unknown(f"E{c}0{name}", known.location / PRIOR) for c in "XYZ"]
        found += [Unknown(f"E{'ABC'[i]}0{name}", known.angle / PRIOR) for i in range(3) if i + 3 != own]
        found.append(Unknown(f"E{name}{name}b", known.backlash_angle / PRIOR))
    found += [Unknown(f"E{c}0{name}", known.angle / PRIOR) for name in machine.linear for c in "ABC"]
    found += [Unknown(f"E{name}{name}1", known.scale / PRIOR) for name in machine.linear]
    found += [Unknown(f"E{name}{name}b", known.backlash / PRIOR) for name in machine.linear]
    found += [Unknown(name, known.location / PRIOR) for name in ("EX0S", "EY0S")]
    found += [Unknown(name, known.angle / PRIOR) for name in ("EA0S", "EB0S")]
    found += [Unknown(f"E{c}t{number}", known.stylus / PRIOR) for number in ("", *touches.styli) for c in "XYZ"]
    found += [Unknown(f"EZf{facet}", table.facet / PRIOR) for facet in touches.facets]
    found += [Unknown(f"E{c}ball{ball}", table.ball / PRIOR) for ball in touches.balls for c in "XYZ"]
    names = {u.name for u in found}
    found = [Unknown(u.name, FREE) if u.name in free else u for u in found]
    return found + [Unknown(name, FREE) for name in free if name not in names]


def _slot(name: str, machine: Machine) -> Slot | None:
    if name[2] == "t":
        return setup_coefficient(name).slot
    if len(name) == 4 and name[2] == "0":
        return Slot(name[3], "inter", "XYZABC".index(name[1]))
    if len(name) == 4 and name[1] == name[2] and name[1] in machine.names:
        return Slot(name[1], "motion")
    return None


def _regressor(name: str, touches: Touches) -> Array:
    axis, kind = name[1], name[3:]
    if name[2] == "t":
        return setup_coefficient(name).regressor(touches)
    if len(name) == 4 and axis == name[2]:
        if kind == "b":
            return touches.sign(axis)
        if kind == "1":
            return touches.axis(axis)
    return np.ones(len(touches))


@dataclass(frozen=True)
class Start:
    """Touches of a cell before anything is fitted: hypotheses that change neither cell nor readings share them."""

    touches: Touches

    @cached_property
    def linear(self) -> tuple[Array, Array, Mapping[Slot, Array]]:
        """→ gaps (n,) mm, their gradient (n, 3), how an error at each slot moves the touches (n,) mm/mm or mm/rad."""
        return _levers(self.touches, np.zeros(len(self.touches.facets)), np.zeros((len(self.touches.balls), 3)), {})


def explain(
    machine: Machine,
    artefact: Artefact,
    readings: Readings,
    free: Sequence[str] = (),
    scale: float | None = None,
    start: Start | None = None,
) -> Explained:
    """cell, readings of which rows with status ok count, unknowns given up → what they leave.

    Names in `free` are those of unknowns, `EXw` (placement), `E_zero_X` and `E_zero_B@7` (zero of an axis, mm or rad, always or at
    one indexation, counted from 0), `E_point_BX` (point of an axis, in its frame), `facets@X` (every facet that is not on a ball),
    `radius` (tip), `ballradius@1` and `bar`. `start` is that of the same cell and readings.
    """
    start = start or Start(from_readings(machine, artefact, readings))
    touches = start.touches
    fitted = _Fitted(touches, tuple(unknowns(machine, touches, free)))
    final = scale or _final(machine)
    prior = np.array([u.prior for u in fitted.columns])
    values = np.zeros(len(fitted.columns))
    before = start.linear[0]
    rounds = ROUNDS if free else 2
    for again in range(rounds):
        gaps, jacobian = fitted.linear(values, start.linear if not again else None)
        first = (*(_wide(gaps) if free else ()), *STAGES, final, final)
        old, values = values, _robust(gaps, jacobian, values, prior, first if not again else (final,) * 3)
        if again and np.abs(jacobian @ (values - old)).max(initial=0.0) < STRAIGHT:
            break
    tip = kinematics.tip(touches.chain, touches.position, fitted.acting(values))
    gaps, beside = fitted.left(values, tip)
    bar = fitted.bar(values)
    cost = float(np.log1p((gaps / final) ** 2).sum() + np.log1p((beside / BESIDE) ** 2).sum() / 2 + np.log1p((bar / 0.05) ** 2))
    cost += float(np.sum((values / prior) ** 2) / 2)
    return Explained(cost, before, gaps, beside, {u.name: float(v) for u, v in zip(fitted.columns, values, strict=True)})


def linear(start: Start) -> tuple[Array, Array, float]:
    """start of a cell → gaps (n,) mm as it is stated, derivatives by every unknown times its prior (n, p), scale of the loss."""
    machine = start.touches.machine
    fitted = _Fitted(start.touches, tuple(unknowns(machine, start.touches, ())))
    gaps, jacobian = fitted.linear(np.zeros(len(fitted.columns)), start.linear)
    prior = np.array([u.prior for u in fitted.columns])
    return gaps, jacobian * prior, _final(machine)


def _final(machine: Machine) -> float:
    """machine → mm, scale of the loss at the end."""
    return max(3 * machine.probe.repeatability, 0.004)


def _wide(gaps: Array) -> list[float]:
    """(n,) mm → scales of the loss before the first of the stages, none where touches are near: a narrow loss finds no way from a
    cell that is decimetres off."""
    half = float(np.median(np.abs(gaps)))
    scales = SPREAD * half / 2.0 ** np.arange(STEPS)
    return list(scales[scales > NARROW])


def _places(name: str, machine: Machine) -> list[tuple[Slot, float]]:
    """name of an unknown → where it acts and with which sign. A point that moves shifts what is before and after the motion."""
    if name.startswith("E_point_"):
        axis, component = name[8], "XYZ".index(name[9])
        return [(Slot(axis, "inter", component), 1.0), (Slot(axis, "intra", component), -1.0)]
    slot = _place(name, machine)
    return [] if slot is None else [(slot, 1.0)]


def _place(name: str, machine: Machine) -> Slot | None:
    if name.endswith("w") and len(name) == 3:
        return Slot("w", "table", "XYZABC".index(name[1]))
    return Slot(name[7:8], "motion") if name.startswith("E_zero_") else _slot(name, machine)


def _pattern(name: str, touches: Touches) -> Array:
    if name.startswith("E_zero_"):
        _, _, at = name[7:].partition("@")
        return np.ones(len(touches)) if not at else (touches.indexation == int(at)).astype(float)
    return _regressor(name, touches)


def _levers(
    touches: Touches, offsets: Array, shifts: Array, acting: Mapping[Slot, Array]
) -> tuple[Array, Array, Mapping[Slot, Array]]:
    run = kinematics.trace(touches.chain, touches.position, acting)
    value, gradient = gap(touches, run.tip, offsets, shifts)
    return value, gradient, kinematics.sensitivity(touches.chain, run, gradient).slots


@dataclass(frozen=True)
class _Fitted:
    """Unknowns and touches, and what follows from both whatever the values are: machine, styli, facets, balls, the rest."""

    touches: Touches
    columns: tuple[Unknown, ...]

    @cached_property
    def place(self) -> dict[str, int]:
        return {u.name: j for j, u in enumerate(self.columns)}

    @cached_property
    def first_facet(self) -> int:
        facets = self.touches.facets
        return self.place[f"EZf{facets[0]}"] if facets else 0

    @cached_property
    def first_ball(self) -> int:
        balls = self.touches.balls
        return self.place[f"EXball{balls[0]}"] if balls else 0

    @cached_property
    def places(self) -> list[tuple[int, list[tuple[Slot, float]]]]:
        """→ columns that act somewhere in the chain, and where."""
        found = ((j, _places(u.name, self.touches.machine)) for j, u in enumerate(self.columns))
        return [(j, places) for j, places in found if places]

    @cached_property
    def patterns(self) -> Array:
        """→ (m, n) their regressors, one row each."""
        rows = [_pattern(self.columns[j].name, self.touches) for j, _ in self.places]
        return np.array(rows).reshape(len(rows), len(self.touches))

    @cached_property
    def rest(self) -> list[tuple[int, str]]:
        """→ columns that are neither in the chain nor an offset of one facet or one ball, with their names."""
        away = ("facets@", "radius", "ballradius@")
        return [(j, u.name) for j, u in enumerate(self.columns) if u.name.startswith(away)]

    def acting(self, values: Array) -> dict[Slot, Array]:
        """(p,) → the error at every slot of which something is not zero, (n,) mm or rad."""
        acting: dict[Slot, Array] = {}
        own = values[[j for j, _ in self.places]]
        amounts = own[:, None] * self.patterns
        for value, amount, (_, places) in zip(own, amounts, self.places, strict=True):
            for slot, sign in places if value else ():
                acting[slot] = acting[slot] + sign * amount if slot in acting else sign * amount
        return acting

    def offsets(self, values: Array) -> tuple[Array, Array, Array | float]:
        """(p,) → offsets of facets (F,) mm, shifts of balls (B, 3) mm, by how much the surface is nearer (n,) mm."""
        facets, balls = len(self.touches.facets), len(self.touches.balls)
        offsets = values[self.first_facet : self.first_facet + facets]
        shifts = values[self.first_ball : self.first_ball + 3 * balls].reshape(-1, 3)
        return offsets, shifts, self.nearer(values)

    def nearer(self, values: Array) -> Array | float:
        """(p,) → (n,) mm by which radii and facets that moved together bring the surface nearer."""
        if not self.rest:
            return 0.0
        own = {name: float(values[j]) for j, name in self.rest}
        less = np.full(len(self.touches), own.get("radius", 0.0))
        less = less + np.sum(self.touches.normal * self.together(values), axis=1)
        for i, ball in enumerate(self.touches.balls):
            less[self.touches.ball_index == i] += own.get(f"ballradius@{ball}", 0.0)
        return less

    def together(self, values: Array) -> Array:
        """(p,) → (n, 3) mm that all facets but those on balls are shifted by."""
        own = {name: float(values[j]) for j, name in self.rest}
        return np.where(self.touches.ball_index < 0, 1.0, 0.0)[:, None] * [own.get(f"facets@{c}", 0.0) for c in "XYZ"]

    def linear(self, values: Array, known: tuple[Array, Array, Mapping[Slot, Array]] | None) -> tuple[Array, Array]:
        """(p,), what is known of the cell as it is stated → gaps (n,) mm and their Jacobian (n, p)."""
        touches = self.touches
        offsets, shifts, nearer = self.offsets(values)
        value, gradient, levers = known or _levers(touches, offsets, shifts, self.acting(values))
        columns = np.zeros((len(self.columns), len(touches)))
        for (j, places), pattern in zip(self.places, self.patterns, strict=True):
            (slot, sign), *others = places
            total = sign * levers[slot]
            for slot, sign in others:
                total = total + sign * levers[slot]
            np.multiply(total, pattern, out=columns[j])
        jacobian = columns.T
        row = np.flatnonzero(touches.facet_index >= 0)
        jacobian[row, self.first_facet + touches.facet_index[row]] = -np.sum(gradient[row] * touches.normal[row], axis=1)
        row = np.flatnonzero(touches.ball_index >= 0)
        for i in range(3):
            jacobian[row, self.first_ball + 3 * touches.ball_index[row] + i] = -gradient[row, i]
        for j, name in self.rest:
            if name.startswith("facets@"):
                columns[j] = np.where(touches.ball_index < 0, -touches.normal[:, "XYZ".index(name[7])], 0.0)
            elif name == "radius":
                columns[j] = -1.0
            else:
                columns[j] = np.where(touches.ball_index == touches.balls.index(name[11:]), -1.0, 0.0)
        return value - nearer, jacobian

    def left(self, values: Array, tip: Array) -> tuple[Array, Array]:
        """(p,), (n, 3) mm tip → gaps (n,) mm and how far the tip is beside the nominal contact (n,) mm."""
        touches = self.touches
        offsets, shifts, nearer = self.offsets(values)
        gaps, _ = gap(touches, tip, offsets, shifts)
        away = tip - touches.point - (self.together(values) if self.rest else 0.0) - touches.radius[:, None] * touches.normal
        return gaps - nearer, np.linalg.norm(across(away, touches.normal), axis=1)

    def bar(self, values: Array) -> float:
        """(p,) → mm by which the scale bar disagrees; 0 without one, or when its length is given up."""
        touches = self.touches
        bar = touches.artefact.scale_bar
        if bar is None or not set(bar.balls) <= set(touches.balls) or "bar" in self.place:
            return 0.0
        _, shifts, _ = self.offsets(values)
        one, two = (np.array(touches.artefact.balls[b].centre) + shifts[touches.balls.index(b)] for b in bar.balls)
        return float(np.linalg.norm(one - two)) - bar.length


def across(away: Array, normal: Array) -> Array:
    """(n, 3), (n, 3) unit normals → what is left of the first across the normals."""
    return away - np.sum(away * normal, axis=1)[:, None] * normal


def _robust(gaps: Array, jacobian: Array, start: Array, prior: Array, stages: Sequence[float]) -> Array:
    """gaps at `start`, Jacobian, priors, scales of the loss in turn → unknowns."""
    values, left = start, gaps
    scaled = jacobian * prior
    for scale in stages:
        weight = 1 / (1 + (left / scale) ** 2) * 2 / scale**2
        normal = (scaled.T * weight) @ scaled
        diagonal = np.einsum("ii->i", normal)  # a view
        diagonal += 1.0 + ROUNDING * diagonal  # of each its own: a free angle is no prior of the others
        right = scaled.T @ (weight * left) + values / prior
        root, failed = lapack.dpotrf(normal, clean=False)
        if failed:
            raise linalg.LinAlgError(f"{failed}-th leading minor of the array is not positive definite")
        change = lapack.dpotrs(root, right)[0] * prior
        values = values - change
        left = left - jacobian @ change
    return values
