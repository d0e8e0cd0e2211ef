"""Plan → how long it takes, by part: trapezoids without jerk limits, each axis with its own rapid and acceleration.

A program protects its linear moves, and control and probe allow that at a feed only, far below rapid: `feed` in mm/min is the
positioning feed of the dialect. Without it the moves are taken to be rapid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from .gate import ALIVE_TIME, RELEASE, gate, served
from .records import OFF, Axis, Move, Plan, Touch

PROOF = "prove the probe alive"  # in each program
FIND = "find and back"  # the first of two touches: to the facet, off it, and to where the measuring move begins
PARTS = {
    "retract": "retract and clear",
    "clear": "retract and clear",
    "index": "index and clamp",
    "approach": "approach",
    "find": FIND,
    "off": FIND,
    "near": FIND,
    "probe": "probe",
    "back": "back off",
}
# Used where machine.yaml says nothing: mm/min or rad/min, and m/s² or rad/s².
DEFAULT_RAPID = {"linear": 10000.0, "rotary": math.radians(3600), "spindle": math.radians(3600)}
DEFAULT_ACCELERATION = {"linear": 2.0, "rotary": 5.0, "spindle": 5.0}


def trapezoid(distance: float, speed: float, acceleration: float) -> float:
    """distance, speed per s, acceleration per s² → s from rest to rest."""
    if distance * acceleration >= speed**2:
        return distance / speed + speed / acceleration
    return 2 * math.sqrt(distance / acceleration)


def _axis_time(axis: Axis, distance: float) -> float:
    speed = (axis.rapid or DEFAULT_RAPID[axis.kind]) / 60
    acceleration = axis.acceleration or DEFAULT_ACCELERATION[axis.kind]
    return trapezoid(distance, speed, acceleration * (1000 if axis.kind == "linear" else 1))


def of_moves(plan: Plan, feed: float | None = None, moves: Iterable[tuple[Move, Touch]] | None = None) -> Iterator[float]:
    """plan, mm/min of protected moves → s for each of its moves, one at a time; a measuring move ends at the nominal contact.

    `moves`: those of a program, with their touches, where it makes more than the plan.
    """
    axes = {axis.name: axis for axis in plan.machine.axes}
    at: dict[str, float] = {}
    approach = plan.strategy.approach
    search = {"probe": approach.standoff / (approach.feed / 60)}
    if approach.find is not None:
        search = {
            "find": approach.standoff / (approach.find.feed / 60),
            "probe": (approach.standoff - plan.nearer) / (approach.feed / 60),
        }
    search["prove"] = approach.standoff / (approach.feed / 60)
    search["probe"] += plan.machine.overhead
    for move, touch in plan.served if moves is None else moves:
        yield search[move.kind] if move.kind in search else _move_time(axes, at, move, feed)
        if move.kind in search:
            contact = dict(zip(plan.machine.names, touch.contact, strict=True))
            at |= {name: contact[name] for name in move.target}
        else:
            at |= move.target


def _move_time(axes: Mapping[str, Axis], at: Mapping[str, float], move: Move, feed: float | None) -> float:
    travelled = {name: abs(value - at.get(name, value)) for name, value in move.target.items()}
    moving = [name for name, distance in travelled.items() if distance > 1e-9]
    if move.kind == "index":  # programs turn one axis after the other
        return sum(axes[name].clamp_time + _axis_time(axes[name], travelled[name]) for name in moving)
    clamp = max((axes[name].clamp_time for name in moving), default=0.0)
    rapid = max((_axis_time(axes[name], travelled[name]) for name in moving), default=0.0)
    linear = [name for name in moving if axes[name].kind == "linear"]
    if feed is None or not linear:
        return clamp + rapid
    slowest = min(axes[name].acceleration or DEFAULT_ACCELERATION["linear"] for name in linear)
    way = math.hypot(*(travelled[name] for name in linear))
    ways = [OFF, max(way - OFF, 0.0)] if move.kind in ("off", "back") else [way]  # off the facet, then guarded
    return clamp + max(rapid, sum(trapezoid(part, feed / 60, slowest * 1000) for part in ways))


def duration(plan: Plan, feed: float | None = None) -> dict[str, float]:
    """plan, mm/min of protected moves → s by part; their sum is the predicted time of one cycle."""
    result = {part: 0.0 for part in PARTS.values() if part != FIND or plan.strategy.approach.find is not None}
    for move, time in zip(plan.moves, of_moves(plan, feed), strict=True):
        result[PARTS[move.kind]] += time
    return result


def proof(plan: Plan, which: str, feed: float | None = None) -> float:
    """plan, value of the option gate, mm/min of protected moves → s at most that a program takes to prove the probe alive."""
    if which == "finger":
        up = gate(plan)
        return ALIVE_TIME + RELEASE + (math.dist(up.start, up.end) / (feed / 60) if feed else 0.0)
    if which == "facet":
        return sum(of_moves(plan, feed, served(plan, which))) - sum(of_moves(plan, feed))
    return 0.0


def saved(plan: Plan, feed: float | None = None) -> float | None:
    """plan, mm/min of protected moves → s a cycle that touching twice saves, negative where it costs; None: it does not."""
    strategy = plan.strategy
    if strategy.approach.find is None:
        return None
    single = replace(plan, strategy=replace(strategy, approach=replace(strategy.approach, find=None)))
    return sum(duration(single, feed).values()) - sum(duration(plan, feed).values())


def spoken(seconds: float) -> str:
    """s → '23 s', '4 min', '1 h 12 min'."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
