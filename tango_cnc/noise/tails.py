"""Touches that scatter with heavy tails: who is far off counts for less, and intervals are those of Student's t.

A normal distribution gives a touch that is three standard deviations off the same say as any other. Where many are, as the
residuals show, a parameter that rests on few touches (a ball, a gain) follows them, and its interval does not say so. The
likelihood of Student's t with ν degrees of freedom weighs a touch by (ν + 1) / (ν + u²), u its residual over its scatter,
and a touch is then worth (ν + 1) / (ν + 3) of a normal one of that scatter (Lange, Little and Taylor 1989, JASA 84).
"""

from __future__ import annotations

import numpy as np
from scipy import special

from ..records import Array

SHAPES = (2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0)  # ν that are tried
WORTH = 6.0  # twice the gain in log likelihood, against normal touches, from which tails are heavy
SCALES = np.exp(np.arange(-1.2, 0.05, 0.05))  # of t's scatter over the standard deviation
FEWEST = 60  # touches to spare: fewer do not show their tails


def tails(off: Array, spare: float) -> tuple[float, float] | None:
    """(n,) residuals over their standard deviations, touches to spare → ν of the Student's t that fits them, its scatter over
    the standard deviation; None where normal touches are about as likely.
    """
    if spare < FEWEST:
        return None
    square = off[:, None] ** 2
    best, found = WORTH / 2 - 0.5 * float(np.sum(square)) - 0.5 * len(off) * np.log(2 * np.pi), None
    for nu in SHAPES:
        constant = special.gammaln((nu + 1) / 2) - special.gammaln(nu / 2) - 0.5 * np.log(nu * np.pi)
        logs = len(off) * (constant - np.log(SCALES)) - (nu + 1) / 2 * np.log1p(square / (nu * SCALES**2)).sum(axis=0)
        most = int(np.argmax(logs))
        if logs[most] > best:
            best, found = float(logs[most]), (nu, float(SCALES[most]))
    return found


def thinned(left: Array, cut: float) -> float:
    """(n,) residuals over their scatter, how far off a touch loses its weight → factor of the standard deviations where tails that
    are not heavy enough for `tails` reach that cut.

    The slope of the mean of ψ(r) = r for |r| < c is P(|r| < c) − 2 c f(c) (Huber and Ronchetti 2009, 3.2); gross errors far beyond
    c leave it at P, tails that pass through c do not. The density at c is that of the touches within a fifth of it.
    """
    size = np.abs(left)
    inside = float(np.mean(size < cut))
    near = float(np.mean(np.abs(size / cut - 1) < 0.2)) / 0.4
    return inside / max(inside - near, 0.5)
