"""What the noise is found from: the system of touches at the solution of an estimate, with walk and seating (see the package)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..estimate import SIGMA_FLOOR, Estimate
from ..judgement import TableTolerances
from ..plausible.bounds import alone, is_backlash
from ..records import Array, Machine
from ..terms import SCALES, Coefficient
from ._decomposed import eigen
from .walk import SMOOTH, FullWalk, waves_of

WAVES = (24, 12)  # functions of the walk in each direction of each day: many, as far as there is room, and few
EACH = 16  # touches of a day for each of many: what is faster is between two touches
MOST = 600  # columns of Z beyond which the noise is taken as it is assumed: white
PLAIN = 0.1  # share of it, above which touches tell how large a smooth drift is
WIDER = 3.0  # times the walk that a smooth drift may be which they do not tell
FAINTER = 1e-2  # share of what a component does to the touches, below which unknowns stand for it


@dataclass(frozen=True)
class System:
    """Rows of the touches with weight, and the few known distances below them, at the solution of `estimate`."""

    gaps: Array  # (n,)
    jacobian: Array  # (n, p), columns scaled
    known: Array  # (m, p), rows over their uncertainty, columns scaled
    known_gaps: Array  # (m,)
    scale: Array  # (p,)
    values: Array  # (p,), over scale
    prior: Array  # (p,) one over the variance of what was known of each before, times scale squared; 0 where nothing was
    least: float  # mm: no touch is taken to be better than a fifth of the stated repeatability
    repeats: float  # mm, the stated repeatability
    walk: Array  # (n, a), functions by day, the slowest first, each along x y z
    seats: Array  # (n, b)
    waves: int = WAVES[-1]  # functions of a day in each direction
    whole: FullWalk | None = None  # the walk without its smooth part, as far as touches tell it


def system(result: Estimate) -> System:
    """estimate → the system of its touches, known distances, walk and seating."""
    touches = result.model.touches
    n = len(touches)
    scale = 1 / np.maximum(np.linalg.norm(result.jacobian, axis=0), 1e-300)
    known = result.jacobian[n:] * scale * (result.known_weights / result.sigma)[:, None]
    normal = touches.machine_normal
    count = int(touches.indexation.max(initial=0)) + 1
    days = np.unique(touches.day)
    walk, seats, whole = np.empty((n, 0)), np.empty((n, 0)), None
    waves = max(min(WAVES[0], n // len(days) // EACH), WAVES[-1]) if n else WAVES[-1]
    if 3 * (count + waves * len(days)) > MOST:
        waves = WAVES[-1]
    if 3 * (count + waves * len(days)) <= MOST:
        place = np.eye(count)[touches.indexation] if count > 2 else np.empty((n, 0))
        seats = (place[:, :, None] * normal[:, None, :]).reshape(n, -1)
        walk = np.hstack([waves_of(touches.time, touches.day == day, normal, waves) for day in days])
        whole = FullWalk(touches.time, touches.day, normal, waves)
    known_gaps = result.known_residuals * result.known_weights / result.sigma
    prior = (scale / _before(result)) ** 2
    jacobian, values = result.jacobian[:n] * scale, result.values / scale
    repeats = max(touches.machine.probe.repeatability, SIGMA_FLOOR)
    least = max(repeats / 5, SIGMA_FLOOR)
    return System(result.residuals, jacobian, known, known_gaps, scale, values, prior, least, repeats, walk, seats, waves, whole)


def _before(result: Estimate) -> Array:
    """→ (p,) one standard deviation of each unknown before it was measured: a quarter of its tolerance, infinite without one."""
    model = result.model
    table = model.touches.artefact.tolerances
    known = [_known(c, model.touches.machine, table) for c in model.coefficients]
    known += [table.facet] * len(model.touches.facets)
    known += [table.ball] * (len(model.names) - len(known))
    return np.array(known) / 4


def _known(c: Coefficient, machine: Machine, table: TableTolerances) -> float:
    if is_backlash(c) or (c.slot.stage in ("stylus", "table", "inter") and c.slot.axis):
        return alone(c, machine, table)[0]
    return machine.tolerances.scale if c.name in SCALES else np.inf


def widened(s: System, columns: Array, prior: float = 0.0) -> System:
    """system, (n, k) what k more unknowns do to the touches, what was known of them before → the system with them, at the end."""
    more = columns.shape[1]
    zero = np.zeros(more)
    return replace(
        s,
        jacobian=np.hstack([s.jacobian, columns]),
        known=np.hstack([s.known, np.zeros((len(s.known), more))]),
        scale=np.concatenate([s.scale, zero + 1]),
        values=np.concatenate([s.values, zero]),
        prior=np.concatenate([s.prior, zero + prior]),
    )


def smooth(s: System) -> NDArray[np.bool_]:
    """system → (a,) columns of its walk that are smooth."""
    return np.arange(s.walk.shape[1]) % (3 * s.waves) < 3 * SMOOTH


def drifting(s: System, turn: Array, seen: NDArray[np.bool_], variance: float) -> System:
    """system, (q, q) directions of the smooth part of its walk, which of them touches tell, mm² of the walk → those as
    unknowns of any size, then the others as unknowns of `WIDER` times that size, the rest of the walk as it was.

    Of any size, what unknowns of the machine stand for as well would leave nothing of them.
    """
    columns = s.walk[:, smooth(s)] @ turn
    free = widened(widened(s, columns[:, seen]), columns[:, ~seen], prior=1 / (WIDER**2 * variance))
    return replace(free, walk=s.walk[:, ~smooth(s)] if s.whole is None or s.whole.columns is None else s.whole.columns)


def beside(part: Array, basis: Array, share: float = FAINTER) -> tuple[Array, NDArray[np.bool_]]:
    """(n, q) columns of a component, (n, r) orthonormal basis of what the unknowns do to the touches, share of what the
    component does to them → (q, q) directions of the component, orthonormal, and those of which more is of no unknown.

    Rows are worked out where the touches were made, so that they scatter by as much as these do. Displacements that unknowns stand
    for but for that would, centimetres large, be the very scatter of the touches.
    """
    left = part - basis @ (basis.T @ part)
    square, turn = eigen(left.T @ left)
    return turn, square > share**2 * float(eigen(part.T @ part)[0][-1])
