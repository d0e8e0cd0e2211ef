"""How high the probe is above the stand-offs of touches: at the clear level, and on the way between two of one indexation."""

from __future__ import annotations

import numpy as np

from ..records import Array
from .clearance import MARGIN
from .places import Rows, Scene, blocks
from .travel import DROP, Roof, Travels


def lifts(scene: Scene, facet: Rows, at: Rows) -> tuple[Array, Array]:
    """(n,) facets, (n,) indexations → (3, n) mm above the stand-offs: clear level, entering, leaving; (m,) mm, clear levels."""
    probe, height = scene.machine.probe, np.empty(len(at))
    for rows in blocks(len(at)):
        height[rows] = np.einsum("ij,ij->i", *scene.standoff(facet[rows], at[rows]))
    level = np.maximum(scene.top + MARGIN + probe.tip_radius, _highest(height, at, len(scene.up)) + DROP)
    clear = level[at] - height
    enter, leave = clear.copy(), clear.copy()
    follows, roof = np.flatnonzero(~_turned(scene, at)), Roof(scene.solid, probe)
    for some in blocks(len(follows)):
        before, after = follows[some], follows[some] + 1
        (start, up), (end, _) = (scene.standoff(facet[these], at[these]) for these in (before, after))
        rise, fall = roof.lifts(Travels(start, end, up), np.minimum(level[at[before]], level[at[after]]))
        same = facet[before] == facet[after]  # up and down again above the same place, where nothing is passed over
        leave[before], enter[after] = np.where(same, DROP, rise), np.where(same, DROP, fall)
    return np.array([clear, enter, leave]), level


def begins(scene: Scene, at: Rows) -> Rows:
    """(n,) indexations → rows of the touches before which rotary axes turn, the first one among them."""
    return np.concatenate([[0], 1 + np.flatnonzero(_turned(scene, at))])


def _turned(scene: Scene, at: Rows) -> Rows:
    """(n,) indexations → (n − 1,) whether the touch after it is made at other angles."""
    found = np.empty(len(at) - 1, bool)
    for rows in blocks(len(found)):
        found[rows] = (scene.station[at[rows]] != scene.station[at[1:][rows]]).any(axis=1)
    return found


def _highest(height: Array, at: Rows, count: int) -> Array:
    """(n,) heights, (n,) indexation of each → (count,) the largest of each indexation."""
    highest = np.full(count, -np.inf)
    np.maximum.at(highest, at, height)
    return highest
