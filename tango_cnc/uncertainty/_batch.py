"""Gaps of many trials at once, exact, with every length carried as a deviation from the nominal contact.

Theory of operation. The nominal path of each stylus tip through the chain is worked out once and kept (`Station.at`). A trial
moves that path by less than a millimetre, and only this deviation is carried from step to step: a shift adds to it, a
commanded turn turns it, a turn by an error angle α adds (cos α − 1) and sin α times the point itself. Error angles are
small: the Taylor terms that are left out move a point a metre away by less than 2e-10 mm; larger ones go through the library's
sine. A block of trials is small enough for its temporaries to stay in the second-level cache.

Because only deviations are carried, single precision is enough for trials: it rounds a gap by about 1e-8 mm, a hundred
thousandth of what a probe repeats, and halves the time. Balls and scale bars keep double precision (their radii and length
are subtracted).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..kinematics import Slot
from ..model import RADIUS, Model
from ..records import Array
from ..terms import GAP

SMALL = 1e-3  # rad: up to here two Taylor terms of sine and cosine, the neglected α⁴/24 is 4e-14
TINY = 1e-4  # rad: up to here one of the sine, the neglected α³/6 is 2e-13


class Acting(NamedTuple):
    """The coefficients that act at one slot: which unknowns, and their regressors; (c, 1) where no touch differs."""

    unknowns: slice | list[int]
    regressors: Array  # (c, n) or (c, 1)
    largest: Array  # (c,) largest |regressor|


class Station(NamedTuple):
    """One thing that happens to a deviation d on its way: a fixed turn of the axes, a commanded turn, or an error."""

    kind: str  # frame | command | shift | turn
    base: int = 0
    factor: float = 1.0
    acting: Acting | None = None
    matrix: Array | None = None  # (3, 3) of a frame
    sine: Array | None = None  # (n,) of a command
    cosine: Array | None = None
    at: tuple[Array, Array] | None = None  # (n,) mm, the two coordinates across `base` of the nominal path before an error turn


@dataclass(frozen=True)
class Batch:
    """A model made ready for many trials."""

    model: Model
    start: tuple[tuple[int, Acting], ...]  # stylus offsets: component, coefficients
    spindle_frame: Array
    stops: tuple[Station, ...]
    tip: Array  # (3, n) mm nominal tip in the table frame
    normal: Array  # (3, n)
    gap: Array  # (n,) mm nominal gap of the plane touches
    own_facet: Array  # (F, n) 1 where the touch is on the facet
    direct: Acting | None  # coefficients that act on the gap itself
    radius: Acting | None  # radii of the tips of other styli


def batch(model: Model, dtype: type[np.floating[Any]] = np.float32) -> Batch:
    """model, precision of the trials → its nominal paths and the stops on them."""
    touches = model.touches
    chain = touches.chain
    n = len(touches)
    acting = {slot: _acting(model, rows, dtype) for slot, rows in model.slots.items()}
    x = [np.full(n, c) for c in chain.tip]
    stops: list[Station] = []
    for joint in chain.joints:
        x = [c - p for c, p in zip(x, joint.point, strict=True)]
        if joint.frame is not None:
            stops.append(Station("frame", matrix=joint.frame.astype(dtype)))
            x = list(joint.frame @ np.array(x))
        for step in joint.steps:
            j, k = (step.base + 1) % 3, (step.base + 2) % 3
            if step.column is not None:
                amount = step.factor * touches.position[:, step.column]
                if step.turn and np.any(amount):
                    sine, cosine = np.sin(amount), np.cos(amount)
                    stops.append(Station("command", step.base, sine=sine.astype(dtype), cosine=cosine.astype(dtype)))
                    x[j], x[k] = cosine * x[j] - sine * x[k], sine * x[j] + cosine * x[k]
                elif not step.turn:
                    x[step.base] = x[step.base] + amount
            if step.slot in acting:
                kind = "turn" if step.turn else "shift"
                stops.append(Station(kind, step.base, step.factor, acting[step.slot], at=(x[j].astype(dtype), x[k].astype(dtype))))
        if joint.frame is not None:
            stops.append(Station("frame", matrix=joint.frame.T.astype(dtype)))
            x = list(joint.frame.T @ np.array(x))
        x = [c + p for c, p in zip(x, joint.point, strict=True)]
    tip = np.array(x)
    gap = np.sum((tip.T - touches.point) * touches.normal, axis=1) - touches.radius
    own_facet = (touches.facet_index == np.arange(len(touches.facets))[:, None]).astype(dtype)
    start = tuple((i, acting[Slot("t", "stylus", i)]) for i in range(3) if Slot("t", "stylus", i) in acting)
    return Batch(
        model,
        start,
        chain.spindle_frame.astype(dtype),
        tuple(stops),
        tip,
        touches.normal.T.astype(dtype),
        gap.astype(dtype),
        own_facet,
        acting.get(GAP),
        acting.get(RADIUS),
    )


def _acting(model: Model, rows: list[int], dtype: type[np.floating[Any]]) -> Acting:
    regressors = model.regressors[rows].astype(dtype)
    if np.all(regressors == regressors[:, :1]):
        regressors = regressors[:, :1]
    first, last = rows[0], rows[-1] + 1
    return Acting(
        slice(first, last) if rows == list(range(first, last)) else rows,
        np.ascontiguousarray(regressors),
        np.abs(regressors).max(axis=1),
    )


def _amount(acting: Acting, values: Array, out: Array) -> Array:
    """→ (b, n) in `out`, or (b, 1): the error at a slot in each trial."""
    own = values[:, acting.unknowns]
    if acting.regressors.shape[1] == 1:
        return np.asarray(own @ acting.regressors)
    return np.asarray(
        np.multiply(own, acting.regressors, out=out) if own.shape[1] == 1 else np.matmul(own, acting.regressors, out=out)
    )


def gaps(ready: Batch, values: Array) -> Array:
    """ready model, (b, p) unknowns → (b, n) mm, the same as `model.residual` to rounding (model.md, one touch one equation)."""
    exact, values = values, values.astype(ready.gap.dtype)
    shape = (len(values), len(ready.gap))
    d = np.zeros((3, *shape), values.dtype)
    scratch = np.empty((5, *shape), values.dtype)
    largest = np.abs(values).max(axis=0)
    for component, acting in ready.start:
        for i in range(3):
            if ready.spindle_frame[component, i]:
                d[i] += _amount(acting, values, scratch[0]) * ready.spindle_frame[component, i]
    for stop in ready.stops:
        if stop.kind == "turn":
            _error_turn(stop, values, largest, d, scratch)
        elif stop.kind == "command":
            _command_turn(stop, d, scratch)
        elif stop.kind == "shift":
            assert stop.acting is not None
            amount = _amount(stop.acting, values, scratch[0])
            d[stop.base] += amount if stop.factor == 1.0 else np.multiply(amount, stop.factor, out=amount)
        else:
            assert stop.matrix is not None
            d = np.tensordot(stop.matrix, d, 1)
    return _close(ready, values, exact, d, scratch)


def _command_turn(stop: Station, d: Array, scratch: Array) -> None:
    y, z = d[(stop.base + 1) % 3], d[(stop.base + 2) % 3]
    assert stop.sine is not None and stop.cosine is not None
    np.multiply(stop.sine, y, out=scratch[0])
    np.multiply(stop.sine, z, out=scratch[1])
    y *= stop.cosine
    y -= scratch[1]
    z *= stop.cosine
    z += scratch[0]


def _error_turn(stop: Station, values: Array, largest: Array, d: Array, scratch: Array) -> None:
    """d → R(α)(x + d) − x in place, x the nominal point: only what differs from the nominal path is carried on."""
    assert stop.acting is not None and stop.at is not None
    dy, dz = d[(stop.base + 1) % 3], d[(stop.base + 2) % 3]
    sine = _amount(stop.acting, values, scratch[0])
    if stop.factor != 1.0:
        sine *= stop.factor
    bound = float(largest[stop.acting.unknowns] @ stop.acting.largest)
    less = np.multiply(sine, sine, out=scratch[1] if sine.shape[1] > 1 else None)
    less *= -0.5  # cos α − 1
    if bound > SMALL:
        less = -2 * np.sin(sine / 2) ** 2
        sine = np.sin(sine)
    elif bound > TINY:
        sine *= 1.0 + less / 3
    y, z, product = scratch[2], scratch[3], scratch[4]
    np.add(stop.at[0], dy, out=y)
    np.add(stop.at[1], dz, out=z)
    dy += np.multiply(less, y, out=product)
    dy -= np.multiply(sine, z, out=product)
    dz += np.multiply(less, z, out=product)
    dz += np.multiply(sine, y, out=product)


def _close(ready: Batch, values: Array, exact: Array, d: Array, scratch: Array) -> Array:
    """→ (b, n) mm: the gap along the normal; balls and other curved surfaces by their distance."""
    model = ready.model
    result = scratch[1]
    result[:] = ready.gap
    for i in range(3):
        result += np.multiply(d[i], ready.normal[i], out=scratch[0])
    offsets = model.split(values)[1]
    if offsets.shape[1]:
        result -= np.matmul(offsets, ready.own_facet, out=scratch[0])
    curved = model.touches.curved
    total = result.astype(float)
    if curved is not None:
        total[:, curved.rows] = _curved(ready, d[:, :, curved.rows].astype(float), *model.split(exact)[1:])
    if ready.direct is not None:
        total += _amount(ready.direct, values, scratch[0])
    if ready.radius is not None:
        total -= _amount(ready.radius, values, scratch[0])
    return total


def _curved(ready: Batch, moved: Array, offsets: Array, shifts: Array) -> Array:
    """(3, b, m) deviations of the tips on curved surfaces, unknowns in double → (b, m) mm gaps, by the distance itself."""
    touches = ready.model.touches
    assert touches.curved is not None
    rows, centre, radius, axis, side = touches.curved
    spoke = (ready.tip[:, rows] - centre.T)[:, None] + moved
    on_facet, on_ball = touches.facet_index[rows], touches.ball_index[rows]
    if offsets.shape[1] and np.any(on_facet >= 0):
        spoke -= np.where(on_facet >= 0, offsets[:, on_facet], 0.0) * touches.normal[rows].T[:, None]
    if shifts.shape[1]:
        spoke -= np.where((on_ball >= 0)[:, None], shifts[:, on_ball], 0.0).transpose(2, 0, 1)
    if np.any(axis):
        spoke -= np.sum(spoke * axis.T[:, None], axis=0) * axis.T[:, None]
    result: Array = side * (np.sqrt(spoke[0] ** 2 + spoke[1] ** 2 + spoke[2] ** 2) - radius) - touches.radius[rows]
    return result


def known_residuals(model: Model, values: Array) -> Array:
    """model, (b, p) unknowns → (b, m) mm, calibrated facets and scale bar in the order of `model.known`."""
    offsets, shifts = model.split(values)[1:]
    columns = [offsets[:, place] for place, _ in model.calibrated]
    bar = model.touches.artefact.scale_bar
    if model.bar is not None and bar is not None:
        one, two = model.bar
        centres = [np.array(model.touches.artefact.balls[b].centre) for b in bar.balls]
        apart = (centres[0] - centres[1]) + (shifts[:, one] - shifts[:, two])
        columns.append(np.linalg.norm(apart, axis=1) - bar.length)
    return np.array(columns).reshape(len(columns), len(values)).T
