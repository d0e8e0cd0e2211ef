"""Columns of rotary axes and the spindle beside strategy.yaml: one that stands still, or is off, from some touch on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..asked import asked
from ..records import Array, Cell, Readings

TURNED = 0.1  # degrees between the rotary positions of strategy and readings that are the same position
ALIKE = 1e-6  # rad: values of a column that stands still
FEWEST = 3  # rows
FIRST = 3  # rows that are right before another zero: with fewer it is that of the whole run


@dataclass(frozen=True)
class Column:
    """One axis whose column is wrong, if strategy.yaml is right."""

    name: str
    rows: NDArray[np.int64]  # of the readings
    meant: Array  # (rows,) rad, by strategy.yaml
    still: float | None  # rad, where it stands still
    off: float  # rad that it is more by, where it does not


def columns(cell: Cell, readings: Readings, run: Mapping[str, Any] | None = None) -> list[Column] | None:
    """cell, readings, readings.json → columns that stand still or are off by one angle, in one part of the run; None where others
    are wrong as well, or in another way.
    """
    touches, machine = asked(cell, run), cell.machine
    rows = np.flatnonzero((readings.touch >= 1) & (readings.touch <= len(touches)))
    place = readings.touch[rows] - 1
    if any(readings.facet[r] != touches.facet[p] for r, p in zip(rows, place, strict=True)):
        return None
    found = []
    index = np.cumsum(np.any(np.diff(touches.position, axis=0, prepend=touches.position[:1]) != 0, axis=1))[place]
    for name in (*machine.rotary, "S"):
        own, meant = readings.position[rows, machine.column(name)], touches.position[place, machine.column(name)]
        off = turned(own, meant)
        wrong = np.flatnonzero(np.abs(off) > np.radians(TURNED))
        if not wrong.size:
            continue
        part = slice(int(wrong[0]), int(wrong[-1]) + 1)
        still = bool(np.ptp(own[part.start :]) < ALIKE and np.ptp(meant[part]) > np.radians(TURNED))
        still |= name == "S" and not own[part.start :].any()  # what a control writes that knows no position of its spindle
        shifted = np.ptp(off[part]) < np.radians(TURNED) and len(off[part]) == len(wrong) and part.start >= FIRST
        if not still and (len(wrong) < FEWEST or not shifted or not np.ptp(index[wrong])):  # of one indexation: that was turned
            return None
        value = float(own[wrong[0]]) if still else None
        found.append(Column(name, rows[wrong], meant[wrong], value, float(np.median(off[wrong]))))
    return found or None


def turned(one: Array, two: Array) -> Array:
    """→ rad from the second to the first, at most half a turn."""
    return np.asarray((one - two + np.pi) % (2 * np.pi) - np.pi)
