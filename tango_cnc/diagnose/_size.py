"""How large a cause is, with an uncertainty that knows that its time constant is not known either."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..records import Array
from ..touches import Touches
from ._explain import Explanation, values
from ._records import Size
from ._search import Chosen

UNITS = {"tau": "tau_s", "pause": "pause_s", "length": "length_mm"}


def size(e: Explanation, touches: Touches, weight: Array) -> dict[int, Size]:
    """explanation → size of every chosen candidate, by id; outliers included."""
    start = np.concatenate([[0], np.cumsum([c.columns.shape[1] for c in e.chosen])]).astype(int)
    solution, _ = values(e, {})
    tangents: dict[int, Array] = {}
    for i, c in enumerate(e.chosen):
        slope = _tangent(e, c, solution[start[i] : start[i + 1]])
        if slope is not None:
            tangents[i] = slope
    solution, covariance = values(e, tangents)
    result = {}
    for i, c in enumerate(e.chosen):
        own = slice(start[i], start[i + 1])
        result[id(c)] = _one(c, solution[own], covariance[own, own], touches, weight)
    return result


def _tangent(e: Explanation, c: Chosen, v: Array) -> Array | None:
    """→ (m, t) change of the fitted pattern with every continuous shape parameter."""
    found = []
    for name, way in e.catalogue.refine.get(c.candidate.cause, {}).items():
        at = c.candidate.setting.get(name)
        if way in ("touch", "order") or not isinstance(at, (int, float)):
            continue
        step = 1e-3 * abs(at) if at else 1e-3
        ends = [e.catalogue.rebuild(c.candidate.cause, {**c.candidate.setting, name: at + s * step}).columns @ v for s in (-1, 1)]
        found.append(e.place.project((ends[1] - ends[0])[:, None] / 2))
    return np.hstack(found) if found else None


def form(names: list[str]) -> str:
    """names of coefficients → vector, wave, vector wave or numbers."""
    tails = [name.rpartition("]")[2] or name for name in names]
    if len(names) == 3 and [t[-2:] for t in tails] == [".x", ".y", ".z"]:
        return "vector"
    if len(names) == 2 and [t[-4:] for t in tails] == [".cos", ".sin"]:
        return "wave"
    if len(names) == 6 and all(".cos." in t for t in tails[:3]) and all(".sin." in t for t in tails[3:]):
        return "vector wave"
    return "numbers"


def _one(c: Chosen, v: Array, covariance: Array, touches: Touches, weight: Array) -> Size:
    names = [k.name for k in c.candidate.coefficients]
    units = [k.unit for k in c.candidate.coefficients]
    kind = form(names)
    measure = _measure(kind)
    amplitude = measure(v)
    gradient = np.array([(measure(v + d) - measure(v - d)) for d in _steps(covariance)]) / 2
    # The covariance is used along its own standard steps: gradients in units of one standard deviation.
    spread = np.sqrt(np.clip(np.diag(covariance), 1e-300, None))
    correlation = covariance / np.outer(spread, spread)
    std = float(np.sqrt(max(gradient @ correlation @ gradient, 0.0)))
    std_values = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    detail: dict[str, Any] = {UNITS.get(k, k): x for k, x in c.candidate.setting.items() if x is not None}
    effect: dict[str, Any] = {"cause": c.candidate.cause, **c.candidate.setting, "amplitude": amplitude}
    if kind.startswith("vector"):
        detail.setdefault(
            "frame", str(c.candidate.setting.get("frame", "table" if c.candidate.cause == "table_drift" else "machine"))
        )
        arrow = v if kind == "vector" else _principal(v)
        detail["direction"] = [round(float(x), 4) for x in arrow / (np.linalg.norm(arrow) or 1.0)]
        effect["direction"] = detail["direction"]
    if kind == "wave":
        detail["phase_deg"] = round(float(np.degrees(np.arctan2(-v[1], v[0]))), 2)
        effect["phase"] = detail["phase_deg"]
    if "period" in detail:
        detail["period_s" if c.candidate.cause == "ambient_cycle" else "period_mm"] = detail.pop("period")
    if "tau" in c.candidate.setting and len(touches):
        detail["run_s"] = round(float(touches.warm.max()), 1)
    if "at" in detail and c.candidate.cause in ("step", "chip"):
        detail["time_s"] = float(touches.time[min(int(detail["at"]), len(touches)) - 1])
    if kind == "numbers" and len(v) == 1:
        effect["amplitude"] = float(v[0])
    each = zip(names, units, v, std_values, strict=bool(names))
    detail["coefficients"] = {n: {"value": float(x), "unit": u, "std": float(s)} for n, u, x, s in each}
    if units and units[0] != "mm":
        peak = float(np.max(np.abs((c.candidate.columns / weight[:, None]) @ v))) if len(v) else 0.0
        factor = peak / amplitude if amplitude else 0.0
        amplitude, std = peak, std * factor
    return Size(v, std_values, amplitude, std, detail, effect)


def _steps(covariance: Array) -> Array:
    return np.diag(np.sqrt(np.clip(np.diag(covariance), 1e-300, None)))


def _principal(v: Array) -> Array:
    left, singular, _ = np.linalg.svd(v.reshape(2, 3).T)
    return np.asarray(left[:, 0] * singular[0])


def _measure(kind: str) -> Callable[[Array], float]:
    if kind == "vector wave":
        return lambda v: float(np.linalg.norm(v.reshape(2, 3), 2))
    return lambda v: float(np.linalg.norm(v))


def plain(detail: Mapping[str, Any]) -> dict[str, Any]:
    """detail → plain data for files."""
    return {k: list(v) if isinstance(v, tuple) else v.item() if isinstance(v, np.generic) else v for k, v in detail.items()}
