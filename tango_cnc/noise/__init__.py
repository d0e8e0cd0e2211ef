"""Noise as the residuals show it → honest standard deviations: white, walk, seating, rough facets, outliers.

A least-squares fit takes every touch for independent. A machine that warms up, clamps that seat anew at every indexation, a
rough facet: each makes touches err together, and what they put into a parameter is then far beyond its standard deviation. Here
the residuals tell how large each of these is (restricted maximum likelihood; Patterson and Thompson 1971), and parameters and
covariance are those of generalised least squares with it, as Henderson's mixed model equations give them (1975).

    gap = J δ + Z_walk u + Z_seat v + ε,   u ~ N(0, θ_w), v ~ N(0, θ_s), ε ~ N(0, σ² s_f²)

The walk is a Wiener process in each direction of the machine frame, by its first Karhunen–Loève functions: smooth drifts lie
in it. Touches that a robust fit with a high breakdown point cannot reach have no weight (least absolute deviations, then
bisquare; Yohai 1987).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..estimate import Estimate, Noise, student
from ..model import known, linearise
from ._fit import by_noise
from ._step import moved

STRAIGHT = 0.01  # mm: a touch that moves by less between two fits sees the same derivatives, but for 1 part in 1000
BENT = 0.1  # of the white scatter, by which what a touch moves further may differ from what its derivatives say
ROUNDS = 4


def honest(result: Estimate) -> Estimate:
    """estimate → the same model with parameters, standard deviations and outliers by the noise that its residuals show.

    `noise.step` says where everything moved at once, if it did: the touches before and after contradict each other then.
    """
    found = by_noise(result)
    for _ in range(ROUNDS):
        way = result.jacobian[: len(result.residuals)] @ (found.values - result.values)
        if not np.abs(way[~found.unused]).max(initial=0.0) > STRAIGHT:
            break
        there = _at(result, found)
        bent = np.abs(there.residuals - found.residuals).max(initial=0.0)
        if found.noise is not None and bent < BENT * found.noise.white:
            break
        result, found = there, by_noise(there, settled=False)
    step = moved(result, found)
    found = replace(found, covariance=found.covariance * student(found.dof) ** 2)
    return found if step is None else replace(found, noise=replace(found.noise or Noise(found.sigma), step=step))


def _at(result: Estimate, found: Estimate) -> Estimate:
    """least-squares estimate, which gross errors drew far away, the same by its noise → the first at the unknowns of the other."""
    gaps, jacobian = linearise(result.model, found.values)
    offsets, rows, _ = known(result.model, found.values)
    return replace(result, values=found.values, residuals=gaps, jacobian=np.vstack([jacobian, rows]), known_residuals=offsets)
