"""Where rotary axes turn: as low as the angles that they pass allow, and 20 mm from everything all the way.

The way of every turn is walked along in small steps, the axes one after the other in every order and together, and those with
room for a whole turn the other way round as well. How far the probe is from block and ball is a true distance of convex bodies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.blockcell import HALF, block, cell, machine, positions
from support.distances import Body, distance
from support.few import every

from tango_cnc import kinematics
from tango_cnc.plan import clearance, plan, sweep, travel
from tango_cnc.records import Array, Artefact, Cell, InputError, Machine, Obstacle, Plan, Probe

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
    limited = replace(
        base, probe=probe, axes=tuple(replace(a, travel=_rad(travels.get(a.name, a.travel), a.name)) for a in base.axes)
    )
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
    return [
        Body(middle + BOX * HALF, np.vstack([np.eye(3), -np.eye(3)])),
        Body(np.array([ball.centre]), np.zeros((0, 3)), ball.radius),
    ]


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


@pytest.mark.few(1)
@pytest.mark.parametrize("topology", every(TABLES + HEADS, 2))
def test_all_along_a_turn_the_probe_keeps_20_mm_from_everything(topology: str) -> None:
    for made in random_plans(topology, 3):
        assert nearest(made) > clearance.MARGIN - FOUND


@pytest.mark.campaign
@pytest.mark.parametrize("topology", TABLES + HEADS)
def test_all_along_many_turns_the_probe_keeps_20_mm_from_everything(topology: str) -> None:
    for made in random_plans(topology, 100, seed=5):
        assert nearest(made) > clearance.MARGIN - FOUND


@pytest.mark.few(0)
@pytest.mark.parametrize("topology", every(TABLES + HEADS, 2, first=1))
def test_the_ways_to_a_turn_and_from_it_are_free(topology: str) -> None:
    for made in random_plans(topology, 3, seed=2):
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


@pytest.mark.few(1)
@pytest.mark.parametrize("topology", every(TABLES, 2))
def test_no_table_turns_higher_than_above_the_sphere_that_it_sweeps(topology: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lower = []
    for made in random_plans(topology, 6, seed=3):
        whole = Cell(Path(), made.machine, made.artefact, made.strategy, ("S3",))
        high = spheres(monkeypatch, lambda whole=whole: plan(whole, "leave-out"))  # type: ignore[misc]
        lower += [_above(high, i) - _above(made, i) for i in range(1, len(made.turns))]
    assert min(lower) > -FOUND and max(lower) > 50
    assert _above(made, 0) == _above(high, 0) and _above(made, -1) <= _above(high, -1) + FOUND


def _above(made: Plan, turn: int) -> float:
    """→ mm along the tool, of the tip where axes turn."""
    at = np.array([made.turns[turn].before])
    chain = kinematics.chain(made.machine)
    return float(np.vdot(kinematics.tip(chain, at), kinematics.spindle_axis(chain, at)))


@pytest.mark.few(0)
def test_a_head_goes_no_longer_way_than_around_spheres(monkeypatch: pytest.MonkeyPatch) -> None:
    for topology in HEADS:
        for made in random_plans(topology, 3, seed=4):
            whole = Cell(Path(), made.machine, made.artefact, made.strategy, ("S3",))
            high = spheres(monkeypatch, lambda whole=whole: plan(whole, "leave-out"))  # type: ignore[misc]
            assert _length(made) <= _length(high) + FOUND


@pytest.mark.parametrize("topology", ["wXYfZCB(S)t", "wCXYfZB(S)t"])
def test_a_head_leaves_in_the_direction_between_where_that_is_shorter(topology: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From B 20 to B 80: along the tool as it stands or will stand, and upwards, are longer ways out than in the middle."""
    head = cell(machine(topology), block(), [{"B": 20.0}, {"B": 80.0}], facets=["5"])
    short, ways = _length(plan(head, "leave-out")), clearance.Clearance._ways
    monkeypatch.setattr(clearance.Clearance, "_ways", lambda *given: [ways(*given)[0][:3], *ways(*given)[1:]])
    assert short < _length(plan(head, "leave-out")) - 40


def _length(made: Plan) -> float:
    """→ mm that the linear axes go on their way from indexation to indexation."""
    columns = [made.machine.column(name) for name in made.machine.linear]
    return sum(
        float(np.linalg.norm((end - start)[columns])) for kind, _, start, end in positions(made) if kind in ("retract", "clear")
    )


def narrow(*poses: dict[str, float], room: float = 200.0, centre: tuple[float, float, float] = (0.0, 0.0, -40.0)) -> Cell:
    """A block on a tilting table of little travel, C of so many degrees; only its top is touched."""
    base = machine("wCBXfZY(S)t")
    travels = {"B": (-math.radians(100), math.radians(100)), "C": (-math.radians(room / 2), math.radians(room / 2))}
    axes = tuple(replace(axis, travel=travels.get(axis.name, axis.travel)) for axis in base.axes)
    return cell(replace(base, axes=axes), block(centre), poses, facets=["5"])


@pytest.mark.parametrize(
    ("pose", "rise"),
    [
        ({"S": 90.0}, 0.0),
        ({"C": 100.0}, 0.0),
        ({"B": 5.0}, 0.0),  # the ball's top, at z 30, goes down, and no edge of the block comes up as far
        ({"B": 60.0}, 100 * math.sin(math.radians(60)) - 10 * math.cos(math.radians(60)) - 30),  # the edge at x −100, z −10 does
    ],
)
def test_a_turn_is_as_high_as_it_has_to_be(pose: dict[str, float], rise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    made, high = plan(narrow({}, pose)), spheres(monkeypatch, lambda: plan(narrow({}, pose)))
    z = made.machine.column("Z")
    over = made.touches[0].over[z]
    assert made.turns[1].before[z] - over == pytest.approx(rise, abs=1e-6)
    assert high.turns[1].before[z] - over > 110


def test_a_turn_is_lifted_over_a_bridge_that_swings_up_with_the_table() -> None:
    """It is carried by B, beside the probe at B -50 and at B 50; in between it is right under it, 110 mm high."""
    free = narrow({"B": -50.0}, {"B": 50.0})
    bridge = Obstacle("box", low=(-15.0, -40.0, 60.0), high=(15.0, 40.0, 110.0), on="B")
    low, made = plan(free), plan(replace(free, machine=replace(free.machine, obstacles=(bridge,))))
    z = made.machine.column("Z")
    assert [touch.facet for touch in made.touches] == [touch.facet for touch in low.touches]
    assert made.turns[1].before[z] > low.turns[1].before[z] + 20


@pytest.mark.parametrize("seed", range(12))
def test_how_far_a_point_gets_in_one_turn_is_what_walking_along_it_finds(seed: int) -> None:
    """C alone passes some angles, also between one below and one above zero; the walk turns the points by itself."""
    rng = np.random.default_rng(seed)
    middle, half = float(rng.uniform(-1.0, 1.0)), float(rng.uniform(0.5, 2.5))
    table = machine("wCXfYZ(S)t", {"C": (20.0, -30.0, 0.0)})
    points, way = rng.uniform(-200, 200, (3, 3)), rng.normal(size=3)
    way /= np.linalg.norm(way)
    span = (middle - half, middle + half)
    at = np.zeros(len(table.names))
    found = sweep.reach(table, ("C",), at, {"C": span}, (points, np.zeros(3)), way)
    direction, about = np.array(table.axis("C").direction), np.array(table.axis("C").point)
    turns = Rotation.from_rotvec(np.linspace(*span, 4001)[:, None] * direction)
    walked = max(float((turns.apply(point - about) + about).dot(way).max()) for point in points)
    assert found == pytest.approx(walked, abs=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_how_far_a_point_gets_while_two_axes_turn_is_at_most_a_hundredth_more_than_walking_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = {"B": tuple(rng.uniform(-80, 80, 3)), "C": tuple(rng.uniform(-80, 80, 3))}
    table = machine("wCBXfYZ(S)t", points)
    middle, half = rng.uniform(-1.0, 1.0, 2), rng.uniform(0.3, 2.5, 2)
    spans = dict(zip("BC", zip((middle - half).tolist(), (middle + half).tolist(), strict=True), strict=True))
    body, way = rng.uniform(-200, 200, (3, 3)), rng.normal(size=3)
    way /= np.linalg.norm(way)
    found = sweep.reach(table, ("B", "C"), np.zeros(len(table.names)), spans, (body, np.zeros(3)), way)
    walked = body[None]
    for name in "CB":  # B carries C
        direction, about = np.array(table.axis(name).direction), np.array(table.axis(name).point)
        turns = Rotation.from_rotvec(np.linspace(*spans[name], 301)[:, None] * direction).as_matrix()
        walked = (np.einsum("nij,mj->nmi", turns, (walked - about).reshape(-1, 3)) + about).reshape(-1, 1, 3)
    farthest = float(walked.reshape(-1, 3).dot(way).max())
    assert farthest - 1e-3 <= found <= farthest + 0.01 * 400.0


def test_an_axis_with_room_for_a_whole_turn_may_go_either_way_round() -> None:
    """A block beside C on a tilted table: the other way from −80 to 80 brings it up."""
    poses = [{"B": 60.0, "C": -80.0}, {"B": 60.0, "C": 80.0}]
    low, high = (_above(plan(narrow(*poses, room=room, centre=(150.0, 0.0, -40.0))), 1) for room in (350.0, 360.0))
    assert high > low + 100


@pytest.mark.few(1)
@pytest.mark.parametrize("blind", ["A", "B", "C"])
def test_a_planner_that_forgot_an_axis_would_be_found(blind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def forgetful(m: Machine, *places: Array) -> sweep.Spans:
        return {name: (places[0][m.column(name)],) * 2 if name == blind else span for name, span in known(m, *places).items()}

    known = sweep.spans
    monkeypatch.setattr(sweep, "spans", forgetful)
    topologies = [topology for topology in TABLES + HEADS if blind in topology]
    assert any(nearest(made) < clearance.MARGIN - 5 for topology in topologies for made in random_plans(topology, 4))


def test_how_a_spindle_stands_does_not_matter_to_what_a_head_sweeps() -> None:
    base = machine("wXYfZCA(S)t")
    high = [plan(cell(base, block(), [{"S": angle}], facets=["5"])).turns[-1].before[:3] for angle in (0.0, 270.0)]
    np.testing.assert_allclose(*high)


@pytest.mark.parametrize("height", [-700.0, 900.0])
def test_which_point_of_its_line_a_rotary_axis_states_does_not_matter(height: float) -> None:
    poses = [{"A": 20.0, "C": 0.0}, {"A": -40.0, "C": 90.0}]
    near, far = (plan(cell(machine("wCXfYZA(S)t", {"C": (0.0, 0.0, z)}), block(), poses)) for z in (-40.0, height))
    np.testing.assert_allclose([turn.after for turn in near.turns], [turn.after for turn in far.turns], atol=1e-6)


@pytest.mark.long
@given(st.integers(0, 2**32 - 1))
def test_the_sphere_that_a_table_sweeps_is_as_small_as_two_axes_and_a_middle_allow(seed: int) -> None:
    """Its centre is on the axis that turns all, next to the other; of one axis alone halfway between the ends of its load."""
    rng = np.random.default_rng(seed)
    axis, place, far = _unit(rng), rng.uniform(-300, 300, 3), float(rng.uniform(-900, 900))
    balls = rng.uniform(-200, 200, (5, 3)), rng.uniform(0, 40, 5)
    one = _tilted(machine("wCXfYZ(S)t"), {"C": (axis, place)})
    centre, radius = sweep.sphere(one, ("C",), np.zeros(len(one.names)), balls)
    ends = (balls[0] - place) @ axis
    middle = place + (np.min(ends - balls[1]) + np.max(ends + balls[1])) / 2 * axis
    np.testing.assert_allclose(centre, middle, atol=1e-6)
    assert radius == pytest.approx(np.max(np.linalg.norm(balls[0] - middle, axis=1) + balls[1]))

    other, beside = _unit(rng), rng.uniform(-300, 300, 3)
    found = []
    for moved in (0.0, far):  # which points of their lines machine.yaml states does not matter
        two = _tilted(machine("wCAYfXZ(S)t"), {"A": (axis, place + moved * axis), "C": (other, beside - moved * other)})
        found.append(sweep.sphere(two, ("A", "C"), np.zeros(len(two.names)), balls))
    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-4)
    assert found[0][1] == pytest.approx(found[1][1], abs=1e-4)
    apart = abs((beside - place) @ np.cross(axis, other)) / np.linalg.norm(np.cross(axis, other))
    assert abs((found[0][0] - place) @ axis) == pytest.approx(np.linalg.norm(found[0][0] - place), abs=1e-6), "on the first axis"
    assert np.linalg.norm(np.cross(found[0][0] - beside, other)) == pytest.approx(apart, abs=1e-4), "nowhere nearer to the other"
    foot = beside + ((found[0][0] - beside) @ other) * other
    load = float(np.max(np.linalg.norm(balls[0] - foot, axis=1) + balls[1]))
    assert found[0][1] == pytest.approx(apart + load, abs=1e-4), "the way to the other axis, and what is farthest from there"


def _unit(rng: np.random.Generator) -> Array:
    direction = rng.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))


def _tilted(base: Machine, lines: dict[str, tuple[Array, Array]]) -> Machine:
    """machine, {axis: unit vector, point mm} → these axes along these lines."""
    axes = (
        replace(a, direction=tuple(lines[a.name][0].tolist()), point=tuple(lines[a.name][1].tolist())) if a.name in lines else a
        for a in base.axes
    )
    return replace(base, axes=tuple(axes))
