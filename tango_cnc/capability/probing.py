"""Probing error on a ball, plane and space, as ISO 230-10 tests a probing system; before and after a calibration.

A ring of 36 points at the equator (2-D) and 25 points over the upper half (3-D: the pole, 4, 8, 4 and 8 points at 67.5°, 45°,
22.5° and 0°, as ISO 10360-5 spreads them). The names and the spread are unconfirmed: they were not compared with the text of
ISO 230-10. The ball stands in for ring and sphere of the standard.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import kinematics
from ..records import Array, InputError
from ..touches import Touches
from .wandering import random_walk

RING = tuple((0.0, 10.0 * i) for i in range(36))  # degrees above the equator, around
OVER = (
    (90.0, 0.0),
    *((67.5, 90.0 * i) for i in range(4)),
    *((45.0, 22.5 + 45.0 * i) for i in range(8)),
    *((22.5, 45.0 + 90.0 * i) for i in range(4)),
    *((0.0, 45.0 * i) for i in range(8)),
)
RARE = 0.975


@dataclass(frozen=True)
class Probing:
    """Form: largest minus smallest distance from the least-squares centre. Size: diameter found less that of ball and tip, mm."""

    form_2d: float
    form_3d: float
    size_3d: float
    noise_2d: float  # form that repeatability alone stays below in 97.5 of 100 tests
    noise_3d: float


def probing(touches: Touches) -> Probing:
    """touches of both patterns on one ball → probing errors. Raises InputError where touches of a pattern are missing."""
    kinds = np.array([facet.rpartition("n")[2][:1] if "n" in facet else "" for facet in touches.facet])
    on = touches.ball_index >= 0
    rows = [np.flatnonzero(on & (kinds == kind)) for kind in ("r", "s")]
    for row, points, name in zip(rows, (RING, OVER), ("ring", "sphere"), strict=True):
        if len(row) != len(points):
            raise InputError(
                f"capability probe: found {len(row)} good touches of the {name}; allowed: {len(points)}, each point once"
            )
    tip = kinematics.tip(touches.chain, touches.position)
    repeat = touches.machine.probe.repeatability
    ring, sphere = tip[rows[0]], tip[rows[1]]
    off = ring - ring.mean(axis=0)
    plane = np.linalg.svd(off, full_matrices=False)[2][:2]
    flat, _ = _centred(off @ plane.T)
    space, radius = _centred(sphere - sphere.mean(axis=0))
    ball = touches.artefact.balls[str(touches.artefact.facets[touches.facet[rows[1][0]]].ball)]
    size = 2 * (radius - ball.radius - touches.machine.probe.tip_radius)
    noise = [repeat * _widest(n, p) for n, p in ((len(RING), 3), (len(OVER), 4))]
    return Probing(float(np.ptp(flat)), float(np.ptp(space)), float(size), *noise)


def _centred(points: Array) -> tuple[Array, float]:
    """(n, d) mm about their mean → residuals (n,) of the least-squares circle or sphere, its radius."""
    d = points.shape[1]
    centre, radius = np.zeros(d), float(np.mean(np.linalg.norm(points, axis=1)))
    for _ in range(20):
        spoke = points - centre
        length = np.linalg.norm(spoke, axis=1)
        columns = np.column_stack([spoke / length[:, None], np.ones(len(points))])
        step = np.linalg.lstsq(columns, length - radius, rcond=None)[0]
        centre, radius = centre + step[:d], radius + float(step[d])
        if np.abs(step).max() < 1e-11:
            break
    return np.linalg.norm(points - centre, axis=1) - radius, radius


def _widest(count: int, fitted: int) -> float:
    """number of points, of fitted numbers → range of their residuals over the standard deviation of a touch, 97.5 %."""
    from scipy import stats  # takes a third of a second to load, and few ask for it

    return float(stats.studentized_range.ppf(RARE, count, np.inf) * np.sqrt(1 - fitted / count))


def changed(before: Probing, after: Probing) -> dict[str, str]:
    """test before, test after → by form what the calibration did: better, worse, or no more than repeatability explains.

    Two forms differ when they are farther apart than what repeatability alone can make of one of them.
    """

    def word(one: float, two: float, noise: float) -> str:
        if abs(two - one) <= noise:
            return "no more than repeatability explains"
        return "better" if two < one else "worse"

    return {
        "form_2d": word(before.form_2d, after.form_2d, before.noise_2d),
        "form_3d": word(before.form_3d, after.form_3d, before.noise_3d),
    }


@dataclass(frozen=True)
class Environment:
    """One facet watched while nothing is done to the machine (ISO 230-3, environmental temperature variation error), mm."""

    duration: float  # s
    etve: float  # largest minus smallest
    noise: float  # what repeatability alone stays below in 97.5 of 100 tests
    temperature: float  # K, range of the thermometer that explains most; 0 where there is none
    per_kelvin: float  # mm/K of it, beside a random walk of the machine
    per_kelvin_std: float  # of what goes up and down with it by chance; 0: nothing is left beside it
    explained: float  # share of the variance that it explains


def environment(time: Array, values: Array, temperatures: Sequence[Array], repeatability: float) -> Environment:
    """(m,) s, (m,) mm, thermometers (m,) °C, standard deviation of a touch (mm) → what the surroundings do to one direction.

    A machine wanders for other reasons, too. A straight line through it took such a walk for independent readings, and gave µm/K
    many of its standard deviations large to a thermometer that had nothing to do with it.
    Raises InputError for fewer than ten touches.
    """
    from scipy import stats

    if len(values) < 10:
        raise InputError(f"capability etve: found {len(values)} touches in a direction; allowed: ten or more")
    best = (0.0, 0.0, 0.0, 0.0)
    spread = float(np.sum((values - values.mean()) ** 2))
    for t in temperatures:
        if np.all(np.isfinite(t)) and np.ptp(t) > 0 and spread > 0:
            explained = float(stats.linregress(t, values).rvalue ** 2)
            if explained > best[3]:
                _, _, slope, std = random_walk(time, values, np.diff(t))
                best = (float(np.ptp(t)), slope, std, explained)
    noise = repeatability * float(stats.studentized_range.ppf(RARE, len(values), np.inf))
    return Environment(float(time[-1] - time[0]), float(np.ptp(values)), noise, *best)
