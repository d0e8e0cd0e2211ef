"""Ways that are not safe, learned while plans are made: what a design leaves out for them, and why.

A plan is made of touches that were chosen for what they tell. Where the axes cannot turn from one indexation to another, another
order may do; where nothing does, the indexation is left out, in all that is chosen afterwards.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Id

NOWHERE = -1  # in a pair: before the first indexation, after the last one
LONG = 1e5  # s, what a turn counts that is not possible: more than any plan takes
Mask = NDArray[np.bool_]


@dataclass
class Ways:
    """What was found of one machine and table; it only grows, so that no choice is tried twice. Indexations are candidates."""

    turns: dict[tuple[int, int], str] = field(default_factory=dict)  # from, to → why axes do not turn so
    visits: dict[int, str] = field(default_factory=dict)  # indexations left out → why
    touches: dict[tuple[int, Id], str] = field(default_factory=dict)  # of the others
    seconds: dict[tuple[int, int], float] = field(default_factory=dict)  # from, to → of a turn; with obstacles
    looked: dict[tuple[object, ...], bool] = field(default_factory=dict)  # the planner's own notes
    legs: dict[tuple[object, ...], NDArray[Any]] = field(default_factory=dict)  # s between facets; notes of `order.Legs`

    def barred(self, pose: NDArray[np.int64], facet: Sequence[Id]) -> Mask:
        """(n,) indexation and facet of touches → (n,) whether they are left out."""
        found = np.isin(pose, list(self.visits))
        if self.touches:
            found |= np.array([key in self.touches for key in zip(pose.tolist(), facet, strict=True)])
        return found

    def seen(self, visits: Sequence[int]) -> set[tuple[int, int]]:
        """m visits → pairs of them, by number, between which a turn was looked at."""
        place = range(len(visits))
        return {(i, k) for i in place for k in place if self.seconds.keys() & {(visits[i], visits[k]), (visits[k], visits[i])}}

    def remembered(self, visits: Sequence[int], times: Array) -> Array:
        """m visits, (m, m) s, NaN for what was not looked at now → with what is known of before; it is kept.

        What is in the way of a turn takes long to find out, and above another facet a turn takes about as long.
        """
        at = np.array(visits)
        for i, k in np.argwhere(~np.isnan(times)).tolist():
            self.seconds.setdefault((visits[i], visits[k]), float(times[i, k]))
        return np.array([[self.seconds.get((i, k), np.nan) for k in at.tolist()] for i in at.tolist()])

    def leave_out(self, visit: int, others: Sequence[int]) -> None:
        """indexation, those of the plan → noted, with the commonest reason for which axes do not turn between it and these."""
        pairs = [pair for other in (*others, NOWHERE) for pair in ((visit, other), (other, visit))]
        why = Counter(self.turns[pair] for pair in pairs if pair in self.turns)
        self.visits[visit] = why.most_common(1)[0][0] if why else "no order of the indexations has a safe way to it"

    def priced(self, visits: Sequence[int], times: Array, closed: bool) -> tuple[Array, Array]:
        """m visits, (m, m) s, whether the first one comes again → s, impossible turns at `LONG`; (m, 2) of being first, last."""
        priced, ends = times.copy(), np.zeros((len(visits), 2))
        place = {j: i for i, j in enumerate(visits)}
        for one, other in self.turns:
            if one in place and other in place:
                priced[place[one], place[other]] = LONG
            elif one == NOWHERE and other in place:
                ends[place[other], 0] = LONG
            elif other == NOWHERE and one in place:
                ends[place[one], 0 if closed else 1] = LONG
        return priced, ends


def reason(error: str) -> str:
    """what the planner says of a way → the same without the place and what to do: 'the table would come within 5 mm of …'."""
    return re.sub(r"^[^(]*\([^()]*\):? ", "", error.splitlines()[0]).split(". ")[0].rstrip(".")
