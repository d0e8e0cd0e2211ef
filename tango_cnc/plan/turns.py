"""The turns of a plan as arrays: a long one has as many as indexations, and each is the record that everything works with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import overload

import numpy as np

from ..records import Array, Turn

PLACES = ("before", "after", "via", "preload")  # of a turn, in the order of `Turned.places`


class Turned(Sequence[Turn]):
    """n turns, some 200 bytes each; the record of one is made when it is asked for. Nobody changes them."""

    __slots__ = ("first", "places", "touch")

    def __init__(self, turns: Iterable[Turn], count: int, axes: int) -> None:
        """turns, how many they are, axes of the machine k → the same; a place that a turn has not is NaN."""
        self.touch = np.empty(count, np.int32)
        self.places: Array = np.full((count, len(PLACES), axes), np.nan)
        self.first: dict[int, str] = {}  # row → axis
        for row, turn in enumerate(turns):
            self.touch[row] = turn.touch
            for column, name in enumerate(PLACES):
                if (place := getattr(turn, name)) is not None:
                    self.places[row, column] = place
            if turn.first is not None:
                self.first[row] = turn.first
        self.touch.flags.writeable = self.places.flags.writeable = False

    def __len__(self) -> int:
        return len(self.touch)

    @overload
    def __getitem__(self, row: int) -> Turn: ...
    @overload
    def __getitem__(self, row: slice) -> tuple[Turn, ...]: ...
    def __getitem__(self, row: int | slice) -> Turn | tuple[Turn, ...]:
        found = range(len(self))[row]
        if isinstance(found, range):
            return tuple(self[each] for each in found)
        missing = np.isnan(self.places[found]).all(axis=1)
        before, after, via, preload = (
            None if no else tuple(place) for place, no in zip(self.places[found].tolist(), missing, strict=True)
        )
        assert before is not None and after is not None
        return Turn(int(self.touch[found]), before, after, via, self.first.get(found), preload)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or len(self) != len(other):
            return False
        return all(mine == theirs for mine, theirs in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash(self.touch.tobytes())

    def __repr__(self) -> str:
        return f"Turned({len(self)})"
