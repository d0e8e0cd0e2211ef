"""How near a probe may come: just inside each limit it is refused by name, just outside it passes.

How near it really comes is computed by tests/support/distances.py, which knows nothing of the check.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import Delaunay
from support import distances
from support.blockcell import block, machine

from tango_cnc.check import solid
from tango_cnc.check.collision import BEHIND, Pose, obstruction
from tango_cnc.plan import sweep
from tango_cnc.records import Approach, Artefact, Ball, Facet, Obstacle, Probe

PROBE = Probe(150.0, 3.0, 0.0005, stylus_radius=1.5, body_radius=20.0, body_length=90.0, nose_radius=40.0)
APPROACH = Approach(10.0, 5.0, 180.0)
UP, ASIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
HELD = {"stem": 1.0, "body": 2.0, "spindle nose": 2.0, "tip": 1.0}  # mm of air that the documentation promises
LOOK = 0.5  # mm: half the way between two poses that are judged is kept beside it
HEIGHT = {"stem": (10.0, 30.0), "body": (85.0, 100.0), "spindle nose": (200.0, 400.0)}
RADIUS = {"stem": 1.5, "body": 20.0, "spindle nose": 40.0}
FLOATING = Artefact("one facet", {"f": Facet("f", (-3.0, 0, 0), (1.0, 0, 0))})


def refusal(
    artefact: Artefact,
    normal=ASIDE,
    tip=(0.0, 0.0, 0.0),
    probe: Probe = PROBE,
    facet="f",
    table=False,
    spindle=UP,
    approach: Approach = APPROACH,
) -> str:
    """→ why one touch of a facet cannot be made, '' when it can; without a table unless stated."""
    on_it = solid(artefact)
    pose = Pose((facet,), np.array([tip]), np.array([normal]), np.array([spindle]))
    found = obstruction(pose, probe, approach, artefact, on_it if table else replace(on_it, table=None))
    return found[0].why if found else ""


def nearest(body: distances.Body) -> float:
    """→ mm between the probe and the body, on all of the way from the end of the search to behind the stand-off."""
    tips = np.arange(-5.0, 11.51, 0.1)[:, None] * ASIDE
    return distances.distance(tips, np.broadcast_to(UP, tips.shape), PROBE, [body], 5.0)


def box(part: str, air: float) -> Obstacle:
    """A box that is `air` beside that part of the probe, or below its tip; not where the whole tip comes down, at the stand-off."""
    if part == "tip":
        return Obstacle("box", (-50.0, -50.0, -60.0), (50.0, 50.0, -3.0 - air))
    low, high = HEIGHT[part]
    return Obstacle("box", (-50.0, RADIUS[part] + air, low), (5.0, 200.0, high))


@pytest.mark.parametrize("part", HELD)
@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
def test_a_box_beside_each_part_of_the_probe(part: str, beyond: float) -> None:
    air = HELD[part] + beyond
    artefact = replace(FLOATING, obstacles=(box(part, air),))
    body = solid(artefact).obstacles[0]
    assert nearest(distances.Body(body.corner, body.normal)) == pytest.approx(air, abs=1e-3)
    why = refusal(artefact)
    assert (f"the {part} would hit obstacle 1" in why) if beyond < 0 else not why


@pytest.mark.parametrize("part", RADIUS)
@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
@pytest.mark.parametrize("ahead", [True, False])
def test_a_box_at_either_end_of_the_way(part: str, beyond: float, ahead: bool) -> None:
    """The way ends 11.5 mm in front of the facet, where a contact behind the stand-off sends the probe, and 5 mm inside it."""
    (low, high), air = HEIGHT[part], HELD[part] + beyond
    near = (11.5 if ahead else 5.0) + RADIUS[part] + air
    x = (near, 300.0) if ahead else (-300.0, -near)
    artefact = replace(FLOATING, obstacles=(Obstacle("box", (x[0], -50.0, low), (x[1], 50.0, high)),))
    body = solid(artefact).obstacles[0]
    assert nearest(distances.Body(body.corner, body.normal)) == pytest.approx(air, abs=1e-3)
    why = refusal(artefact)
    assert (f"the {part} would hit obstacle 1" in why) if beyond < 0 else not why


@pytest.mark.parametrize("part", HELD)
def test_a_box_right_at_the_distance_that_is_kept_is_not_too_near(part: str) -> None:
    """A probe along a wall with just that air is one that a person has drawn so."""
    passes, hits = (refusal(replace(FLOATING, obstacles=(box(part, HELD[part] + LOOK - less),))) for less in (0.0, 0.001))
    assert not passes and f"the {part} would hit obstacle 1" in hits


@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
def test_what_carries_the_probe_ends_where_it_ends(beyond: float) -> None:
    """A beam over the machine is no obstacle to a probe that stands below it."""
    low = PROBE.length + BEHIND + RADIUS["body"] + HELD["body"] + beyond
    artefact = replace(FLOATING, obstacles=(Obstacle("box", (-50.0, -50.0, low), (50.0, 50.0, low + 10.0)),))
    assert refusal(artefact, probe=replace(PROBE, nose_radius=0.0)) == ("the body would hit obstacle 1" if beyond < 0 else "")


@pytest.mark.parametrize("part", HELD)
@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
def test_a_ball_beside_each_part_of_the_probe(part: str, beyond: float) -> None:
    air, size = HELD[part] + beyond, 8.0
    height = sum(HEIGHT[part]) / 2 if part != "tip" else -3.0 - air - size
    centre = (0.0, RADIUS[part] + air + size if part != "tip" else 0.0, height)
    artefact = replace(FLOATING, balls={"b": Ball("b", centre, size)})
    assert nearest(distances.Body(np.array([centre]), np.zeros((0, 3)), size)) == pytest.approx(air, abs=1e-3)
    why = refusal(artefact)
    assert (f"the {part} would hit ball b" in why) if beyond < 0 else not why


@pytest.mark.parametrize("kind", ["obstacle 1", "ball b"])
@pytest.mark.parametrize("end", [-5.0, 11.5])  # of the search; where a contact right behind the stand-off sends the probe
@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
def test_what_is_below_the_tip_at_either_end_of_its_way(kind: str, end: float, beyond: float) -> None:
    air, outwards = HELD["tip"] + beyond, math.copysign(30.0, end)
    if kind == "ball b":
        centre = (end, 0.0, -3.0 - air - 8.0)
        artefact = replace(FLOATING, balls={"b": Ball("b", centre, 8.0)})
        body = distances.Body(np.array([centre]), np.zeros((0, 3)), 8.0)
    else:
        low, high = sorted((end, end + outwards))
        artefact = replace(FLOATING, obstacles=(Obstacle("box", (low, -50.0, -60.0), (high, 50.0, -3.0 - air)),))
        body = distances.Body(solid(artefact).obstacles[0].corner, solid(artefact).obstacles[0].normal)
    assert nearest(body) == pytest.approx(air, abs=1e-3)
    why = refusal(artefact)
    assert why == (f"the tip would hit {kind}" if beyond < 0 else "")


@pytest.mark.parametrize(
    ("x", "aside", "passes"),
    [
        (78.0, 0.0, False),
        (72.0, 0.0, False),
        (70.0, 0.0, True),
        (90.0, 17.0, False),
        (90.0, -17.0, False),
        (90.0, 20.0, True),
        (90.0, -20.0, True),
    ],
)
def test_in_a_slot_there_is_table_15_mm_around_the_point_of_an_outer_facet(x: float, aside: float, passes: bool) -> None:
    """Facet 1 faces +X at x = 100. The stem of a probe in a slot goes up past it, 11.5 mm nearer to it when it has backed off."""
    flat = {name: facet for name, facet in block().facets.items() if facet.ball is None}
    _, y, z = flat["1"].point
    slot = Facet("s", (x - PROBE.tip_radius, y + aside, z), (1.0, 0.0, 0.0))
    why = refusal(Artefact("slot", {**flat, "s": slot}), tip=(x, y + aside, z), facet="s", table=True)
    assert (why == "") == passes and (passes or why == "the probe would come through facet 1")


@pytest.mark.parametrize("kind", ["obstacle 1", "ball b"])
@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
def test_what_comes_down_to_the_stand_off_is_as_wide_as_the_tip(kind: str, beyond: float) -> None:
    """Something stands beside the stem there, 20 mm above where the tip ends up."""
    air, down = HELD["tip"] + beyond, np.array([[APPROACH.standoff, 0.0, 0.0]])
    beside = PROBE.tip_radius + air
    if kind == "ball b":
        centre = (APPROACH.standoff, beside + 8.0, 20.0)
        artefact = replace(FLOATING, balls={"b": Ball("b", centre, 8.0)})
        body = distances.Body(np.array([centre]), np.zeros((0, 3)), 8.0)
    else:
        artefact = replace(FLOATING, obstacles=(Obstacle("box", (-50.0, beside, 10.0), (50.0, 200.0, 30.0)),))
        body = distances.Body(solid(artefact).obstacles[0].corner, solid(artefact).obstacles[0].normal)
    wide = replace(PROBE, stylus_radius=PROBE.tip_radius)
    assert distances.distance(down, UP[None], wide, [body], 5.0) == pytest.approx(air, abs=1e-3)
    why = refusal(artefact)
    assert (f"the tip would hit {kind} on the way to the stand-off" in why) if beyond < 0 else not why


@pytest.mark.parametrize("standoff", [0.5, 1.5])
def test_a_stand_off_nearer_than_the_usual_margin_needs_half_of_itself(standoff: float) -> None:
    """At the stand-off the tip is this far from the facet that it has just touched, and no further."""
    flat = {name: facet for name, facet in block().facets.items() if facet.ball is None}
    x, y, z = flat["1"].point
    tip = (x + PROBE.tip_radius, y, z)
    assert refusal(Artefact("block", flat), tip=tip, facet="1", table=True, approach=replace(APPROACH, standoff=standoff)) == ""


@pytest.mark.parametrize(("thick", "passes"), [(2.85, False), (2.75, True)])
def test_a_stem_keeps_two_tenths_off_the_ball_that_its_tip_touches(thick: float, passes: bool) -> None:
    """The facet leans to the spindle by 6°: the stem is nearest to the ball where the tip is."""
    normal = np.array([math.cos(0.1), 0.0, math.sin(0.1)])
    ball, facet = Ball("b", (0.0, 0.0, 0.0), 30.0), Facet("f", tuple(30 * normal), tuple(normal), "b")
    why = refusal(Artefact("ball", {"f": facet}, {"b": ball}), normal, 33 * normal, replace(PROBE, stylus_radius=thick))
    assert (why == "") == passes and (passes or "the stem would hit ball b" in why)


@pytest.mark.parametrize(("leaves", "passes"), [(0.05, False), (0.15, True)])
def test_a_stem_as_thick_as_its_tip_needs_a_facet_that_it_leaves(leaves: float, passes: bool) -> None:
    """It is 0.1 mm thinner than the tip; at its upper end, 60 mm up, it has to be 0.2 mm off the facet."""
    cosine = leaves / 60
    why = refusal(FLOATING, np.array([math.sqrt(1 - cosine**2), 0.0, cosine]), probe=replace(PROBE, stylus_radius=2.9))
    assert (why == "") == passes and (passes or "not thinner than the tip" in why)


@pytest.mark.parametrize(("air", "passes"), [(0.9, False), (1.1, True)])
def test_a_tip_that_searches_a_ball_ends_above_the_table(air: float, passes: bool) -> None:
    """A ball that stands out of the table by a few millimetres, touched from above: the search goes on 5 mm behind the contact."""
    top = max(corner[2] for corner in solid(block()).corners[0])
    contact = (0.0, 0.0, top + air + 5.0)
    ball, facet = Ball("b", (0.0, 0.0, contact[2] - 10.0), 10.0), Facet("f", contact, (0.0, 0.0, 1.0), "b")
    artefact = Artefact("sunk ball", {**{n: f for n, f in block().facets.items() if f.ball is None}, "f": facet}, {"b": ball})
    why = refusal(artefact, UP, (0.0, 0.0, contact[2] + 3.0), table=True)
    assert (why == "") == passes and (passes or "the tip would hit the table" in why)


@pytest.mark.parametrize("nose", [0.0, 60.0])
def test_what_turns_with_the_probe_holds_all_of_it(nose: float) -> None:
    """Points on stem, body and nose, up to 300 mm behind the nose, lie within the hull of the balls that are swept."""
    whole = machine("wCBXfZY(S)t")
    own = replace(whole.probe, nose_radius=nose)
    centre, size = sweep.probe(replace(whole, probe=own))
    hull = Delaunay(centre[1:])  # all but the ball of the tip are points
    rng = np.random.default_rng(4)
    turn = rng.uniform(0, 2 * np.pi, 2000)
    foot = np.array(whole.spindle.point) - own.length * UP
    thickness = [
        (own.length - own.body_length, own.length, own.body_radius),
        (own.length, own.length + 300, max(nose, own.body_radius)),
    ]
    for low, high, radius in thickness:
        around = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(2000)]) * radius * (1 - 1e-9)
        points = foot + around + rng.uniform(low + 1e-6, high - 1e-6, 2000)[:, None] * UP
        assert (hull.find_simplex(points, tol=1e-9) >= 0).all()
    assert np.allclose(centre[0], foot) and size[0] == max(own.tip_radius, own.stylus_radius) and not size[1:].any()


@pytest.mark.parametrize(("above", "passes"), [(21.6, False), (22.4, True)])
def test_the_body_keeps_two_millimeters_off_the_table_while_the_tip_touches(above: float, passes: bool) -> None:
    """A short stand-off: less is kept on the way to it. The end of the body, 20 mm in radius, counts as round."""
    flat = {name: facet for name, facet in block().facets.items() if facet.ball is None}
    top = solid(Artefact("block", flat)).table
    assert top is not None
    height = float(top.corner[:, 2].max())
    x, y, _ = flat["1"].point
    tip = (x + PROBE.tip_radius, y, height + above - (PROBE.length - PROBE.body_length))
    why = refusal(Artefact("block", flat), tip=tip, facet="1", table=True, approach=Approach(2.0, 5.0, 180.0))
    assert why == ("" if passes else "the body would hit the table while the tip touches")


@pytest.mark.parametrize(("leans", "passes"), [(55.0, True), (65.0, False)])
def test_a_probe_in_a_slot_leans_at_most_60_degrees_from_the_way_out(leans: float, passes: bool) -> None:
    """In the middle of a large block, 25 mm under its top; its outer facets are all near one corner, where no stem passes."""
    sides = ((1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), (0, -1.0, 0), (0, 0, 1.0), (0, 0, -1.0))
    middle, half = np.array([0.0, 0.0, -200.0]), 200.0
    corner = middle + np.array([180.0, -180.0, -180.0])
    outer = {
        str(i): Facet(str(i), tuple(np.where(np.array(n) != 0, middle + half * np.array(n), corner)), n)
        for i, n in enumerate(sides)
    }
    slot, lean = Facet("s", (-3.0, 0.0, -25.0), (1.0, 0.0, 0.0)), math.radians(leans)
    spindle = (0.0, math.sin(lean), math.cos(lean))
    why = refusal(Artefact("slot", {**outer, "s": slot}), tip=(0.0, 0.0, -25.0), facet="s", table=True, spindle=spindle)
    assert ("leans more than 60°" in why) != passes, why


@pytest.mark.parametrize("beyond", [-0.1, LOOK + 0.1])
def test_a_wall_behind_the_stand_off_is_met_by_a_tip_that_goes_off_the_facet(beyond: float) -> None:
    """A contact right behind the stand-off sends the probe 1.5 mm farther. The wall is lower than the body is."""
    air = HELD["tip"] + beyond
    wall = Obstacle("box", (11.5 + PROBE.tip_radius + air, -50.0, -60.0), (60.0, 50.0, 20.0))
    artefact = replace(FLOATING, obstacles=(wall,))
    body = solid(artefact).obstacles[0]
    assert nearest(distances.Body(body.corner, body.normal)) == pytest.approx(air, abs=1e-3)
    assert refusal(artefact) == ("the tip would hit obstacle 1" if beyond < 0 else "")


@pytest.mark.parametrize(
    ("away", "shown"),
    [(91.1, ""), (91.16, "91.2"), (91.31, "91.4"), (91.49, "91.5"), (91.6, "92"), (95.4, "95"), (150.0, "150")],
)
def test_how_far_a_facet_looks_away_is_said_and_never_the_91_that_is_allowed(away: float, shown: str) -> None:
    """Up to a tenth of a degree above where it is refused, whole degrees farther away."""
    spindle = np.array([math.cos(math.radians(away)), 0.0, math.sin(math.radians(away))])
    said = f"the facet faces {shown}° away from the spindle, a straight stylus reaches up to 91°" if shown else ""
    assert refusal(FLOATING, spindle=spindle) == said


@pytest.mark.parametrize(
    ("off", "aside", "tilt", "own"),
    [
        (0.0, 0.0, 0.0, True),
        (0.5, 0.0, 0.0, True),  # as unevenly as a facet may be entered, and no more
        (-0.5, 0.0, 0.0, True),
        (0.51, 0.0, 0.0, False),
        (-0.51, 0.0, 0.0, False),
        (0.0, 50.5, 0.0, True),  # half a millimeter beyond the edge of the face
        (0.0, -50.51, 0.0, False),
        (0.0, 0.0, 25.0, True),  # turned like the face, by less than 25.8 degrees
        (0.0, 0.0, 27.0, False),
    ],
)
def test_a_facet_on_a_face_of_an_obstacle_touches_it_and_any_other_keeps_off(
    off: float, aside: float, tilt: float, own: bool
) -> None:
    """The box has its face at x = 40; the probe comes down beside it."""
    normal = np.array([math.cos(math.radians(tilt)), 0.0, math.sin(math.radians(tilt))])
    point = np.array([40.0 + off, aside, -10.0])
    box = Obstacle("box", (-60.0, -50.0, -60.0), (40.0, 50.0, 0.0))
    artefact = Artefact("box", {"f": Facet("f", tuple(point), tuple(normal))}, obstacles=(box,))
    why = refusal(artefact, normal, tuple(point + PROBE.tip_radius * normal))
    assert (why == "") == own and (own or "would hit obstacle 1" in why), why


@pytest.mark.parametrize(("x", "passes"), [(201.0, True), (195.0, False), (-195.0, False), (189.5, False)])
def test_a_probe_in_a_step_is_asked_for_its_way_out_where_it_stands_at_the_stand_off(x: float, passes: bool) -> None:
    """A facet that faces +X, 25 mm under the top of a block with a side at x = 200; the probe leans by 45° along it."""
    sides = ((1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), (0, -1.0, 0), (0, 0, 1.0), (0, 0, -1.0))
    middle, half = np.array([0.0, 0.0, -200.0]), 200.0
    corner = middle + np.array([180.0, -180.0, -180.0])
    outer = {
        str(i): Facet(str(i), tuple(np.where(np.array(n) != 0, middle + half * np.array(n), corner)), n)
        for i, n in enumerate(sides)
    }
    step = Facet("s", (x - PROBE.tip_radius, 0.0, -25.0), (1.0, 0.0, 0.0))
    spindle = (0.0, math.sqrt(0.5), math.sqrt(0.5))
    why = refusal(Artefact("step", {**outer, "s": step}), tip=(x, 0.0, -25.0), facet="s", table=True, spindle=spindle)
    assert (why == "") == passes and (passes or "leans more than 60°" in why), why
