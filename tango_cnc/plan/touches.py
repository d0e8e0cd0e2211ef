"""The touches of a plan: a hundred thousand of them are small, and each is the record that everything works with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np

from ..records import Array, Id, Touch
from .places import Rows, blocks

PLACES = ("standoff", "contact", "end", "over", "enter", "leave")  # of a touch, in the order of `Planned.places`
BLOCK = 2048  # touches whose places are worked out at once


@dataclass
class _Kept:
    """The block whose places were asked for last, and by whose `places` it was worked out."""

    by: Callable[[Rows], Array] | None = None
    block: int = -1
    places: Array = field(default_factory=lambda: np.empty(0))


class Planned(Sequence[Touch]):
    """n touches, some tens of bytes each; the places of a block of them are worked out when one is asked for."""

    __slots__ = ("_kept", "facet", "indexation", "names", "number", "places")

    def __init__(self, number: Rows, facet: Rows, names: tuple[Id, ...], indexation: Rows, places: Callable[[Rows], Array]) -> None:
        """(n,) numbers, (n,) facets as rows of their names, (n,) indexations from 0, (m,) rows → (m, 6, k) mm rad: PLACES."""
        self.number, self.facet, self.names, self.indexation, self.places = number, facet, names, indexation, places
        for column in (number, facet, indexation):
            column.flags.writeable = False
        self._kept = _Kept()

    def rows(self, rows: Rows) -> Planned:
        """(m,) → the touches of those rows."""
        return Planned(self.number[rows], self.facet[rows], self.names, self.indexation[rows], lambda some: self.places(rows[some]))

    def _worked_out(self, block: int) -> Array:
        """number of a block, from 0 → the places of its touches; those asked for last are kept."""
        kept = self._kept
        if kept.by is not self.places or kept.block != block:
            kept.places = self.places(np.arange(block * BLOCK, min((block + 1) * BLOCK, len(self))))
            kept.by, kept.block = self.places, block
        return kept.places

    def part_of(self, whole: Planned) -> Planned:
        """touches that these are some of → themselves: both keep one block between them, however many parts there are."""
        self._kept = whole._kept
        return self

    def _record(self, row: int, places: Array) -> Touch:
        name = self.names[self.facet[row]]
        return Touch(int(self.number[row]), name, int(self.indexation[row]), *map(tuple, places.tolist()))

    def __len__(self) -> int:
        return len(self.number)

    def __iter__(self) -> Iterator[Touch]:
        for block, rows in enumerate(blocks(len(self), BLOCK)):
            places = self._worked_out(block)
            yield from map(self._record, range(rows.start, rows.stop), places)

    @overload
    def __getitem__(self, row: int) -> Touch: ...
    @overload
    def __getitem__(self, row: slice) -> Planned: ...
    def __getitem__(self, row: int | slice) -> Touch | Planned:
        found = range(len(self))[row]
        if isinstance(found, range):
            return self.rows(np.array(found, dtype=np.int64))
        return self._record(found, self._worked_out(found // BLOCK)[found % BLOCK])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or len(self) != len(other):
            return False
        return all(mine == theirs for mine, theirs in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash((len(self), *(self.names[facet] for facet in self.facet[:BLOCK])))

    def __repr__(self) -> str:
        return f"Planned({len(self)})"
