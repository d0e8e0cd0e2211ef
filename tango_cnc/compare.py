"""Two measurements of one plan, touch by touch: what one control, feed or day does to the readings that the other does not.

A control that looks at the probe input once in a period T takes a position that is late by between 0 and v T at a feed v: by
v T / 2 on the mean, with a standard deviation of v T / √12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .features import good, located
from .kinematics import inverse
from .records import Array, Artefact, InputError, Machine, Readings
from .touches import Touches, from_readings

STEP = 1.0  # mm of the approach that its direction is taken from
SHOWN = 5  # touches named in a complaint


@dataclass(frozen=True)
class Comparison:
    """n touches that both made; mm, first minus second."""

    touch: NDArray[np.int64]  # (n,)
    along: Array  # (n,) in the direction of the approach, positive = farther in
    across: Array  # (n,) at right angles to it
    feed: Array  # (n,) mm/min, of the first; nan when it is not recorded
    main: tuple[str, ...]  # axis of which most of the approach is made, with its sense: X+ …
    alone: tuple[int, int]  # touches that only the first, only the second made

    @property
    def mean(self) -> float:
        """→ mm."""
        return float(self.along.mean())

    @property
    def std(self) -> float:
        """→ mm, about the mean."""
        return float(self.along.std(ddof=1))


def compare(machine: Machine, artefact: Artefact, first: Readings, second: Readings) -> Comparison:
    """machine, artefact, readings of one plan twice → what is different. Raises InputError when they are not of one plan."""
    mine, other = _good(machine, artefact, first), _good(machine, artefact, second)
    places = {key: i for i, key in enumerate(_keys(other))}
    pairs = [(i, places[key]) for i, key in enumerate(_keys(mine)) if key in places]
    if len(pairs) < 2:
        raise InputError(f"compared readings: found {len(pairs)} touches that both have with status ok; allowed: 2 or more")
    a, b = np.array(pairs).T
    rotary = [machine.column(name) for name in (*machine.rotary, "S")]
    turned = np.remainder(mine.position[a][:, rotary] - other.position[b][:, rotary] + math.pi, 2 * math.pi) - math.pi
    unlike = [
        i
        for i, j, away in zip(a, b, turned, strict=True)
        if mine.facet[i] != other.facet[j] or np.abs(away).max() > math.radians(0.1)
    ]
    if unlike:
        named = ", ".join(str(mine.number[i]) for i in unlike[:SHOWN])
        raise InputError(f"compared readings: touch {named} is on another facet or at other angles; compare readings of one plan")
    linear = [machine.column(name) for name in machine.linear]
    approach = _approach(mine)[a]
    difference = (mine.position[a] - other.position[b])[:, linear]
    along = np.einsum("ij,ij->i", difference, approach)
    return Comparison(
        mine.number[a],
        along,
        np.linalg.norm(difference - along[:, None] * approach, axis=1),
        mine.feed[a],
        tuple(f"{machine.linear[k]}{'+' if row[k] > 0 else '-'}" for row in approach for k in [int(np.abs(row).argmax())]),
        (len(mine) - len(pairs), len(other) - len(pairs)),
    )


def latch(feed: Array, period: float) -> tuple[float, float]:
    """(n,) mm/min, s between two looks at the probe → (mean, standard deviation) mm that positions are late. Raises InputError."""
    if not np.isfinite(feed).all():
        raise InputError("compared readings: found no column feed, which the prediction for a period needs")
    way = feed / 60 * period
    return float(way.mean() / 2), float(math.sqrt((way**2).mean() / 12 + (way / 2).var()))


def _good(machine: Machine, artefact: Artefact, readings: Readings) -> Touches:
    return from_readings(machine, located(artefact, good(readings)), readings)


def _keys(touches: Touches) -> list[tuple[int, int, int]]:
    return list(zip(touches.day.tolist(), touches.cycle.tolist(), touches.number.tolist(), strict=True))


def _approach(touches: Touches) -> Array:
    """touches → (n, 3) unit vectors: how the linear axes go towards the nominal facet."""
    tip = touches.point + touches.radius[:, None] * touches.normal
    before = inverse(touches.chain, touches.position, tip + STEP * touches.normal)
    way = (inverse(touches.chain, touches.position, tip) - before)[:, [touches.machine.column(n) for n in touches.machine.linear]]
    unit: Array = way / np.linalg.norm(way, axis=1, keepdims=True)
    return unit
