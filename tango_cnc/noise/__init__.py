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

from ..estimate import Estimate, Noise
from ._fit import by_noise
from ._step import moved


def honest(result: Estimate) -> Estimate:
    """estimate → the same model with parameters, standard deviations and outliers by the noise that its residuals show.

    `noise.step` says where everything moved at once, if it did: the touches before and after contradict each other then.
    """
    found = by_noise(result)
    step = moved(result, found)
    return found if step is None else replace(found, noise=replace(found.noise or Noise(found.sigma), step=step))
