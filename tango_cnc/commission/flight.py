"""Plan of a cell → a plan in the air: measuring moves at the clear level of a few indexations, that meet nothing.

    probe moves up from the stand-off ▲ 5 mm, record of a miss     ▶ 5 mm along every other linear axis, at the first indexation
    stand-off  ──────────────────────── 10 mm above the clear level
    clear level ─ ─ ─ nothing on the table reaches it at this indexation

Rotary axes turn where the cell's own plan turns them, so what is tried here is what the cell does later.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from .. import kinematics
from ..gate import gate
from ..plan import part, plan_hash, refuse
from ..records import Array, InputError, Move, Plan, Touch
from .experiment import Question

MOST = 6  # indexations
ABOVE, WAY = 10.0, 5.0  # mm over the clear level where a measuring move begins; mm that it goes
ENTER = 1.0  # mm above its beginning from where it is approached
HELD = 0.5  # mm of the one move while somebody holds the stylus aside: no stylus breaks
HELD_FEED = 60.0  # mm/min of that move: a hand has time to let go
UNTRIED_FEED = 1000.0  # mm/min of protected moves while nobody has seen that up is up: a person has time for feed hold
SEEN = math.radians(5.0)  # of a turn that a person can judge
UPRIGHT = 0.9  # part of the way up that one axis makes: it needs no move of its own


def air(whole: Plan, most: int = MOST, own: int | None = None) -> Plan:
    """plan of a cell, indexations at most → plan in the air: measuring moves that are misses where all is right, numbered from 1.

    One up along the tool at each indexation, and at the first one along each other linear axis. `own`: how many indexations are
    those of the cell; what `rolling` has added behind them is made besides, at the end. Raises InputError where the travels leave
    no room above the clear level.
    """
    chosen = _chosen(whole, most, len(whole.strategy.indexations) if own is None else own)
    few = part(whole, [touch.number for touch in chosen])
    up = _up(whole)
    touches: list[Touch] = []
    number = {few.touches[-1].number + 1: 0}  # of the cell's plan → of this one
    for touch in few.touches:
        number[touch.number] = len(touches) + 1
        ways = [up, *(_sideways(few, touch, up) if not touches else ())]
        touches += [_moved(touch, up, way, len(touches) + i) for i, way in enumerate(ways, 1)]
    number[few.touches[-1].number + 1] = len(touches) + 1
    turns = tuple(replace(turn, touch=number[turn.touch]) for turn in few.turns)
    approach = replace(few.strategy.approach, standoff=WAY / 2, search=WAY / 2, find=None)
    made = replace(few, touches=tuple(touches), turns=turns, strategy=replace(few.strategy, approach=approach))
    _within(made)
    refuse(made)
    gate(made)
    plan_hash(made)
    return made


def held(made: Plan) -> Plan:
    """plan in the air, at whose end the machine stands → a plan of one guarded move of `HELD` mm up from there, and no touch.

    It is for a hand that holds the stylus aside: a control that goes on all the same bends nothing. Where the travel ends there,
    it goes down, 10 mm above the clear level. Raises InputError where the axis has no room at all.
    """
    begun, at = next(move for move in made.moves), dict[str, float]()
    for move in made.moves:
        at.update(move.target)
    name = next(name for name in made.machine.linear if name in begun.target)
    up = math.copysign(HELD, float(_up(made)[made.machine.column(name)]))
    low, high = made.machine.axis(name).limits
    place = next((at[name] + by for by in (up, up / 10, -up) if low <= at[name] + by <= high), None)
    if place is None:
        raise InputError(f"{name}: {at[name]:.1f} mm is where the moves in the air end; allowed: {HELD:g} mm of travel beside it")
    return replace(made, touches=made.touches[:1], turns=(), only=Move("retract", {name: place}, made.touches[0].number))


def along(made: Plan) -> dict[str, Question]:
    """plan in the air → {linear axis: which move goes along it and where to}."""
    chain, found = kinematics.chain(made.machine), dict[str, Question]()
    for touch in made.touches:
        way = np.array(touch.end) - np.array(touch.standoff)
        name = max(made.machine.linear, key=lambda axis: abs(way[made.machine.column(axis)]))
        column = made.machine.column(name)
        if name in found or touch.indexation != made.touches[0].indexation or abs(way[column]) < UPRIGHT * WAY:
            continue
        begin, end = kinematics.tip(chain, np.array([touch.standoff, touch.end]))
        moved = f"move {touch.number} took {name} from {touch.standoff[column]:.1f} to {touch.end[column]:.1f}"
        text = f"{moved}: did the probe move {_seen(made, end - begin, touch.number == 1)}?"
        found[name] = Question(text, (touch.number,))
    return found


def turning(made: Plan) -> dict[str, Question]:
    """plan in the air → {rotary axis: which turn to look at and how it has to be}."""
    found: dict[str, Question] = {}
    for axis in (axis for axis in made.machine.axes if axis.kind == "rotary"):
        column = made.machine.column(axis.name)
        turns = [(b.standoff[column] - a.standoff[column], a, b) for a, b in pairwise(made.touches)]
        turns = [turn for turn in turns if abs(turn[0]) < math.pi] or turns  # beyond half a turn nobody can say which way it was
        turned = max(turns, key=lambda turn: abs(turn[0]), default=None)
        if turned is None or abs(turned[0]) < math.radians(0.5):
            continue
        by, before, after = turned
        what = "the table" if axis.name in made.machine.workpiece_branch else "the spindle head"
        where = ", ".join(f"{v:g}" for v in axis.direction)
        angles = (math.degrees(touch.standoff[column]) for touch in (before, after))
        turn = f"between move {before.number} and move {after.number} {axis.name} went {' to '.join(f'{v:.1f}' for v in angles)}"
        way = f"turn {'counter' if by > 0 else ''}clockwise (or the other way round by more than half a turn)"
        text = f"{turn}: where ({where}) of the machine points at you, did {what} {way}?"
        found[axis.name] = Question(text, (before.number, after.number))
    return found


def _seen(made: Plan, way: Array, up: bool) -> str:
    """(3,) mm of the tip as seen from the table → where it goes, in words that the person at the machine can check."""
    if up:
        return "away from the table"
    facets = {key: float(np.dot(facet.point, way)) for key, facet in made.artefact.facets.items()}
    least, most = min(facets, key=lambda key: facets[key]), max(facets, key=lambda key: facets[key])
    return f"from the side of facet {least} towards the side of facet {most}, seen from the table"


def _moved(touch: Touch, up: Array, way: Array, number: int) -> Touch:
    """touch of the cell, up, direction of its move in the air, number → that move."""
    begin = np.array(touch.over) + ABOVE * up
    places = [begin, begin + WAY / 2 * way, begin + WAY * way, np.array(touch.over) + (ABOVE + ENTER) * up]
    standoff, contact, end, over = (tuple(float(v) for v in place) for place in places)
    return Touch(number, "air", touch.indexation, standoff, contact, end, over)


def _sideways(made: Plan, touch: Touch, up: Array) -> Iterator[Array]:
    """→ the step of 1 mm along each linear axis that does not go up by itself, where there is room, and never down."""
    begin = np.array(touch.over) + ABOVE * up
    for name in made.machine.linear:
        column, travel = made.machine.column(name), made.machine.axis(name).limits
        if abs(up[column]) >= UPRIGHT:
            continue
        signs = (math.copysign(1.0, up[column]),) if abs(up[column]) > 1e-3 else (1.0, -1.0)
        for sign in signs:
            if travel[0] <= begin[column] + sign * WAY <= travel[1]:
                step = np.zeros(len(made.machine.names))
                step[column] = sign
                yield step
                break


def _chosen(whole: Plan, most: int, own: int) -> Sequence[Touch]:
    """→ the first touch of indexations that differ in every rotary axis and the spindle, and of the added ones."""
    first: dict[int, Touch] = {}
    added: dict[int, Touch] = {}
    for touch in whole.touches:
        (first if touch.indexation < own else added).setdefault(touch.indexation, touch)
    turned = [whole.machine.column(name) for name in (*whole.machine.rotary, "S")]
    found: list[Touch] = []
    for touch in first.values():
        if len(found) < most and (not found or any(all(abs(touch.over[i] - f.over[i]) > 1e-6 for f in found) for i in turned)):
            found.append(touch)
    found = _turning(found, list(first.values()), turned, most)
    for touch in first.values():  # and a second look at each sense of turning, as far as there is room
        if len(found) < most and touch not in found:
            found.append(touch)
    return sorted([*found, *added.values()], key=lambda touch: touch.number)


def _turning(found: Sequence[Touch], every: Sequence[Touch], columns: Sequence[int], most: int) -> list[Touch]:
    """chosen touches, all there are, columns of axes that turn, how many at most → chosen ones that turn every axis, if any do.

    The axis that swings the head often stands still at the first indexations of a strategy: nobody would be asked of its sense.
    """
    still = [c for c in columns if max(t.over[c] for t in found) - min(t.over[c] for t in found) < SEEN]
    more: list[Touch] = []
    for column in still:
        others = [touch for touch in every if touch not in (*found, *more)]
        turns = [(abs(touch.over[column] - found[0].over[column]), -touch.number, touch) for touch in others]
        far = [turn for turn in turns if SEEN <= turn[0] < math.pi]
        more += [max(far)[2]] if far and len(more) < most - 1 else []
    return [found[0], *found[1 : most - len(more)], *more]


def _up(whole: Plan) -> Array:
    """→ (k,) the step of 1 mm up along the tool, in the columns of the linear axes."""
    touch = whole.touches[0]
    way = np.array(touch.over) - np.array(touch.standoff)
    for name in (*whole.machine.rotary, "S"):
        way[whole.machine.column(name)] = 0.0
    length = float(np.linalg.norm(way))
    if length < 1e-6:
        raise InputError(f"touch {touch.number}: its stand-off is at the clear level; allowed: one below it, so that up is known")
    up: Array = way / length
    return up


def _within(made: Plan) -> None:
    for touch in made.touches:
        for axis, *values in zip(made.machine.axes, touch.standoff, touch.end, touch.over, strict=True):
            if axis.travel is not None and not all(axis.travel[0] - 1e-6 <= v <= axis.travel[1] + 1e-6 for v in values):
                raise InputError(
                    f"{axis.name}: {max(values):.1f} mm is beyond its travel {axis.travel[0]:g} … {axis.travel[1]:g}; allowed: "
                    f"{ABOVE + WAY:g} mm of room above the clear level at every indexation, to try the control there"
                )
