"""Terms and touches → gaps and their exact Jacobian: one touch, one equation.

    r = n · (p_tip(q; E) − P) − r_tip − E_Zf = 0            (design: positive = the ball stands off the surface)

Unknowns in this order: machine coefficients, stylus and table placement, facet offsets, ball centres. Below the touches
stand the few equations that come from elsewhere: calibrated facets and the scale bar, each divided by its uncertainty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import kinematics
from .kinematics import Errors, Slot
from .records import COMPONENTS, Array
from .terms import GAP, Coefficient
from .touches import Touches

STYLUS = ("EXt", "EYt", "EZt")
PLACEMENT = ("EXw", "EYw", "EZw", "EAw", "EBw", "ECw")
RADIUS = Slot("t", "stylus", -1)  # of the tip: it makes every gap of its stylus smaller


def setup_coefficient(name: str) -> Coefficient:
    """`EXt` … `EZt` (stylus tip, spindle frame), `EXw` … `ECw` (placement of a calibrated artefact) → coefficient.

    `EXt2` … `EZt2` are of stylus 2 alone, `EXt` … of all others. `ERt2` is how much larger its tip is than stated, compared with
    that of the first stylus, whose own the facets take up.
    """
    if name[2] == "w":
        component = COMPONENTS.index(name[1])
        unit = "mm" if component < 3 else "rad"
        return Coefficient(name, unit, Slot("w", "table", component), lambda touches: np.ones(len(touches)))
    slot = RADIUS if name[1] == "R" else Slot("t", "stylus", COMPONENTS.index(name[1]))
    if number := name[3:]:
        return Coefficient(name, "mm", slot, lambda touches: touches.by_stylus(int(number)))

    def first(touches: Touches) -> Array:
        others = [touches.by_stylus(s) for s in touches.styli]
        return np.ones(len(touches)) - sum(others)

    return Coefficient(name, "mm", slot, first)


def setup_names(touches: Touches, calibrated: bool) -> list[str]:
    """touches, whether facets are calibrated → names of what is estimated of styli and placement."""
    others = [f"E{c}t{number}" for number in touches.styli for c in "XYZR"]
    return [*STYLUS, *others, *(PLACEMENT if calibrated else ())]


@dataclass(frozen=True)
class Model:
    """What is estimated (`coefficients`, the setup among them, last) from which touches."""

    touches: Touches
    coefficients: tuple[Coefficient, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """→ (p,) names of the unknowns."""
        balls = [f"E{c}ball{ball}" for ball in self.touches.balls for c in "XYZ"]
        return (*(c.name for c in self.coefficients), *(f"EZf{f}" for f in self.touches.facets), *balls)

    @cached_property
    def regressors(self) -> Array:
        """→ (c, n) one row a coefficient."""
        rows = [c.regressor(self.touches) for c in self.coefficients]
        return np.array(rows).reshape(len(rows), len(self.touches))

    @cached_property
    def slots(self) -> dict[Slot, list[int]]:
        """→ slot: rows of `regressors` that act there."""
        found: dict[Slot, list[int]] = {}
        for i, c in enumerate(self.coefficients):
            found.setdefault(c.slot, []).append(i)
        return found

    @cached_property
    def by_slot(self) -> tuple[NDArray[np.int64], Array, NDArray[np.int64], NDArray[np.int64]]:
        """→ coefficients sorted by slot, their regressors, where each slot begins among them; (c,) slot of each coefficient."""
        rows = list(self.slots.values())
        order = np.array([i for own in rows for i in own], dtype=np.int64)
        begin = np.cumsum([0, *(len(own) for own in rows[:-1])])
        slot = np.empty(len(order), dtype=np.int64)
        slot[order] = np.repeat(np.arange(len(rows)), [len(own) for own in rows])
        return order, self.regressors[order], begin, slot

    @cached_property
    def bar(self) -> tuple[int, int] | None:
        """→ places in `touches.balls` of the two balls of the scale bar, None when it was not touched whole."""
        bar = self.touches.artefact.scale_bar
        if bar is None or not set(bar.balls) <= set(self.touches.balls):
            return None
        return self.touches.balls.index(bar.balls[0]), self.touches.balls.index(bar.balls[1])

    @cached_property
    def calibrated(self) -> tuple[tuple[int, float], ...]:
        """→ (place in `touches.facets`, uncertainty in mm) of every calibrated facet."""
        facets = self.touches.artefact.facets
        return tuple((i, u) for i, f in enumerate(self.touches.facets) if (u := facets[f].uncertainty) is not None)

    def split(self, values: Array) -> tuple[Array, Array, Array]:
        """(..., p) → coefficients (..., c), facet offsets (..., F) mm, ball shifts (..., B, 3) mm."""
        c, f = len(self.coefficients), len(self.touches.facets)
        return values[..., :c], values[..., c : c + f], values[..., c + f :].reshape(*values.shape[:-1], -1, 3)


def errors(model: Model, values: Array) -> dict[Slot, Array]:
    """model, (..., c) coefficients → the error at every slot for every touch, (..., n) mm or rad."""
    if not model.slots:
        return {}
    order, regressors, begin, _ = model.by_slot
    acting = np.add.reduceat(values[..., order, None] * regressors, begin, axis=-2)
    return {slot: acting[..., i, :] for i, slot in enumerate(model.slots)}


def gap(touches: Touches, tip: Array, offsets: Array, shifts: Array) -> tuple[Array, Array]:
    """tip (..., n, 3), facet offsets (..., F), ball shifts (..., B, 3) → gap (..., n) mm, its gradient by the tip (..., n, 3).

    Planes: model.md eq. r. Balls, cylinders and spheres: signed distance to the surface, so that a touch beside the nominal
    point is not taken for a form error (the cosine error, left as future work in the thesis).
    """
    radius = touches.radius
    away = tip - touches.point
    value = np.einsum("...i,...i", away, touches.normal) - radius  # a sum over so short an axis takes several times as long
    on_facet = touches.facet_index >= 0
    value = value - np.where(on_facet, offsets[..., touches.facet_index], 0.0) if offsets.shape[-1] else value
    gradient = np.broadcast_to(touches.normal, tip.shape)
    curved = touches.curved
    if curved is None:
        return value, gradient
    rows, centre, curvature_radius, axis, side = curved
    n = touches.normal[rows]
    moved = np.zeros((*tip.shape[:-2], len(rows), 3))
    if offsets.shape[-1]:
        own = touches.facet_index[rows]
        moved = moved + np.where(own >= 0, offsets[..., own], 0.0)[..., None] * n
    if shifts.shape[-2]:
        own = touches.ball_index[rows]
        moved = moved + np.where((own >= 0)[:, None], shifts[..., own, :], 0.0)
    spoke = tip[..., rows, :] - centre - moved
    spoke = spoke - np.einsum("...i,...i", spoke, axis)[..., None] * axis
    distance = np.sqrt(np.einsum("...i,...i", spoke, spoke))  # not a norm: complex errors must stay analytic
    value = np.array(value)
    gradient = np.array(gradient, dtype=spoke.dtype)
    value[..., rows] = side * (distance - curvature_radius) - radius[rows]
    gone = distance == 0.0  # on the centre every way leads to the surface: taken is the one that was to be touched
    gradient[..., rows, :] = np.where(gone[..., None], n, (side / np.where(gone, 1.0, distance))[..., None] * spoke)
    return value, gradient


def residual(model: Model, values: Array) -> Array:
    """(..., p) unknowns → (..., n) mm, gaps of the touches; positive = the ball stands off the surface."""
    machine, offsets, shifts = model.split(values)
    acting = errors(model, machine)
    tip = kinematics.tip(model.touches.chain, model.touches.position, acting)
    value, _ = gap(model.touches, tip, offsets, shifts)
    return _direct(value, acting)


def _direct(value: Array, acting: Errors) -> Array:
    """gaps (..., n) mm, errors by slot → the same with what acts on the gap itself."""
    value = value + acting[GAP] if GAP in acting else value
    return value - acting[RADIUS] if RADIUS in acting else value


def linearise(model: Model, values: Array) -> tuple[Array, Array]:
    """(p,) unknowns → gaps (n,) mm and their exact Jacobian (n, p)."""
    return with_levers(model, values)[:2]


def with_levers(model: Model, values: Array) -> tuple[Array, Array, Mapping[Slot, Array]]:
    """(p,) unknowns → gaps (n,) mm, their exact Jacobian (n, p), how an error at each slot moves the touches (n,) mm/mm, mm/rad."""
    touches = model.touches
    machine, offsets, shifts = model.split(values)
    acting = errors(model, machine) if machine.any() else {}  # the nominal machine: nothing acts, and its steps are few
    run = kinematics.trace(touches.chain, touches.position, acting)
    value, gradient = gap(touches, run.tip, offsets, shifts)
    value = _direct(value, acting)
    one = np.ones(len(touches))
    levers = {GAP: one, RADIUS: -one, **kinematics.sensitivity(touches.chain, run, gradient).slots}
    columns = np.zeros((len(model.names), len(touches)))
    jacobian, count = columns.T, len(model.coefficients)
    if count:
        np.multiply(np.array([levers[slot] for slot in model.slots])[model.by_slot[3]], model.regressors, out=columns[:count])
    row = np.flatnonzero(touches.facet_index >= 0)
    along = np.sum(gradient[row] * touches.normal[row], axis=-1)
    jacobian[row, count + touches.facet_index[row]] = -along
    row = np.flatnonzero(touches.ball_index >= 0)
    first = count + len(touches.facets) + 3 * touches.ball_index[row]
    for i in range(3):
        jacobian[row, first + i] = -gradient[row, i]
    return value, jacobian, levers


def known(model: Model, values: Array) -> tuple[Array, Array, Array]:
    """(p,) unknowns → residuals (m,) mm, Jacobian (m, p) and uncertainties (m,) mm of calibrated facets and scale bar."""
    p = len(model.names)
    _, offsets, shifts = model.split(values)
    first = len(model.coefficients)
    value, rows, sigma = [], [], []
    for place, uncertainty in model.calibrated:
        row = np.zeros(p)
        row[first + place] = 1.0
        value.append(offsets[place])
        rows.append(row)
        sigma.append(uncertainty)
    bar = model.touches.artefact.scale_bar
    if model.bar is not None and bar is not None:
        one, two = model.bar
        centres = [np.array(model.touches.artefact.balls[b].centre) for b in bar.balls]
        apart = (centres[0] - centres[1]) + (shifts[one] - shifts[two])
        length = float(np.linalg.norm(apart))
        row = np.zeros(p)
        start = first + len(model.touches.facets)
        row[start + 3 * one : start + 3 * one + 3] = apart / length
        row[start + 3 * two : start + 3 * two + 3] = -apart / length
        value.append(length - bar.length)
        rows.append(row)
        sigma.append(bar.uncertainty)
    return np.array(value), np.array(rows).reshape(-1, p), np.array(sigma)
