"""How a facet is touched: no further from it, and no longer past it, than what is known of its place asks for.

Most of a slow touch is a search through air. Where an earlier run says how far facets were from where they should be, the stand-off
is as small as that allows and one slow touch does. Where nobody knows, a fast first touch finds the facet and a slow one
measures it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .. import kinematics
from ..records import Approach, Cell, Find, Readings
from ..touches import from_readings

FREE = 1.5  # mm from the surface at which a probe and its control are ready again
LEAST, SHORTEST = 2.0, 0.5  # mm of stand-off and search
SAFETY = 1.5  # times the farthest that a facet was from its place
FINDING = 600.0  # mm/min of a first touch; it is measured again, so its scatter does not count


@dataclass(frozen=True)
class Touching:
    """Approach of the strategy, and why."""

    approach: Approach
    why: str


def known_within(cell: Cell, readings: Readings) -> float:
    """cell, readings of an earlier run → mm: farther than this no facet is from where machine.yaml and artefact.yaml have it."""
    touches = from_readings(cell.machine, cell.artefact, readings)
    tip = kinematics.tip(touches.chain, touches.position)
    away = np.abs(np.sum((tip - touches.point) * touches.normal, axis=1) - cell.machine.probe.tip_radius)
    return SAFETY * float(away.max(initial=0.0))


def touching(own: Approach, within: float | None, source: str = "--within") -> Touching:
    """approach of the cell's strategy, mm within which facets are where they should be or None, who says so → approach."""
    if within is not None:
        standoff = max(LEAST, math.ceil(10 * (within + FREE)) / 10)
        search = max(SHORTEST, math.ceil(10 * (within + 0.2)) / 10)
        approach = Approach(standoff, search, own.feed)
        return Touching(
            approach, f"facets are within {within:.2g} mm of their places ({source}): one slow touch from {standoff:g} mm"
        )
    retreat = max(LEAST, own.search + 0.5)
    feed = max(FINDING, own.feed)
    once = own.standoff / own.feed * 60
    twice = (own.standoff / feed + retreat / own.feed) * 60 + 0.2
    if own.find is None and retreat < own.standoff and twice < once:
        approach = Approach(own.standoff, own.search, own.feed, Find(feed, retreat))
        return Touching(
            approach, "nobody has said how well the places of facets are known (--within): a fast touch finds, a slow one measures"
        )
    return Touching(own, "as in the strategy of the cell")


def scatter(repeatability: float, feed: float, period: float) -> float:
    """mm, mm/min, s between two looks of the control at the probe → mm, standard deviation of a touch at that feed.

    The position is latched up to one period late, evenly: feed · period / √12. Its mean is the same for all touches of one feed and
    works like a smaller ball.
    """
    return math.hypot(repeatability, feed / 60 * period / math.sqrt(12))
