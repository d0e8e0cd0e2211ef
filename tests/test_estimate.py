"""The estimate: exact without noise, honest with it, the thesis' figures on the thesis' machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.optimize import least_squares

from sim_controller.simulate import simulate
from tango_cnc.commands.estimate import as_text
from tango_cnc.estimate import Estimate, estimate, fit, without
from tango_cnc.files import read_cell, read_strategy, read_world
from tango_cnc.identify import Selection, select
from tango_cnc.model import Model, gap, known, linearise, residual
from tango_cnc.records import Artefact, Cell, Facet, InputError, Readings, Surface, TangoError, World
from tango_cnc.touches import from_readings

EXAMPLES = Path(__file__).parent.parent / "examples"
# How far each axis goes on the HU40T, mm and rad: what a polynomial coefficient amounts to is judged there.
REACH = {"X": 300.0, "Y": 300.0, "Z": 700.0, "B": np.pi / 2, "C": 3 * np.pi / 2}


def size_of(name: str) -> float:
    """What one rad or mm of the axis to the power of the degree amounts to at the end of the travel."""
    degree = int(name[3]) if name[3].isdigit() and name[2] != "0" else 0
    return float(REACH[name[2]] ** degree) if degree else 1.0


def bad_machine(names: list[str], rng: np.random.Generator) -> dict[str, float]:
    """Up to 20 µm and 60 µrad of everything at the end of the travel."""
    return {name: rng.uniform(-1, 1) * (0.02 if name[1] in "XYZ" else 6e-5) / size_of(name) for name in names}


def true_setup(cell: Cell, rng: np.random.Generator) -> dict:
    facets = [f.id for f in cell.artefact.facets.values() if f.ball is None and f.uncertainty is None]
    stylus = dict(zip(("EXt", "EYt", "EZt"), rng.uniform(-0.05, 0.05, 3), strict=True))
    return {"stylus": stylus, "facets": {f: rng.uniform(-0.05, 0.05) for f in facets}}


def worst_error(result: Estimate, truth: Mapping[str, float]) -> tuple[float, float]:
    """→ mm, rad: largest difference from the truth, polynomials at the end of the travel, stylus and facets included."""
    values = {name: p.value for name, p in {**result.parameters, **result.setup}.items()}
    values |= {f"EZf{f}": p.value for f, p in result.facets.items()}
    assert set(values) == set(truth)
    errors = {n: abs(v - truth[n]) * (1.0 if n.startswith("EZf") or n.endswith("t") else size_of(n)) for n, v in values.items()}
    return max(e for n, e in errors.items() if n[1] in "XYZ"), max((e for n, e in errors.items() if n[1] in "ABC"), default=0.0)


@pytest.fixture(scope="module")
def hu40t() -> Cell:
    return read_cell(EXAMPLES / "hu40t")


@pytest.fixture(scope="module")
def names_86(hu40t) -> list[str]:
    world = read_world(EXAMPLES / "hu40t" / "world.yaml")
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    return [c.name for c in select(from_readings(hu40t.machine, hu40t.artefact, readings), ["S4"]).model.coefficients][:-3]


def test_noise_free_s3_comes_back_to_a_picometre(hu40t):
    world = replace(read_world(EXAMPLES / "hu40t" / "world.yaml"), noise=0.0)
    result = estimate(hu40t.machine, hu40t.artefact, simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world), ["S3"])
    length, angle = worst_error(result, truth_of(world, hu40t.artefact))
    assert length < 1e-9
    assert angle < 1e-12


def test_noise_free_s4_comes_back_whole(hu40t, names_86):
    assert len(names_86) == 86
    rng = np.random.default_rng(4)
    world = World(errors=bad_machine(names_86, rng), **true_setup(hu40t, rng))
    result = estimate(hu40t.machine, hu40t.artefact, simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world), ["S4"])
    length, angle = worst_error(result, truth_of(world, hu40t.artefact))
    assert length < 1e-8
    assert angle < 1e-11
    assert result.iterations <= 6


def truth_of(world: World, artefact: Artefact) -> dict[str, float]:
    offsets = {f"EZf{f.id}": world.facets.get(f.id, 0.0) for f in artefact.facets.values() if f.ball is None}
    return {**world.errors, **world.stylus, **offsets}


@pytest.mark.long
def test_polynomials_to_degree_six_still_come_back(hu40t):
    """Powers of 700 mm to the sixth: the columns are scaled, so that only the shape of a power counts, not its size."""
    rng = np.random.default_rng(6)
    setup = true_setup(hu40t, rng)
    plain = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, World(**setup))
    names = [c.name for c in select(from_readings(hu40t.machine, hu40t.artefact, plain), ["S4"], 6).model.coefficients][:-3]
    assert {"ECC6", "EXX6", "EZC6"} <= set(names)
    errors = bad_machine(names, rng)
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, World(errors=errors, **setup))
    result = estimate(hu40t.machine, hu40t.artefact, readings, ["S4"], 6)
    assert np.abs(result.residuals).max() < 1e-9
    polynomial: dict[str, dict[int, float]] = {}
    for name, p in result.parameters.items():
        if name[3].isdigit() and name[2] != "0":
            polynomial.setdefault(name[:3], {})[int(name[3])] = p.value - errors[name]
    columns = {axis: result.model.touches.axis(axis) for axis in "XYZBC"}
    for motion, difference in polynomial.items():
        # A single power of 400 … 700 mm says little; what the error motion is where the axis has been says it all.
        wrong = sum(value * columns[motion[2]] ** degree for degree, value in difference.items())
        assert np.abs(wrong).max() < (1e-6 if motion[1] in "XYZ" else 1e-8), motion


def thesis_readings(shared: Path, hu40t: Cell, seed: int = 1) -> Readings:
    errors = yaml.safe_load((shared / "contract/thesis/table_4_4_subset4.yaml").read_text())
    strategy = read_strategy(shared / "contract/thesis/table_4_2.yaml", hu40t.machine, hu40t.artefact)
    world = World(errors={name: float(value) for name, value in errors.items()}, noise=0.0006, seed=seed)
    return simulate(hu40t.machine, hu40t.artefact, strategy, world)


@pytest.mark.few(0)
@pytest.mark.parametrize(("subset", "mean"), [("S1", 25.8), ("S2", 25.7), ("S3", 2.4)])
def test_unexplained_distances_of_the_thesis_machine(shared, hu40t, subset, mean):
    """Table 4-4 made true, Table 4-2 touched with 0.6 µm: Table 4-6 within a tenth of what an independent program gets."""
    result = estimate(hu40t.machine, hu40t.artefact, thesis_readings(shared, hu40t), [subset])
    assert np.abs(result.residuals).mean() * 1e3 == pytest.approx(mean, rel=0.1)


@pytest.mark.long
def test_the_whole_model_leaves_the_thesis_machine_only_its_noise(shared, hu40t):
    result = estimate(hu40t.machine, hu40t.artefact, thesis_readings(shared, hu40t), ["S4"])
    assert result.sigma * 1e3 == pytest.approx(0.6, rel=0.1)
    assert len(result.outliers) == 0


@pytest.mark.long
def test_standardised_errors_are_standard(hu40t, names_86):
    """A dozen machines through the simulator; the long test has two thousand."""
    standardised = many_machines(hu40t, names_86, 12)
    assert np.var(standardised) == pytest.approx(1.0, abs=0.15)


@pytest.mark.campaign
def test_standardised_errors_of_two_thousand_machines_are_standard(hu40t, names_86):
    standardised = many_machines(hu40t, names_86, 2000)
    variance = standardised.var(axis=0)
    assert variance.shape == (86,)
    worst = {name: float(v) for name, v in zip(names_86, variance, strict=True) if not 0.85 < v < 1.15}
    assert worst == {}
    assert np.abs(standardised.mean(axis=0)).max() < 4 / np.sqrt(2000)


def many_machines(cell: Cell, names: list[str], count: int) -> np.ndarray:
    """→ (count, 86) errors of the estimates over their standard deviations: each machine, stylus and table another one.

    The bar is as long as it is; what its certificate says is off by the uncertainty that it states, each time anew.
    """
    rng = np.random.default_rng(2000)
    bar = cell.artefact.scale_bar
    assert bar is not None
    found = np.empty((count, len(names)))
    coefficients = None
    for i in range(count):
        world = World(errors=bad_machine(names, rng), noise=0.0006, seed=i, **true_setup(cell, rng))
        certified = replace(cell.artefact, scale_bar=replace(bar, length=bar.length + bar.uncertainty * rng.normal()))
        touches = from_readings(cell.machine, certified, simulate(cell.machine, cell.artefact, cell.strategy, world))
        coefficients = coefficients or select(touches, ["S4"]).model.coefficients
        result = fit(Selection(Model(touches, coefficients), ()))
        truth = np.array([world.errors[c.name] for c in coefficients[:-3]])
        found[i] = (result.values[: len(truth)] - truth) / result.std[: len(truth)]
    assert coefficients is not None
    assert [c.name for c in coefficients[:-3]] == names
    return found


def test_a_gross_touch_is_flagged_and_kept_until_told_otherwise(hu40t):
    world = read_world(EXAMPLES / "hu40t" / "world.yaml")
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    position = readings.position.copy()
    position[[40, 41, 200], 0] += 0.02
    soiled = replace(readings, position=position)
    result = estimate(hu40t.machine, hu40t.artefact, soiled, ["S3"])
    clean = estimate(hu40t.machine, hu40t.artefact, readings, ["S3"])
    seen = {41, 42, 201} & set(result.outliers.tolist())
    assert seen and set(result.outliers.tolist()) <= {41, 42, 201}
    assert len(result.residuals) == len(readings)
    assert len(clean.outliers) == 0
    again = estimate(hu40t.machine, hu40t.artefact, without(soiled, result.model.touches, result.out), ["S3"])
    assert len(again.residuals) == len(readings) - len(result.outliers)
    assert again.sigma < result.sigma


@pytest.mark.long
def test_twenty_soiled_touches_do_not_hide_each_other(hu40t):
    """A twentieth of all touches are wrong, all in one direction: the plain residual would spread them over everybody."""
    world = read_world(EXAMPLES / "hu40t" / "world.yaml")
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    touches = from_readings(hu40t.machine, hu40t.artefact, readings)
    rows = np.random.default_rng(8).choice(len(readings), 20, replace=False)
    position = readings.position.copy()
    position[rows, :3] += 0.02 * np.column_stack([touches.lever(axis) for axis in "XYZ"])[rows]
    result = estimate(hu40t.machine, hu40t.artefact, replace(readings, position=position), ["S3"])
    assert set(result.outliers.tolist()) == set(readings.touch[rows].tolist())


@pytest.mark.long
def test_condition_number_is_that_of_the_matrix_and_stays_finite_for_high_powers(hu40t):
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, read_world(EXAMPLES / "hu40t" / "world.yaml"))
    plain = estimate(hu40t.machine, hu40t.artefact, readings, ["S3"])
    assert plain.condition_number == pytest.approx(np.linalg.cond(plain.jacobian), rel=1e-9)
    high = estimate(hu40t.machine, hu40t.artefact, readings, ["S4"], 6)
    assert 1e18 < high.condition_number < 1e40  # where singular values of the matrix itself end at 1e16


def test_too_few_touches_are_refused_with_the_numbers(hu40t):
    world = read_world(EXAMPLES / "hu40t" / "world.yaml")
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world).rows(np.arange(20))
    with pytest.raises(TangoError, match=r"found 20 touches for \d+ unknowns"):
        estimate(hu40t.machine, hu40t.artefact, readings, ["S3"])
    with pytest.raises(TangoError, match="no touch with status ok"):
        estimate(hu40t.machine, hu40t.artefact, replace(readings, status=("miss",) * 20), ["S3"])


@pytest.mark.few(0)
def test_readings_that_belong_to_another_table_do_not_give_numbers(hu40t):
    """Facets swapped all over: either the iteration refuses, or the residual shouts; it never returns a quiet answer."""
    world = read_world(EXAMPLES / "hu40t" / "world.yaml")
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    mixed = list(readings.facet)
    np.random.default_rng(0).shuffle(mixed)
    try:
        result = estimate(hu40t.machine, hu40t.artefact, replace(readings, facet=tuple(mixed)), ["S3"])
    except TangoError:
        return
    assert result.sigma > 1.0


def test_a_ball_touched_from_one_side_only_is_a_facet_of_its_own(hu40t):
    """Two misses on a ball must not cost the whole measurement, nor let its centre wander around the ball."""
    world = replace(read_world(EXAMPLES / "hu40t" / "world.yaml"), noise=0.0)
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    lost = tuple("miss" if facet in ("102", "103", "104", "105") else "ok" for facet in readings.facet)
    result = estimate(hu40t.machine, hu40t.artefact, replace(readings, status=lost), ["S3"])
    assert list(result.balls) == ["2"] and "101" in result.facets
    assert result.model.bar is None  # half a bar measures nothing
    assert np.abs(result.residuals).max() < 1e-9
    assert max(abs(result.value(n) - world.errors[n]) for n in ("EX0C", "EX0S", "EC0Y", "EA0B")) < 1e-9


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(12))
def test_whatever_part_of_the_readings_is_left_there_is_an_answer_or_a_sentence(hu40t, seed):
    rng = np.random.default_rng(seed)
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, read_world(EXAMPLES / "hu40t" / "world.yaml"))
    some = rng.choice(list(hu40t.artefact.facets), rng.integers(1, 12), replace=False)
    rows = np.flatnonzero([f in some for f in readings.facet]) if seed % 2 else np.arange(rng.integers(1, len(readings)))
    try:
        result = estimate(hu40t.machine, hu40t.artefact, readings.rows(rows), [("S2", "S3", "S4")[seed % 3]])
    except TangoError as refusal:
        assert "more touches than unknowns are needed" in str(refusal)
        return
    assert np.isfinite(result.std).all() and np.isfinite(result.condition_number)
    assert result.dof > 0 and result.std.shape == result.values.shape


def test_an_unknown_term_is_refused_with_its_nearest_name(hu40t):
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, World())
    with pytest.raises(InputError, match="EX0Q"):
        estimate(hu40t.machine, hu40t.artefact, readings, ["S3", "EX0Q"])


@pytest.mark.few(0)
def test_the_scale_bar_weighs_by_its_uncertainty(hu40t):
    world = replace(read_world(EXAMPLES / "hu40t" / "world.yaml"), noise=0.0006)
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    assert hu40t.artefact.scale_bar is not None
    information = []
    for uncertainty in (1.0, 0.005, 0.0005):
        artefact = replace(hu40t.artefact, scale_bar=replace(hu40t.artefact.scale_bar, uncertainty=uncertainty))
        information.append(estimate(hu40t.machine, artefact, readings, ["S3"]).parameters["EXX1"].std ** -2)
    # The balls' radii are known too and tell a little about the scale without any bar; what the bar adds is its own.
    loose = (0.005 / 304.6686) ** -2
    assert information[1] - information[0] == pytest.approx(loose, rel=0.1)
    tight = 1 / (information[2] - information[0])
    assert (0.0005 / 304.6686) ** 2 < tight < (0.0025 / 304.6686) ** 2


def round_artefact(cell: Cell, kind: str, inside: bool) -> Artefact:
    """The octagon with strongly curved surfaces: where a plane would be taken for granted the cosine error is micrometres."""
    facets = {}
    for facet in cell.artefact.facets.values():
        n = np.array(facet.normal)
        axis = None if kind == "sphere" else tuple(np.cross(n, np.eye(3)[np.argmin(np.abs(n))]).tolist())
        axis = None if axis is None else tuple((np.array(axis) / np.linalg.norm(axis)).tolist())
        facets[facet.id] = (
            facet if facet.ball else Facet(facet.id, facet.point, facet.normal, surface=Surface(kind, 25.0, axis, inside))
        )  # type: ignore[arg-type]
    return replace(cell.artefact, facets=facets)


@pytest.mark.few(1)
@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_curved_facets_touched_beside_their_point_are_no_form_error(hu40t, kind, inside):
    """The machine is out by a quarter of a millimetre, so that every touch misses its point: the cosine error is in the model."""
    artefact, world = round_artefact(hu40t, kind, inside), read_world(EXAMPLES / "hu40t" / "world.yaml")
    errors = {**world.errors, "EX0C": -0.3, "EY0S": 0.25, "EX0S": -0.25}
    world = replace(world, errors=errors, noise=0.0)
    readings = simulate(hu40t.machine, artefact, hu40t.strategy, world)
    result = estimate(hu40t.machine, artefact, readings, ["S3"])
    length, angle = worst_error(result, truth_of(world, artefact))
    assert length < 1e-9
    assert angle < 1e-11
    flat = estimate(hu40t.machine, hu40t.artefact, readings, ["S3"])
    assert np.abs(flat.residuals).max() > 1e-4  # taken for planes the same readings would be off by micrometres


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_a_ball_on_the_centre_of_a_round_facet_has_the_gradient_of_the_touch_that_was_wanted(hu40t, kind):
    """As a tool length that was still active may have it: every way leads to the surface, and none is a division by zero."""
    readings = simulate(hu40t.machine, round_artefact(hu40t, kind, False), hu40t.strategy, World())
    touches = from_readings(hu40t.machine, round_artefact(hu40t, kind, False), readings)
    assert touches.curved is not None
    tip = touches.point.copy()
    tip[touches.curved.rows] = touches.curved.centre
    value, gradient = gap(touches, tip, np.zeros(0), np.zeros((0, 3)))
    assert gradient == pytest.approx(touches.normal)
    assert value[touches.curved.rows] == pytest.approx(-touches.curved.radius - touches.radius[touches.curved.rows])


@pytest.mark.long
def test_a_hundred_times_nearer_than_finite_differences(hu40t):
    """The same residual, scaled alike, given to scipy with its own derivatives; the reference is iterated by singular values."""
    world = replace(read_world(EXAMPLES / "hu40t" / "world.yaml"), noise=0.0006)
    readings = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    result = estimate(hu40t.machine, hu40t.artefact, readings, ["S3"])
    model, weights = result.model, result.known_weights
    start = np.zeros(len(model.names))

    def jacobian(values: np.ndarray) -> np.ndarray:
        return np.vstack([linearise(model, values)[1], known(model, values)[1] * weights[:, None]])

    def gaps(values: np.ndarray) -> np.ndarray:
        return np.concatenate([residual(model, values), known(model, values)[0] * weights])

    scale = np.linalg.norm(jacobian(start), axis=0)
    exact = start
    for _ in range(8):
        exact = exact - np.linalg.lstsq(jacobian(exact) / scale, gaps(exact), rcond=1e-15)[0] / scale
    theirs = least_squares(lambda x: gaps(x / scale), start, method="lm").x / scale
    here, there = (np.abs(gaps(values) - gaps(exact)).max() for values in (result.values, theirs))
    assert here < 1e-11
    assert 100 * here < there < 1e-4


@pytest.mark.long
def test_an_outlier_of_one_cycle_leaves_its_number_in_the_other(hu40t):
    world = read_world(EXAMPLES / "hu40t" / "world.yaml")
    first = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, world)
    second = simulate(hu40t.machine, hu40t.artefact, hu40t.strategy, replace(world, seed=world.seed + 1))
    two = replace(
        first,
        **{
            name: np.concatenate([getattr(first, name), getattr(second, name)])
            for name in ("touch", "position", "direction", "day")
        },
        time=np.concatenate([first.time, second.time + first.time[-1] + 1]),
        cycle=np.repeat([1, 2], len(first)),
        facet=first.facet * 2,
        status=first.status * 2,
        feed=None if first.feed is None else np.concatenate([first.feed, first.feed]),
        temperatures={},
    )
    touches = from_readings(hu40t.machine, hu40t.artefact, first)
    two.position[len(first) + 40, :3] += 0.05 * np.array([touches.lever(axis)[40] for axis in "XYZ"])
    result = estimate(hu40t.machine, hu40t.artefact, two, ["S3"])
    assert result.outliers.tolist() == [41]
    left = without(two, result.model.touches, result.out)
    assert len(left) == len(two) - 1
    assert left.touch[left.cycle == 1].tolist() == first.touch.tolist()


@pytest.mark.parametrize("example", ["three_axis_calibrated", "trunnion"])
def test_the_scatter_of_a_touch_is_that_of_the_freedom_which_the_touches_have(example: str) -> None:
    """Trace of the touches' own part of the hat matrix: a certificate that touches hardly need takes nothing off their scatter."""
    folder = EXAMPLES / example
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    result = estimate(cell.machine, cell.artefact, simulate(cell.machine, cell.artefact, cell.strategy, world, seed=3), cell.terms)
    own = result.jacobian[: len(result.residuals)]
    spent = np.einsum("ij,jk,ik->", own, result.covariance, own) / result.sigma**2
    freedom = len(own) - spent
    assert result.sigma == pytest.approx(np.sqrt(result.residuals @ result.residuals / freedom), rel=1e-3)


@pytest.mark.parametrize(("times", "said"), [(1.0, False), (1.7, False), (2.6, True)])
def test_touches_that_scatter_far_more_than_stated_are_said_to(times: float, said: bool) -> None:
    cell = read_cell(EXAMPLES / "trunnion")
    world = replace(read_world(EXAMPLES / "trunnion" / "world.yaml"), noise=times * cell.machine.probe.repeatability)
    made = simulate(cell.machine, cell.artefact, cell.strategy, replace(world, seed=5))
    found = estimate(cell.machine, cell.artefact, made, cell.terms)
    assert (f"the touches scatter {found.sigma / cell.machine.probe.repeatability:.1f} times as much" in as_text(found, [])) == said
