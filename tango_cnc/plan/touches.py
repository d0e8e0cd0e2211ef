"""The touches of a plan as arrays: a hundred thousand of them are small, and each is the record that everything works with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Id, Touch

PLACES = ("standoff", "contact", "end", "over", "enter", "leave")  # of a touch, in the order of `Planned.places`


class Planned(Sequence[Touch]):
    """n touches held as arrays, some 300 bytes each; the record of one is made when it is asked for. Nobody changes the arrays."""

    __slots__ = ("facet", "indexation", "number", "places")

    def __init__(self, number: NDArray[np.int64], facet: Sequence[Id], indexation: NDArray[np.int64], places: Array) -> None:
        """(n,) numbers, n facets, (n,) indexations from 0, (n, 6, k) mm rad: PLACES → touches."""
        self.number, self.facet, self.indexation, self.places = number, tuple(facet), indexation, places

    def rows(self, rows: NDArray[np.int64]) -> Planned:
        """(m,) → the touches of those rows."""
        return Planned(self.number[rows], [self.facet[row] for row in rows], self.indexation[rows], self.places[rows])

    def __len__(self) -> int:
        return len(self.number)

    @overload
    def __getitem__(self, row: int) -> Touch: ...
    @overload
    def __getitem__(self, row: slice) -> Planned: ...
    def __getitem__(self, row: int | slice) -> Touch | Planned:
        if isinstance(row, slice):
            return self.rows(np.arange(len(self))[row])
        places = map(tuple, self.places[row].tolist())
        return Touch(int(self.number[row]), self.facet[row], int(self.indexation[row]), *places)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or len(self) != len(other):
            return False
        return all(mine == theirs for mine, theirs in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash((len(self), self.facet))

    def __repr__(self) -> str:
        return f"Planned({len(self)})"
