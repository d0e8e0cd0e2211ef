"""Control charts, and what they cost in false alarms: average run length to a false alarm, computed and not looked up.

Shewhart: exact. EWMA (Roberts 1959) and CUSUM (Page 1954): a Markov chain over the chart's own value (Brook & Evans 1972,
Lucas & Saccucci 1990). The values charted are standardised: mean 0 and standard deviation 1 while nothing has changed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from ..records import Array

CELLS = 201  # of the chain; the run length changes by less than 0.5 % when they are doubled


@dataclass(frozen=True)
class Chart:
    """A chart of n nights: what is drawn, its limits, where it alarms, and how many nights lie between false alarms."""

    kind: str
    value: Array  # (n,)
    low: Array  # (n,)
    high: Array  # (n,)
    alarm: NDArray[np.bool_]  # (n,)
    nights_to_false_alarm: float


def shewhart(values: Array, limit: float = 3.0) -> Chart:
    """(n,) standardised values, limit in standard deviations → chart; one false alarm in 370 nights at 3."""
    return _chart("shewhart", values, np.full(len(values), limit), run_length_shewhart(limit))


def ewma(values: Array, weight: float = 0.2, limit: float = 2.962) -> Chart:
    """(n,) standardised values, weight of the newest, limit → chart of the weighted mean, limits as they open."""
    drawn = np.zeros(len(values))
    level = 0.0
    for i, value in enumerate(values):
        level = weight * value + (1 - weight) * level
        drawn[i] = level
    nights = np.arange(1, len(values) + 1)
    spread = np.sqrt(weight / (2 - weight) * (1 - (1 - weight) ** (2 * nights)))
    return _chart("ewma", drawn, limit * spread, run_length_ewma(weight, limit))


def cusum(values: Array, slack: float = 0.5, limit: float = 4.774) -> Chart:
    """(n,) standardised values, slack and limit in standard deviations → two-sided chart: the larger sum, with its sign."""
    drawn = np.zeros(len(values))
    up = down = 0.0
    for i, value in enumerate(values):
        up, down = max(0.0, up + value - slack), max(0.0, down - value - slack)
        drawn[i] = up if up >= down else -down
    return _chart("cusum", drawn, np.full(len(values), limit), run_length_cusum(slack, limit))


def _chart(kind: str, drawn: Array, limit: Array, nights: float) -> Chart:
    return Chart(kind, drawn, -limit, limit, np.abs(drawn) > limit, nights)


def run_length_shewhart(limit: float, shift: float = 0.0) -> float:
    """limit, true shift in standard deviations → nights until the chart alarms, on average."""
    return float(1 / (special.ndtr(-limit - shift) + special.ndtr(-limit + shift)))


def run_length_ewma(weight: float, limit: float, shift: float = 0.0) -> float:
    """weight, limit, true shift → nights until the chart alarms, on average, begun at its steady limits."""
    bound = limit * np.sqrt(weight / (2 - weight))
    edges = np.linspace(-bound, bound, CELLS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    step = special.ndtr((edges[None, :] - (1 - weight) * middle[:, None]) / weight - shift)
    return _absorbed(np.diff(step, axis=1), CELLS // 2)


def run_length_cusum(slack: float, limit: float, shift: float = 0.0) -> float:
    """slack, limit, true shift → nights until the two-sided chart alarms, on average."""
    up, down = _one_sided(slack, limit, shift), _one_sided(slack, limit, -shift)
    return 1 / (1 / up + 1 / down)  # Van Dobben de Bruyn 1968


def _one_sided(slack: float, limit: float, shift: float) -> float:
    width = 2 * limit / (2 * CELLS - 1)
    middle = width * np.arange(CELLS)
    step = special.ndtr((middle[None, :] + width / 2 - middle[:, None]) + slack - shift)
    return _absorbed(np.column_stack([step[:, 0], np.diff(step, axis=1)]), 0)


def _absorbed(stay: Array, begin: int) -> float:
    return float(np.linalg.solve(np.eye(len(stay)) - stay, np.ones(len(stay)))[begin])


def limit_for(run_length: Callable[[float], float], nights: float) -> float:
    """run length by limit, wanted nights between false alarms → the limit that has them."""
    return float(optimize.brentq(lambda limit: np.log(run_length(limit)) - np.log(nights), 0.3, 12.0, xtol=1e-6))


KINDS: dict[str, Callable[[Array], Chart]] = {"shewhart": shewhart, "ewma": ewma, "cusum": cusum}
