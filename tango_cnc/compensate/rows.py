"""Which rows of tables touches meet: where one is typed wrong, only touches that meet it say so.

A row moves the tool tip where its axis is near it. A touch meets it where it feels, along its facet, `FEELS` of what the row does
where it does most: between two rows it feels both of them by half.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ..touches import Touches
from .space import Held, Poses

FEELS = 0.3  # of what a row moves at most
LISTED = 6  # rows that a line names


@dataclass(frozen=True)
class TableRows:
    """The rows of one table, and what touches feel of them."""

    table: str  # with the sense of the axis, where the table has numbers for either
    axis: str
    unit: str  # of `at`
    at: tuple[float, ...]  # (r,) mm or deg, of each of its numbers
    felt: Array  # (n, r) share of what each moves at most, along each touch

    @property
    def meets(self) -> NDArray[np.bool_]:
        """→ (n, r) whether a touch meets a row."""
        return np.asarray(self.felt >= FEELS)

    def missed(self, chosen: Sequence[int] | None = None) -> list[float]:
        """rows of touches (None: all) → where the rows lie that none of them meets, mm or deg."""
        met = np.any(self.meets[slice(None) if chosen is None else list(chosen)], axis=0).tolist()
        return sorted({at for at, found in zip(self.at, met, strict=True) if not found})


def rows_of(held: Sequence[Held], changed: Collection[str], touches: Touches, at: Poses) -> tuple[TableRows, ...]:
    """what a target holds, places that change, touches, poses of the volume → the rows of every table that is written anew."""
    machine, here = touches.machine, Poses(touches)
    tables = dict.fromkeys((h.table, h.sense) for h in held if h.at is not None and h.table in _written(held, changed))
    found = []
    for table, sense in tables:
        own = [h for h in held if (h.table, h.sense) == (table, sense) and h.at is not None and h.axis is not None]
        most = np.array([float(np.linalg.norm(h.lever(at), axis=1).max()) for h in own])
        along = np.stack([np.abs(np.sum(h.lever(here) * touches.normal, axis=1)) for h in own], axis=1)
        axis = str(own[0].axis)
        scale, unit = (1.0, "mm") if axis in machine.linear else (180 / np.pi, "deg")
        places = tuple(round(scale * float(h.at), 6) + 0.0 for h in own if h.at is not None)
        name = f"{table}, {axis} moving {'up' if sense > 0 else 'down'}" if sense else table
        found.append(TableRows(name, axis, unit, places, along / np.maximum(most, 1e-12 * max(float(most.max()), 1e-12))))
    return tuple(found)


def _written(held: Sequence[Held], changed: Collection[str]) -> set[str]:
    """what a target holds, places that change → the tables that they are in."""
    return {h.table for h in held if h.at is not None and h.place in changed}


def added(tables: Sequence[TableRows], chosen: Sequence[int]) -> list[int]:
    """rows of tables, rows of the touches of a check → the fewest touches more (greedy) that meet what any touch meets, those that
    meet most rows first."""
    if not tables:
        return []
    meets = np.concatenate([one.meets for one in tables], axis=1)
    open_ = meets.any(axis=0) & ~meets[list(chosen)].any(axis=0)
    found: list[int] = []
    while open_.any():
        best = int(np.argmax(meets[:, open_].sum(axis=1)))
        found.append(best)
        open_ &= ~meets[best]
    return found


def not_met(tables: Sequence[TableRows]) -> tuple[str, ...]:
    """rows of tables, felt by the touches of a run → of each table which of its rows no touch met, for people."""
    found = []
    for one in tables:
        if missed := one.missed():
            listed = ", ".join(f"{at:g}" for at in missed[:LISTED]) + (
                f" and {len(missed) - LISTED} more" if missed[LISTED:] else ""
            )
            found.append(f"{one.table}, {len(missed)} of {len(set(one.at))} ({one.axis} {listed} {one.unit})")
    return tuple(found)


def lines_of(tables: Sequence[TableRows], chosen: Sequence[int] | None = None) -> list[str]:
    """rows of tables, rows of the touches of a check (None: all) → a line a table, for people; [] where there is no table."""
    if not tables:
        return []
    found = ["rows of tables that these touches meet; a wrong row that none meets is not seen (compare the files by --check):"]
    for one in tables:
        every, missed = len(set(one.at)), one.missed(chosen)
        listed = ", ".join(f"{at:g}" for at in missed[:LISTED]) + (f" and {len(missed) - LISTED} more" if missed[LISTED:] else "")
        more = f"; none at {one.axis} {listed} {one.unit}" if missed else ""
        found.append(f"  {one.table}: {every - len(missed)} of {every}{more}")
    return found
