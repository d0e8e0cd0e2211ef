"""What was measured, and what was estimated from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .numbers import Array, Id


@dataclass(frozen=True)
class Readings:
    """One row a touch, in the order of measurement; `position` and `direction` have the columns of `axes`."""

    axes: tuple[str, ...]
    touch: NDArray[np.int64]  # (n,)
    time: Array  # (n,) s
    facet: tuple[Id, ...]  # n
    position: Array  # (n, k) mm, rad: machine coordinates at the trigger
    direction: Array  # (n, k) −1 0 1: direction of the last motion
    status: tuple[str, ...]  # n: ok, miss, early
    cycle: NDArray[np.int64]  # (n,)
    day: NDArray[np.int64]  # (n,)
    feed: Array | None = None  # (n,) mm/min
    temperatures: Mapping[str, Array] = field(default_factory=dict)  # °C, NaN where it is not known
    segment: NDArray[np.int64] | None = None  # (n,) 1, and one more after each interruption; None: there was none
    stylus: NDArray[np.int64] | None = None  # (n,) number of the stylus, of `Machine.styli`; None: the usual one
    derived: tuple[str, ...] = ()  # axes whose `direction` no column gives: it follows from the sequence of positions

    def __len__(self) -> int:
        return len(self.touch)

    def rows(self, keep: NDArray[Any]) -> Readings:
        """(n,) mask or (m,) indices → the readings of those rows, in that order."""
        index = np.arange(len(self))[keep]
        names = ("touch", "time", "position", "direction", "cycle", "day", "feed", "segment", "stylus")
        taken: dict[str, Any] = {n: None if (v := getattr(self, n)) is None else v[index] for n in names}
        taken |= {name: tuple(map(getattr(self, name).__getitem__, index.tolist())) for name in ("facet", "status")}
        return replace(self, **taken, temperatures={name: values[index] for name, values in self.temperatures.items()})

    @cached_property
    def ok(self) -> NDArray[np.bool_]:
        """→ (n,) mask of the touches that made contact where they should."""
        found = np.array([status == "ok" for status in self.status], dtype=np.bool_)
        found.flags.writeable = False  # many ask
        return found


@dataclass(frozen=True)
class Parameter:
    """An estimated coefficient with its standard deviation, in `unit` (mm, rad, mm/mm …)."""

    value: float
    unit: str
    std: float


@dataclass(frozen=True)
class Combination:
    """Directions that no touch sees: `weights` over names, and a sentence for people."""

    names: tuple[str, ...]
    weights: tuple[float, ...]
    text: str
