"""How large the error motions of this machine are, learned from its own touches, and what that leaves of the figures.

`whole` gives every error motion 100 µm or 300 µrad before the touches are looked at. That decides what is withheld: nothing may
rest on a guess. An interval about what is not withheld must not rest on it either. A curve that may be 100 µm large is read with
all the noise in it, so that its range is too large, and what is mixed with it widens it by what no machine has. So the sizes
are estimated: motions of a kind share one, and each has its own about it. Over a part of the travel a bow shows less the higher
its degree: tilts and straightness have a size for each degree, and the first degree of a straightness is squareness. With one
size for all degrees, large tilts that the touches see faintly were above their intervals. Two or three of a kind say too little
of each other: gain and backlash of linear axes keep the wide one, and the rest of their positioning has one size for all degrees.
Source: empirical Bayes with scaled inverse χ² variances, by expectation and maximization (Gelman et al., Bayesian Data Analysis,
3rd ed., 5.4 and 13.4).
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ..records import Array, Machine
from ..terms import Coefficient, backlash
from .whole import PLACED, WIDTH, Whole

FREEDOM = 20.0  # degrees of freedom by which the size of one motion varies about that of its kind
FIRST = 0.05  # of the wide one: where the search begins
LEAST = (1e-4, 3e-7)  # mm and rad: no motion of a real machine is smaller
ROUNDS = 25
STILL = 0.02  # relative change of the sizes at which the search ends
DEGREE = re.compile(r".*\.(P[1-9])")

Kind = tuple[str, bool, bool]  # place, wave, series, or its degree (P1); of a linear axis; a displacement, not a turn


def sized(w: Whole) -> Whole:
    """machine under the wide prior → the same touches under sizes that they show; values, covariance, gain and widths are new.

    The touches are in the old values as a likelihood: precision less that of the wide prior. Nothing is fitted again.
    """
    assert w.widths is not None
    seen = np.flatnonzero(w.widths > 0).astype(np.int64)
    width = w.widths[seen]
    precision = np.linalg.inv(w.covariance[np.ix_(seen, seen)] / np.outer(width, width))
    told, pull = precision - np.eye(len(seen)), precision @ (w.values[seen] / width)
    size = _sizes(w, seen, told, pull)
    inverse = linalg.inv(told + np.diag(size**-2.0))
    values, covariance = np.zeros_like(w.values), np.zeros_like(w.covariance)
    values[seen] = width * (inverse @ pull)
    covariance[np.ix_(seen, seen)] = np.outer(width, width) * (inverse + inverse.T) / 2
    gain = None
    if w.gain is not None:
        gain = np.zeros_like(w.gain)
        gain[seen] = width[:, None] * (inverse @ (precision @ (w.gain[seen] / width[:, None])))
    widths = w.widths.copy()
    widths[seen] *= size
    return replace(w, values=values, covariance=covariance, gain=gain, widths=widths)


def _sizes(w: Whole, seen: NDArray[np.int64], told: Array, pull: Array) -> Array:
    """→ (seen,) standard deviation of each coefficient, as a part of its wide one."""
    machine, found = w.touches.machine, np.ones(len(seen))
    kinds = {j: kind for j, i in enumerate(seen) if (kind := _kind(w.coefficients[i], machine)) is not None}
    own = np.array(list(kinds), dtype=int)
    if not len(own):
        return found
    every = list(dict.fromkeys(kinds.values()))
    motions = list(dict.fromkeys((w.motions[seen[j]], kind) for j, kind in kinds.items()))
    of_motion = np.array([motions.index((w.motions[seen[j]], kind)) for j, kind in kinds.items()])
    of_kind = np.array([every.index(kind) for _, kind in motions])
    least = np.array([LEAST[not moves] / (PLACED if what == "place" else WIDTH)[not moves] for what, _, moves in every])
    many, motions_of = np.bincount(of_motion), np.bincount(of_kind)
    shared = np.full(len(every), FIRST)
    each = shared[of_kind]
    for _ in range(ROUNDS):
        found[own] = each[of_motion]
        inverse = linalg.inv(told + np.diag(found**-2.0))
        square = (inverse @ pull) ** 2 + np.diag(inverse)
        summed = FREEDOM * shared[of_kind] ** 2 + np.bincount(of_motion, square[own])
        each = np.maximum(np.sqrt(summed / (FREEDOM + many)), least[of_kind])
        step = np.sqrt(motions_of / np.bincount(of_kind, (FREEDOM + many) / summed)) / shared
        shared = np.maximum(shared * np.clip(step, 0.5, 2.0) ** 2, least)  # squared: plain steps come near slowly
        if np.max(np.abs(np.log(step))) < STILL:
            break
    found[own] = each[of_motion]
    return found


def _kind(c: Coefficient, machine: Machine) -> Kind | None:
    """coefficient, machine → the kind with which it shares its size; None where it keeps the wide one."""
    if backlash.PATTERN.fullmatch(c.name):
        return None
    linear, series = c.slot.axis in machine.linear, DEGREE.fullmatch(c.name)
    if c.slot.stage == "motion":
        if linear and (series is None or series[1] == "P1"):
            return None
        return ("wave" if series is None else "series", linear, linear)
    what = "place" if c.slot.stage == "inter" else "wave" if series is None else series[1] if linear else "series"
    return (what, linear and what != "place", c.slot.component < 3)
