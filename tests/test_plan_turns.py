"""Where rotary axes turn: as low as the angles that they pass allow, and 20 mm from everything all the way.

The way of every turn is walked along in small steps, the axes one after the other in every order and together, and those with
room for a whole turn the other way round as well. How far the probe is from block and ball is a true distance of convex bodies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from blockcell import HALF, block, cell, machine, positions
from distances import Body, distance

from tango_cnc import kinematics
from tango_cnc.plan import clearance, plan, sweep, travel
from tango_cnc.records import Array, Artefact, Cell, InputError, Machine, Plan, Probe

TABLES = ("wCBXfZY(S)t", "wCAYfXZ(S)t", "wCXfYZ(S)t", "wCBfXZY(S)t")
HEADS = ("wCXfYZB(S)t", "wCXfYZA(S)t", "wXYfZCA(S)t", "wfXYZCB(S)t", "wYfXZB(S)t")
TRAVELS = ((-100.0, 100.0), (-170.0, 170.0), (-365.0, 365.0), None)  # deg
STEP = math.radians(4.0)
FOUND = 1e-3  # mm within which places and distances are computed
BOX = np.array(list(itertools.product((-1, 1), repeat=3)))


def random_cell(topology: str, rng: np.random.Generator) -> Cell:
    """Tables and heads with axes anywhere, some of little travel and some of much; every other turn is a small one."""
    length = float(rng.choice([120.0, 300.0]))
    work = topology.split("f")[0]
    points = {name: tuple(rng.uniform(-80, 80, 3).round(1).tolist()) for name in work if name in "ABC"}
    base = machine(topology, points, length)
    travels = {name: TRAVELS[rng.integers(len(TRAVELS))] for name in base.rotary}
    probe = Probe(length, 3.0, 0.0005, body_radius=25.0, body_length=length / 2, nose_radius=float(rng.choice([0.0, 60.0, 110.0])))
    poses = [{name: float(rng.uniform(*(travels[name] or (-180, 180)))) for name in base.rotary}]
    while len(poses) < 4:
        if rng.random() < 0.5:
            name = str(rng.choice(base.rotary))
            low, high = travels[name] or (-400.0, 400.0)
            poses.append(poses[-1] | {name: float(np.clip(poses[-1][name] + rng.uniform(-30, 30), low, high))})
        else:
            poses.append({name: float(rng.uniform(*(travels[name] or (-180, 180)))) for name in base.rotary})
    limited = replace(base, probe=probe, axes=tuple(replace(a, travel=_rad(travels.get(a.name, a.travel), a.name)) for a in base.axes))
    return cell(limited, block(rng.uniform(-100, 100, 3)), [pose | {"S": float(rng.choice([0, 270]))} for pose in poses])


def _rad(travel: tuple[float, float] | None, name: str) -> tuple[float, float] | None:
    return travel if travel is None or name not in "ABC" else (math.radians(travel[0]), math.radians(travel[1]))


def random_plans(topology: str, count: int, seed: int = 1) -> Iterator[Plan]:
    """→ plans of random cells, without those that nobody can make."""
    rng = np.random.default_rng([seed, *topology.encode()])
    while count:
        try:
            yield plan(random_cell(topology, rng), "leave-out")
        except InputError:
            continue
        count -= 1


def bodies(artefact: Artefact) -> list[Body]:
    """→ the block and its ball, as they are."""
    ball = next(iter(artefact.balls.values()))
    middle = np.array(ball.centre) - [60.0, 40.0, 60.0]
    return [Body(middle + BOX * HALF, np.vstack([np.eye(3), -np.eye(3)])), Body(np.array([ball.centre]), np.zeros((0, 3)), ball.radius)]


def apart(made: Plan, path: Array, enough: float = clearance.MARGIN) -> float:
    """(n, k) mm rad → mm between probe and table, the least; no more than `enough` is asked."""
    chain = kinematics.chain(made.machine)
    return distance(
        kinematics.tip(chain, path), kinematics.spindle_axis(chain, path), made.machine.probe, bodies(made.artefact), enough
    )


def ways(m: Machine, start: Array, end: Array) -> Iterator[Array]:
    """→ (n, k), every way that a control may take from the one to the other."""
    turning = [m.column(name) for name in m.rotary if start[m.column(name)] != end[m.column(name)]]
    round_ = [_either(m, column, start[column], end[column]) for column in turning]
    for goals in itertools.product(*round_):
        goal = start.copy()
        goal[turning] = goals
        yield _straight(start, goal)
        for order in itertools.permutations(turning):
            at = start
            for column in order:
                there = at.copy()
                there[column] = goal[column]
                yield _straight(at, there)
                at = there


def _either(m: Machine, column: int, start: float, end: float) -> tuple[float, ...]:
    """→ where an axis may go: to its angle, and the other way round to the same place if there is room for a whole turn."""
    room = m.axes[column].travel
    whole = room is None or room[1] - room[0] >= math.tau
    return (end, end - math.copysign(math.tau, end - start)) if whole else (end,)


def _straight(start: Array, end: Array) -> Array:
    steps = 2 + int(np.abs(end - start).max() / STEP)
    return start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)


def turned(made: Plan) -> Iterator[tuple[Array, Array]]:
    """→ where the axes are before and after every turn but those of the first touch, before which they are nobody knows where."""
    first = made.touches[0].number
    return ((start, end) for kind, touch, start, end in positions(made) if kind == "index" and touch != first)


def nearest(made: Plan) -> float:
    """→ mm, the least between probe and table in all turns."""
    return min((apart(made, way) for start, end in turned(made) for way in ways(made.machine, start, end)), default=math.inf)


@pytest.mark.parametrize("topology", TABLES + HEADS)
def test_all_along_a_turn_the_probe_keeps_20_mm_from_everything(topology: str) -> None:
    for made in random_plans(topology, 12):
        assert nearest(made) > clearance.MARGIN - FOUND


@pytest.mark.parametrize("topology", TABLES + HEADS)
def test_the_ways_to_a_turn_and_from_it_are_free(topology: str) -> None:
    for made in random_plans(topology, 6, seed=2):
        first = made.touches[0].number
        for kind, touch, start, end in positions(made):
            if kind == "clear" and touch != first:
                path = start + np.linspace(0.0, 1.0, 2 + int(np.abs(end - start).max() / 10.0))[:, None] * (end - start)
                assert apart(made, path, travel.MARGIN) > travel.MARGIN - FOUND


def spheres(monkeypatch: pytest.MonkeyPatch, work: Callable[[], Plan]) -> Plan:
    """→ the plan of somebody who knows nothing of the angles."""
    with monkeypatch.context() as blind:
        blind.setattr(sweep, "spans", lambda *given: None)
        return work()
