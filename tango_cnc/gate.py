"""Plan → what proves the probe alive before the first touch: a slow move during which somebody touches the stylus, or a facet.

The finger finds a dead probe where nothing is. The facet is for runs that nobody watches: it is touched from above, where the last
run has found it, by a search that ends so little behind it that a probe that says nothing comes to no harm.

Posts write it, the read-back asks for it, a driver makes it; all three take it from here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from .records import InputError, Machine, Move, MoveKind, Plan, Touch

ALIVE = 10.0  # mm of the slow move during which somebody touches the stylus, before the first descent
ALIVE_TIME = 20.0  # s of it, for a person to get there
RELEASE = 5  # s for the hand to go
HOLD = "HOLD THE STYLUS ASIDE"  # what a program shows that has to stop because of it
TOUCH = "TOUCH THE STYLUS"  # what a program shows then, word by word
BENT = 0.5  # mm: every stylus gives way by more; what a probe that says nothing is bent at most
BEHIND = 0.45  # mm behind its facet where the search ends that proves the probe; the rest is for rounded angles (0.006 deg on grbl)
ABOVE = math.cos(math.radians(45.0))  # of the angle between tool and facet normal: touched from above
STEP = 0.5  # mm of the step that shows whether positions come in mm: every stylus gives way by more
STEP_FEED = 60.0  # mm/min of it
ALONG = 0.1  # mm along the spindle of 1 mm of an axis: less, and the axis lies across it
INCH = 25.4  # mm
MIRRORED = "MIRROR IMAGE OR SCALING"  # what a program says where the step goes the other way, or too far
PROVING = "PROVING THE PROBE AT FACET"  # what a program says before it does


@dataclass(frozen=True, slots=True)
class Gate:
    """The slow move that proves the probe alive: positions (mm, rad; columns of `Machine.names`) of its beginning and its end.

    It begins where the first descent begins, at the clear level, and goes up along the tool, or sideways where there is no room.
    With a tool that lies the clear level is beside the table, and the way down to it is a descent, too.
    """

    start: tuple[float, ...]
    end: tuple[float, ...]
    feed: float  # mm/min
    before: int  # which of the moves of the plan (`Plan.served`) comes after it
    along: str  # axis letter that moves most, with its sign where the tool lies: else it goes up


def gate(plan: Plan) -> Gate:
    """plan → the slow move before the first descent. Raises InputError where the travels leave no room for one."""
    first, linear = plan.touches[0], [plan.machine.column(name) for name in plan.machine.linear]
    before, start = _descends(plan)
    up = [first.over[i] - first.standoff[i] for i in linear]
    length = math.hypot(*up)
    ways = [[u / length for u in up]] if length > 1e-6 else []
    for k in range(len(linear)):
        ways += [[s * float(i == k) for i in range(len(linear))] for s in (1.0, -1.0) if not ways or abs(ways[0][k]) < 0.1]
    room, way = max(((_room(plan, start, linear, way), -n) for n, way in enumerate(ways)), default=(0.0, 0))
    if room < 1:
        raise InputError(
            f"touch {first.number}: no axis has 1 mm of way left at the clear level; allowed: room for the move that "
            "proves the probe alive; correct travels, artefact or approach, or state gate: none under controller:"
        )
    end = list(start)
    for i, part in zip(linear, ways[-way], strict=True):
        end[i] += room * part
    moved = {name: end[plan.machine.column(name)] - start[plan.machine.column(name)] for name in plan.machine.linear}
    most = max(moved, key=lambda name: abs(moved[name]))
    along = f"{'-' if moved[most] < 0 else ''}{most}" if _lies(plan) else ""
    return Gate(start, tuple(end), round(room / ALIVE_TIME * 60, 1), before, along)


def _lies(plan: Plan) -> bool:
    """plan → whether the tool lies at its first touch: more than 45 deg from how it stands with the rotary axes at 0."""
    first, machine = plan.touches[0], plan.machine
    off = {name: first.over[machine.column(name)] - first.standoff[machine.column(name)] for name in machine.linear}
    length = math.hypot(*off.values())
    return length > 1e-6 and sum(way * _up(machine, name) for name, way in off.items()) / length < ABOVE - 1e-9


def _descends(plan: Plan) -> tuple[int, tuple[float, ...]]:
    """plan → which of its moves is the first that goes below what nothing is beside, and where the axes stand before it.

    With a tool that stands that is the approach from the clear level; with one that lies, what follows its turn, high up.
    """
    first, lies, turned = plan.touches[0], _lies(plan), False
    at: dict[str, float] = {}
    for number, (move, _) in enumerate(plan.served):
        if lies and turned and move.kind == "clear":
            return number, tuple(at.get(name, first.over[i]) for i, name in enumerate(plan.machine.names))
        if move.kind == "approach":
            return number, first.enter or first.over
        turned |= move.kind == "index"
        at.update(move.target)
    return 0, first.enter or first.over


def _room(plan: Plan, start: Sequence[float], linear: Sequence[int], way: Sequence[float]) -> float:
    """place, columns, direction → mm that there are within the travels, at most `ALIVE`."""
    room = min(ALIVE, plan.strategy.approach.standoff + plan.strategy.approach.search)
    for i, part in zip(linear, way, strict=True):
        travel = plan.machine.axes[i].travel
        if travel is not None and abs(part) > 1e-9:
            room = min(room, ((travel[1] if part > 0 else travel[0]) - start[i]) / part)
    return room


def step(plan: Plan) -> tuple[str, float]:
    """plan → axis letter and mm of the step before all else that shows whether positions come in mm.

    A program that takes the difference of two frames from the control would go anywhere where they come in inches. The step is
    along the axis of its first move, away from its upper end, where people begin with the rotary axes at 0, wherever a head points
    at the first touch; it is said as a distance, so no frame matters.
    """
    first, touch = next(move for move, _ in plan.served), plan.touches[0]
    name = next(name for name in plan.machine.linear if name in first.target)
    column = plan.machine.column(name)
    up = _up(plan.machine, name)
    if abs(up) < ALONG:
        up = touch.over[column] - touch.standoff[column]
    return name, -math.copysign(STEP, up if abs(up) > 1e-9 else 1.0)


def _up(machine: Machine, name: str) -> float:
    """machine, linear axis → mm along the spindle, away from the table, of 1 mm of it while the rotary axes are at 0."""
    way = sum(d * s for d, s in zip(machine.axis(name).direction, machine.spindle.direction, strict=True))
    return way if name in machine.tool_branch else -way


def proving_touch(plan: Plan) -> Touch:
    """plan → the touch of its first indexation that proves the probe: most from above, its search ending `BEHIND` behind it.

    Where a run has found its facet elsewhere (`Plan.met`) the whole touch is there. Raises InputError where no facet is touched
    from above.
    """
    linear = [plan.machine.column(name) for name in plan.machine.linear]
    first = plan.touches[0].indexation
    known = list(takewhile(lambda touch: touch.indexation == first, plan.touches))
    touch = max(known, key=lambda each: (round(_above(each, linear), 6), -each.number))
    if (best := _above(touch, linear)) < ABOVE:
        raise InputError(
            f"gate: found facet; the first indexation touches nothing from above: touch {touch.number}, the nearest, is "
            f"{math.degrees(math.acos(best)):.0f} deg from the tool; allowed: a facet within 45 deg of it at the first indexation "
            "of strategy.yaml, or gate: finger"
        )
    part, by = min(BEHIND / plan.strategy.approach.search, 1.0), plan.met.get(touch.number, 0.0) / plan.strategy.approach.search
    way = [(e - c) * (i in linear) for i, (c, e) in enumerate(zip(touch.contact, touch.end, strict=True))]
    moved = (tuple(p + by * w for p, w in zip(place, way, strict=True)) for place in (touch.standoff, touch.contact))
    standoff, contact = moved
    end = tuple(c + part * w for c, w in zip(contact, way, strict=True))
    return replace(touch, standoff=standoff, contact=contact, end=end, enter=None, leave=None)


def from_above(plan: Plan) -> list[Touch]:
    """plan → its touches on facets that are touched from above: one of them may have to prove the probe."""
    linear = [plan.machine.column(name) for name in plan.machine.linear]
    return [touch for touch in plan.touches if _above(touch, linear) >= ABOVE]


def served(plan: Plan, which: str) -> Iterator[tuple[Move, Touch]]:
    """plan, value of the option gate → its moves and their touches; with `facet`, what proves the probe before the first descent.

    From the clear level it goes down to the stand-off of `proving_touch`, touches it (`prove`), and comes back where it was.
    Raises InputError as `proving_touch`.
    """
    proven = which != "facet"
    at: dict[str, float] = {}
    for move, touch in plan.served:
        if move.kind == "approach" and not proven:
            proven, one = True, proving_touch(plan)
            yield from ((each, one) for each in _proof(plan, one, at))
        at.update(move.target)
        yield move, touch


def _proof(plan: Plan, one: Touch, at: dict[str, float]) -> Iterator[Move]:
    """plan, touch that proves the probe, where the axes stand → down to it, touch it, and back there; only axes that move."""
    names, linear, first = plan.machine.names, plan.machine.linear, plan.touches[0]
    begun = here = tuple(at.get(name, first.over[i]) for i, name in enumerate(names))
    ways: tuple[tuple[MoveKind, tuple[float, ...]], ...] = (
        ("retract", first.over),
        ("clear", one.over),
        ("near", one.standoff),
        ("prove", one.end),
        ("back", one.standoff),
        ("retract", one.over),
        ("clear", first.over),
        ("near", begun),
    )
    for kind, place in ways:
        if changed := {n: v for n, v, old in zip(names, place, here, strict=True) if n in linear and abs(v - old) > 1e-9}:
            yield Move(kind, changed, one.number)
        here = place


def _above(touch: Touch, linear: Sequence[int]) -> float:
    """touch, columns → cosine of the angle between the way off its facet and the tool; 0 where the clear level is the stand-off."""
    off = [touch.standoff[i] - touch.contact[i] for i in linear]
    up = [touch.over[i] - touch.standoff[i] for i in linear]
    length = math.hypot(*off) * math.hypot(*up)
    cosine = sum(a * b for a, b in zip(off, up, strict=True)) / length if length > 1e-9 else 0.0
    return max(-1.0, min(1.0, cosine))
