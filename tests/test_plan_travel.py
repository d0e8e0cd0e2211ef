"""How far the probe goes up between two touches: never too low, by distances of a probe that is walked along; never too high, by
a linear program that asks the same of each body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from support.blockcell import block, cell, machine, positions

from tango_cnc import duration, kinematics
from tango_cnc.check import Solid, solid
from tango_cnc.check.solid import Body
from tango_cnc.plan import plan
from tango_cnc.plan.travel import DROP, MARGIN, Roof, Travels, parts
from tango_cnc.records import Array, Artefact, Ball, Obstacle, Probe

PROBE = Probe(150.0, 3.0, 0.0005, stylus_radius=1.5, body_radius=20.0, body_length=60.0, nose_radius=45.0)
FAR = 1e6  # mm: as high as anybody wants


def boxes(rng: np.random.Generator, count: int) -> list[Obstacle]:
    low = rng.uniform(-100, 60, (count, 3))
    return [Obstacle("box", low=tuple(a), high=tuple(a + rng.uniform(5, 80, 3))) for a in low]


def things(rng: np.random.Generator) -> Artefact:
    """Two boxes, a cylinder and a hull, no table and no ball."""
    axis = rng.normal(size=3)
    post = Obstacle(
        "cylinder", base=tuple(rng.uniform(-80, 80, 3)), axis=tuple(axis / np.linalg.norm(axis)), radius=9.0, height=70.0
    )
    hull = Obstacle("hull", points=tuple(map(tuple, rng.uniform(-60, 60, (9, 3)))))
    return Artefact("things", {}, obstacles=(*boxes(rng, 2), post, hull))


def travels(rng: np.random.Generator, count: int) -> Travels:
    up = rng.normal(size=(count, 3))
    start, end = rng.uniform(-150, 150, (2, count, 3))
    end[0] = start[0]  # one that goes nowhere
    end[1] = start[1] + 40 * up[1]  # and one that goes up only
    return Travels(start, end, up / np.linalg.norm(up, axis=1)[:, None])


def under(body: Body, travel: tuple[Array, Array, Array], wide: float, slope: float) -> float:
    """→ mm, the highest point of a body under a strip, less the rise of the travel up to there: by linear programming."""
    start, end, up = travel
    way = end - start - ((end - start) @ up) * up
    length = float(np.linalg.norm(way))
    along = way / length
    across = np.cross(up, along)
    strip = np.vstack([along, -along, across, -across])
    room = np.array([length + wide + along @ start, wide - along @ start, wide + across @ start, wide - across @ start])
    found = linprog(
        -(up - slope * along), np.vstack([body.normal, strip]), np.concatenate([body.offset, room]), bounds=(None, None)
    )
    return -found.fun + slope * (along @ start) if found.status == 0 else -np.inf


def wanted(bodies: Solid, travel: tuple[Array, Array, Array]) -> tuple[float, float]:
    """→ lifts at both ends: the smaller sum of a slanted and a level travel."""
    start, end, up = travel
    low, high = start @ up, end @ up
    length = np.linalg.norm(end - start - ((end - start) @ up) * up)
    need = []
    for slope in ((high - low) / length, 0.0):
        heights = [
            under(body, travel, radius + MARGIN, slope) + abs(slope) * (radius + MARGIN) - begin + MARGIN
            for body in bodies.obstacles
            for begin, radius in parts(PROBE)
        ]
        need.append(max(heights))
    slanted = max(need[0] - low, DROP)
    level = max(need[1], max(low, high) + DROP)
    return (slanted, slanted) if 2 * slanted < 2 * level - low - high else (level - low, level - high)


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", range(4))
def test_the_retract_is_the_lowest_that_keeps_the_margin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bodies, many = solid(things(rng)), travels(rng, 12)
    up, down = Roof(bodies, PROBE).lifts(many, np.full(12, FAR))
    for row in range(2, 12):
        expected = wanted(bodies, (many.start[row], many.end[row], many.spindle[row]))
        assert (up[row], down[row]) == pytest.approx(expected, abs=1e-6), row


def test_over_a_face_that_is_larger_than_the_way_the_highest_is_over_a_corner_of_the_way() -> None:
    """No edge of the block is anywhere near: what the way has to clear is the face itself, where it rises highest.

    Of the first ways the tool stands upright, along the sides of the block; two of them pass beside it.
    """
    rng = np.random.default_rng(7)
    ground = Obstacle("box", low=(-2000.0, -2000.0, -900.0), high=(2000.0, 2000.0, 0.0))
    bodies, many = solid(Artefact("ground", {}, obstacles=(ground,))), travels(rng, 18)
    tilted = rng.uniform(-0.5, 0.5, (18, 3)) + np.array([0.0, 0.0, 1.0])
    tilted[:6] = [0.0, 0.0, 1.0]
    beside = np.where(np.isin(np.arange(18), (4, 5)), 5000.0, 0.0)[:, None] * np.array([1.0, 0.0, 0.0])
    many = Travels(many.start + beside, many.end + beside, tilted / np.linalg.norm(tilted, axis=1)[:, None])
    up, down = Roof(bodies, PROBE).lifts(many, np.full(18, FAR))
    for row in range(2, 18):
        expected = wanted(bodies, (many.start[row], many.end[row], many.spindle[row]))
        assert (up[row], down[row]) == pytest.approx(expected, abs=1e-6), row


def _gap(obstacle: Obstacle, points: Array) -> Array:
    low, high = np.array(obstacle.low), np.array(obstacle.high)
    beyond = np.abs(points - (low + high) / 2) - (high - low) / 2
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0))


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(4))
def test_no_part_of_the_probe_comes_within_the_margin(seed: int) -> None:
    """Stylus, body and nose as rings of points, walked along every travel and up and down at its ends."""
    rng = np.random.default_rng(100 + seed)
    things, many = boxes(rng, 3), travels(rng, 12)
    up, down = Roof(solid(Artefact("boxes", {}, obstacles=tuple(things))), PROBE).lifts(many, np.full(12, FAR))
    start, end = many.start + up[:, None] * many.spindle, many.end + down[:, None] * many.spindle
    assert (up >= DROP - 1e-9).all() and (down >= DROP - 1e-9).all()
    turn = np.linspace(0, 2 * np.pi, 13)[:-1]
    for row in range(12):
        spindle = many.spindle[row]
        one = np.cross(spindle, np.eye(3)[np.argmin(np.abs(spindle))])
        one /= np.linalg.norm(one)
        around = np.cos(turn)[:, None] * one + np.sin(turn)[:, None] * np.cross(spindle, one)
        rings = []
        for begin, radius in parts(PROBE):
            heights = begin + np.linspace(0, 240, 17)
            rings += [h * spindle + r * around for h in heights for r in (0.0, radius)]
        probe = np.vstack(rings)
        way = start[row] + np.linspace(0, 1, 30)[:, None] * (end[row] - start[row])
        places = way[:, None, :] + probe[None, :, :]
        assert min(_gap(thing, places).min() for thing in things) >= MARGIN - 1e-6, row


def test_between_touches_the_way_up_is_between_a_least_drop_and_the_clear_level() -> None:
    made = plan(cell(machine("wCBXfZY(S)t"), block(), [{}, {"B": 30, "C": 40}]), "leave-out")
    chain = kinematics.chain(made.machine)
    for touch in made.touches:
        assert touch.enter is not None and touch.leave is not None
        low, high, enter, leave = kinematics.tip(chain, np.array([touch.standoff, touch.over, touch.enter, touch.leave]))
        spindle = kinematics.spindle_axis(chain, np.array([touch.over]))[0]
        for place in (enter, leave):
            assert np.linalg.norm(np.cross(place - low, spindle)) < 1e-9, "not straight above the touch"
            assert (place - low) @ spindle >= DROP - 1e-9
        assert (enter - high) @ spindle <= 1e-9
    full = replace(made, touches=tuple(replace(t, enter=None, leave=None) for t in made.touches))
    assert sum(duration.duration(made, 3000.0).values()) < 0.9 * sum(duration.duration(full, 3000.0).values())


def test_every_touch_is_come_down_to_along_the_tool() -> None:
    """So that the last motion of the axis that carries the tool has the same sense at every touch that does not move it."""
    made = plan(cell(machine("wCBXfZY(S)t"), block(), [{}]), "leave-out")
    moves = positions(made)
    down = [end - start for kind, _, start, end in moves if kind == "approach"]
    assert len(down) == len(made.touches)
    z = made.machine.column("Z")
    assert all(change[z] <= -DROP + 1e-9 and np.abs(np.delete(change, z)).max() < 1e-9 for change in down)


def test_a_facet_that_is_touched_again_at_once_is_left_no_further_than_the_drop() -> None:
    block_cell = cell(machine("wCBXfZY(S)t"), block(), [{}])
    (one,) = block_cell.strategy.indexations
    again = replace(one, facets=tuple(f for f in one.facets for _ in range(2)))
    made = plan(replace(block_cell, strategy=replace(block_cell.strategy, indexations=(again,))), "leave-out")
    chain = kinematics.chain(made.machine)
    first, second = made.touches[0], made.touches[1]
    assert first.facet == second.facet and first.leave is not None and first.leave == second.enter
    places = np.array([first.standoff, first.leave])
    low, up = kinematics.tip(chain, places)
    assert np.linalg.norm(up - low) == pytest.approx(DROP)
    assert (up - low) @ kinematics.spindle_axis(chain, places[:1])[0] == pytest.approx(DROP)


def ball_under(centre: Array, radius: float, travel: tuple[Array, Array, Array], wide: float) -> float:
    """→ mm, the highest point of a ball within `wide` of a travel seen along the tool, −inf where it is beside: by its points."""
    start, end, up = travel
    way = end - start - ((end - start) @ up) * up
    length = float(np.linalg.norm(way))
    rng = np.random.default_rng(3)
    points = rng.normal(size=(20_000, 3))
    points = centre + radius * points / np.linalg.norm(points, axis=1)[:, None]
    seen = points - start
    flat = seen - (seen @ up)[:, None] * up
    ahead = np.clip(flat @ way / length, 0.0, length)
    near = np.linalg.norm(flat - ahead[:, None] * way / length, axis=1) <= wide
    return float((points @ up)[near].max(initial=-np.inf))


def test_over_a_ball_the_way_is_as_high_as_its_highest_point_under_the_probe() -> None:
    """A ball right under a level way, at its side, ahead of it and behind it, and one that the probe passes beside."""
    up = np.array([0.0, 0.0, 1.0])
    start, end = np.array([-60.0, 0.0, 30.0]), np.array([60.0, 0.0, 30.0])
    level = Travels(start[None], end[None], up[None])
    for centre in ((0.0, 0.0), (5.0, 48.0), (95.0, 12.0), (-100.0, -20.0), (0.0, 80.0), (20.0, 300.0)):
        ball = Ball("501", (*centre, 40.0), 25.0)
        (lift,), (down,) = Roof(solid(Artefact("ball", {}, balls={ball.id: ball})), PROBE).lifts(level, np.array([FAR]))
        heights = [
            ball_under(np.array(ball.centre), ball.radius, (start, end, up), radius + MARGIN) - begin + MARGIN
            for begin, radius in parts(PROBE)
        ]
        assert (lift, down) == pytest.approx((max(max(heights) - 30.0, DROP),) * 2, abs=0.3), centre


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
def test_no_part_of_the_probe_comes_within_the_margin_of_a_ball(seed: int) -> None:
    """Parts as lines with a radius, walked along slanted ways. A way that no ball is near goes up by no more than the drop."""
    rng = np.random.default_rng(200 + seed)
    balls = tuple(Ball(str(501 + i), tuple(rng.uniform(-90, 90, 3)), float(rng.uniform(8, 30))) for i in range(3))
    many = travels(rng, 14)
    far = Travels(many.start + 5000, many.end + 5000, many.spindle)
    roof = Roof(solid(Artefact("balls", {}, balls={ball.id: ball for ball in balls})), PROBE)
    up, down = roof.lifts(many, np.full(14, FAR))
    start, end = many.start + up[:, None] * many.spindle, many.end + down[:, None] * many.spindle
    for row in range(14):
        way = start[row] + np.linspace(0, 1, 60)[:, None] * (end[row] - start[row])
        for ball in balls:
            seen = np.array(ball.centre) - way
            high = seen @ many.spindle[row]
            for begin, radius in parts(PROBE):  # a cylinder that goes up from `begin`
                aside = np.sqrt(np.maximum((seen**2).sum(axis=1) - high**2, 0.0))
                gap = np.hypot(np.maximum(aside - radius, 0.0), np.maximum(begin - high, 0.0))
                assert gap.min() >= ball.radius + MARGIN - 1e-6, (row, ball.id)
    lifts = np.array(roof.lifts(far, np.full(14, FAR)))
    rise = np.einsum("ij,ij->i", far.end - far.start, far.spindle)
    assert (lifts.min(axis=0) <= DROP + 1e-9).all() and (lifts.sum(axis=0) <= 2 * DROP + np.abs(rise) + 1e-6).all()


@pytest.mark.parametrize(
    ("probe", "expected"),
    [
        (PROBE, [(-3.0, 3.0), (90.0, 20.0), (150.0, 45.0)]),
        (replace(PROBE, nose_radius=0.0), [(-3.0, 3.0), (90.0, 20.0), (150.0, 20.0)]),  # what carries the body is as thick
        (replace(PROBE, stylus_radius=4.0), [(-3.0, 4.0), (90.0, 20.0), (150.0, 45.0)]),  # a stem thicker than its tip
        (replace(PROBE, body_length=200.0), [(-3.0, 3.0), (0.0, 20.0), (150.0, 45.0)]),  # no part begins below the tip
    ],
)
def test_a_probe_has_three_parts_each_wider_than_the_one_below(probe: Probe, expected: list[tuple[float, float]]) -> None:
    """mm above the tip centre where it begins, mm of its radius; the stem from the lowest point of the tip."""
    assert list(parts(probe)) == expected
