"""The true machine of the simulator, by arithmetic that fits on a hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.machines import machine_of, random_positions, topologies

from sim_controller.transforms import axis_frame
from sim_controller.world import nominal_machine, tip_in_table, true_machine
from tango_cnc.files import read_machine
from tango_cnc.records import InputError, Machine, World

HU40T = read_machine(Path(__file__).parent.parent / "examples" / "hu40t" / "machine.yaml")
LENGTH = HU40T.probe.length
FORWARD = dict.fromkeys(HU40T.names, 1.0)


def tip(machine: Machine, at: dict[str, float], errors: dict[str, float] | None = None, **more: dict[str, float]) -> np.ndarray:
    """Positions in mm and degrees → tip in the table frame, mm; every axis last moved forwards unless `last` says otherwise."""
    true = true_machine(machine, World(errors or {}, more.get("stylus", {})))
    values = [at.get(axis.name, 0.0) * (1.0 if axis.kind == "linear" else np.pi / 180) for axis in machine.axes]
    last = [more.get("last", {}).get(name, 1.0) for name in machine.names]
    return tip_in_table(true, np.array([values]), np.array([last]))[0]


def reversed_axis(machine: Machine, name: str) -> Machine:
    axes = [replace(a, direction=tuple(-v for v in a.direction)) if a.name == name else a for a in machine.axes]  # type: ignore[arg-type]
    return replace(machine, axes=tuple(axes))


def test_at_the_zero_pose_the_tip_hangs_one_length_below_the_spindle() -> None:
    assert tip(HU40T, {}) == pytest.approx([0, 0, -LENGTH], abs=1e-12)


def test_x_carries_the_table_so_the_tip_moves_backwards_over_it() -> None:
    assert tip(HU40T, {"X": 10, "Y": 20, "Z": LENGTH + 5}) == pytest.approx([-10, 20, 5], abs=1e-12)


def test_the_table_turns_under_the_tip() -> None:
    assert tip(HU40T, {"Y": 20, "Z": LENGTH, "C": 90}) == pytest.approx([20, 0, 0], abs=1e-12)
    assert tip(HU40T, {"Z": LENGTH + 5, "B": 90}) == pytest.approx([-5, 0, 0], abs=1e-12)


def test_a_scale_gain_of_ten_ppm_is_a_micrometre_after_a_hundred_millimetres() -> None:
    error = tip(HU40T, {"X": 100}, {"EXX1": 1e-5}) - tip(HU40T, {"X": 100})
    assert error == pytest.approx([-0.001, 0, 0], abs=1e-12)


def test_a_positioning_error_follows_the_command_whatever_the_sense() -> None:
    backwards = reversed_axis(HU40T, "X")
    error = tip(backwards, {"X": 100}, {"EXX1": 1e-5}) - tip(backwards, {"X": 100})
    assert error == pytest.approx([0.001, 0, 0], abs=1e-12)  # the table goes further along -x


def test_a_straightness_error_is_a_displacement_whatever_the_sense() -> None:
    for machine in (HU40T, reversed_axis(HU40T, "X")):
        error = tip(machine, {"X": 100}, {"EYX2": 1e-7}) - tip(machine, {"X": 100})
        assert error == pytest.approx([0, -0.001, 0], abs=1e-12)  # the table is carried towards +y


def test_the_offset_of_the_c_axis_stays_with_b_and_does_not_turn_with_c() -> None:
    for angle, seen in ((0, [-0.1, 0, 0]), (90, [0, 0.1, 0]), (180, [0.1, 0, 0])):
        error = tip(HU40T, {"C": angle}, {"EX0C": 0.1}) - tip(HU40T, {"C": angle})
        assert error == pytest.approx(seen, abs=1e-12)


def test_an_error_motion_of_degree_nought_turns_with_its_axis_and_an_axis_location_error_does_not() -> None:
    stands = tip(HU40T, {"C": 90}, {"EX0C": 0.1}) - tip(HU40T, {"C": 90})
    turns = tip(HU40T, {"C": 90}, {"EXC0": 0.1}) - tip(HU40T, {"C": 90})
    assert stands == pytest.approx([0, 0.1, 0], abs=1e-12)
    assert turns == pytest.approx([-0.1, 0, 0], abs=1e-12)


def test_the_thesis_puts_the_same_offset_into_the_degree_nought_of_the_axis_before() -> None:
    at = {"X": 30, "Y": -40, "Z": 400, "B": 25, "C": 140}
    assert tip(HU40T, at, {"EX0C": -0.251}) == pytest.approx(tip(HU40T, at, {"EXB0": -0.251}), abs=1e-12)
    assert tip(HU40T, at, {"EA0B": -2.58e-4}) == pytest.approx(tip(HU40T, at, {"EAX0": -2.58e-4}), abs=1e-12)
    assert tip(HU40T, at, {"EX0S": -0.252}) == pytest.approx(tip(HU40T, at, {"EXY0": -0.252}), abs=1e-12)


def test_tilts_act_over_the_height_above_the_axis() -> None:
    at = {"Z": LENGTH + 100}
    error = tip(HU40T, at, {"EB0C": 1e-5}) - tip(HU40T, at)
    assert error == pytest.approx([-0.001, 0, 0], abs=1e-8)  # the table leans towards +x, the tip stands back by it


def test_backlash_goes_with_the_last_motion() -> None:
    plain = tip(HU40T, {"X": 50})
    for sign in (1.0, -1.0):
        error = tip(HU40T, {"X": 50}, {"EXXb": 0.006}, last={"X": sign}) - plain
        assert error == pytest.approx([-0.006 * sign, 0, 0], abs=1e-12)
    assert tip(HU40T, {"X": 50}, {"EXXb": 0.006}, last={"X": 0.0}) == pytest.approx(plain, abs=1e-12)


def test_the_stylus_offset_turns_with_the_spindle_and_the_spindle_offset_does_not() -> None:
    for angle, seen in ((0, [0.01, 0, 0]), (90, [0, 0.01, 0]), (180, [-0.01, 0, 0])):
        error = tip(HU40T, {"S": angle}, stylus={"EXt": 0.01}) - tip(HU40T, {"S": angle})
        assert error == pytest.approx(seen, abs=1e-12)
        error = tip(HU40T, {"S": angle}, {"EX0S": 0.01}) - tip(HU40T, {"S": angle})
        assert error == pytest.approx([0.01, 0, 0], abs=1e-12)


def test_a_rotary_head_swings_the_tip_about_its_point() -> None:
    machine = machine_of("wXYfZB(S)t")
    axes = tuple(replace(a, point=(0.0, 0.0, 100.0)) if a.name == "B" else a for a in machine.axes)
    swung = tip(replace(machine, axes=axes), {"B": 90})
    assert swung == pytest.approx([-(machine.probe.length + 100), 0, 100], abs=1e-12)


@pytest.mark.few(0)
@given(st.integers(0, 2), st.integers(0, 2**32 - 1))
def test_an_axis_frame_is_a_turn_that_takes_the_base_vector_to_the_direction(base: int, seed: int) -> None:
    direction = np.random.default_rng(seed).normal(size=3)
    direction /= np.linalg.norm(direction)
    columns, sense = axis_frame(base, tuple(direction))
    assert sense == 1
    assert columns[:, base] == pytest.approx(direction, abs=1e-12)
    assert columns @ columns.T == pytest.approx(np.eye(3), abs=1e-12)
    smallest = np.arccos(np.clip(direction[base], -1, 1))
    assert (np.trace(columns) - 1) / 2 == pytest.approx(np.cos(smallest), abs=1e-12)


def test_a_direction_against_the_base_vector_is_a_negative_sense_in_the_machine_frame() -> None:
    columns, sense = axis_frame(2, (0.0, 0.0, -1.0))
    assert sense == -1
    assert np.array_equal(columns, np.eye(3))


@pytest.mark.long
@given(topologies(), st.integers(0, 2**32 - 1))
def test_with_every_error_zero_any_chain_is_the_nominal_one(topology: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    machine = machine_of(topology, rng)
    positions = random_positions(machine, rng, 5)
    zeros = dict.fromkeys([f"E{c}{a}{d}" for a in machine.names for c in "XYZABC" for d in (0, 1, 2, 3, "b")], 0.0)
    true, nominal = true_machine(machine, World(zeros)), nominal_machine(machine)
    assert tip_in_table(true, positions, np.ones_like(positions)) == pytest.approx(
        tip_in_table(nominal, positions, -np.ones_like(positions)), abs=1e-11
    )


@pytest.mark.long
@given(topologies(), st.integers(0, 2**32 - 1))
def test_the_table_frame_is_the_machine_frame_at_the_zero_pose_of_any_chain(topology: str, seed: int) -> None:
    machine = machine_of(topology, np.random.default_rng(seed))
    spindle = machine.spindle
    hanging = np.array(spindle.point) - machine.probe.length * np.array(spindle.direction)
    assert tip(machine, {}) == pytest.approx(hanging, abs=1e-10)


def test_coefficients_may_change_from_touch_to_touch() -> None:
    true = true_machine(HU40T, World({"EXX0": 0.001}))
    moved = tip_in_table(true, np.zeros((3, 6)), np.ones((3, 6)), {"EXX0": np.array([0.0, 0.01, 0.02])})
    assert moved[:, 0] == pytest.approx([-0.001, -0.011, -0.021], abs=1e-12)


@pytest.mark.parametrize(
    ("name", "nearest"), [("EXC", "EXC"), ("EX0A", "EX0"), ("EYX1x", "EYX1"), ("EXXB", "EXXb"), ("XX1", "EXX1"), ("eb0c", "EB0C")]
)
def test_an_unknown_coefficient_is_refused_with_the_nearest_one(name: str, nearest: str) -> None:
    with pytest.raises(InputError, match=rf"found '{name}'.*Did you mean '{nearest}"):
        true_machine(HU40T, World({name: 1.0}))
