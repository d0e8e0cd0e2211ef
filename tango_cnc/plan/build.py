"""Cell → Plan. Everything is computed for many touches at once, and kept as what places are worked out from (`places.py`).

Theory of operation. At one indexation the table stands still and the probe keeps its direction, so the tip moves in the
table frame as the linear axes do, on straight lines. Seen from there, with the spindle "above":

    ───── over ───────────────────── over ─────   the clear level: nothing on the table reaches it
           ┊                           ┊
         leave ───────────────────▶  enter        as low as what is under this one travel allows (`travel.py`)
           ▲ retract                   │ approach
        stand-off ──probe──▶ | facet   ▼          straight down, then along the facet's normal, and back the same way

The first touch of an indexation is entered from the clear level, and the last one left up to there: above it everything of the
probe is above the tip, so any way is free. Rotary axes turn only where a plane keeps the probe from everything on the table at
all angles that they pass (`clearance.py`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from .. import check, kinematics
from ..check.collision import Obstruction
from ..check.travel import travel_text
from ..records import OFF, Array, Cell, InputError, Plan, Probe, Strategy
from .clearance import MARGIN, Clearance
from .guard import TOUCH, Faults, Looked, complaint, refuse, remarks
from .places import Places, Rows, Scene, blocks, nowhere, scene
from .touches import PLACES, Planned
from .travel import DROP
from .turns import Turned
from .ways import begins, lifts

Fate = Literal["left out", "planned", "refused"]
OBSTRUCTED: dict[str, tuple[Fate, Fate]] = {  # what becomes of touches on facets that face away; at which anything else is hit
    "leave-out-facing-away": ("left out", "refused"),
    "leave-out": ("left out", "left out"),
    "refuse": ("refused", "refused"),
    "warn": ("planned", "refused"),
}
USUAL = "leave-out-facing-away"
NAMED = 8  # touches named in one complaint
THICK = "Measure the stem of the stylus and state probe.stylus_radius in machine.yaml: its radius, 1.5 mm where nothing is stated."
STRAIGHT = 1e-6  # mm aside
SAID = {"contact": "contact", "standoff": "stand-off", "end": "search end", "over": "clear level"}


def plan(cell: Cell, obstructed: str | None = None) -> Plan:
    """cell → plan. Raises InputError naming touch, facet, indexation and axis of what cannot be reached.

    `obstructed`, a key of `OBSTRUCTED`, else what the strategy states, else the usual: touches that a straight probe cannot make
    are an error, or are listed in the plan and not in its touches, whose numbers stay those of the strategy. With 'warn' those on
    facets that face away from the spindle are planned all the same and listed as doubtful: whoever wrote the strategy may have
    another stylus in mind.
    """
    return _planned(cell, obstructed, None)


def attempt(
    cell: Cell, obstructed: str | None = None, looked: Looked | None = None, turns_alone: bool = False
) -> tuple[Plan, Faults]:
    """cell → the same plan where all of its ways are safe; else one that is not to be run, and its ways that are not.

    For who chooses what to touch. `looked`: turns that were looked at, for all plans of a machine and table; it is added to.
    `turns_alone`: other ways are not looked at. Raises InputError for all else that `plan` refuses.
    """
    faults: Faults = {}
    return _planned(cell, obstructed, faults, looked, turns_alone), faults


def _planned(
    cell: Cell, obstructed: str | None, faults: Faults | None, looked: Looked | None = None, turns_alone: bool = False
) -> Plan:
    _one_stylus(cell)
    obstructed = obstructed or cell.strategy.obstructed or USUAL
    shared = scene(cell.machine, cell.artefact, cell.strategy, looked)
    facet, at = _order(cell.strategy, shared.facet)
    blocked = _blocked(shared, facet, at)
    before = cell.strategy.before

    def named(touch: int) -> str:
        pose = _pose(cell, int(at[touch]))
        return f"touch {before + touch + 1} (facet {shared.facet[facet[touch]]}, indexation {at[touch] + 1}: {pose})"

    said: dict[Fate, dict[int, str]] = {"left out": {}, "planned": {}, "refused": {}}
    for touch, found in sorted(blocked.items()):
        said[_fate(found, obstructed)][touch] = f"{named(touch)}: {found.why}"
    left_out = {before + touch + 1: text for touch, text in said["left out"].items()}
    doubtful, refused = tuple(said["planned"].values()), tuple(said["refused"].values())
    if refused:
        raise InputError(
            f"{cell.strategy.name}: {len(refused)} of {len(at)} touches cannot be made with a straight probe:\n"
            f"{_some(refused)}\n"
            "Take these facets out of those indexations, or let the plan do it (--obstructed leave-out)."
        )
    kept = np.setdiff1d(np.arange(len(at), dtype=np.int32), list(said["left out"]))
    if not len(kept):
        raise InputError(
            f"{cell.strategy.name}: no touch is left: a straight probe can make none of {len(at)}:\n"
            f"{_some([*left_out.values()])}\n"
            f"{THICK if _too_thick(cell.machine.probe) else 'Turn the table otherwise, or touch other facets.'}"
        )
    touches, turns = _made(cell, shared, kept + 1 + before, facet[kept], at[kept], None, faults, turns_alone)
    first = turns[0]
    start = (
        remarks(cell.machine, shared.guard, first.before, first.first)
        if shared.guard and first.first and not (faults or turns_alone)
        else ()
    )
    return Plan(cell.machine, cell.artefact, cell.strategy, touches, turns, left_out, doubtful, start)


def _too_thick(probe: Probe) -> bool:
    return probe.stylus_radius >= probe.tip_radius


def _styli(strategy: Strategy) -> tuple[int, ...]:
    return tuple(dict.fromkeys(i.stylus for i in strategy.indexations))


def _one_stylus(cell: Cell) -> None:
    used = _styli(cell.strategy)
    if used != (cell.machine.stylus,):
        raise InputError(
            f"{cell.strategy.name}: found touches with stylus {' and '.join(map(str, used))}; allowed: one stylus a program. "
            "Choose it with --stylus. Where the command has no --stylus, make a copy of the strategy with the indexations of "
            "one stylus only, and name the copy in tango.yaml"
        )


def by_stylus(cell: Cell) -> tuple[Cell, ...]:
    """cell → one for each stylus of its strategy, in the order of measurement: its own probe, its own indexations.

    Touches keep the numbers that they have in the whole strategy. A cell with one stylus comes back as it is.
    """
    strategy = cell.strategy
    if _styli(strategy) == (cell.machine.stylus,):
        return (cell,)
    found, before = [], strategy.before
    for number in _styli(strategy):
        own = tuple(i for i in strategy.indexations if i.stylus == number)
        part = replace(strategy, indexations=own, before=before)
        found.append(replace(cell, machine=cell.machine.with_stylus(number), strategy=part))
        before += sum(len(i.facets) for i in own)
    return tuple(found)


def reachable(cell: Cell, obstructed: str | None = None) -> Strategy:
    """cell → its strategy without the touches that plan leaves out, and without indexations of which none is left.

    Raises InputError when there is none at all.
    """
    obstructed = obstructed or cell.strategy.obstructed or USUAL
    shared, strategy = scene(cell.machine, cell.artefact, cell.strategy), cell.strategy
    facet, at = _order(strategy, shared.facet)
    blocked = _blocked(shared, facet, at)
    out = {row for row, found in blocked.items() if _fate(found, obstructed) == "left out"}
    kept: list[list[str]] = [[] for _ in strategy.indexations]
    for row in range(len(at)):
        if row not in out:
            kept[at[row]].append(shared.facet[facet[row]])
    left = tuple(replace(i, facets=tuple(names)) for i, names in zip(strategy.indexations, kept, strict=True) if names)
    if not left:
        why, count = Counter(blocked[row].why for row in out).most_common(1)[0]
        raise InputError(
            f"{strategy.name}: no touch is left: a straight probe can make none of {len(at)}; most often ({count} times): {why}. "
            "Correct what stands in the way there (obstacles in machine.yaml or artefact.yaml), or touch other facets"
        )
    return replace(strategy, indexations=left)


def _fate(found: Obstruction, obstructed: str) -> Fate:
    """what is in the probe's way, a key of `OBSTRUCTED` → what becomes of the touch."""
    away, other = OBSTRUCTED[obstructed]
    return away if found.kind == "facing" or (found.away and away == "left out") else other


def _order(strategy: Strategy, names: Sequence[str]) -> tuple[Rows, Rows]:
    """strategy, names of the facets → (n,) facet and (n,) indexation of every touch in its order, from 0."""
    rows = {name: row for row, name in enumerate(names)}
    count = [len(i.facets) for i in strategy.indexations]
    facet = (rows[name] for i in strategy.indexations for name in i.facets)
    return np.fromiter(facet, np.int32, sum(count)), np.repeat(np.arange(len(count), dtype=np.int32), count)


def _blocked(shared: Scene, facet: Rows, at: Rows) -> dict[int, Obstruction]:
    """scene, (n,) facets, (n,) indexations → {row: why the probe cannot make that touch}."""
    found = {}
    for rows in blocks(len(at)):
        names = tuple(shared.facet[row] for row in facet[rows].tolist())
        pose = check.Pose(names, shared.tip[facet[rows]], shared.normal[facet[rows]], shared.up[at[rows]])
        here = check.obstruction(pose, shared.machine.probe, shared.strategy.approach, shared.artefact, shared.solid)
        beside = _beside(shared, facet[rows], at[rows]) if shared.guard else {}
        found.update({rows.start + row: why for row, why in (beside | here).items()})
    return found


def _beside(shared: Scene, facet: Rows, at: Rows) -> dict[int, Obstruction]:
    """scene, (n,) facets, (n,) indexations → {row: what of the machine is in the way of that touch, from the clear level down}."""
    approach, probe = shared.strategy.approach, shared.machine.probe
    tip, normal = shared.tip[facet], shared.normal[facet]
    standoff, up = shared.standoff(facet, at)
    height = shared.top[at] + MARGIN + probe.tip_radius - np.einsum("ij,ij->i", standoff, up)
    over = standoff + np.maximum(height, DROP)[:, None] * up
    places = shared.axes(at, np.array([tip - approach.search * normal, standoff + OFF * normal, standoff, over])).transpose(1, 0, 2)
    found: dict[int, Obstruction] = {}
    for some in (slice(0, 2), slice(2, 4)):
        met = shared.guard.meets(places[:, some], TOUCH)
        for row in np.flatnonzero(met >= 0).tolist():
            found.setdefault(row, Obstruction(complaint(shared.guard.pairs[int(met[row])], TOUCH), "shank", False))
    return found


def part(whole: Plan, numbers: Sequence[int]) -> Plan:
    """plan, numbers of touches → the plan of these alone, numbers and order kept, with a safe way between them (for --resume).

    Raises InputError for a number that the plan lacks, and when no touch is left.
    """
    wanted = set(numbers)
    number = planned(whole).number
    unknown = wanted.difference(number.tolist())
    if unknown or not wanted:
        found = f"touch {min(unknown)}" if unknown else "no touch"
        raise InputError(f"part of a plan: found {found}; allowed: touches {number[0]} … {number[-1]} of the plan")
    return of_rows(whole, np.flatnonzero(np.isin(number, list(wanted))))


def of_rows(whole: Plan, rows: Rows) -> Plan:
    """plan, rows of its touches in their order → the plan of these, with a safe way between them."""
    touches = planned(whole)
    own = touches.places
    assert isinstance(own, Places)
    number, facet, at = (column[rows] for column in (touches.number, touches.facet, touches.indexation))
    found, turns = _made(whole, own.scene, number, facet, at, None if own.given is None else own.given[rows])
    return replace(whole, touches=found.part_of(touches), turns=turns)


def planned(whole: Plan) -> Planned:
    """plan → its touches as the planner makes them, those of a plan made by hand too."""
    if isinstance(whole.touches, Planned) and isinstance(own := whole.touches.places, Places) and own.scene.belongs_to(whole):
        return whole.touches
    shared = scene(whole.machine, whole.artefact, whole.strategy)
    rows = {name: row for row, name in enumerate(shared.facet)}
    number, facet, at = np.array([(t.number, rows[t.facet], t.indexation) for t in whole.touches], np.int32).T.copy()
    given = np.array([[getattr(t, name) for name in PLACES[:3]] for t in whole.touches])
    return Planned(
        number, facet, shared.facet, at, Places(shared, facet, at, np.zeros((3, len(at))), nowhere(given.shape[2]), given)
    )


def _made(
    whole: Cell | Plan,
    shared: Scene,
    number: Rows,
    facet: Rows,
    at: Rows,
    given: Array | None,
    faults: Faults | None = None,
    turns_alone: bool = False,
) -> tuple[Planned, Turned]:
    """cell or plan, (n,) numbers, facets, indexations of touches → these, and the turns between them.

    `faults`: takes the ways that are not safe. Without it these raise InputError.
    """
    lift, level = lifts(shared, facet, at)
    places = Places(shared, facet, at, lift, nowhere(shared.station.shape[1]), given)
    touches = Planned(number, facet, shared.facet, at, places)
    if isinstance(whole, Cell):
        _within(whole, touches)
    turns = Clearance(shared, level).turns(touches, begins(shared, at), lambda index: _pose(whole, index), faults)
    left = _at_once(touches, turns, shared)
    made = Planned(number, facet, shared.facet, at, replace(places, left=left))
    if not turns_alone:
        refuse(Plan(shared.machine, shared.artefact, shared.strategy, made, turns), shared.guard, faults)
    return made, turns


def _at_once(touches: Planned, turns: Turned, shared: Scene) -> tuple[Rows, Array]:
    """touches, turns between them → `Places.left`: all the way up to where axes turn, where that is straight above the touch."""
    after = np.searchsorted(touches.number, turns.touch[1:]) - 1
    goal, straight = turns.places[1:, 0], np.empty(len(after), bool)
    for some in blocks(len(after)):
        over = touches.places(after[some])[:, PLACES.index("over")]
        way = kinematics.tip(shared.chain, goal[some]) - kinematics.tip(shared.chain, over)
        straight[some] = np.linalg.norm(np.cross(way, shared.up[touches.indexation[after[some]]]), axis=1) < STRAIGHT
    return after[straight].astype(np.int32), goal[straight]


def _within(cell: Cell, touches: Planned) -> None:
    """Raises InputError naming every kind of position that leaves the travel of an axis."""
    machine, found = cell.machine, []
    for some in blocks(len(touches)):
        places = touches.places(np.arange(some.start, some.stop))
        here = []
        for kind, what in SAID.items():
            position = places[:, PLACES.index(kind)]
            beyond = check.outside(machine, position)
            for row, column in zip(*(axis.tolist() for axis in np.nonzero(beyond)), strict=True):
                name, touch = machine.names[column], touches[some.start + row]
                needs = travel_text(machine, name, position[row, column])
                pose = f"indexation {touch.indexation + 1}: {_pose(cell, touch.indexation)}"
                # What turns is the same for all touches of an indexation, and said once.
                one = f"touch {touch.number} (facet {touch.facet}, {pose}): the {what} needs {needs}"
                here.append((row + some.start, f"{pose} needs {needs}" if name in machine.rotary else one))
        found += sorted(here, key=lambda item: item[0])
    if found:
        raise InputError(
            f"{cell.strategy.name}: {len({row for row, _ in found})} of {len(touches)} touches are beyond the travel of an axis:\n"
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
