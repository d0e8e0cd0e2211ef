"""The simulated axes: contacts on the way, trips, the deflected stylus, the clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_controller import surfaces
from sim_controller.faults import Faults, faults
from sim_controller.motion import Motion, MotionStop
from sim_controller.probing import home, rig
from sim_controller.search import first_contact
from sim_controller.simulate import simulate
from sim_controller.world import place
from tango_cnc.files import read_cell
from tango_cnc.records import Approach, Artefact, Ball, Facet, Indexation, InputError, Obstacle, Strategy, World

MACHINE = read_cell(Path(__file__).parent.parent / "examples" / "hu40t").machine
NAMES = MACHINE.names
LENGTH, RADIUS = MACHINE.probe.length, MACHINE.probe.tip_radius
TOPS = {
    name: Facet(name, (x, y, 0.0), (0.0, 0.0, 1.0)) for name, x, y in (("a", 90.0, 0.0), ("b", -60.0, 70.0), ("c", 0.0, -120.0))
}
TABLE = Artefact("three tops", TOPS)
OVER_A = {"X": -90.0, "Y": 0.0, "Z": LENGTH + RADIUS + 10}


def machine_at(world: World = World(), artefact: Artefact = TABLE, **more: object) -> Motion:  # noqa: B008  frozen
    """A machine whose tip stands 10 mm above facet a."""
    motion = Motion(rig(MACHINE, artefact, world), **more)  # type: ignore[arg-type]
    motion.rapid({"X": OVER_A["X"], "Y": OVER_A["Y"]})
    motion.rapid({"Z": OVER_A["Z"]})
    return motion


def z(position: np.ndarray) -> float:
    return float(position[MACHINE.column("Z")])


def test_home_is_up_and_off_the_table() -> None:
    assert home(MACHINE) == pytest.approx([0, 0, 800, 0, 0, 0])


def test_a_probing_move_stops_at_the_surface_and_a_little_behind_it() -> None:
    motion = machine_at()
    hit = motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    assert hit.hit and not hit.already
    assert z(hit.position) == pytest.approx(LENGTH + RADIUS, abs=1e-12)
    # 3 mm/s: one millisecond of latency, then 2 m/s² of deceleration
    assert z(motion.position) == pytest.approx(LENGTH + RADIUS - 0.003 - 3**2 / 4000, abs=1e-9)
    assert motion.deflected


def test_a_probing_move_that_meets_nothing_goes_to_its_end() -> None:
    motion = machine_at(World(facets={"a": -20.0}))
    missed = motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    assert not missed.hit
    assert z(missed.position) == z(motion.position) == LENGTH + RADIUS - 5
    assert not motion.deflected


def test_a_deflected_probe_ends_the_next_probing_move_at_once() -> None:
    motion = machine_at()
    motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    before = motion.position
    again = motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    assert again.hit and again.already
    assert np.array_equal(motion.position, before)


def test_backing_off_frees_the_probe_and_the_same_surface_is_found_again() -> None:
    motion = machine_at()
    first = motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    motion.feed({"Z": OVER_A["Z"] - 9}, 600)
    assert not motion.deflected
    second = motion.skip({"Z": LENGTH + RADIUS - 5}, 30)
    assert second.position == pytest.approx(first.position, abs=1e-12)


def test_driving_a_deflected_stylus_on_is_a_collision() -> None:
    motion = machine_at()
    motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    with pytest.raises(MotionStop, match="not a probing move"):
        motion.feed({"Z": LENGTH + RADIUS - 5}, 600)


def test_a_rapid_into_the_table_trips_the_probe_where_it_touches() -> None:
    told = []
    motion = machine_at(note=lambda event, **data: told.append((event, data)))
    with pytest.raises(MotionStop, match="probe tripped during a move that is not a probing move") as stop:
        motion.rapid({"Z": LENGTH - 5})
    assert stop.value.cause == "collision"
    assert z(motion.position) == pytest.approx(LENGTH + RADIUS, abs=1e-10)
    assert told[-1][0] == "collision" and told[-1][1]["surface"] == "facet a"


def test_a_rotary_move_into_a_facet_trips_too() -> None:
    motion = machine_at()
    motion.feed({"Z": LENGTH + RADIUS + 1}, 600)
    with pytest.raises(MotionStop, match="facet a"):
        motion.feed({"B": np.radians(-30)}, 600)  # lifts the +x side of the table


def test_beyond_the_patch_of_the_outermost_facet_there_is_nothing_to_touch() -> None:
    motion = machine_at()
    motion.rapid({"X": -90.0 - 25})
    assert not motion.skip({"Z": LENGTH - 5}, 180).hit


def test_a_ball_is_met_when_it_is_grazed_by_a_micrometre_and_not_when_it_is_passed() -> None:
    ball = Artefact("ball", {"top": Facet("top", (0, 0, 50), (0, 0, 1), ball="1")}, {"1": Ball("1", (0.0, 0.0, 40.0), 10.0)})
    for side, hit in ((10 + RADIUS - 0.001, True), (10 + RADIUS + 0.001, False)):
        motion = Motion(rig(MACHINE, ball, World()))
        motion.rapid({"X": -100.0, "Y": side})
        motion.rapid({"Z": LENGTH + 40})
        assert motion.skip({"X": 100.0}, 300).hit is hit


def test_an_obstacle_stops_the_probe_like_a_facet() -> None:
    post = replace(TABLE, obstacles=(Obstacle("box", low=(20.0, -30.0, 0.0), high=(40.0, 30.0, 60.0)),))
    motion = Motion(rig(MACHINE, post, World()))
    motion.rapid({"X": -90.0})
    motion.rapid({"Z": LENGTH + 30})
    with pytest.raises(MotionStop, match="obstacle 1"):
        motion.rapid({"X": 0.0})
    assert motion.position[0] == pytest.approx(-(40 + RADIUS), abs=1e-10)


def test_a_rapid_of_several_axes_may_run_on_a_bent_line() -> None:
    # X and Y have the same rapid: the way from (0, 0) to (100, 40) goes over (40, 40), not over (62.5, 25)
    corner = Artefact(
        "post", {"p": Facet("p", (-40.0, 40.0, 0.0), (0, 0, 1))}, {}, None, (Obstacle("box", (-45, 35, 0), (-35, 45, 60)),)
    )
    for straight in (True, False):
        motion = Motion(rig(MACHINE, corner, World()))
        motion.rapid({"Z": LENGTH + 30})
        if straight:
            motion.rapid({"X": 100.0, "Y": 40.0}, straight=True)
        else:
            with pytest.raises(MotionStop, match="obstacle 1"):
                motion.rapid({"X": 100.0, "Y": 40.0}, straight=False)


def test_an_axis_stays_within_its_travel() -> None:
    motion = machine_at()
    before = motion.position
    with pytest.raises(MotionStop, match="X would leave its travel") as stop:
        motion.rapid({"X": -401.0})
    assert (stop.value.cause, stop.value.axis, stop.value.sign) == ("overtravel", "X", -1)
    assert np.array_equal(motion.position, before)


def test_the_clock_follows_the_feed_and_whoever_waits_is_told() -> None:
    waited: list[float] = []
    motion = machine_at(wait=waited.append)
    began = motion.time
    motion.feed({"Z": OVER_A["Z"] + 30}, 600)
    assert motion.time - began == pytest.approx(3.0)
    motion.feed({"C": np.radians(60)}, 600)  # alone, a rotary axis takes the feed in degrees
    assert motion.time - began == pytest.approx(9.0)
    assert sum(waited) == pytest.approx(motion.time)


def test_backlash_follows_the_motions_that_were_really_made() -> None:
    motion = machine_at(World({"EZZb": 0.005}))
    down = motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    assert z(down.position) == pytest.approx(LENGTH + RADIUS + 0.005, abs=1e-12)  # moving down it stays 5 µm lower


def strategy(count: int) -> Strategy:
    indexations = tuple(Indexation({"B": 0.0, "C": np.radians(40.0 * i), "S": 0.0}, ("a", "b", "c")) for i in range(count))
    return Strategy("tops", Approach(10, 5, 180), indexations)


def test_touch_by_touch_the_same_machine_is_met_as_all_at_once() -> None:
    events = (
        {"cause": "indexation_seating", "amplitude": 0.002},
        {"cause": "surface_form", "amplitude": 0.001},
        {"cause": "probe_lobing", "amplitude": 0.004},
        {"cause": "step", "amplitude": 0.005, "direction": [0, 0, 1], "at": 7},
        {"cause": "chip", "facet": "b", "amplitude": 0.03, "at": 4},
        {"cause": "backlash", "axis": "Z", "amplitude": 0.004},
    )
    world = World({"EX0C": -0.1, "EZB2": 1e-3}, {"EXt": 0.01}, {"b": 0.02}, 0.0006, events, 11)
    wanted = simulate(MACHINE, TABLE, strategy(5), world)
    nominal = simulate(MACHINE, TABLE, strategy(5), World())
    motion = Motion(rig(MACHINE, TABLE, world))
    for i, contact in enumerate(nominal.position):
        at = dict(zip(NAMES, contact, strict=True))
        motion.rapid({"Z": 600.0})
        motion.rapid({name: at[name] for name in "BCS"})
        motion.rapid({name: at[name] for name in "XY"})
        motion.rapid({"Z": at["Z"] + 10})
        hit = motion.skip({"Z": at["Z"] - 5}, 180)
        assert hit.position == pytest.approx(wanted.position[i], abs=1e-9)


@pytest.mark.long
@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_the_first_contact_is_the_one_that_a_very_fine_search_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    r = rig(MACHINE, TABLE, World({"EX0C": 0.1, "EB0C": 1e-4}))
    low, high = np.array([-130, -130, LENGTH - 10, -0.3, -3, 0]), np.array([130, 130, LENGTH + 60, 0.3, 3, 0])
    start, end = rng.uniform(low, high), rng.uniform(low, high)
    direction = np.sign(end - start)
    s = np.linspace(0, 1, 4_001)
    positions = start + s[:, None] * (end - start)
    tip = place(r.true, positions, np.broadcast_to(direction, positions.shape)).tip
    closed = surfaces.gaps(r.surfaces, tip).min(axis=1) <= 0
    found = first_contact(r, start, end, direction)
    if closed.any():
        assert found is not None
        assert s[np.argmax(closed)] - 1 / 4_000 <= found[0] <= s[np.argmax(closed)]
    else:
        assert found is None or surfaces.gaps(r.surfaces, tip).min() < 0.05


@pytest.mark.parametrize(("name", "cause"), [("stop-after", "silence"), ("alarm-after", "alarm")])
def test_a_fault_comes_at_its_touch(name: str, cause: str) -> None:
    motion = machine_at(faults=faults([f"{name}=2"]))
    motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    motion.feed({"Z": OVER_A["Z"]}, 600)
    with pytest.raises(MotionStop, match=cause):
        motion.skip({"Z": LENGTH + RADIUS - 5}, 180)


def test_a_probe_that_sticks_stays_deflected_in_the_air() -> None:
    motion = machine_at(faults=Faults({"probe-stuck-after": 1}))
    motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    motion.feed({"Z": OVER_A["Z"]}, 600)
    stuck = motion.skip({"Z": LENGTH + RADIUS - 5}, 180)
    assert stuck.already and z(stuck.position) == OVER_A["Z"]


@pytest.mark.parametrize("text", ["stop-aftr=3", "stop-after", "stop-after=0", "stop-after=x"])
def test_a_wrong_fault_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="allowed:"):
        faults([text])
