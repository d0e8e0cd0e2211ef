"""Something moved once and stayed there: a table knocked, a work offset changed, a stylus bent.

The change point is where a displacement from one touch on takes most out of the residuals (maximum likelihood; Hawkins 1977, in
the frame of the machine, the table and the spindle). It is believed when the robust fit with that displacement leaves little beyond
white scatter, where the fit without it left much: a drift is not explained by a step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate, Jump
from ..kinematics import Slot
from ..records import Array
from ..terms._moment import between, gains
from ..touches import Touches
from ._decomposed import singular
from ._fit import LARGEST, Fitted, gls
from ._start import SUSPECT, reachable
from ._system import System, system, widened

FEWEST = 4  # touches before and after
WORTH = 60.0  # white variances that a step has to take out of the residuals before it is tried
LEFT = 0.4  # of what the fit without it leaves, at most, that a step may leave
UNFIT = 0.1  # share of touches that it may leave unfit: a shift makes some of any wrong touches fit
LOST = 7.0  # what each touch without weight costs: as much as one that is a hundred times off
WHITE = 1.3  # times the white scatter beside walk and seating that it may leave: a drift leaves more
MOST = 3  # moments that are fitted
PAID = 4.0  # what one number more in the displacement costs
AS_GOOD = 0.5  # cost by which what is less usual has to be better
ALIKE = 12.0  # by which twice the log likelihood of what moved may be less than that of the best
PLACES = {
    "machine": ("machine", ""),
    "table": ("table", ""),
    "turned": ("table", ""),
    "spindle": ("spindle", ""),
    "tip": ("spindle", ""),
}
TIMES = 3.0  # white standard deviations that it has to be


def moved(result: Estimate, found: Estimate) -> Jump | None:
    """estimate, the same by its noise → the step that explains what that noise does not, if any."""
    n = len(result.residuals)
    if found.noise is None or n > LARGEST or result.dof < 12 or n < 4 * FEWEST:
        return None
    touches = result.model.touches
    s = system(result)
    frames = _frames(touches)
    every = np.ones(n, dtype=np.bool_)
    rows = [every] if found.rejected is None or not found.rejected.any() else [every, ~found.rejected]
    white = max(found.noise.white, s.least)
    plane = np.cumsum(touches.ball_index < 0)
    tried: dict[tuple[str, int, int], float] = {}
    for keep in rows:
        for name, normal in frames.items():
            gain, at, until = _scan(s, normal, keep, white)
            # Touches on balls often stand alone at the beginning: what they contradict is the bar or the tip radius.
            if gain > WORTH * white**2 and min(plane[at - 1], plane[-1] - plane[at - 1]) >= FEWEST:
                tried[name, at, until] = max(gain, tried.get((name, at, until), 0.0))
    if not tried:
        return None
    usual = list(frames)  # of what reads alike, what is more usual comes first
    few = sorted(tried, key=lambda one: (-round(tried[one] / white**2), usual.index(one[0])))[:MOST]
    plain = _refit(s)
    # Where the fit without it drops many touches, those that it keeps scatter by less than a touch does.
    most = max(WHITE * white, SUSPECT * s.repeats) if (~plain[1]).mean() > UNFIT else WHITE * white
    best, least = None, np.inf
    for name, at, until in few:
        with_it = _with(s, frames[name], at)
        other = _refit(with_it)
        cost, before = _cost(other, plain, other, white), _cost(plain, plain, other, white)
        size = other[0].change[-frames[name].shape[1] :]
        lost = cost + LOST * float((~other[1]).sum()) + PAID * len(size)
        good = other[0].sigma < most and (~other[1]).mean() < UNFIT and cost < LEFT * before
        if good and lost < least - AS_GOOD and np.abs(frames[name] @ size).max() > TIMES * white:
            best, least = (name, at, until, other[0]), lost
    if best is None:
        return None
    name, at, until, other_fit = best
    p = len(result.values)
    std = np.sqrt(np.diag(other_fit.covariance))[:p]
    off = np.abs(result.values + other_fit.change[:p] - found.values)
    own = np.flatnonzero((off > found.std) | (std > 3 * found.std))
    names = tuple(result.model.names[i] for i in own if i < len(result.model.coefficients))
    place, axis = PLACES.get(name, ("axis", name))
    # An error of the table or of an axis moves it; a displacement of the touches is the other way.
    sign = 1.0 if name == "turned" or axis else -1.0
    shift = (sign * other_fit.change[-frames[name].shape[1] :]).tolist()
    turn = (shift[3], shift[4], shift[5]) if len(shift) == 6 else (0.0, 0.0, 0.0)
    radius = shift[3] if len(shift) == 4 else 0.0
    instead = tuple(other for other in _alike(s, frames, rows, white, at, until) if other != (place, axis))
    before, after = int(touches.number[at - 1]), int(touches.number[until])
    return Jump(before, after, place, (shift[0], shift[1], shift[2]), names, turn, radius, until, axis, instead)


def _frames(touches: Touches) -> dict[str, Array]:
    """touches → (n, k) mm a unit of what may move at one moment: displacements, a table that turned as well, another tip."""
    return {
        "machine": touches.machine_normal,
        "table": touches.normal,
        "spindle": touches.spindle_normal,
        "turned": touches.of_table,
        "tip": np.hstack([touches.spindle_normal, np.ones((len(touches), 1))]),
        **{axis: np.stack([touches.seen.slots[Slot(axis, "inter", i)] for i in range(3)], 1) for axis in touches.machine.carried},
    }


def _alike(
    s: System, frames: dict[str, Array], rows: list[NDArray[np.bool_]], white: float, at: int, until: int
) -> list[tuple[str, str]]:
    """system, (n, k) mm a unit by frame, masks of touches, mm, first touch after the step and the last that may be → what may have
    moved, as (frame, axis): what takes as much out of the residuals at that moment, but for its numbers (Akaike 1974).
    """
    found = []
    for keep in rows:
        scans = {name: _scan(s, normal, keep, white) for name, normal in frames.items()}
        worth = {name: gain / white**2 - 2 * frames[name].shape[1] for name, (gain, _, _) in scans.items()}
        best = max(worth.values())
        if best < WORTH:
            continue
        near = [name for name, (_, one, two) in scans.items() if worth[name] > best - ALIKE and one <= until and at <= two]
        found += [PLACES.get(name, ("axis", name)) for name in near]
    return list(dict.fromkeys(found))


def _scan(s: System, normal: Array, keep: NDArray[np.bool_], white: float) -> tuple[float, int, int]:
    """system, (n, k) mm a unit, touches that count, mm → largest mm² that a displacement takes out of the residuals, first touch.

    The last number is the last touch that could as well be the first after it: those between did not feel it.
    """
    n = len(s.gaps)
    full = np.vstack([s.jacobian * keep[:, None], s.known * s.least])
    basis, size = singular(full)
    basis = basis[:n, size > 1e-7 * size[0]]
    left = np.where(keep, s.gaps, 0.0)
    left = left - basis @ (basis.T @ left)
    seen = normal * keep[:, None]

    def after(rows: Array) -> Array:
        return np.asarray(np.cumsum(rows[::-1], axis=0)[::-1])

    within = after(np.einsum("ij,ik->ijk", basis, seen))
    plain = after(np.einsum("ij,ik->ijk", seen, seen))
    gram = plain - np.einsum("nij,nik->njk", within, within)
    pull = after(seen * np.where(keep, left, 0.0)[:, None])
    inside = slice(FEWEST, n - FEWEST + 1)
    every = np.sqrt(np.maximum(np.diagonal(plain, axis1=1, axis2=2), 1e-30))[inside]
    gain = gains(gram[inside], pull[inside], every)
    best, begin, end = between(gain, white**2)
    return float(gain[best]), begin + FEWEST, end + FEWEST


def _with(s: System, normal: Array, at: int) -> System:
    """system, (n, k) mm a unit, first touch after it → the system with k more unknowns."""
    return widened(s, normal * (np.arange(len(s.gaps)) >= at)[:, None], prior=1e-6)


Refit = tuple[Fitted, NDArray[np.bool_]]


def _refit(s: System) -> Refit:
    keep = reachable(s)
    return gls(s, keep, np.ones(len(s.gaps)), white=True), keep


def _cost(of: Refit, one: Refit, other: Refit, white: float) -> float:
    """A fit, two fits, mm of white scatter → what it leaves of the touches that either of them reaches."""
    left = of[0].residual[one[1] | other[1]]
    scatter = 3 * min(max(one[0].sigma, white), max(other[0].sigma, white))
    return float(np.log1p((left / scatter) ** 2).sum())
