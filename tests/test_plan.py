"""From a cell to a plan: where every touch happens, and that the probe meets nothing on its way there."""

from __future__ import annotations

import csv
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.blockcell import NORMALS, ball_distance, block, block_distance, cell, machine, positions

from tango_cnc import kinematics
from tango_cnc.files import read_cell
from tango_cnc.plan import clearance, last_motion, part, plan, plan_hash, travel
from tango_cnc.plan.build import planned
from tango_cnc.plan.places import Places
from tango_cnc.records import Array, Cell, Facet, Find, InputError, Machine, Obstacle, Plan, Surface

TABLES = ("wCBXfZY(S)t", "wCAYbXZ(S)t".replace("b", "f"), "wCXYfZ(S)t", "wXYfZ(S)t", "wCXBfZY(S)t")
HEADS = ("wXYfZCB(S)t", "wXYfZCA(S)t", "wCXYfZB(S)t", "wfXYZCA(S)t")


def small(topology: str = "wCBXfZY(S)t", poses: tuple[dict[str, float], ...] = ({},)) -> Cell:
    return cell(machine(topology), block(), poses)


# What is planned


def test_the_ball_centre_is_one_tip_radius_off_the_surface_along_the_outward_normal() -> None:
    made = plan(small(poses=({"B": 30, "C": 40},)), "leave-out")
    chain = kinematics.chain(made.machine)
    for touch in made.touches:
        facet = made.artefact.facets[touch.facet]
        for position, distance in ((touch.standoff, 10.0), (touch.contact, 0.0), (touch.end, -5.0)):
            tip = kinematics.tip(chain, np.array([position]))[0]
            wanted = np.array(facet.point) + (made.machine.probe.tip_radius + distance) * np.array(facet.normal)
            np.testing.assert_allclose(tip, wanted, atol=1e-9)


def test_a_curved_facet_is_touched_at_its_own_nominal_point() -> None:
    whole = small()
    facet = replace(whole.artefact.facets["1"], surface=Surface("cylinder", 250.0, (0.0, 0.0, 1.0)))
    artefact = replace(whole.artefact, facets={**whole.artefact.facets, "1": facet})
    flat, curved = plan(whole), plan(replace(whole, artefact=artefact))
    assert flat.touches == curved.touches


@pytest.mark.few(0)
def test_contacts_agree_with_readings_of_an_independent_program(shared: Path) -> None:
    """Its machine is not nominal: contacts differ by its errors, some tenths of a millimetre, along the normals."""
    example = read_cell(shared / "contract" / "hu40t")
    made = plan(example)
    reachable = {t.number for t in made.touches}
    with (shared / "contract" / "hu40t" / "readings.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if int(row["touch"]) in reachable]
    assert len(rows) == len(made.touches) == 358
    difference = np.array([[float(row[n]) for n in "XYZ"] for row in rows]) - np.array([t.contact[:3] for t in made.touches])
    assert np.abs(difference).max() < 0.6
    assert [row["facet"] for row in rows] == [t.facet for t in made.touches]


def test_the_order_of_the_strategy_is_kept() -> None:
    whole = cell(machine("wCBXfZY(S)t"), block(), [{"C": 90}, {}, {"C": 90}], facets=["5", "1", "7", "3", "5"])
    made = plan(whole)
    assert [t.facet for t in made.touches] == ["5", "1", "7", "3", "5"] * 3
    assert [t.number for t in made.touches] == list(range(1, 16))
    assert [t.indexation for t in made.touches] == [0] * 5 + [1] * 5 + [2] * 5


def test_every_touch_is_approached_made_and_left_the_same_way() -> None:
    made = plan(small(poses=({}, {"B": 20, "C": 10})), "leave-out")
    for touch in made.touches:
        moves = [m for m in made.moves if m.touch == touch.number]
        kinds = [m.kind for m in moves]
        assert kinds.count("probe") == kinds.count("back") == 1
        before, after = kinds[: kinds.index("probe")], kinds[kinds.index("back") + 1 :]
        assert before[-2:] == ["clear", "approach"] or before[-1:] == ["clear"]
        assert after[:1] == ["retract"] or touch.over == touch.standoff
        back = next(m for m in moves if m.kind == "back")
        names = made.machine.names
        assert all(value == touch.standoff[names.index(name)] for name, value in back.target.items())


def test_the_first_move_is_one_axis_alone_and_up() -> None:
    moves = list(plan(small()).moves)
    assert (moves[0].kind, list(moves[0].target)) == ("retract", ["Z"])
    assert [m.kind for m in moves[1:6]] == ["clear", "clear", "index", "index", "clear"]
    assert set(moves[3].target) == {"B", "C", "S"} and set(moves[4].target) == {"B", "C"}


def test_before_the_first_touch_every_axis_is_brought_to_where_the_sense_of_its_last_motion_is_known() -> None:
    made = plan(cell(machine("wCBXfZY(S)t"), block(), [{"B": 10, "C": -30}, {"S": 90}], facets=["5"]))
    (first, second, *_) = [m.target for m in made.moves if m.kind == "index"]
    assert {name: round(math.degrees(value)) for name, value in first.items()} == {"B": 5, "C": -35, "S": -5}
    assert {name: round(math.degrees(value)) for name, value in second.items()} == {"B": 10, "C": -30, "S": 0}
    assert (last_motion(made) != 0).all()
    names = made.machine.names
    assert [last_motion(made)[0][names.index(name)] for name in "BCS"] == [1, 1, 1]


@pytest.mark.parametrize(
    ("travel", "stop"), [((10, 90), 15), ((7, 90), 15), ((4, 90), 5), ((10, 12), 12), ((9, 10), 9), ((10, 10), 10)]
)
def test_the_stop_stays_within_the_travel(travel: tuple[float, float], stop: float) -> None:
    whole = small(poses=({"B": 10},))
    low, high = map(math.radians, travel)
    axes = tuple(replace(a, travel=(low, high)) if a.name == "B" else a for a in whole.machine.axes)
    made = plan(replace(whole, machine=replace(whole.machine, axes=axes)), "leave-out")
    first = next(m for m in made.moves if m.kind == "index")
    assert math.degrees(first.target["B"]) == pytest.approx(stop)


def _sense(travel: tuple[float, float] | None, *angles: float) -> list[float]:
    """Travel of C in degrees, indexations → sense of its last motion at each."""
    whole = cell(machine("wCBXfZY(S)t"), block(), [{"C": a} for a in angles], facets=["5"])
    limits = None if travel is None else (math.radians(travel[0]), math.radians(travel[1]))
    axes = tuple(replace(a, travel=limits) if a.name == "C" else a for a in whole.machine.axes)
    made = plan(replace(whole, machine=replace(whole.machine, axes=axes)))
    for literal, shorter in zip(_senses(made, False), _senses(made, True), strict=True):
        assert literal == shorter, "the sense depends on whether the control rolls over"
    result: list[float] = last_motion(made)[:, made.machine.column("C")].tolist()
    return result


def _senses(made: Plan, rolls: bool) -> list[float]:
    """Sense of C's last motion at every touch, on a control that rolls over or takes angles as they are."""
    at, sense, found = 0.0, 0.0, []
    for move in made.moves:
        change = move.target.get("C", at) - at
        change = math.remainder(change, math.tau) if rolls else change
        if abs(change) > 1e-9:
            sense = math.copysign(1.0, change)
        at = move.target.get("C", at)
        if move.kind == "probe":
            found.append(sense)
    return found


def test_an_endless_axis_takes_the_shorter_way_whether_its_control_rolls_over_or_not() -> None:
    assert _sense(None, 0, 270) == [1, -1]
    assert _sense(None, 270, 10) == [1, 1]
    assert _sense((-720, 720), 0, 270, -90) == [1, -1, -1]


def test_an_axis_with_limits_goes_as_the_numbers_say() -> None:
    assert _sense((-360, 360), 0, 270, -90) == [1, 1, -1]


def test_last_motion_is_that_of_the_approach_and_of_the_last_indexation() -> None:
    made = plan(cell(machine("wCBXfZY(S)t"), block(), [{"C": 10}, {"C": 20}, {"C": 5}], facets=["1", "2"]))
    sense = last_motion(made)
    x, c = made.machine.column("X"), made.machine.column("C")
    # The table moves: to press facet 1 (+x) on the probe the table goes towards +X at C = 0, and not far from that here.
    assert sense[:, x].tolist() == [1, -1, 1, -1, 1, -1]
    assert sense[:, c].tolist() == [1, 1, 1, 1, -1, -1]


def test_a_part_of_a_plan_keeps_numbers_and_finds_its_own_safe_way() -> None:
    whole = plan(cell(machine("wCBXfZY(S)t"), block(), [{}, {"C": 40}, {"B": 20}], facets=["2", "5", "7"]))
    some = part(whole, [2, 3, 8])
    assert [t.number for t in some.touches] == [2, 3, 8]
    assert [m.touch for m in some.moves if m.kind == "index"] == [2, 2, 8]
    _assert_clear(some)
    assert part(whole, range(1, 10)) == whole
    with pytest.raises(InputError, match="found touch 12; allowed: touches 1 … 9"):
        part(whole, [12])


@pytest.mark.parametrize("changed", ["machine", "artefact", "strategy"])
def test_a_part_of_a_changed_plan_is_planned_for_what_it_is_now(changed: str) -> None:
    """Contacts stay as they are stated; how high the probe goes over them is that of the cell of today."""
    whole = plan(cell(machine("wCBXfZY(S)t"), block(), [{}, {"C": 40}], facets=["5"]))
    taller = replace(block(), obstacles=(Obstacle("box", (150.0, 150.0, -40.0), (170.0, 170.0, 300.0)),))
    today: dict[str, Any] = {
        "machine": replace(whole.machine, probe=replace(whole.machine.probe, length=whole.machine.probe.length + 50.0)),
        "artefact": taller,
        "strategy": replace(whole.strategy, approach=replace(whole.strategy.approach, standoff=20.0)),
    }
    assert planned(whole) is whole.touches
    now = planned(replace(whole, **{changed: today[changed]}))
    assert isinstance(now.places, Places) and getattr(now.places.scene, changed) is today[changed]
    assert [t.contact for t in now] == [t.contact for t in whole.touches]


def test_the_plan_hash_sees_what_matters_and_nothing_else() -> None:
    whole = small()
    name = plan_hash(plan(whole))
    assert len(name) == 12
    assert plan_hash(plan(replace(whole, folder=Path("elsewhere")))) == name
    artefact = block(centre=(0.0, 0.0, -40.001))
    assert plan_hash(plan(replace(whole, artefact=artefact))) != name


def test_the_plan_hash_changes_with_every_number_by_its_least_step_and_with_nothing_smaller() -> None:
    made = plan(small())
    made = replace(made, touches=tuple(made.touches))
    first, rest, probe, approach = made.touches[0], made.touches[1:], made.machine.probe, made.strategy.approach

    def name(**changes: Any) -> str:
        return plan_hash(replace(made, touches=(replace(first, **changes), *rest)))

    base = name()
    assert base == plan_hash(made)
    for member in ("standoff", "contact", "end"):
        place = getattr(first, member)
        for column, axis in enumerate(made.machine.axes):
            step = 1e-6 if axis.kind == "linear" else 1e-9
            whole, less, nothing, minus = (
                name(**{member: (*place[:column], value, *place[column + 1 :])})
                for value in (round(place[column], 6) + step, round(place[column], 6) + 0.01 * step, 0.0, -0.0)
            )
            still = name(**{member: (*place[:column], round(place[column], 6), *place[column + 1 :])})
            assert whole != still and less == still and nothing == minus, (member, axis.name)
    others = [
        replace(made, machine=replace(made.machine, probe=replace(probe, length=probe.length + 1e-6))),
        replace(made, machine=replace(made.machine, probe=replace(probe, tip_radius=probe.tip_radius + 1e-6))),
        *(
            replace(made, strategy=replace(made.strategy, approach=replace(approach, **change)))
            for change in (
                {"standoff": approach.standoff + 1e-6},
                {"search": approach.search + 1e-6},
                {"feed": approach.feed + 1e-6},
                {"find": Find(feed=800.0, retreat=1.0)},
                {"find": Find(feed=800.000001, retreat=1.0)},
                {"find": Find(feed=800.0, retreat=1.000001)},
            )
        ),
        replace(made, touches=(replace(first, number=first.number + 100), *rest)),
        replace(made, touches=(replace(first, facet="another"), *rest)),
        replace(made, touches=rest),
    ]
    names = [plan_hash(other) for other in others]
    assert len({base, *names}) == 1 + len(names)


# What cannot be planned


def test_a_position_beyond_a_travel_is_named_in_full() -> None:
    whole = small()
    axes = tuple(replace(a, travel=(-400.0, 95.0)) if a.name == "Y" else a for a in whole.machine.axes)
    narrow = replace(whole, machine=replace(whole.machine, axes=axes))
    assert plan(narrow)  # the stand-off of facet 3 is at Y 93
    with pytest.raises(InputError) as error:
        plan(replace(narrow, strategy=replace(whole.strategy, approach=replace(whole.strategy.approach, standoff=20.0))))
    text = str(error.value)
    assert "touch 3 (facet 3, indexation 1: B 0 C 0 S 0): the stand-off needs Y 103.000 mm, travel -400 … 95 mm" in text
    assert "1 of 8 touches" in text


def test_an_angle_beyond_a_travel_is_named_once_an_indexation() -> None:
    whole = small()
    axes = tuple(replace(a, travel=(math.radians(100), math.radians(200))) if a.name == "C" else a for a in whole.machine.axes)
    with pytest.raises(InputError) as error:
        plan(replace(whole, machine=replace(whole.machine, axes=axes)))
    lines = [line for line in str(error.value).splitlines() if line.startswith("  ")]
    assert lines == sorted(set(lines), key=lines.index)
    assert "  indexation 1: B 0 C 0 S 0 needs C 0.000 deg, travel 100 … 200 deg" in lines


def test_a_rotary_position_beyond_its_travel_is_named_in_degrees() -> None:
    whole = small(poses=({"B": 30},))
    axes = tuple(replace(a, travel=(-0.1, 0.1)) if a.name == "B" else a for a in whole.machine.axes)
    with pytest.raises(InputError, match=r"B 30\.000 deg, travel -5\.72958 … 5\.72958 deg"):
        plan(replace(whole, machine=replace(whole.machine, axes=axes)), "leave-out")


def test_no_room_to_turn_the_table_says_how_much_is_missing() -> None:
    whole = small(poses=({}, {"C": 90}))
    axes = tuple(replace(a, travel=(-4000.0, 420.0)) if a.name == "Z" else a for a in whole.machine.axes)
    with pytest.raises(
        InputError, match=r"to turn the rotary axes clear of the table the probe needs Z \d+\.\d+ mm, travel -4000 … 420"
    ):
        plan(replace(whole, machine=replace(whole.machine, axes=axes)))


def test_a_facet_that_faces_away_is_planned_on_request_and_named_with_its_angle() -> None:
    made = plan(small(poses=({}, {"B": 40})), "warn")
    assert len(made.touches) == 2 * len(small().strategy.indexations[0].facets) and not made.left_out
    assert any("touch 9 (facet 1, indexation 2: B 40 C 0 S 0): the facet faces 130° away" in text for text in made.doubtful)


def test_a_facet_that_faces_away_can_be_refused() -> None:
    with pytest.raises(InputError) as error:
        plan(small(poses=({}, {"B": 40})), "refuse")
    text = str(error.value)
    assert "touch 9 (facet 1, indexation 2: B 40 C 0 S 0): the facet faces 130° away from the spindle" in text
    assert "touch 10" not in text  # facet 2 looks up there


def test_obstructed_touches_can_be_left_out_and_are_listed() -> None:
    made = plan(small(poses=({}, {"B": 40})), "leave-out")
    assert [t.facet for t in made.touches if t.indexation == 1].count("1") == 0
    assert any("facet 1, indexation 2" in text for text in made.left_out.values())
    missing = set(made.left_out)
    assert [t.number for t in made.touches] == [n for n in range(1, 17) if n not in missing]


def test_side_faces_upright_to_the_spindle_are_within_reach() -> None:
    """Table 4-2 of the thesis touches them at B = ±90 and at B = 0."""
    made = plan(cell(machine("wCBXfZY(S)t"), block(), [{}, {"B": 90, "C": -90}, {"B": -90, "C": 90}], facets=["1", "2"]))
    assert len(made.touches) == 6


@pytest.mark.parametrize(
    ("obstacle", "why"),
    [
        (Obstacle("box", low=(105.0, -60.0, 20.0), high=(130.0, 0.0, 60.0)), "the body|the stem|the tip"),
        (Obstacle("cylinder", base=(125.0, -32.0, 0.0), axis=(0.0, 0.0, 1.0), radius=15.0, height=30.0), "would hit obstacle 1"),
        (Obstacle("box", low=(100.3, -60.0, -40.0), high=(101.0, 0.0, -22.0)), "would hit obstacle 1"),  # right in front
    ],
)
def test_what_stands_beside_a_facet_is_in_the_way(obstacle: Obstacle, why: str) -> None:
    artefact = replace(block(), obstacles=(obstacle,))
    with pytest.raises(InputError, match=f"touch 1 \\(facet 1, .*({why})"):
        plan(cell(machine("wCBXfZY(S)t"), artefact, [{}], facets=["1"]))
    assert plan(cell(machine("wCBXfZY(S)t"), artefact, [{}], facets=["2"]))


def test_a_ball_above_a_facet_is_in_the_way() -> None:
    artefact = block(facets={name: np.array([0.6, 0.5, 0.0]) for name in NORMALS})
    with pytest.raises(InputError, match=r"touch 2 \(facet 5, .*: the stem would hit ball 1"):
        plan(cell(machine("wCBXfZY(S)t"), artefact, [{}], facets=["1", "5", "7"]))


def test_the_probe_body_does_not_go_where_only_the_stem_fits() -> None:
    whole = small()
    short = replace(whole.machine, probe=replace(whole.machine.probe, body_length=290.0))
    with pytest.raises(InputError, match=r"touch 1 .*: the body would hit the table while the tip touches"):
        plan(replace(whole, machine=short))


def test_a_stem_as_thick_as_the_tip_cannot_touch_a_wall() -> None:
    whole = small()
    thick = replace(whole.machine, probe=replace(whole.machine.probe, stylus_radius=3.0))
    with pytest.raises(InputError, match=r"touch 1 .*: the stem \(stylus_radius 3 mm\) is not thinner than the tip \(3 mm\)"):
        plan(replace(whole, machine=thick))


def test_where_nothing_can_be_touched_for_a_thick_stem_the_stem_is_to_be_stated() -> None:
    whole = small()
    thick = replace(whole.machine, probe=replace(whole.machine.probe, tip_radius=1.5))
    with pytest.raises(
        InputError, match=r"(?s)no touch is left.*state probe.stylus_radius in machine.yaml: its radius, 1.5 mm"
    ) as raised:
        plan(replace(whole, machine=thick), "leave-out")
    assert "Turn the table" not in str(raised.value)


def test_a_body_that_is_declared_may_be_touched() -> None:
    assert len(plan(cell(machine("wCBXfZY(S)t"), block(obstacle=True), [{}])).touches) == 8


def test_a_facet_within_the_body_of_the_table_is_judged_by_its_own_plane() -> None:
    artefact = block()
    slot = Facet("9", (0.0, 10.0, -20.0), (0.0, -1.0, 0.0))
    made = plan(cell(machine("wCBXfZY(S)t"), replace(artefact, facets={**artefact.facets, "9": slot}), [{}], facets=["9"]))
    assert [t.facet for t in made.touches] == ["9"]


def test_linear_axes_that_do_not_span_space_are_an_error() -> None:
    whole = small()
    axes = tuple(replace(a, direction=(1.0, 0.0, 0.0)) if a.name == "Y" else a for a in whole.machine.axes)
    with pytest.raises(InputError, match="do not span space"):
        plan(replace(whole, machine=replace(whole.machine, axes=axes)))


# The way there. The judge below knows the block and the ball as they are and walks along every move in small steps.


def _gap(made: Plan, path: Array) -> Array:
    """(n, k) positions → (n,) mm between the probe, taken as spheres along the tool, and what is on the table."""
    probe, chain = made.machine.probe, kinematics.chain(made.machine)
    stem = np.arange(5.0, probe.length - probe.body_length, 9.0)
    body = np.arange(probe.length - probe.body_length + probe.body_radius, probe.length - probe.body_radius + 1, 18.0)
    height = np.concatenate([[0.0], stem, body])
    radius = np.concatenate([[probe.tip_radius], np.full(len(stem), probe.stylus_radius), np.full(len(body), probe.body_radius)])
    tips, spindles = kinematics.tip(chain, path), kinematics.spindle_axis(chain, path)
    centres = (tips[:, None, :] + height[None, :, None] * spindles[:, None, :]).reshape(-1, 3)
    gap = np.minimum(block_distance(centres, made.artefact), ball_distance(centres, made.artefact))
    result: Array = (gap.reshape(len(path), -1) - radius).min(axis=1)
    return result


def _assert_clear(made: Plan) -> None:
    """Walks along every move of a plan; the margins are what the planner promises for each kind."""
    touches = {t.number: t for t in made.touches}
    columns = [made.machine.column(n) for n in made.machine.linear]
    paths, wanted, names = [], [], []
    for kind, number, start, end in positions(made):
        if kind == "index":
            assert np.array_equal(start[columns], end[columns]), "a linear axis moves while rotary axes turn"
            path, margin = _turns(made.machine, start, end), clearance.MARGIN - 1e-5
        else:
            assert np.array_equal(np.delete(start, columns), np.delete(end, columns)), "a rotary axis moves near the table"
            if kind in ("probe", "back"):  # up to the contact; what is behind it is the surface itself
                start, end = np.array(touches[number].standoff), np.array(touches[number].contact)
            margin = {"probe": -1e-6, "back": -1e-6, "clear": travel.MARGIN - 1e-6}.get(kind, 0.1)
            path = start + np.linspace(0.0, 1.0, 2 + int(np.abs(end - start).max() / 15.0))[:, None] * (end - start)
        paths.append(path)
        wanted.append(np.full(len(path), margin))
        names += [f"touch {number}: {kind}"] * len(path)
    gap, least = _gap(made, np.vstack(paths)), np.concatenate(wanted)
    worst = int(np.argmin(gap - least))
    assert gap[worst] >= least[worst], f"{names[worst]}: {gap[worst]:.3f} mm where {least[worst]:g} mm are due"


def _turns(m: Machine, start: Array, end: Array) -> Array:
    """Rotary axes together, and one after the other: a control may do either."""
    way = np.linspace(0.0, 1.0, 25)[:, None]
    paths, at = [start + way * (end - start)], start
    for name in (*m.rotary, "S"):
        goal = at.copy()
        goal[m.column(name)] = end[m.column(name)]
        paths.append(at + way * (goal - at))
        at = goal
    return np.vstack(paths)


angle = st.sampled_from([-180, -120, -90, -60, -45, -30, -10, 0, 15, 30, 45, 60, 75, 90, 135, 180, 270])
place = st.floats(-150, 150).map(lambda v: round(v, 3))
spread = st.builds(lambda values: {name: np.array(values[i]) for i, name in enumerate(NORMALS)}, st.lists(
    st.tuples(*[st.floats(-1, 1)] * 3), min_size=len(NORMALS), max_size=len(NORMALS)))  # fmt: skip


@pytest.mark.long
@settings(max_examples=80)
@given(
    topology=st.sampled_from(TABLES + HEADS),
    poses=st.lists(st.fixed_dictionaries({name: angle for name in "ABCS"}), min_size=2, max_size=3),
    point=st.tuples(place, place, place),
    centre=st.tuples(place, place, place),
    facets=spread,
    standoff=st.floats(2, 25),
    length=st.sampled_from([120.0, 300.0]),
)
def test_the_probe_meets_nothing_on_its_way(
    topology: str,
    poses: list[dict[str, float]],
    point: tuple[float, float, float],
    centre: tuple[float, float, float],
    facets: dict[str, Array],
    standoff: float,
    length: float,
) -> None:
    rotary = sorted(set("ABC") & set(topology))
    m = machine(topology, {rotary[-1]: point} if rotary and rotary[-1] in topology.split("f")[0] else None, length)
    turned = [{name: pose[name] for name in (*rotary, "S")} for pose in poses]
    artefact = block(centre, facets)
    assume(artefact.facets["1"].point[2] > centre[2] - 30)
    try:
        made = plan(cell(m, artefact, turned, standoff=standoff), "leave-out")
    except InputError as error:
        refused = ("no touch is left", "turns right round")
        parallel = ("do not span space", "are beyond the travel") if topology == "wCXBfZY(S)t" else ()  # X and Z at B = ±90
        assume(not any(text in str(error) for text in (*refused, *parallel)))
        raise
    _assert_clear(made)
    for move in made.moves:
        for name, value in move.target.items():
            low, high = made.machine.axis(name).travel or (-math.inf, math.inf)
            assert low <= value <= high


def test_a_table_far_from_the_axis_that_tilts_it_is_given_room() -> None:
    """The block stands on C, 200 mm beside B: B lifts it by as much."""
    m = machine("wCBXfZY(S)t", {"C": (200.0, 0.0, 0.0)})
    _assert_clear(plan(cell(m, block((200.0, 0.0, -40.0)), [{"B": 45}, {"B": -75}], facets=["5"])))


def test_the_way_is_clear_at_the_example_of_the_thesis(shared: Path) -> None:
    """No rotary axis moves unless the probe is 20 mm above every facet and ball, at both ends of the turn."""
    made = plan(read_cell(shared / "contract" / "hu40t"), "leave-out")
    chain, radius = kinematics.chain(made.machine), made.machine.probe.tip_radius
    corners = np.array([f.point for f in made.artefact.facets.values()])
    turned = [(start, end) for kind, _, start, end in positions(made) if kind == "index"]
    assert len(turned) == 30  # 28 indexations, C twice by half a turn or more; where the axes were before the first nobody knows
    places = np.array(turned).reshape(-1, len(made.machine.names))
    spindle = kinematics.spindle_axis(chain, places)
    height = np.einsum("ij,ij->i", kinematics.tip(chain, places), spindle) - radius
    assert (height > (spindle @ corners.T).max(axis=1) + 20 - 1e-6).all()
    for ball in made.artefact.balls.values():
        assert (height > spindle @ np.array(ball.centre) + ball.radius + 20 - 1e-6).all()


@pytest.mark.few(0)
def test_time_and_memory_grow_with_the_number_of_touches_only() -> None:
    """A plan of forty strategies has forty times the moves of one, and one preload: nothing is compared with everything else."""
    one = small(poses=({}, {"C": 30}))
    forty = replace(one, strategy=replace(one.strategy, indexations=one.strategy.indexations * 40))
    assert len(plan(forty).touches) == 40 * len(plan(one).touches)
    many, few = (Counter(m.kind for m in plan(c).moves) for c in (forty, one))
    assert many["probe"] == 40 * few["probe"] and many["index"] - 1 == 40 * (few["index"] - 1)
