"""How large a cause is, with an uncertainty that knows that its time constant is not known either."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..records import Array
from ..terms import causes
from ..terms._moment import between, gains
from ..touches import Touches
from ._candidates import pattern
from ._catalogue import Chosen, searched_range
from ._explain import Explanation, values
from ._records import Size
from ._rows import Rows
from ._space import orthonormal

SIGMAS = 2.0  # standard deviations within which a size is wanted to be: as far as that its likelihood is followed
STEP = 0.1  # of the logarithm of a time constant, along the likelihood
Told = Callable[[Array, Array], float]  # values (k,), what they do to every touch (n,) → one number for their size


def size(e: Explanation, means: Rows, weight: Array) -> dict[int, Size]:
    """explanation, rows, their weights (r,) → size of every chosen candidate, by id; outliers included."""
    touches = means.whole
    start = np.concatenate([[0], np.cumsum([c.columns.shape[1] for c in e.chosen])]).astype(int)
    solution, _ = values(e, {})
    slopes = {i: _slopes(e, c, solution[start[i] : start[i + 1]]) for i, c in enumerate(e.chosen)}
    tangents = {i: e.place.project(slope) for i, slope in slopes.items() if slope.shape[1]}
    _, covariance = values(e, tangents)
    end = start[-1]
    result = {}
    for i, c in enumerate(e.chosen):
        own = np.arange(start[i], start[i + 1])
        v, k = solution[own], slopes[i].shape[1]
        block = np.concatenate([own, np.arange(end, end + k)]).astype(int)
        end += k
        told = _told(c, weight * means.scale)
        amplitude = told(v, c.candidate.columns @ v)
        beside = [x for j, o in enumerate(e.chosen) if j != i for x in (o.columns, tangents.get(j, o.columns[:, :0]))]
        around = np.hstack([c.columns[:, :0], *beside])
        std = _known(e, c, told, v, slopes[i], covariance[np.ix_(block, block)], around)
        more: dict[str, Any] = {}
        if c.candidate.setting.get("shape") == "exponential" and len(v) == 1 and c.candidate.coefficients[0].unit == "mm":
            shown = _shown(weight * means.scale)
            more["run_um"] = shown(v, c.candidate.columns @ v) * 1e3
            more["run_std_um"] = _known(e, c, shown, v, slopes[i], covariance[np.ix_(block, block)], around) * 1e3
        if _begins(c):
            more["at_after"], more["at"] = _between(e, c, means, weight)
            more["time_s"] = float(touches.time[touches.row(more["at"])])
        each = np.sqrt(np.clip(np.diag(covariance)[own], 0.0, None))
        result[id(c)] = _one(c, v, each, amplitude, std, touches, more)
    return result


def _known(e: Explanation, c: Chosen, told: Told, v: Array, slopes: Array, covariance: Array, around: Array) -> float:
    """→ standard deviation of a size: that of the first order, or further where the likelihood allows a further one."""
    straight = _std(told, v, c.candidate.columns, slopes, covariance)
    return max(straight, _followed(e, c, told, told(v, c.candidate.columns @ v), around))


def _curved(e: Explanation, c: Chosen) -> dict[str, str]:
    """→ shape parameters that change the shape: the time of a straight line only sets the unit of its slope."""
    straight = c.candidate.setting.get("shape") == "linear"
    return {name: way for name, way in e.catalogue.refine.get(c.candidate.cause, {}).items() if not (straight and name == "tau")}


def _slopes(e: Explanation, c: Chosen, v: Array) -> Array:
    """→ (n, t) change of the fitted pattern with every continuous shape parameter."""
    found = []
    for name, way in _curved(e, c).items():
        at = c.candidate.setting.get(name)
        if way in ("touch", "order") or not isinstance(at, (int, float)):
            continue
        step = 1e-3 * abs(at) if at else 1e-3
        ends = [e.catalogue.rebuild(c.candidate.cause, {**c.candidate.setting, name: at + s * step}).columns @ v for s in (-1, 1)]
        found.append((ends[1] - ends[0]) / 2)
    return np.array(found).reshape(len(found), len(c.candidate.columns)).T


def _told(c: Chosen, weight: Array) -> Told:
    """→ text of a size: millimetres as they are, angles and slopes by their largest effect on a touch."""
    units = [k.unit for k in c.candidate.coefficients]
    if units and units[0] != "mm":
        return _shown(weight)
    measure = _measure(form([k.name for k in c.candidate.coefficients]))
    return lambda v, effect: measure(v)


def _shown(weight: Array) -> Told:
    """→ a size as the largest effect on a touch."""
    return lambda v, effect: float(np.abs(effect / weight).max())


def _std(told: Told, v: Array, columns: Array, slopes: Array, covariance: Array) -> float:
    """size, values (k,), columns (n, k), slopes (n, t), covariance of both → standard deviation of the size, to first order.

    A coefficient that is near zero, and of which these touches know nothing, changes the size to no first order. How far it may
    go beyond the size itself is added.
    """
    effect = columns @ v
    spread = np.sqrt(np.clip(np.diag(covariance), 1e-300, None))
    # The covariance is used along its own standard steps: gradients in units of one standard deviation.
    moved = [(d * step, column) for step, d, column in zip(spread, np.eye(len(v)), columns.T, strict=False)]
    moved += [(np.zeros(len(v)), slope) for slope in slopes.T]
    ends = [[told(v + s * d, effect + s * step * x) for s in (-1, 1)] for step, (d, x) in zip(spread, moved, strict=True)]
    gradient = np.array([(high - low) / 2 for low, high in ends])
    beyond = [max((high + low) / 2 - 2 * told(v, effect), 0.0) for low, high in ends]
    return float(np.sqrt(max(gradient @ (covariance / np.outer(spread, spread)) @ gradient, 0.0) + np.square(beyond).sum()))


def _followed(e: Explanation, c: Chosen, told: Told, amplitude: float, around: Array) -> float:
    """chosen, its size, columns beside it (m, s) → half of how far the size may be away at two standard deviations.

    A drift whose time constant is about as long as the test is as well a larger and slower one: the size is followed along the
    time constant as far as the likelihood allows (profile likelihood), where a straight step from the best one would be too short.
    """
    names = [n for n, way in _curved(e, c).items() if way == "log" and isinstance(c.candidate.setting.get(n), float)]
    if not names:
        return 0.0
    root = e.place.setting(e.ratios).root
    basis = orthonormal(root @ around)

    def outside(x: Array) -> Array:
        return np.asarray(x - basis @ (basis.T @ x))

    y = outside(root @ e.place.y)

    def fitted(name: str, value: float) -> tuple[float, float, float]:
        """shape parameter, its value → chi-squared, size, its standard deviation with that shape."""
        one = e.catalogue.rebuild(c.candidate.cause, {**c.candidate.setting, name: value})
        white = outside(root @ e.place.project(one.columns))
        v = np.asarray(np.linalg.lstsq(white, y, rcond=1e-12)[0], dtype=float)
        covariance = np.asarray(e.sigma**2 * np.linalg.pinv(white.T @ white, rcond=1e-12), dtype=float)
        rest = float(np.sum((y - white @ v) ** 2)) / e.sigma**2
        return rest, told(v, one.columns @ v), _std(told, v, one.columns, one.columns[:, :0], covariance)

    away = 0.0
    for name in names:
        low, high = searched_range(e.catalogue, c.candidate.cause)[name]
        best = fitted(name, float(c.candidate.setting[name]))[0]
        for sign in (-1, 1):
            at = float(c.candidate.setting[name]) * np.exp(sign * STEP)
            while low <= at <= high:
                rest, size, std = fitted(name, at)
                left = SIGMAS**2 - max(rest - best, 0.0)
                if left < 0:
                    break
                away = max(away, abs(size - amplitude) + std * float(np.sqrt(left)))
                at *= np.exp(sign * STEP)
    return away / SIGMAS


def form(names: list[str]) -> str:
    """names of coefficients → vector, wave, vector wave, swing (of two axes) or numbers."""
    tails = [name.rpartition("]")[2] or name for name in names]
    if [t[-2:] for t in tails] in ([".x", ".y", ".z"], [".x", ".y"]):  # two: nothing goes along the last one
        return "vector"
    if len(names) == 2 and [t[-4:] for t in tails] == [".cos", ".sin"]:
        return "wave"
    if len(names) == 6 and all(".cos." in t for t in tails[:3]) and all(".sin." in t for t in tails[3:]):
        return "vector wave"
    if [t[-5:] for t in tails] == [".xcos", ".ycos", ".xsin", ".ysin"]:
        return "swing"
    return "numbers"


def _one(
    c: Chosen, v: Array, std_values: Array, amplitude: float, std: float, touches: Touches, more: Mapping[str, Any] | None = None
) -> Size:
    names = [k.name for k in c.candidate.coefficients]
    units = [k.unit for k in c.candidate.coefficients]
    kind = form(names)
    cause = causes().get(c.candidate.cause)  # None: a single touch, or a shape without a name
    unit = {} if cause is None else cause.units
    detail: dict[str, Any] = {f"{k}_{unit[k]}" if k in unit else k: x for k, x in c.candidate.setting.items() if x is not None}
    effect: dict[str, Any] = {"cause": c.candidate.cause, **c.candidate.setting, "amplitude": _measure(kind)(v)}
    if kind.startswith("vector"):
        own = cause.frame if cause is not None else ""
        detail.setdefault("frame", own if own in ("machine", "table", "spindle", "axis") else "machine")
        arrow = np.pad(v, (0, 3 - len(v))) if kind == "vector" else _principal(v)
        detail["direction"] = [round(float(x), 4) for x in arrow / (np.linalg.norm(arrow) or 1.0)]
        effect["direction"] = detail["direction"]
    if kind == "wave":
        detail["phase_deg"] = round(float(np.degrees(np.arctan2(-v[1], v[0]))), 2)
        effect["phase"] = detail["phase_deg"]
    if "tau" in c.candidate.setting and len(touches):
        detail["run_s"] = round(float(touches.warm.max()), 1)
    if cause is not None and "at" in detail and cause.refine.get("at") == "touch":
        detail["time_s"] = float(touches.time[touches.row(detail["at"])])
    detail.update(more or {})
    if kind == "numbers" and len(v) == 1:
        effect["amplitude"] = float(v[0])
    each = zip(names, units, v, std_values, strict=bool(names))
    detail["coefficients"] = {n: {"value": float(x), "unit": u, "std": float(s)} for n, u, x, s in each}
    return Size(v, std_values, amplitude, std, detail, effect)


def _begins(c: Chosen) -> bool:
    """Whether it happened at one touch, and stays."""
    cause = causes().get(c.candidate.cause)
    return cause is not None and "at" in c.candidate.setting and cause.refine.get("at") == "touch"


def _between(e: Explanation, c: Chosen, means: Rows, weight: Array) -> tuple[int, int]:
    """explanation, what happened at a moment, rows, their weights (r,) → the last touch that was before it, the first that may have
    been after it and by which the touches show it (their numbers in the readings)."""
    touches, cause, setting = means.whole, causes()[c.candidate.cause], c.candidate.setting
    always = pattern(touches, cause.make(touches.machine, **{**setting, "at": int(touches.counted[0])}))
    root = e.place.setting(e.ratios).root
    others = [root @ o.columns for o in e.chosen if o is not c]
    basis = orthonormal(np.hstack([root @ c.columns[:, :0], *others]))
    rows = root @ (e.place.basis.T * weight)
    rows, y = rows - basis @ (basis.T @ rows), root @ e.place.y
    y = y - basis @ (basis.T @ y)
    n, k = always.shape
    gram, pull, every = np.empty((n, k, k)), np.empty((n, k)), np.empty((n, k))
    seen, length = np.zeros((len(y), k)), np.zeros(k)
    place, share = means.parts
    for i in range(n - 1, -1, -1):  # what it does from touch i on
        seen, length = seen + rows[:, [place[i]]] * (share[i] * always[i]), length + always[i] ** 2
        gram[i], pull[i], every[i] = seen.T @ seen, seen.T @ y, length
    _, first, last = between(gains(gram[1:], pull[1:], np.sqrt(np.maximum(every[1:], 1e-30))), e.sigma**2)
    return int(touches.counted[first]), int(touches.counted[last + 1])


def _principal(v: Array) -> Array:
    left, singular, _ = np.linalg.svd(v.reshape(2, 3).T)
    return np.asarray(left[:, 0] * singular[0])


def _measure(kind: str) -> Callable[[Array], float]:
    if kind == "vector wave":
        return lambda v: float(np.linalg.norm(v.reshape(2, 3), 2))
    if kind == "swing":
        return lambda v: float(np.linalg.norm(v.reshape(2, 2), 2))
    return lambda v: float(np.linalg.norm(v))


def plain(detail: Mapping[str, Any]) -> dict[str, Any]:
    """detail → plain data for files."""
    return {k: list(v) if isinstance(v, tuple) else v.item() if isinstance(v, np.generic) else v for k, v in detail.items()}
