"""Effects of axes, by hand. On this machine B turns about the machine's y, C about what B makes of z, through one point."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from support.effectparts import CELL, LENGTH, MACHINE, PLAIN, TOUCHES, X, Y, Z, along, at, carried_by_b, early, read_early, turning

from sim_controller.simulate import simulate
from tango_cnc.records import World

DIRECTION = {name: TOUCHES.direction[:, MACHINE.column(name)] for name in MACHINE.names}


def test_backlash_is_the_normal_times_the_direction_of_the_axis() -> None:
    # X carries the table: further forwards means early; Y carries the tool: further forwards means late
    assert read_early("backlash") == pytest.approx(0.005 * along(X) * DIRECTION["X"], abs=1e-9)
    assert read_early("backlash", axis="Y") == pytest.approx(-0.005 * along(Y) * DIRECTION["Y"], abs=1e-9)


def test_rotary_backlash_turns_the_table_too_far_the_way_it_came() -> None:
    assert set(DIRECTION["C"]) == {-1, 1}
    assert read_early("rotary_backlash") == pytest.approx(2e-5 * DIRECTION["C"] * turning(carried_by_b(Z)), abs=1e-7)
    assert read_early("rotary_backlash", axis="B") == pytest.approx(2e-5 * DIRECTION["B"] * turning(Y), abs=1e-7)


@pytest.mark.few(0)
def test_an_axis_remembers_how_far_it_came() -> None:
    x = at("X")
    ways = [0.0, *(abs(b - a) for a, b in itertools.pairwise(x))]
    wound = [0.003 * (1 - np.exp(-way / 50)) for way in ways]
    assert read_early("move_length_memory") == pytest.approx(wound * along(X), abs=1e-9)
    proportional = read_early("move_length_memory", shape="linear")
    assert proportional == pytest.approx(0.003 * np.array(ways) / 50 * along(X), abs=1e-9)
    assert max(ways) > 200 and min(ways[1:]) < 1  # so both a long and a short way are among them
    b = np.degrees(np.abs(np.diff(at("B"), prepend=at("B")[0])))
    turned = read_early("move_length_memory", axis="B", amplitude=1e-5, length=20)
    assert turned == pytest.approx(1e-5 * (1 - np.exp(-b / 20)) * turning(Y), abs=1e-7)


@pytest.mark.long
def test_an_eccentric_graduation_errs_once_a_turn() -> None:
    once = 2e-5 * np.cos(at("C"))
    assert read_early("encoder_harmonic") == pytest.approx(once * turning(carried_by_b(Z)), abs=1e-7)
    thrice = 2e-5 * np.cos(3 * at("B") + np.radians(40))
    assert read_early("encoder_harmonic", axis="B", order=3, phase=40) == pytest.approx(thrice * turning(Y), abs=1e-7)


@pytest.mark.long
def test_radial_error_motion_displaces_the_table_across_the_axis() -> None:
    twice = 0.003 * np.cos(2 * at("C") + np.radians(30))
    fixed = read_early("rotary_radial", phase=30, frame="fixed")
    assert fixed == pytest.approx(twice * along(carried_by_b(X)), abs=1e-9)
    turning_with_c = read_early("rotary_radial", phase=30)
    assert turning_with_c == pytest.approx(twice * TOUCHES.normal_table[:, 0], abs=1e-9)
    # what of the direction is along the axis is not radial and does not count
    assert read_early("rotary_radial", phase=30, direction=[1, 0, 7]) == pytest.approx(turning_with_c, abs=1e-12)
    assert read_early("rotary_radial", axis="B", order=1, frame="fixed") == pytest.approx(
        0.003 * np.cos(at("B")) * along(X), abs=1e-9
    )


def test_axial_error_motion_displaces_the_table_along_the_axis() -> None:
    assert read_early("rotary_axial") == pytest.approx(0.003 * np.cos(at("C")) * TOUCHES.normal_table[:, 2], abs=1e-9)
    twice = 0.003 * np.cos(2 * at("B") - np.radians(10))
    assert read_early("rotary_axial", axis="B", order=2, phase=-10) == pytest.approx(twice * along(Y), abs=1e-9)


@pytest.mark.few(0)
def test_tilt_error_motion_turns_the_table_about_a_line_across_the_axis() -> None:
    twice = 1e-5 * np.cos(2 * at("C"))
    assert read_early("rotary_tilt", frame="fixed") == pytest.approx(twice * turning(carried_by_b(X)), abs=1e-7)
    turned = read_early("rotary_tilt", direction=[0, 1, 0])
    of_the_table = np.einsum("nij,j->ni", TOUCHES.table, Y)
    assert turned == pytest.approx(twice * turning(of_the_table), abs=1e-7)


@pytest.mark.long
def test_a_weight_beside_the_axis_sags_and_winds_it_up() -> None:
    moment = np.sin(at("B"))
    assert read_early("gravity_sag") == pytest.approx(-0.005 * moment * along(Y), abs=1e-9)
    both = read_early("gravity_sag", direction=[0, 0, -1], tilt=1e-5, phase=25)
    later = np.sin(at("B") + np.radians(25))
    assert both == pytest.approx(later * (-0.005 * along(Z) + 1e-5 * turning(Y)), abs=1e-7)


@pytest.mark.long
def test_an_error_motion_has_its_size_at_its_span() -> None:
    # EYX lifts the table to +y; the travel of X ends at 400 mm
    second = read_early("error_motion", amplitude=1e-4)
    assert second == pytest.approx(1e-4 * (at("X") / 400) ** 2 * along(Y), abs=1e-9)
    fourth = read_early("error_motion", amplitude=1e-4, degree=4, span=200)
    assert fourth == pytest.approx(1e-4 * (at("X") / 200) ** 4 * along(Y), abs=1e-9)
    told = simulate(MACHINE, CELL.artefact, CELL.strategy, World({"EYX2": 0.01 / 400**2})).position
    assert read_early("error_motion") == pytest.approx(early(told, PLAIN.position), abs=1e-12)
    # EBZ turns the tool about y where Z is: the tip hangs one length below that point and goes to −x
    turned = read_early("error_motion", name="EBZ", amplitude=1e-6, degree=1, span=100)
    assert turned == pytest.approx(1e-6 * at("Z") / 100 * LENGTH * along(X), abs=1e-8)
    # EZC lifts the table along its own z; 180° is where it has its size
    of_c = read_early("error_motion", name="EZC", amplitude=0.004, degree=1, span=180)
    assert of_c == pytest.approx(0.004 * at("C") / np.pi * TOUCHES.normal_table[:, 2], abs=1e-9)


@pytest.mark.few(0)
def test_an_axis_location_error_is_that_of_the_machine() -> None:
    assert read_early("axis_location") == pytest.approx(0.02 * along(carried_by_b(X)), abs=1e-9)
    told = simulate(MACHINE, CELL.artefact, CELL.strategy, World({"EA0C": 3e-5})).position
    assert read_early("axis_location", name="EA0C", amplitude=3e-5) == pytest.approx(early(told, PLAIN.position), abs=1e-11)


@pytest.mark.long
def test_a_screw_errs_with_its_pitch() -> None:
    assert read_early("cyclic_error") == pytest.approx(-0.002 * np.cos(2 * np.pi * at("Y") / 10) * along(Y), abs=1e-9)
    shifted = read_early("cyclic_error", axis="X", period=12.5, phase=60)
    assert shifted == pytest.approx(0.002 * np.cos(2 * np.pi * at("X") / 12.5 + np.pi / 3) * along(X), abs=1e-9)


@pytest.mark.few(0)
def test_a_wrong_table_of_compensation_is_straight_between_its_nodes() -> None:
    # through 0 at −200, 3 µm at 0, −1 µm at 200: 15 and −20 nm a mm; constant beyond
    inside = np.clip(at("X"), -200, 200)
    roof = np.where(inside < 0, 0.003 + 1.5e-5 * inside, 0.003 - 2e-5 * inside)
    assert read_early("compensation_kink") == pytest.approx(roof * along(X), abs=1e-9)
    kink = read_early("compensation_kink", axis="B", nodes=[-90, 0, 90], values=[1e-5, 0, 1e-5])
    assert kink == pytest.approx(1e-5 * np.abs(at("B")) / (np.pi / 2) * turning(Y), abs=1e-7)


@pytest.mark.long
def test_a_column_leans_as_the_head_goes_up() -> None:
    # EAZ turns column, head and tool about x, at the origin of Z: the tip, at (0, y, −length) from there, goes by (0, length, y)
    lean = 1e-6 * at("Y") / 350
    went = np.column_stack([np.zeros(len(lean)), np.full(len(lean), LENGTH), at("Y")])
    assert read_early("moving_mass", amplitude=1e-6) == pytest.approx(-lean * along(went), abs=1e-9)
    # EBX turns the table about y, at the origin of X, where B turns too
    bed = 1e-6 * at("Z") / 500
    assert read_early("moving_mass", name="EBX", by="Z", amplitude=1e-6, span=500) == pytest.approx(bed * turning(Y), abs=1e-8)
