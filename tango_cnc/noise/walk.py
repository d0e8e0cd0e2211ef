"""A walk of table against tool, as touches see it: a Wiener process along x y z during each day.

A truncated Karhunen–Loève series of m functions leaves 1 / (π² m) of the variance of a Wiener process (Loève 1978, 37.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ._decomposed import eigen

FINE = 128  # functions of a walk in each direction of each day from which those that touches see most of are combined
SHARE = 0.4  # combinations of them for each touch of a day: as many leave 2 parts in 1000 of a walk of 400 touches
MANY = 160  # all days together
SMOOTH = 3  # of them are drift that is smooth: any size of theirs is as likely as another, once there is a walk


def waves_of(time: Array, rows: NDArray[np.bool_], normal: Array, waves: int) -> Array:
    """(n,) s, rows of one day, (n, 3) unit normals, how many → (n, 3 waves) Karhunen–Loève functions of a Wiener process of
    variance 1 at the end, along x y z, the slowest first; 0 on other days.
    """
    span = np.ptp(time[rows]) or 1.0
    t = (time - time[rows].min()) / span
    rate = (np.arange(waves) + 0.5) * np.pi
    wave = np.sqrt(2) * np.sin(t[:, None] * rate) / rate * rows[:, None]
    return np.asarray((wave[:, :, None] * normal[:, None, :]).reshape(len(time), -1))


@dataclass(frozen=True, eq=False)
class FullWalk:
    """A walk without its smooth part, as touches see it: worked out where there is a walk, as it has many functions."""

    time: Array  # (n,) s
    day: NDArray[np.int64]  # (n,)
    normal: Array  # (n, 3)
    waves: int  # functions of a day in each direction that are there already

    @cached_property
    def columns(self) -> Array | None:
        """→ (n, q) the combinations of `FINE` functions of a day that touches see most of, so many for each touch; None where
        these are no more than there are.

        What a few functions leave of a walk goes on from touch to touch. Taken for scatter, it is in no interval: with 24
        functions errors under a walk of 8 µm in an hour are up to 1.10 of their standard deviations, root mean square, with
        these 1.01.
        """
        days = np.unique(self.day)
        found = []
        for day in days:
            rows = self.day == day
            own = int(rows.sum())
            count = min(int(SHARE * own), MANY // len(days))
            waves = min(FINE, own)
            if count <= 3 * (self.waves - SMOOTH):
                return None
            every = waves_of(self.time, rows, self.normal, waves)[:, 3 * SMOOTH :]
            _, turn = eigen(every.T @ every)
            found.append(every @ turn[:, -count:])
        return np.hstack(found) if found else None
