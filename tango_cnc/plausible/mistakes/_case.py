"""What a kind of mistake is given, and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...records import Array, Artefact, Axis, Cell, Machine, Probe, Readings
from ..fit import Explained


@dataclass(frozen=True)
class Case:
    """A cell, its usable readings, and what the cell as it is stated leaves of them."""

    cell: Cell
    readings: Readings
    stated: Explained

    @property
    def machine(self) -> Machine:
        """→ the machine as it is stated."""
        return self.cell.machine

    @property
    def artefact(self) -> Artefact:
        """→ the artefact as it is stated."""
        return self.cell.artefact


Words = Callable[[Mapping[str, float]], tuple[str, str]]


@dataclass(frozen=True)
class Hypothesis:
    """One mistake put right; `None` keeps what the cell states."""

    text: str  # the readings fit if …
    file: str
    key: str
    change: str
    machine: Machine | None = None
    artefact: Artefact | None = None
    readings: Readings | None = None
    free: Sequence[str] = ()  # unknowns that are given up and take whatever value fits
    words: Words | None = None  # of freed unknowns: values → text and change
    touches: tuple[int, ...] = ()
    price: float = 0.0  # how much rarer than the commonest mistake, as a natural logarithm
    least: Mapping[str, float] = field(default_factory=dict)  # freed unknowns that are smaller than this are no mistake


def with_axis(machine: Machine, name: str, **changes: object) -> Machine:
    """machine, letter, fields of the axis → machine."""
    axes = tuple(_changed(axis, changes) if axis.name == name else axis for axis in machine.axes)
    return replace(machine, axes=axes)


def _changed(axis: Axis, changes: Mapping[str, object]) -> Axis:
    return replace(axis, **changes)  # type: ignore[arg-type]


def with_probe(machine: Machine, **changes: float) -> Machine:
    """machine, fields of the probe → machine."""
    probe: Probe = replace(machine.probe, **changes)
    return replace(machine, probe=probe)


def with_positions(readings: Readings, position: Array) -> Readings:
    """readings, (n, k) mm rad → the readings with these positions."""
    return replace(readings, position=position)


def moved_column(readings: Readings, column: int, values: Array) -> Readings:
    """readings, column, (n,) → the readings with that column."""
    position = np.array(readings.position)
    position[:, column] = values
    return with_positions(readings, position)
