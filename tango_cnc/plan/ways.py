"""How high the probe is above the stand-offs of touches: at the clear level, and on the way between two of one indexation."""

from __future__ import annotations

import numpy as np

from .. import check
from ..records import Array
from .clearance import MARGIN
from .guard import TRAVEL
from .places import Rows, Scene, blocks
from .travel import DROP, Roof, Travels

RISES = (20.0, 50.0, 100.0, 200.0, 400.0)  # mm above the clear level that are tried where something of the machine is in the way


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
    lift = np.array([clear, enter, leave])
    return _beside(scene, facet, at, lift, level, follows) if scene.guard else (lift, level)


def _beside(scene: Scene, facet: Rows, at: Rows, lift: Array, level: Array, follows: Rows) -> tuple[Array, Array]:
    """lifts and clear levels, rows of touches that the next one follows at the same angles → the same, above what is in the way.

    A way that comes too near what is declared on the machine goes over the clear level; where that is too low, the clear level of
    its indexation is raised as far as it helps. What nothing helps is left as it is, for the plan to be refused by name.
    """
    lift, level = lift.copy(), level.copy()
    over, enter, leave = lift
    met = _met(scene, facet, at, leave, enter, follows)
    leave[follows[met]], enter[follows[met] + 1] = over[follows[met]], over[follows[met] + 1]
    met &= _met(scene, facet, at, leave, enter, follows)
    for index in np.unique(at[follows[met]]).tolist():
        some = follows[met & (at[follows] == index)]
        own = np.flatnonzero(at == index)
        for more in RISES:
            raised = lift.copy()
            raised[0, own] += more
            raised[2, some], raised[1, some + 1] = raised[0, some], raised[0, some + 1]
            if check.outside(scene.machine, _over(scene, facet, at, raised[0], own)).any():
                break
            if not _met(scene, facet, at, raised[2], raised[1], some).any():
                lift[:], level[index] = raised, level[index] + more
                break
    return lift, level


def _met(scene: Scene, facet: Rows, at: Rows, leave: Array, enter: Array, rows: Rows) -> Rows:
    """→ (n,) whether the way from these touches to the next comes too near what is declared on the machine."""
    found = np.zeros(len(rows), bool)
    for some in blocks(len(rows)):
        before, after = rows[some], rows[some] + 1
        places = np.stack([_over(scene, facet, at, leave, before), _over(scene, facet, at, enter, after)], axis=1)
        found[some] = scene.guard.meets(places, TRAVEL) >= 0
    return found


def _over(scene: Scene, facet: Rows, at: Rows, lift: Array, rows: Rows) -> Array:
    """→ (n, k) mm rad, that far above the stand-offs of these touches."""
    standoff, up = scene.standoff(facet[rows], at[rows])
    return scene.axes(at[rows], (standoff + lift[rows, None] * up)[None])[0]


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
