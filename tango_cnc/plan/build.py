"""Cell → Plan. Everything is computed for all touches at once, and kept as arrays.

Theory of operation. At one indexation the table stands still and the probe keeps its direction, so the tip moves in the
table frame as the linear axes do, on straight lines. Seen from there, with the spindle "above":

    ───── over ───────────────────── over ─────   the clear level: nothing on the table reaches it
           ┊                           ┊
         leave ───────────────────▶  enter        as low as what is under this one travel allows (`travel.py`)
           ▲ retract                   │ approach
        stand-off ──probe──▶ | facet   ▼          straight down, then along the facet's normal, and back the same way

The first touch of an indexation is entered from the clear level, and the last one left up to there: above it everything of the
probe is above the tip, so any way is free. Rotary axes turn only where the sphere that the table can sweep, and the sphere that
a swivelling probe can sweep, are apart (`clearance.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import check, kinematics
from ..check.travel import travel_text
from ..records import Array, Cell, InputError, Plan, Probe, Touch, Turn
from .clearance import MARGIN, Clearance
from .touches import PLACES, Planned
from .travel import DROP, Roof, Travels

OBSTRUCTED = ("warn", "refuse", "leave-out")  # what to do with touches that the probe cannot make
Rows = NDArray[np.int64]
NAMED = 8  # touches named in one complaint
STRAIGHT = 1e-6  # mm aside


def plan(cell: Cell, obstructed: str = "warn") -> Plan:
    """cell → plan. Raises InputError naming touch, facet, indexation and axis of what cannot be reached.

    `obstructed`: touches at which the straight probe would hit what is on the table are an error ('refuse'), or are not planned
    and listed in the plan ('leave-out'). With 'warn' only those on facets that face away from the spindle are planned all the
    same, as the strategy asks for them, and listed as doubtful: whoever wrote the strategy may have another stylus in mind.
    """
    machine, artefact, approach = cell.machine, cell.artefact, cell.strategy.approach
    chain = kinematics.chain(machine)
    station = np.array([[i.position.get(name, 0.0) for name in machine.names] for i in cell.strategy.indexations])
    at = np.repeat(np.arange(len(station)), [len(i.facets) for i in cell.strategy.indexations])
    facets = [facet for i in cell.strategy.indexations for facet in i.facets]
    place = {facet: i for i, facet in enumerate(artefact.facets)}
    row = np.array([place[f] for f in facets])
    point = np.array([f.point for f in artefact.facets.values()])[row]
    normal = np.array([f.normal for f in artefact.facets.values()])[row]
    spindle = kinematics.spindle_axis(chain, station)
    tip = point + machine.probe.tip_radius * normal
    solid = check.solid(artefact)

    def named(touch: int) -> str:
        return f"touch {touch + 1} (facet {facets[touch]}, indexation {at[touch] + 1}: {_pose(cell, at[touch])})"

    blocked = check.obstruction(check.Pose(tuple(facets), tip, normal, spindle[at]), machine.probe, approach, artefact, solid)
    said = {touch: f"{named(touch)}: {found.why}" for touch, found in sorted(blocked.items())}
    doubtful = [touch for touch, found in blocked.items() if obstructed == "warn" and found.kind == "facing"]
    doubts = tuple(said.pop(touch) for touch in sorted(doubtful))
    if said and obstructed != "leave-out":
        raise InputError(
            f"{cell.strategy.name}: {len(said)} of {len(facets)} touches cannot be made with a straight probe:\n"
            f"{_some(said.values())}\n"
            "Take these facets out of those indexations, or let the plan do it (--obstructed leave-out)."
        )
    left_out = tuple(said.values())
    if said:
        keep = np.setdiff1d(np.arange(len(facets)), list(said))
        if not len(keep):
            raise InputError(f"{cell.strategy.name}: no touch is left; the first one was {left_out[0]}")
        at, tip, normal, facets = at[keep], tip[keep], normal[keep], [facets[i] for i in keep]

    def axes(tips: Array) -> Array:
        return _inverse(chain, station[at], tips)

    standoff = tip + approach.standoff * normal
    ways = _ways(machine.probe, solid, standoff, spindle, station, at)
    tips = (standoff, tip, tip - approach.search * normal, ways.over, ways.enter, ways.leave)
    places = np.empty((len(facets), len(PLACES), len(machine.names)))
    for column, at_tips in enumerate(tips):
        places[:, column] = axes(at_tips)
    said_of = {"contact": "contact", "standoff": "stand-off", "end": "search end", "over": "clear level"}
    _within(cell, facets, at, {text: places[:, PLACES.index(name)] for name, text in said_of.items()})
    touches = Planned(1 + np.arange(len(facets)), facets, at, places)
    turns = Clearance(machine, chain, solid, ways.level, station).turns(touches, lambda index: _pose(cell, index))
    _at_once(touches, turns, chain, spindle)
    return Plan(machine, artefact, cell.strategy, touches, turns, left_out, doubts)


def part(whole: Plan, numbers: Sequence[int]) -> Plan:
    """plan, numbers of touches → the plan of these alone, numbers and order kept, with a safe way between them (for --resume).

    Raises InputError for a number that the plan lacks, and when no touch is left.
    """
    wanted = set(numbers)
    unknown = wanted - {touch.number for touch in whole.touches}
    if unknown or not wanted:
        found = f"touch {min(unknown)}" if unknown else "no touch"
        raise InputError(f"part of a plan: found {found}; allowed: touches 1 … {whole.touches[-1].number} of the plan")
    return of_rows(whole, [row for row, touch in enumerate(whole.touches) if touch.number in wanted])


def of_rows(whole: Plan, rows: Sequence[int]) -> Plan:
    """plan, rows of its touches in their order → the plan of these, with a safe way between them."""
    machine, chain, solid = whole.machine, kinematics.chain(whole.machine), check.solid(whole.artefact)
    station = np.array([[i.position.get(name, 0.0) for name in machine.names] for i in whole.strategy.indexations])
    spindle = kinematics.spindle_axis(chain, station)
    found = _columns(whole.touches, np.array(rows))
    at = found.indexation
    facets = [whole.artefact.facets[facet] for facet in found.facet]
    normal = np.array([facet.normal for facet in facets])
    tip = np.array([facet.point for facet in facets]) + machine.probe.tip_radius * normal
    standoff = tip + whole.strategy.approach.standoff * normal
    ways = _ways(machine.probe, solid, standoff, spindle, station, at)
    places = (_inverse(chain, station[at], tips) for tips in (ways.over, ways.enter, ways.leave))
    found.places[:, 3:] = np.stack(tuple(places), axis=1)
    clearance = Clearance(machine, chain, solid, ways.level, station)
    turns = clearance.turns(found, lambda index: _pose(whole, index))
    _at_once(found, turns, chain, spindle)
    return replace(whole, touches=found, turns=turns)


def _columns(touches: Sequence[Touch], rows: Rows) -> Planned:
    """touches, some rows → these, as arrays."""
    if isinstance(touches, Planned):
        return touches.rows(rows)
    some = [touches[row] for row in rows]
    places = np.array([[getattr(t, name) or t.over for name in PLACES] for t in some])
    return Planned(np.array([t.number for t in some]), [t.facet for t in some], np.array([t.indexation for t in some]), places)


def _at_once(touches: Planned, turns: Sequence[Turn], chain: kinematics.Chain, spindle: Array) -> None:
    """touches just made, turns between them → those are left all the way up to where axes turn that have it straight above them."""
    after = np.searchsorted(touches.number, [turn.touch for turn in turns]) - 1
    rows = after[after >= 0]
    places = np.array([turn.before for turn, row in zip(turns, after, strict=True) if row >= 0])
    low, high = kinematics.tip(chain, touches.places[rows, PLACES.index("over")]), kinematics.tip(chain, places)
    aside = np.linalg.norm(np.cross(high - low, spindle[touches.indexation[rows]]), axis=1)
    straight = aside < STRAIGHT
    touches.places[rows[straight], PLACES.index("leave")] = places[straight]
    touches.places.flags.writeable = False  # a plan is not changed


@dataclass(frozen=True)
class _Ways:
    """Where the tip of the probe is above its touches, table frame, and the clear level of every indexation."""

    over: Array  # (n, 3) mm
    enter: Array  # (n, 3)
    leave: Array  # (n, 3)
    level: Array  # (m,) mm


def _ways(probe: Probe, solid: check.Solid, standoff: Array, spindle: Array, station: Array, at: Rows) -> _Ways:
    """probe, bodies, (n, 3) mm stand-offs, (m, 3) directions to the spindle, (m, k) indexations, (n,) that of each touch → ways."""
    up = spindle[at]
    height = np.einsum("ij,ij->i", standoff, up)
    top = solid.top(spindle) + MARGIN + probe.tip_radius
    level = np.maximum(top, _highest(height, at, len(spindle)) + DROP)
    clear = level[at] - height
    follows = np.flatnonzero((np.diff(station[at], axis=0) == 0).all(axis=1))
    enter, leave = clear.copy(), clear.copy()
    travels = Travels(standoff[follows], standoff[follows + 1], up[follows])
    most = np.minimum(level[at[follows]], level[at[follows + 1]])
    leave[follows], enter[follows + 1] = Roof(solid, probe).lifts(travels, most)
    over, entered, left = (standoff + lift[:, None] * up for lift in (clear, enter, leave))
    return _Ways(over, entered, left, level)


def _highest(height: Array, at: Rows, count: int) -> Array:
    """(n,) heights, (n,) indexation of each → (count,) the largest of each indexation."""
    highest = np.full(count, -np.inf)
    np.maximum.at(highest, at, height)
    return highest


def _inverse(chain: kinematics.Chain, position: Array, tip: Array) -> Array:
    try:
        return kinematics.inverse(chain, position, tip)
    except np.linalg.LinAlgError:
        raise InputError("machine: the three linear axes do not span space; check their directions") from None


def _within(cell: Cell, facets: Sequence[str], at: Rows, positions: Mapping[str, Array]) -> None:
    """Raises InputError naming every kind of position that leaves the travel of an axis."""
    machine = cell.machine
    found = []
    for what, position in positions.items():
        beyond = check.outside(machine, position)
        for row, column in zip(*np.nonzero(beyond), strict=True):
            name = machine.names[column]
            needs = travel_text(machine, name, position[row, column])
            pose = f"indexation {at[row] + 1}: {_pose(cell, at[row])}"
            # What turns is the same for all touches of an indexation, and said once.
            turns = name in machine.rotary
            text = f"{pose} needs {needs}" if turns else f"touch {row + 1} (facet {facets[row]}, {pose}): the {what} needs {needs}"
            found.append((row, text))
    if found:
        found.sort(key=lambda item: item[0])
        raise InputError(
            f"{cell.strategy.name}: {len({row for row, _ in found})} of {len(facets)} touches are beyond the travel of an axis:\n"
            f"{_some(dict.fromkeys(text for _, text in found))}\n"
            "Take these facets out of those indexations, turn the table otherwise, or correct travels, probe length and facets."
        )


def _pose(cell: Cell | Plan, index: int) -> str:
    """indexation, from 0 → 'B 30 C -90 S 0'."""
    position = cell.strategy.indexations[index].position
    return " ".join(f"{name} {math.degrees(position.get(name, 0.0)):g}" for name in (*cell.machine.rotary, "S"))


def _some(lines: Iterable[str]) -> str:
    """lines → the first of them, one below the other, and how many more there are."""
    listed = list(lines)
    more = [f"  … and {len(listed) - NAMED} more"] if len(listed) > NAMED else []
    return "\n".join([f"  {line}" for line in listed[:NAMED]] + more)
