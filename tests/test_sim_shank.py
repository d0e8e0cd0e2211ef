"""What the simulated machine notices beside contacts of the ball from in front: table between facets, stylus, body, spindle."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sim_controller import shank, solids
from sim_controller.motion import Motion, MotionStop
from sim_controller.probing import rig
from sim_controller.world import place
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.records import Artefact, Facet, Obstacle, Plan, World

EXAMPLES = Path(__file__).parent.parent / "examples"
MACHINE = read_cell(EXAMPLES / "hu40t").machine
LENGTH, RADIUS = MACHINE.probe.length, MACHINE.probe.tip_radius
BODY = LENGTH - MACHINE.probe.body_length  # mm above the tip where the thick part begins
FACES = {"top": ((0, 0, 0), (0, 0, 1)), "left": ((-80, 0, -30), (-1, 0, 0)), "right": ((80, 0, -30), (1, 0, 0))}
BLOCK = Artefact("block", {name: Facet(name, *where) for name, where in FACES.items()})


def machine_at(x: float, y: float, height: float, artefact: Artefact = BLOCK) -> Motion:
    """A machine whose tip is there (mm, table frame; the table moves in X)."""
    motion = Motion(rig(MACHINE, artefact, World()))
    motion.rapid({"X": -x, "Y": y})
    motion.rapid({"Z": LENGTH + height})
    return motion


def with_box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Artefact:
    return replace(BLOCK, obstacles=(Obstacle("box", low=low, high=high),))


def test_the_side_of_the_table_is_met_where_no_facet_is() -> None:
    motion = machine_at(-130, 14, -20)  # 14 mm beside the line of the facet, at half its height
    with pytest.raises(MotionStop, match=r"the table|facet left") as stop:
        motion.rapid({"X": 130.0 - 49.0})
    assert stop.value.cause == "collision"
    assert motion.position[0] == pytest.approx(80 + RADIUS, abs=1e-9)


def test_the_top_is_met_between_its_facets_from_above() -> None:
    motion = machine_at(50, 0, 20)
    with pytest.raises(MotionStop, match="the table"):
        motion.rapid({"Z": LENGTH - 5})
    assert motion.position[2] == pytest.approx(LENGTH + RADIUS, abs=1e-9)


def test_a_ball_that_goes_along_the_face_at_a_tenth_of_a_millimetre_goes_free() -> None:
    machine_at(-100, 0, RADIUS + 0.1).rapid({"X": -100.0})


def test_the_stylus_is_caught_by_what_its_ball_goes_under() -> None:
    artefact = with_box((20, -10, 40), (30, 10, 50))
    for height, free in ((20.0, False), (60.0, True)):
        motion = machine_at(-20, 0, height, artefact)
        if free:
            motion.rapid({"X": -60.0})
            continue
        with pytest.raises(MotionStop, match=r"probe tripped.*obstacle 1 \(stylus\)"):
            motion.rapid({"X": -60.0})
        reached = -motion.position[0]
        assert 20 - MACHINE.probe.stylus_radius <= reached <= 20 - MACHINE.probe.stylus_radius + shank.SKIN + shank.STEP


def test_a_guarded_move_is_ended_by_the_stylus_and_the_way_back_is_free() -> None:
    motion = machine_at(-20, 0, 20, with_box((20, -10, 40), (30, 10, 50)))
    assert motion.skip({"X": -60.0}, 600).hit and motion.deflected
    motion.feed({"X": 20.0}, 600)
    assert not motion.deflected


def test_a_bent_stylus_that_is_driven_on_is_a_collision() -> None:
    motion = machine_at(-20, 0, 20, with_box((20, -10, 40), (60, 10, 50)))
    motion.skip({"X": -60.0}, 600)
    with pytest.raises(MotionStop, match="obstacle 1"):
        motion.feed({"X": -50.0}, 600)


@pytest.mark.parametrize("protected", [False, True])
def test_the_probe_body_hits_a_post_that_the_stylus_passes_and_no_guard_helps(protected: bool) -> None:
    post = with_box((20, 20, 0), (30, 30, BODY + 30))
    motion = machine_at(-50, 0, 10, post)
    with pytest.raises(MotionStop, match=r"^collision .*obstacle 1 \(probe body\)"):
        motion.skip({"X": -60.0}, 600) if protected else motion.rapid({"X": -60.0})
    machine_at(-50, -15, 10, post).rapid({"X": -60.0})  # 35 mm beside it, the body has 32


@cache
def planned(name: str) -> Plan:
    cell = read_cell(EXAMPLES / name)
    return plan(replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[:2])), "leave-out")


def carried_out(made: Plan) -> str:
    """plan → what stopped the machine; empty when nothing did."""
    motion = Motion(rig(made.machine, made.artefact, World()))
    try:
        for move in made.moves:
            if move.kind == "probe":
                assert motion.skip(move.target, made.strategy.approach.feed).hit
            else:
                motion.rapid(move.target)
    except MotionStop as stop:
        return str(stop)
    return ""


@pytest.mark.long
@pytest.mark.parametrize("name", ["hu40t", "trunnion", "three_axis"])
def test_every_travel_that_is_planned_too_low_is_noticed(name: str) -> None:
    """Wherever the ball then is more than 0.5 mm in what lies behind all facets, by points along the way."""
    made = planned(name)
    assert carried_out(made) == ""
    true = rig(made.machine, made.artefact, World()).true
    flat = [f for f in made.artefact.facets.values() if f.ball is None]
    normal, point = (np.array([getattr(f, what) for f in flat]) for what in ("normal", "point"))
    inside = 0
    for i, (one, two) in enumerate(zip(made.touches, made.touches[1:], strict=False)):
        if one.indexation != two.indexation:
            continue
        low = (one.standoff, two.standoff)  # straight from stand-off to stand-off, over nothing
        path = np.linspace(*np.array(low), 300)
        tip = place(true, path, np.ones_like(path)).tip
        beyond = np.concatenate(
            [np.einsum("nj,fj->nf", tip, normal) - np.einsum("fj,fj->f", normal, point), tip - point.max(axis=0)], 1
        )
        beyond = np.concatenate([beyond, point.min(axis=0) - tip], 1)
        if beyond.max(axis=1).min() > made.machine.probe.tip_radius - 0.5:
            continue
        inside += 1
        touches = list(made.touches)
        touches[i], touches[i + 1] = replace(one, leave=low[0]), replace(two, enter=low[1])
        assert carried_out(replace(made, touches=tuple(touches))), f"from touch {one.number} to {two.number}"
    assert inside >= 3


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_cylinder_and_body_have_a_point_in_common_when_a_cloud_of_points_says_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = solids.hull(rng.uniform(-40, 40, (12, 3)))
    parts = shank.shank(MACHINE, Artefact("nothing", {}), None)
    tip, up = rng.uniform(-60, 60, (60, 3)), rng.normal(size=(60, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    part = np.arange(60) % 2  # stylus and probe body
    tip = np.where(part[:, None] == 1, tip - BODY * up, tip)
    found = shank._common(parts, body, tip, up, part)
    for row in range(60):
        low, high, radius = (values[part[row]] for values in (parts.low, parts.high, parts.radius))
        cloud = tip[row] + rng.uniform(low + shank.SKIN, high - shank.SKIN, 20_000)[:, None] * up[row]
        aside = np.cross(up[row], rng.normal(size=(20_000, 3)))
        aside *= ((radius - shank.SKIN) * np.sqrt(rng.random(20_000)) / np.linalg.norm(aside, axis=1))[:, None]
        beyond = ((cloud + aside) @ body.normal.T - body.offset).max(axis=1).min()
        assert found[row] or beyond > 0, row
        assert not found[row] or beyond < 2.0, row
    assert 5 < found.sum() < 55
