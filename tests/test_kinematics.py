"""The chain: exact transforms, exact derivatives, any topology; judged by complex steps and by the simulator's own transforms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.machines import machine_of, random_positions, topologies

from sim_controller.world import tip_in_table, true_machine
from tango_cnc import kinematics
from tango_cnc.files import read_cell
from tango_cnc.kinematics import Slot
from tango_cnc.model import PLACEMENT, STYLUS, Model, errors, known, linearise, residual, setup_coefficient
from tango_cnc.records import Artefact, Ball, Facet, Machine, Readings, ScaleBar, Surface, World
from tango_cnc.terms import backlash, error_motion, inter_axis
from tango_cnc.touches import Touches, from_readings, of_facets

EXAMPLES = sorted(file.parent for file in (Path(__file__).parent.parent / "examples").glob("*/tango.yaml"))
STEP = 1e-30  # complex steps know no cancellation


def every_coefficient(machine: Machine) -> list:
    """All three families to degree 3, degree 0 and the spindle's own included."""
    names = [f"E{c}{axis}{degree}" for axis in machine.names for c in "XYZABC" for degree in (0, 3)]
    extra = [found for name in names if (found := error_motion.coefficient(name, machine))]
    known_names = {c.name for c in extra}
    motion = [c for c in error_motion.coefficients(machine, 3) if c.name not in known_names]
    return [*inter_axis.coefficients(machine, 3), *backlash.coefficients(machine, 3), *motion, *extra]


def magnitude(name: str) -> float:
    """A bad machine: tenths of a millimetre and of a milliradian at the end of the travel, whatever the degree."""
    size = 0.3 if name[1] in "XYZ" else 3e-4
    if name[-1] == "b":
        return 0.01 if name[2] in "XYZ" else 1e-4
    if name[2] in "0tw":
        return size
    return size / (400.0 if name[2] in "XYZ" else 2.0) ** int(name[3])


def some_artefact(rng: np.random.Generator) -> Artefact:
    """One facet of every kind: plane, calibrated plane, cylinder, bore, sphere, bowl, and two balls with a bar."""
    normals = rng.normal(size=(8, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    across = np.cross(normals, rng.normal(size=(8, 3)))
    across /= np.linalg.norm(across, axis=1)[:, None]
    point = [tuple((150 * n).tolist()) for n in normals]
    normal = [tuple(n.tolist()) for n in normals]
    axis = [tuple(a.tolist()) for a in across]
    balls = {"1": Ball("1", (-150.0, 20.0, 90.0), 12.7), "2": Ball("2", (150.0, -40.0, 70.0), 10.0)}
    on = [tuple((np.array(balls[b].centre) + balls[b].radius * normals[6 + i]).tolist()) for i, b in enumerate("12")]
    facets = [
        Facet("plane", point[0], normal[0]),
        Facet("calibrated", point[1], normal[1], uncertainty=0.001),
        Facet("cylinder", point[2], normal[2], surface=Surface("cylinder", 250.0, axis[2])),
        Facet("bore", point[3], normal[3], surface=Surface("cylinder", 20.0, axis[3], inside=True)),
        Facet("sphere", point[4], normal[4], surface=Surface("sphere", 30.0)),
        Facet("bowl", point[5], normal[5], surface=Surface("sphere", 30.0, inside=True)),
        Facet("ball one", on[0], normal[6], ball="1"),
        Facet("ball two", on[1], normal[7], ball="2"),
    ]
    return Artefact("one of each", {f.id: f for f in facets}, balls, ScaleBar(("1", "2"), 306.0, 0.001))


def touches_near(machine: Machine, rng: np.random.Generator, count: int) -> Touches:
    """Touches that miss the nominal contact by up to a millimetre sideways; the linear axes must be independent."""
    artefact = some_artefact(rng)
    facets = [list(artefact.facets)[i] for i in rng.integers(0, 8, count)]
    position, signs = random_positions(machine, rng, count), rng.choice([-1.0, 1.0], (count, len(machine.names)))
    nominal = of_facets(machine, artefact, facets, position, signs).nominal
    shake = np.zeros_like(position)
    shake[:, list(nominal.chain.linear_columns)] = rng.uniform(-0.6, 0.6, (count, 3))
    return replace(nominal, position=nominal.position + shake)


@pytest.mark.long
@given(topologies(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_tip_of_any_chain_is_where_multiplied_transforms_put_it(topology, seed):
    rng = np.random.default_rng(seed)
    machine = machine_of(topology, rng)
    wrong = {c.name: rng.uniform(-1, 1) * magnitude(c.name) for c in every_coefficient(machine)}
    stylus = dict(zip(STYLUS, rng.uniform(-0.5, 0.5, 3), strict=True))
    position, signs = random_positions(machine, rng, 20), rng.choice([-1.0, 1.0], (20, len(machine.names)))
    true = true_machine(machine, World(errors=wrong, stylus=stylus))
    touches = of_facets(machine, one_facet(), ["1"] * 20, position, signs)
    model = Model(touches, (*every_coefficient(machine), *(setup_coefficient(name) for name in STYLUS)))
    acting = errors(model, np.array([*wrong.values(), *stylus.values()]))
    np.testing.assert_allclose(
        kinematics.tip(touches.chain, position, acting), tip_in_table(true, position, signs), rtol=0, atol=1e-10
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("cell", EXAMPLES, ids=lambda folder: folder.name)
def test_model_and_simulator_agree_over_ten_thousand_poses_and_errors(cell):
    machine, rng = read_cell(cell).machine, np.random.default_rng(1)
    coefficients = every_coefficient(machine)
    sizes = np.array([magnitude(c.name) for c in coefficients])
    values = rng.uniform(-1, 1, (100, len(sizes))) * sizes  # one hundred machines in one hundred poses each
    position, signs = random_positions(machine, rng, 10_000), rng.choice([-1.0, 1.0], (10_000, len(machine.names)))
    per_pose = {c.name: np.repeat(values[:, i], 100) for i, c in enumerate(coefficients)}
    theirs = tip_in_table(true_machine(machine, World()), position, signs, per_pose)
    ours = np.empty_like(theirs)
    for i in range(100):
        rows = slice(100 * i, 100 * i + 100)
        touches = of_facets(machine, one_facet(), ["1"] * 100, position[rows], signs[rows])
        ours[rows] = kinematics.tip(touches.chain, position[rows], errors(Model(touches, tuple(coefficients)), values[i]))
    assert np.abs(ours - theirs).max() < 1e-10
    nominal = kinematics.tip(kinematics.chain(machine), position)
    assert np.median(np.linalg.norm(ours - nominal, axis=1)) > 0.1  # the errors were no trifle


def one_facet() -> Artefact:
    return Artefact("one facet", {"1": Facet("1", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))})


@pytest.mark.long
@given(topologies(), st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_sensitivity_is_the_derivative_by_complex_step(topology, seed):
    rng = np.random.default_rng(seed)
    machine = machine_of(topology, rng)
    chain = kinematics.chain(machine)
    position = random_positions(machine, rng, 6)
    normal = rng.normal(size=(6, 3))
    at = {slot: rng.uniform(-1e-3, 1e-3, 6) for slot in chain.slots}
    found = kinematics.sensitivity(chain, kinematics.trace(chain, position, at), normal).slots
    assert set(found) == set(chain.slots)
    for slot in chain.slots:
        stepped = kinematics.tip(chain, position, at | {slot: at[slot] + 1j * STEP})
        expected = np.sum(stepped.imag / STEP * normal, axis=1)
        np.testing.assert_allclose(found[slot], expected, rtol=1e-8, atol=1e-9)


@pytest.mark.long
@given(topologies(), st.integers(0, 2**32 - 1))
@settings(max_examples=12, deadline=None)
def test_jacobian_of_every_unknown_is_the_derivative_by_complex_step(topology, seed):
    rng = np.random.default_rng(seed)
    machine = machine_of(topology, rng)
    touches = touches_near(machine, rng, 24)
    setup = [setup_coefficient(name) for name in (*STYLUS, *PLACEMENT)]
    model = Model(touches, (*every_coefficient(machine), *setup))
    sizes = [magnitude(c.name) for c in model.coefficients]
    sizes += [0.1] * (len(model.names) - len(sizes))
    values = rng.uniform(-1, 1, len(sizes)) * sizes
    _, jacobian = linearise(model, values)
    _, below, _ = known(model, values)
    for j in range(len(values)):
        stepped = values.astype(complex)
        stepped[j] += 1j * STEP
        scale = np.abs(jacobian[:, j]).max() + 1e-12
        np.testing.assert_allclose(jacobian[:, j] / scale, residual(model, stepped).imag / STEP / scale, rtol=0, atol=1e-8)
        width = 1e-3
        if model.names[j].startswith(("EZf", "EXball", "EYball", "EZball")):
            shift = np.zeros(len(values))
            shift[j] = width
            difference = (known(model, values + shift)[0] - known(model, values - shift)[0]) / (2 * width)
            np.testing.assert_allclose(below[:, j], difference, rtol=0, atol=1e-8)


def test_jacobian_agrees_with_central_differences_too():
    rng = np.random.default_rng(3)
    touches = touches_near(machine_of("wCBXfZY(S)t"), rng, 40)
    model = Model(touches, (*inter_axis.coefficients(touches.machine, 3), *(setup_coefficient(name) for name in STYLUS)))
    values = rng.uniform(-1e-3, 1e-3, len(model.names))
    _, jacobian = linearise(model, values)
    for j, coefficient in enumerate(model.coefficients):
        # In balance between the rounding of 300 mm numbers and the curvature of a 10 mm ball.
        shift = np.zeros(len(values))
        shift[j] = 1e-3 if coefficient.unit == "mm" else 1e-5
        difference = (residual(model, values + shift) - residual(model, values - shift)) / (2 * shift[j])
        assert np.abs(difference - jacobian[:, j]).max() < 1e-8 * max(1.0, np.abs(jacobian[:, j]).max())


@given(topologies(), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_inverse_brings_the_tip_where_it_is_wanted(topology, seed):
    rng = np.random.default_rng(seed)
    machine = machine_of(topology)
    chain, wanted = kinematics.chain(machine), rng.uniform(-200, 200, (10, 3))
    position = kinematics.inverse(chain, random_positions(machine, rng, 10), wanted)
    np.testing.assert_allclose(kinematics.tip(chain, position), wanted, rtol=0, atol=1e-9)


def test_inverse_refuses_linear_axes_that_do_not_span_space():
    machine = machine_of("wXfYZ(S)t")
    axes = tuple(replace(axis, direction=(1.0, 0.0, 0.0)) if axis.name == "Y" else axis for axis in machine.axes)
    with pytest.raises(np.linalg.LinAlgError):
        kinematics.inverse(kinematics.chain(replace(machine, axes=axes)), np.zeros((1, 4)), np.zeros((1, 3)))


def test_a_leading_dimension_of_trials_changes_nothing():
    rng = np.random.default_rng(5)
    touches = touches_near(machine_of("wXYfZCA(S)t"), rng, 30)
    model = Model(touches, (*inter_axis.coefficients(touches.machine, 3), *(setup_coefficient(name) for name in STYLUS)))
    values = rng.uniform(-1e-3, 1e-3, (4, 5, len(model.names)))
    together = residual(model, values)
    alone = np.array([[residual(model, v) for v in row] for row in values])
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-12)


def test_the_stylus_turns_with_the_spindle():
    machine = machine_of("wCBXfZY(S)t")
    chain = kinematics.chain(machine)
    position = np.zeros((2, len(machine.names)))
    position[1, machine.column("S")] = np.pi / 2
    moved = kinematics.tip(chain, position, {Slot("t", "stylus", 0): 0.5}) - kinematics.tip(chain, position)
    np.testing.assert_allclose(moved, [[0.5, 0, 0], [0, 0.5, 0]], atol=1e-12)


def test_positioning_error_follows_the_command_whatever_the_sense():
    """E_XX is measured in command units along the positive command: it moves a reversed axis the other way."""
    machine = machine_of("wfXYZ(S)t")
    axes = tuple(replace(a, direction=(-1.0, 0.0, 0.0)) if a.name == "X" else a for a in machine.axes)
    for m, expected in ((machine, 0.2), (replace(machine, axes=axes), -0.2)):
        chain, position = kinematics.chain(m), np.zeros((1, 4))
        motion = kinematics.tip(chain, position, {Slot("X", "motion"): 0.2}) - kinematics.tip(chain, position)
        straightness = kinematics.tip(chain, position, {Slot("X", "intra", 1): 0.2}) - kinematics.tip(chain, position)
        np.testing.assert_allclose(motion, [[expected, 0, 0]], atol=1e-12)
        np.testing.assert_allclose(straightness, [[0, 0.2, 0]], atol=1e-12)


@pytest.mark.parametrize("tilt", [1e-9, 1e-7, 1e-3, 0.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_axis_frames_stay_orthonormal_and_carry_the_direction(tilt, sign):
    direction = np.array([0.0, np.sin(tilt), sign * np.cos(tilt)])
    frame, base, sense = kinematics.axis_frame("C", tuple(direction.tolist()))
    frame = np.eye(3) if frame is None else frame
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(sense * frame[base], direction, atol=1e-12)


def test_names_of_slots_are_those_of_iso_230():
    names = {kinematics.slot_name(slot) for slot in kinematics.chain(machine_of("wCBXfZY(S)t")).slots}
    assert {"EX0C", "EYX", "EXX", "ECC", "EXt", "EA0S", "ECw"} <= names


def test_only_touches_with_status_ok_are_used():
    machine = machine_of("wfXYZ(S)t")
    one = np.ones(3, dtype=np.int64)
    readings = Readings(
        machine.names,
        np.array([1, 2, 3]),
        np.arange(3.0),
        ("1",) * 3,
        np.zeros((3, 4)),
        np.zeros((3, 4)),
        ("ok", "miss", "early"),
        one,
        one,
    )
    assert from_readings(machine, one_facet(), readings).number.tolist() == [1]
