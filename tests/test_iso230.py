"""Figures of ISO 230 against cases that can be worked out by hand, and against the simulator's exact transforms."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_controller.simulate import simulate
from sim_controller.world import place, true_machine
from tango_cnc import iso230
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.iso230 import Tell
from tango_cnc.iso230._line import POINTS, line_of, turned
from tango_cnc.iso230.onpart import asked
from tango_cnc.iso230.trajectory import reference
from tango_cnc.kinematics import axis_frame
from tango_cnc.records import Axis, Machine, World
from tango_cnc.terms import find

ROOT = Path(__file__).parents[1]
TOGETHER = {"X": (-200.0, 200.0), "Y": (-150.0, 150.0), "Z": (-100.0, 300.0), "B": (-1.5, 1.5), "C": (-4.0, 4.0)}


@cache
def example(name: str) -> Machine:
    return read_cell(ROOT / "examples" / name).machine


@pytest.fixture
def hu40t() -> Machine:
    return example("hu40t")


@pytest.fixture
def huron() -> Machine:
    return example("huron")


def figures(
    machine: Machine, errors: dict[str, float], over: dict[str, tuple[float, float]] = TOGETHER
) -> dict[tuple[str, str], iso230.Figure]:
    """coefficients → figures by (kind, name); exactly known, so every standard deviation is zero."""
    coefficients = [find(name, machine)[0] for name in errors]
    values = np.array(list(errors.values()))
    found = iso230.of_coefficients(machine, coefficients, values, np.zeros((len(values), len(values))), over)
    return {(f.kind, f.name): f for f in found}


def test_a_parabola_of_4_um_sagitta_is_4_um_out_of_straight(hu40t: Machine) -> None:
    found = figures(hu40t, {"EYX2": 1e-7})
    assert found["straightness", "EYX"].value == pytest.approx(1e-7 * 200**2 * 1e3, rel=1e-4)
    assert found["straightness", "EYX"].unit == "µm"
    assert found["straightness", "EYX"].range == (-200, 200)


def test_a_cubic_loses_its_slope_to_the_least_squares_line(hu40t: Machine) -> None:
    # a x³ on [−L, L]: the line has slope 3/5 a L², at the ends 2/5 a L³ is left on either side
    assert figures(hu40t, {"EZX3": 2e-10})["straightness", "EZX"].value == pytest.approx(0.8 * 2e-10 * 200**3 * 1e3, rel=0.02)


def test_a_tilted_line_is_straight(hu40t: Machine) -> None:
    assert figures(hu40t, {"EYX1": 1e-4, "EYX0": 0.1})["straightness", "EYX"].value == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("half", [0.003, -0.003])
def test_positioning_with_backlash_is_bidirectional(hu40t: Machine, half: float) -> None:
    found = figures(hu40t, {"EXX1": 1e-5, "EXXb": half})
    assert found["positioning", "EXX M"].value == pytest.approx(4.0)  # 10 µm/m over 400 mm
    assert found["positioning gain", "EXX"].value == pytest.approx(10.0)
    assert found["reversal", "EXX B"].value == pytest.approx(2e3 * half)  # negative: lost motion
    assert found["positioning", "EXX E"].value == pytest.approx(10.0)


def test_positioning_of_a_rotary_axis_is_told_in_seconds_of_arc_too(hu40t: Machine) -> None:
    found = figures(hu40t, {"EBBb": 5 * np.pi / 180 / 3600})
    assert found["reversal", "EBB B"].arcseconds == pytest.approx(10.0)
    assert found["reversal", "EBB B"].unit == "µrad"


def test_roll_and_tilts_of_a_linear_axis(hu40t: Machine) -> None:
    found = figures(hu40t, {"EAX1": 1e-7, "EBX2": 1e-9})
    assert found["angular", "EAX"].value == pytest.approx(40.0)
    assert found["angular", "EAX"].note == "roll"
    assert found["angular", "EBX"].value == pytest.approx(40.0, rel=1e-3)
    assert found["angular", "EBX"].note == "tilt about Y"


def direction_of(machine: Machine, errors: dict[str, float], axis: str) -> np.ndarray:
    """Which way the tip goes on the part for a positive command of one linear axis: by the simulator's transforms."""
    position = np.zeros((2, len(machine.names)))
    position[1, machine.column(axis)] = 100.0
    tip = place(true_machine(machine, World(errors)), position, np.zeros_like(position)).tip
    way: np.ndarray = (tip[1] - tip[0]) / np.linalg.norm(tip[1] - tip[0])
    return way


@pytest.mark.long
@given(
    errors=st.dictionaries(
        st.sampled_from(["EB0Z", "EA0Y", "EC0Y", "EC0X", "EB0X", "EA0Z", "EXZ1", "EYX1", "ECZ0"]),
        st.floats(-1e-4, 1e-4),
        min_size=1,
    )
)
@settings(max_examples=30)
def test_squareness_is_the_angle_that_the_true_machine_has(errors: dict[str, float]) -> None:
    machine = example("hu40t")
    found = figures(machine, errors)
    for one, two in (("X", "Y"), ("X", "Z"), ("Y", "Z")):
        a, b = direction_of(machine, errors, one), direction_of(machine, errors, two)
        truth = np.arccos(a @ b) - np.pi / 2
        told = found.get(("squareness", f"{two} to {one}"))
        assert (told.value if told else 0.0) == pytest.approx(truth * 1e6, abs=0.05)  # second order of 100 µrad: 0.01


def turning_axis(machine: Machine, errors: dict[str, float], axis: str) -> np.ndarray:
    """Machine-frame direction about which the table turns when one rotary axis moves, by the simulator's transforms."""
    position = np.zeros((2, len(machine.names)))
    position[1, machine.column(axis)] = 0.5
    table = place(true_machine(machine, World(errors)), position, np.zeros_like(position)).table
    turn = table[1] @ table[0].T
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize("errors", [{"EA0C": 4e-5}, {"EB0C": -6e-5, "EC0A": 2e-5}, {"EB0A": 8e-5, "EC0A": -3e-5}])
def test_the_angle_between_inclined_rotary_axes(huron: Machine, errors: dict[str, float]) -> None:
    found = figures(huron, errors, {"A": (-1.0, 1.0), "C": (-3.0, 3.0), "X": (-200, 200), "Y": (-200, 200), "Z": (100, 400)})
    one, two = turning_axis(huron, errors, "A"), turning_axis(huron, errors, "C")
    nominal = np.arccos(np.array(huron.axis("A").direction) @ np.array(huron.axis("C").direction))
    told = found.get(("angle", "C to A"))
    assert (told.value if told else 0.0) == pytest.approx((np.arccos(one @ two) - nominal) * 1e6, abs=0.05)


@pytest.mark.parametrize("errors", [{"EA0C": 5e-5}, {"EB0C": -4e-5}, {"EB0Z": 7e-5}, {"EA0B": 2e-5, "EB0C": 1e-5, "EB0Z": -3e-5}])
def test_parallelism_is_the_turn_that_takes_one_line_to_the_other(hu40t: Machine, errors: dict[str, float]) -> None:
    coefficients = [find(name, hu40t)[0] for name in errors]
    told = iso230.of_coefficients(hu40t, coefficients, np.array(list(errors.values())), np.zeros((len(errors),) * 2), TOGETHER)
    zero = np.zeros((1, len(hu40t.names)))
    table = place(true_machine(hu40t, World(errors)), zero, zero).table[0]  # from the table frame into the machine frame
    turn = np.cross(table @ direction_of(hu40t, errors, "Z"), turning_axis(hu40t, errors, "C"))
    found = np.zeros(3)
    for f in told:
        if (f.kind, f.name) == ("parallelism", "C to Z"):
            found += f.value * np.array([float(x) for x in f.note.removeprefix("turn about [").rstrip("]").split(",")])
    assert found == pytest.approx(turn * 1e6, abs=0.05)


def test_offset_of_c_from_b_is_where_its_axis_runs(hu40t: Machine) -> None:
    found = figures(hu40t, {"EX0C": -0.108})
    assert found["offset", "C to B"].value == pytest.approx(-108.0)
    assert found["offset", "C to B"].note == "along [1, 0, 0]"


def rotary(direction: float = 1.0) -> tuple[Machine, Axis]:
    machine = example("hu40t")
    axis = replace(machine.axis("C"), direction=(0.0, 0.0, direction))
    return replace(machine, axes=tuple(axis if a.name == "C" else a for a in machine.axes)), axis


@given(
    place=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    eccentric=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    sense=st.sampled_from([1.0, -1.0]),
)
@settings(max_examples=40)
def test_an_axis_that_runs_elsewhere_has_no_error_motion(
    place: tuple[float, float], eccentric: tuple[float, float], sense: float
) -> None:
    """A body turned about a place off its frame, set up eccentrically, turns truly: all of it is place and eccentricity."""
    machine, axis = rotary(sense)
    assert axis_frame("C", axis.direction)[2] == sense
    line = line_of(machine, axis, [], -2.5, 2.5)
    angle = sense * line.command
    a, b = complex(*place), complex(*eccentric)
    body = np.exp(-1j * angle) * a + b  # d(θ) = a + R(θ) b, turned back into the body
    offset, rest = turned(line, (body.real[:, None], body.imag[:, None]))
    assert np.allclose([offset[0], offset[1]], [[a.real], [a.imag]], atol=1e-9)
    assert np.allclose(rest, 0, atol=1e-9)


def test_a_two_lobed_spindle_of_1_um_runs_out_by_its_lobes() -> None:
    machine, axis = rotary()
    line = line_of(machine, axis, [], -np.pi, np.pi)
    lobes = 0.001 * np.exp(2j * line.command)  # fixed frame
    body = np.exp(-1j * line.command) * lobes
    _, rest = turned(line, (body.real[:, None], body.imag[:, None]))
    assert np.ptp(rest[0]) == pytest.approx(0.002, rel=0.02)
    assert len(rest[0]) == POINTS


@pytest.mark.long
def test_figures_come_with_their_standard_deviation(hu40t: Machine) -> None:
    """By hand for one coefficient, and by drawing from the covariance for a figure of many."""
    rng = np.random.default_rng(3)
    names = ["EB0Z", "EXZ2", "EXZ3", "EA0Y"]
    coefficients = [find(n, hu40t)[0] for n in names]
    values, std = np.array([4e-5, 2e-7, 3e-10, 1e-5]), np.array([2e-6, 2e-8, 3e-11, 1e-6])
    told = {(f.kind, f.name): f for f in iso230.of_coefficients(hu40t, coefficients, values, np.diag(std**2), TOGETHER)}
    drawn = []
    for _ in range(150):
        once = iso230.of_coefficients(hu40t, coefficients, values + std * rng.normal(size=4), np.zeros((4, 4)), TOGETHER)
        drawn.append({(f.kind, f.name): f.value for f in once})
    for key in (("squareness", "Z to X"), ("straightness", "EXZ"), ("squareness", "Z to Y")):
        assert np.std([d[key] for d in drawn]) == pytest.approx(told[key].std, rel=0.25), key


@pytest.mark.few(0)
@pytest.mark.parametrize("size", [0, 1, 4, 20])
def test_the_interval_of_a_range_holds_the_range_and_never_goes_below_zero(size: float) -> None:
    """A bent axis, from straight to 20 standard deviations: 95 of 100 intervals hold the true range."""
    bend, rng = np.linspace(-1, 1, 41)[:, None] ** 2, np.random.default_rng(11)
    told = [Tell(value, np.eye(1)).spread(bend) for value in size + rng.normal(size=(200, 1))]
    assert all(0 <= low <= range_ <= high for range_, _, (low, high) in told)
    assert np.mean([low <= size <= high for _, _, (low, high) in told]) >= 0.91  # at 95 % fewer come once in two hundred


def test_what_was_not_estimated_is_not_told(hu40t: Machine) -> None:
    assert figures(hu40t, {"EXX1": 1e-5}).keys() == {("positioning", "EXX M"), ("positioning gain", "EXX")}


def test_figures_of_an_estimate_lie_about_those_of_the_true_machine() -> None:
    cell = read_cell(ROOT / "examples" / "hu40t")
    world = read_world(ROOT / "examples" / "hu40t" / "world.yaml")
    result = estimate(cell.machine, cell.artefact, simulate(cell.machine, cell.artefact, cell.strategy, world), ("S3",))
    over = iso230.ranges(result.model.touches)
    assert set(over) == {"X", "Y", "Z", "B", "C"}
    coefficients = [find(n, cell.machine)[0] for n in world.errors]
    truth = iso230.of_coefficients(
        cell.machine, coefficients, np.array(list(world.errors.values())), np.zeros((len(coefficients),) * 2), over
    )
    true = {(f.kind, f.name, f.note if f.kind == "parallelism" else ""): f.value for f in truth}
    found = iso230.figures(result)
    assert len(found) > 20
    deviation = [(f.value - true[f.kind, f.name, f.note if f.kind == "parallelism" else ""]) / f.std for f in found]
    assert np.max(np.abs(deviation)) < 4
    assert 0.3 < np.sqrt(np.mean(np.square(deviation))) < 1.8


@pytest.mark.long
def test_curves_are_the_figures_drawn() -> None:
    cell = read_cell(ROOT / "examples" / "hu40t")
    world = read_world(ROOT / "examples" / "hu40t" / "world.yaml")
    result = estimate(cell.machine, cell.artefact, simulate(cell.machine, cell.artefact, cell.strategy, world), ("S4",))
    ranges = {(f.kind, f.name): f.value for f in iso230.figures(result)}
    drawn = iso230.curves(result)
    assert set(drawn) == {"X", "Y", "Z", "B", "C"}
    for at, curves in drawn.values():
        for curve in curves:
            name = f"{curve.name} M" if curve.kind == "positioning" else curve.name
            assert np.ptp(curve.value) == pytest.approx(ranges[curve.kind, name], rel=1e-9)
            assert len(curve.value) == len(at) == len(curve.std)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["hu40t", "trunnion", "fork_head", "split"])
def test_figures_of_one_name_have_one_sign_and_size_in_both_lists(name: str) -> None:
    """Of the fitted terms alone, and of the tool on the part: squareness, reversal, gain at a probe without tilts."""
    machine = example(name)
    errors = {"EXX1": 4e-5, "EYY1": -6e-5, "EXXb": 0.004, "EYYb": -0.003, "EC0Y": 8e-5, "EB0Z": 5e-5, "EA0Z": -3e-5}
    chosen = [c for name in errors for c in find(name, machine)[:1]]
    values = np.array(list(errors.values()))
    over = {axis: (-100.0, 100.0) for axis in machine.linear}
    alone = {(f.kind, f.name): f.value for f in iso230.of_coefficients(machine, chosen, values, np.eye(len(values)), over)}
    asks = asked(machine, chosen, over, reference(machine, over))
    part = {(a.kind, a.name): float(a.curve @ values) * a.factor for a in asks if not a.is_range}
    both = [key for key in alone if key in part and abs(alone[key]) > 1]
    assert {kind for kind, _ in both} == {"squareness", "reversal", "positioning gain"}
    for key in both:
        assert alone[key] == pytest.approx(part[key], rel=1e-6), key
