"""Readings of a capability program → repeatability, film, surface, drift and lobing, and what they say to the budget."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..model import Model, residual
from ..records import Array, InputError
from ..touches import Touches
from .programs import Kind, direction, machine_normal
from .wandering import random_walk


def heights(touches: Touches) -> Array:
    """touches → (n,) mm by which the surface is read above its nominal place, nominal machine."""
    return residual(Model(touches, ()), np.zeros(len(touches.facets) + 3 * len(touches.balls)))


def directions(touches: Touches) -> list[str]:
    """touches → (n) probing direction of each: X, Y, Z, 2D, 3D."""
    normal = machine_normal(touches.chain, touches.position, touches.normal)
    return [direction(n) for n in normal]


@dataclass(frozen=True)
class Repeatability:
    """Thesis Tables 7-1 and 7-2, mm."""

    touches: int
    range: float
    std: float  # of all touches: drift included
    pooled: float  # within windows: drift excluded
    dof: int
    detrended: float  # within windows, a straight drift through each taken out
    detrended_dof: int


def repeatability(values: Array, window: int = 25) -> Repeatability:
    """(n,) mm in the order of measurement, window → spread with and without drift (thesis eq. 7-1).

    Raises InputError for fewer than two touches or windows.
    """
    if len(values) < 2 or window < 2:
        raise InputError(f"capability: found {len(values)} touches in windows of {window}; allowed: two or more of each")
    windows = [values[i : i + window] for i in range(0, len(values), window)]
    pooled, dof = _pooled(windows)
    straight, left = _pooled(windows, 1) if max(map(len, windows)) > 2 else (pooled, dof)
    return Repeatability(len(values), float(np.ptp(values)), float(np.std(values, ddof=1)), pooled, dof, straight, left)


def _pooled(windows: Sequence[Array], degree: int = 0) -> tuple[float, int]:
    """windows, degree of what is taken out of each → pooled standard deviation, degrees of freedom."""
    total, dof = 0.0, 0
    for w in windows:
        if len(w) > degree + 1:
            columns = np.vander(np.linspace(-1.0, 1.0, len(w)), degree + 1)
            rest = w - columns @ np.linalg.lstsq(columns, w, rcond=None)[0]
            total, dof = total + float(rest @ rest), dof + len(w) - degree - 1
    return math.sqrt(total / dof), dof


@dataclass(frozen=True)
class Wetness:
    """Thesis section 4.6, mm: blocks alternately dry and wet, dry first."""

    means: Array  # (b,)
    stds: Array  # (b,)
    range_of_means: float
    edges: Array  # (b − 1,) wet minus dry at every change, from the touches beside it
    effect: float  # wet minus dry of all changes together, drift allowed for
    effect_std: float
    p_value: float
    detectable: float  # the film that such a test finds (p < 0.05) in 80 of 100 cases


def wetness(values: Array, block: int = 100, time: Array | None = None, last: int | None = None) -> Wetness:
    """(n,) mm, touches of a block, (n,) s, how many of the last touches to use (default: all) → block means, film.

    The film shows where dry becomes wet: a drift has no step there. It is modelled as a random walk under white noise (generalised
    least squares), so that touches near a change count most. Raises InputError for fewer than three blocks, or `last` that is
    not whole blocks.
    """
    count = len(values) // block
    first = 0 if last is None else count - last // block
    if count - first < 3 or first < 0 or (last or 0) % block:
        raise InputError(
            f"capability wetness: found {count - max(first, 0)} blocks of {block} touches; allowed: three or more whole blocks "
            "(dry, wet, dry, wet …)"
        )
    used = slice(first * block, count * block)
    blocks = values[used].reshape(count - first, block)
    means = blocks.mean(axis=1)
    state = np.repeat(np.arange(first, count) % 2, block).astype(float)
    t = np.arange(len(values), dtype=float) if time is None else time
    _, _, film, spread = random_walk(t[used], values[used], np.diff(state))
    side = max(2, block // 5)
    edges = (blocks[1:, :side].mean(axis=1) - blocks[:-1, -side:].mean(axis=1)) * np.diff(state[::block])
    from scipy import special  # slow to load, and a plan of the touches needs no test

    dof = len(state) - 3  # steps, less film, walk and white noise
    p = float(2 * special.stdtr(dof, -abs(film) / spread)) if spread > 0 else 0.0
    power = float(special.stdtrit(dof, 0.975) + special.ndtri(0.8)) * spread
    return Wetness(means, blocks.std(axis=1, ddof=1), float(np.ptp(means)), edges, film, spread, p, power)


@dataclass(frozen=True)
class Grid:
    """Thesis Tables 4-3, 7-4 and 7-5, mm: one grid of n points measured m times."""

    total_std: float  # eq. 4-9
    total_range: float
    repeatability: float  # largest pooled standard deviation of a point, eq. 4-12
    rest: float  # of one touch when its point and its cycle are taken out
    surface_std: float  # of the points' means, eq. 4-14
    surface_range: float
    surface: float  # the same without what repeatability alone puts there
    drift_std: float  # of the cycles' means, eq. 4-16
    drift_range: float
    point_stds: Array  # (n,) Table 7-5


def grid(values: Array, window: int = 5) -> Grid:
    """(m, n) mm, cycles × points → what repeatability, surface and drift contribute. Raises InputError for fewer than 2 × 2."""
    m, n = values.shape
    if m < 2 or n < 2 or window < 2:
        raise InputError(f"capability grid: found {m} cycles of {n} points; allowed: two or more of each")
    pooled = np.array([_pooled([p[i : i + window] for i in range(0, m, window)])[0] for p in values.T])
    points, cycles = values.mean(axis=0), values.mean(axis=1)
    surface = float(np.var(points, ddof=1))
    rest = values - points - cycles[:, None] + values.mean()
    noise = float(np.sum(rest**2)) / ((m - 1) * (n - 1))
    return Grid(
        float(np.std(values, ddof=1)),
        float(np.ptp(values)),
        float(pooled.max()),
        math.sqrt(noise),
        math.sqrt(surface),
        float(np.ptp(points)),
        math.sqrt(max(surface - noise / m, 0.0)),
        float(np.std(cycles, ddof=1)),
        float(np.ptp(cycles)),
        values.std(axis=0, ddof=1),
    )


@dataclass(frozen=True)
class Drift:
    """One direction watched over hours, mm and s."""

    duration: float
    range: float
    std: float
    random_walk: float  # mm after one hour, of a random walk under white noise
    white: float  # mm, that white noise
    amplitude: float  # of amplitude (1 − e^(−t/τ))
    tau: float
    explained: float  # share of the variance that this warm-up explains


def drift(time: Array, values: Array) -> Drift:
    """(m,) s, (m,) mm → how the machine wanders. Raises InputError for fewer than five touches."""
    if len(values) < 5:
        raise InputError(f"capability drift: found {len(values)} touches in a direction; allowed: five or more")
    t = time - time[0]
    walk = random_walk(t, values)[:2]
    spread = float(np.sum((values - values.mean()) ** 2))

    def rest(log_tau: float) -> tuple[float, Array]:
        columns = np.column_stack([np.ones(len(t)), 1 - np.exp(-t / math.exp(log_tau))])
        fit, _, _, _ = np.linalg.lstsq(columns, values, rcond=None)
        return float(np.sum((values - columns @ fit) ** 2)), fit

    ends = math.log(max(t[-1] / 100, 1.0)), math.log(max(10 * t[-1], 2.0))
    from scipy import optimize  # slow to load, and a plan of the touches needs no fit

    best = optimize.minimize_scalar(lambda x: rest(x)[0], bounds=ends, method="bounded")
    left, fit = rest(float(best.x))
    explained = 1 - left / spread if spread > 0 else 0.0
    return Drift(
        float(t[-1]), float(np.ptp(values)), float(values.std(ddof=1)), *walk, float(fit[1]), math.exp(float(best.x)), explained
    )


@dataclass(frozen=True)
class Lobe:
    """amplitude · √(n_sx² + n_sy²) cos(order θ + phase): mm and deg."""

    order: int
    amplitude: float
    amplitude_std: float
    phase: float


@dataclass(frozen=True)
class Lobing:
    """A ball probed all around (thesis section 7.3, procedure IV), mm."""

    touches: int
    largest: float
    smallest: float
    out_of_sphericity: float
    std: float
    lobes: tuple[Lobe, ...]
    std_after: float  # what the lobes leave


def lobing(touches: Touches, orders: Sequence[int] = (2, 3)) -> Lobing:
    """touches on one ball, orders → residuals of the fitted sphere and the lobes among them.

    A centre is fitted for every position of the spindle, because the stylus runs out; the radius is common.
    Raises InputError for too few touches.
    """
    on = np.flatnonzero(touches.ball_index >= 0)
    spindle = np.round(np.degrees(touches.position[on, touches.machine.column("S")])) if len(on) else np.zeros(0)
    groups = np.unique(spindle)
    unknowns = 3 * len(groups) + 1 + 2 * len(orders)
    if len(on) <= unknowns:
        raise InputError(f"capability lobing: found {len(on)} touches on a ball; allowed: more than {unknowns}")
    tip = kinematics.tip(touches.chain, touches.position[on])
    run = kinematics.trace(touches.chain, touches.position[on])
    group = np.searchsorted(groups, spindle)
    centre = np.array([touches.artefact.balls[str(touches.artefact.facets[touches.facet[i]].ball)].centre for i in on])
    shift, radius = np.zeros((len(groups), 3)), 0.0
    for _ in range(10):
        spoke = tip - centre - shift[group]
        length = np.linalg.norm(spoke, axis=1)
        normal = spoke / length[:, None]
        columns = np.column_stack([_by_group(normal, group, len(groups)), np.ones(len(on))])
        step = np.linalg.lstsq(columns, length - radius, rcond=None)[0]
        shift = shift + step[:-1].reshape(-1, 3)
        radius += step[-1]
        if np.abs(step).max() < 1e-10:
            break
    rest = np.linalg.norm(tip - centre - shift[group], axis=1) - radius
    seen = kinematics.sensitivity(touches.chain, run, normal).spindle_normal
    across, azimuth = np.hypot(seen[:, 0], seen[:, 1]), np.arctan2(seen[:, 1], seen[:, 0])
    waves = [across * f(order * azimuth) for order in orders for f in (np.cos, np.sin)]
    full = np.column_stack([columns, *waves])
    fit, _, rank, _ = np.linalg.lstsq(full, rest, rcond=None)
    after = rest - full @ fit
    dof = len(on) - rank
    covariance = np.linalg.pinv(full.T @ full) * float(after @ after) / dof
    first = columns.shape[1]
    lobes = []
    for i, order in enumerate(orders):
        c, s = fit[first + 2 * i], fit[first + 2 * i + 1]
        size = math.hypot(c, s)
        along = np.array([c, s]) / size if size > 0 else np.array([1.0, 0.0])
        own = covariance[first + 2 * i : first + 2 * i + 2, first + 2 * i : first + 2 * i + 2]
        lobes.append(Lobe(order, size, math.sqrt(float(along @ own @ along)), math.degrees(math.atan2(-s, c))))
    std = math.sqrt(float(rest @ rest) / (len(on) - columns.shape[1]))
    return Lobing(
        len(on),
        float(rest.max()),
        float(rest.min()),
        float(np.ptp(rest)),
        std,
        tuple(lobes),
        math.sqrt(float(after @ after) / dof),
    )


def _by_group(columns: Array, group: NDArray[np.integer[Any]], count: int) -> Array:
    """(n, 3) → (n, 3·count): each row's three columns at the place of its group."""
    return np.hstack([columns * (group == g)[:, None] for g in range(count)])


# What the results say to the budget and to the simulated world


def budget_lines(kind: Kind, results: dict[str, Any]) -> list[dict[str, Any]]:
    """kind, results by direction → lines of uncertainty.yaml: root mean square over the directions."""
    if kind == "repeatability":
        return [{"source": "repeatability", "std": _rms([r.detrended for r in results.values()])}]
    if kind == "wetness":
        seen = [abs(r.effect) for r in results.values() if r.p_value < 0.05]
        return [{"source": "wetness", "range": max(seen)}] if seen else []
    if kind == "grid":
        form = _rms([r.surface for r in results.values()])
        return [{"source": "form", "std": form}] if form > 0 else []
    if kind == "drift":
        return [{"source": "drift", "shape": "random_walk", "amplitude": _rms([r.random_walk for r in results.values()])}]
    if kind in ("probe", "etve"):
        return []  # what they show is in lobing, form and drift already
    return [{"source": "lobing", "amplitude": lobe.amplitude, "order": lobe.order} for lobe in _real(results["ball"])]


def world_effects(kind: Kind, results: dict[str, Any]) -> tuple[float | None, list[dict[str, Any]]]:
    """kind, results by direction → noise (None: unchanged) and effects of world.yaml that make the simulated machine like this."""
    lines = budget_lines(kind, results)
    by = {line["source"]: line for line in lines}
    noise = by["repeatability"]["std"] if "repeatability" in by else None
    if "form" in by:
        return noise, [{"cause": "surface_form", "amplitude": by["form"]["std"]}]
    if kind == "drift":
        return noise, [{"cause": "random_walk", "amplitude": by["drift"]["amplitude"]}]
    if kind == "lobing":
        lobes = _real(results["ball"])
        return noise, [{"cause": "probe_lobing", "amplitude": x.amplitude, "order": x.order, "phase": x.phase} for x in lobes]
    return noise, []


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values))


def _real(found: Lobing) -> list[Lobe]:
    """→ the lobes that stand out of their own uncertainty."""
    return [lobe for lobe in found.lobes if lobe.amplitude > 3 * lobe.amplitude_std]
