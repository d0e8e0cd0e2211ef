"""What an effect may know (`History`) and what it may change (`Disturbance`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Array, Artefact, Id, Machine, Vector


@dataclass(frozen=True)
class History:
    """n touches in the order of measurement, at the contacts that there would be without effects and noise."""

    machine: Machine
    artefact: Artefact
    time: Array  # (n,) s since the first row's clock zero
    warm: Array  # (n,) s since the machine was started on that day
    day: NDArray[np.int64]  # (n,)
    indexation: NDArray[np.int64]  # (n,) counts up when a rotary axis or the spindle has moved
    facet: tuple[Id, ...]  # n
    position: Array  # (n, k) mm rad
    direction: Array  # (n, k) −1 0 1 of the last motion
    move: Array  # (n, k) mm rad, signed length of the last motion
    feed: Array  # (n,) mm/min
    point: Array  # (n, 3) mm where the ball touches, table frame
    normal_table: Array  # (n, 3) outward, table frame
    normal: Array  # (n, 3) outward, machine frame
    normal_spindle: Array  # (n, 3) outward, spindle frame
    table: Array  # (n, 3, 3) turn of the table frame into the machine frame

    def __len__(self) -> int:
        return len(self.time)

    @property
    def number(self) -> NDArray[np.int64]:
        """→ (n,) 1 2 3 … over all cycles and days."""
        return np.arange(1, len(self) + 1)

    def column(self, name: str) -> int:
        """axis letter → its column of `position`."""
        return self.machine.column(name)


@dataclass(frozen=True)
class Disturbance:
    """What changes at each of n touches; whatever is None or missing stays as it is."""

    gap: Array | None = None  # (n,) mm by which the surface is read too early
    work: Array | None = None  # (n, 3) mm by which everything on the table is displaced, machine frame
    table: Array | None = None  # (n, 3) mm the same, table frame
    errors: Mapping[str, Array] = field(default_factory=dict)  # coefficient → (n,) added to it
    facet: tuple[Id, ...] | None = None  # n names that stand in the log instead of the true ones


def no_touches(machine: Machine, artefact: Artefact) -> History:
    """cell → a history before the first touch."""
    none, axes, vectors = np.zeros(0), np.zeros((0, len(machine.names))), np.zeros((0, 3))
    count = np.zeros(0, dtype=np.int64)
    return History(
        *(machine, artefact, none, none, count, count, (), axes, axes, axes, none),
        *(vectors, vectors, vectors, vectors, np.zeros((0, 3, 3))),
    )


def unit(direction: Vector) -> Array:
    """any vector but zero → (3,) unit vector."""
    return np.array(direction) / np.linalg.norm(direction)


def lever(history: History, letter: str) -> Array:
    """rotary axis → (n,) mm by which a surface is read early per rad that this axis turns its body further than commanded.

    Nominal geometry, by central differences.
    """
    from ..world import nominal_machine, place

    nominal, column, step = nominal_machine(history.machine), history.column(letter), 1e-4
    ahead, behind = history.position.copy(), history.position.copy()
    ahead[:, column] += step
    behind[:, column] -= step
    tips = [place(nominal, q, history.direction).tip for q in (ahead, behind)]
    return -np.einsum("ni,ni->n", tips[0] - tips[1], history.normal_table) / (2 * step)
