"""Covariances in, covariances out: each way that the product takes is compared with a second one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.commands.init import examples
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.model import known, residual
from tango_cnc.records import Cell, InputError, Readings, TangoError, World
from tango_cnc.uncertainty import _batch, coverage, trials
from tango_cnc.uncertainty.analysis import Analysis, Options, analyse
from tango_cnc.uncertainty.inputs import BudgetLine, Part, Scene, draw, gaussian, parts, read_budget, sources, stated
from tango_cnc.uncertainty.study import Study, solve, study

FULL = (
    BudgetLine("repeatability", {"std": 0.0006}),
    BudgetLine("drift", {"shape": "random_walk", "amplitude": 0.002}),
    BudgetLine("lobing", {"amplitude": 0.0035, "order": 2}),
    BudgetLine("form", {"std": 0.0009}),
    BudgetLine("rotary_positioning", {"axis": "B", "std": 0.0003}),
)


@pytest.fixture(scope="module")
def cell() -> Cell:
    return read_cell(examples()["hu40t"])


@pytest.fixture(scope="module")
def readings(cell: Cell) -> Readings:
    return simulate(cell.machine, cell.artefact, cell.strategy, read_world(cell.folder / "world.yaml"))


@pytest.fixture(scope="module")
def found(cell: Cell, readings: Readings) -> dict[str, Estimate]:
    return {terms: estimate(cell.machine, cell.artefact, readings, (terms,)) for terms in ("S3", "S4")}


def study_of(e: Estimate, lines: tuple[BudgetLine, ...] = FULL) -> Study:
    return study(e.model, e.values, e.sigma, parts(Scene(e.model, e.values), lines))


# The gaps of many trials


@pytest.mark.few(1)
@pytest.mark.parametrize("name", sorted(examples()))
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-10), (np.float32, 3e-7)])
def test_gaps_of_a_block_are_those_of_the_model(name: str, dtype: type, tolerance: float) -> None:
    other = read_cell(examples()[name])
    noise = World({}, {}, {}, 0.0007, (), 1)
    e = estimate(other.machine, other.artefact, simulate(other.machine, other.artefact, other.strategy, noise), ("S3",))
    rng = np.random.default_rng(1)
    size = np.array([0.05 if c.unit == "mm" else 1e-4 for c in e.model.coefficients])
    values = np.concatenate(
        [rng.normal(size=(5, len(size))) * size, rng.normal(scale=0.05, size=(5, len(e.values) - len(size)))], 1
    )
    reference = np.array([residual(e.model, v) for v in values])
    assert np.abs(_batch.gaps(_batch.batch(e.model, dtype), values) - reference).max() < tolerance
    assert np.abs(reference).max() > 0.1
    direct = np.array([known(e.model, v)[0] for v in values])
    assert _batch.known_residuals(e.model, values) == pytest.approx(direct, abs=1e-12)


def test_gaps_with_large_error_angles_leave_the_taylor_terms(found: dict[str, Estimate]) -> None:
    model = found["S3"].model
    values = np.zeros((2, len(model.names)))
    values[0, model.names.index("EA0C")] = 0.02
    values[1, model.names.index("EA0C")] = 5e-4
    assert np.abs(_batch.gaps(_batch.batch(model, np.float64), values) - residual(model, values)).max() < 1e-10


# Linear propagation


def test_gain_is_the_derivative_of_the_whole_estimation(found: dict[str, Estimate]) -> None:
    s = study_of(found["S3"])
    rng = np.random.default_rng(2)
    for _ in range(3):
        deviation = 1e-5 * rng.standard_normal(s.gain.shape[1])
        start = solve(s.model, s.values, s.weight)
        moved = solve(s.model, s.values, s.weight, deviation) - start
        # J₀ᵀr and Jᵀr differ by what the residuals of 0.7 µm turn in the normal equations
        assert moved / s.std == pytest.approx(s.gain @ deviation / s.std, abs=2e-3 * np.abs(s.gain @ deviation / s.std).max())


def test_white_noise_and_the_bar_give_the_covariance_of_the_estimate(found: dict[str, Estimate]) -> None:
    for e in found.values():
        s = study_of(e, (BudgetLine("repeatability", {"std": e.sigma}),))
        assert s.std == pytest.approx(e.std, rel=1e-6)


def test_shares_add_up_and_nothing_is_correlated_beyond_one(found: dict[str, Estimate]) -> None:
    s = study_of(found["S3"])
    assert s.shares.sum(axis=0) == pytest.approx(s.std[s.outputs] ** 2)
    assert np.abs(s.correlation).max() <= 1 + 1e-12
    assert np.diag(s.correlation) == pytest.approx(1.0)
    labels = [p.label for p in s.parts]
    assert labels == ["repeatability", "drift", "lobing", "form", "rotary_positioning", "scale_bar"]


def test_a_plan_that_leaves_a_direction_open_has_no_uncertainty(cell: Cell, found: dict[str, Estimate]) -> None:
    e = found["S3"]
    twice = replace(e.model, coefficients=(*e.model.coefficients, e.model.coefficients[0]))
    with pytest.raises(TangoError, match="undetermined"):
        study(twice, np.zeros(len(twice.names)), e.sigma, ())


# Sources against the simulator, which writes the physics another way


def effect_on_gaps(cell: Cell, e: Estimate, effect: dict[str, object], seed: int = 1) -> np.ndarray:
    """→ (n,) mm: what an effect of the simulated world changes in the gaps of the same touches."""
    still = simulate(cell.machine, cell.artefact, cell.strategy, World({}, {}, {}, 0.0, (), seed))
    moved = simulate(cell.machine, cell.artefact, cell.strategy, World({}, {}, {}, 0.0, (effect,), seed))
    touches = e.model.touches
    zero = np.zeros(len(e.model.names))
    before, after = (residual(replace(e.model, touches=replace(touches, position=r.position)), zero) for r in (still, moved))
    return np.asarray(after - before)


def test_lobing_moves_the_readings_as_its_two_columns_say(cell: Cell, found: dict[str, Estimate]) -> None:
    e = found["S3"]
    (part, _) = parts(Scene(e.model, e.values), (BudgetLine("lobing", {"amplitude": 0.003, "order": 3}),))
    change = effect_on_gaps(cell, e, {"cause": "probe_lobing", "amplitude": 0.003, "order": 3, "phase": 40.0})
    phase = np.radians(40.0)
    expected = part.factor[: len(change)] @ (np.sqrt(2) * np.array([np.cos(phase), np.sin(phase)]))
    plane = e.model.touches.ball_index < 0  # a ball is touched beside its nominal point by as much as it is misplaced
    assert change[plane] == pytest.approx(expected[plane], abs=2e-6)
    assert change == pytest.approx(expected, abs=1e-4)
    assert part.law == "phase" and np.abs(change).max() > 0.0025


def test_warm_up_moves_the_readings_as_its_three_columns_say(cell: Cell, found: dict[str, Estimate]) -> None:
    e = found["S3"]
    line = BudgetLine("drift", {"shape": "warm_up", "amplitude": 0.01, "tau": 900.0})
    (part, _) = parts(Scene(e.model, e.values), (line,))
    n = len(e.model.touches)
    effect = {"cause": "thermal_drift", "amplitude": 0.01, "tau": 900.0, "direction": [0, 1, 0]}
    change = effect_on_gaps(cell, e, effect)
    # The clock of the budget starts with the first touch, that of the machine when it was switched on.
    start = 0.01 * (1 - np.exp(-e.model.touches.time[0] / 900.0))
    y = Scene(e.model, e.values).normal[:, 1]
    expected = start * y + part.factor[:n, 1] * np.exp(-e.model.touches.time[0] / 900.0)
    sign = np.sign(change @ expected)
    assert change == pytest.approx(sign * expected, abs=2e-5)


@pytest.mark.long
def test_a_probe_that_is_looked_at_once_in_a_period_is_late_by_up_to_its_way(found: dict[str, Estimate]) -> None:
    """3 mm/s and 1 ms: positions on a grid of 3 µm, the next one behind the contact."""
    scene = Scene(found["S3"].model, found["S3"].values)
    (part, *_) = parts(scene, (BudgetLine("probe_latch", {"period": 0.001}),))
    n = len(scene.touches)
    contact = np.random.default_rng(1).uniform(9.9, 10.1, 20_000)
    late = np.ceil(contact / 0.003) * 0.003 - contact
    assert np.diag(part.factor[:n]) == pytest.approx(late.std(), rel=0.01)
    assert part.law == "rectangular" and np.abs(draw(np.random.default_rng(2), 500, *gaussian((part,)))).max() <= 0.0015
    unknown = replace(scene.model, touches=replace(scene.touches, feed=np.full(n, np.nan)))
    with pytest.raises(InputError, match="no column feed"):
        parts(Scene(unknown, scene.values), (BudgetLine("probe_latch", {"period": 0.001}),))
    (stated_feed, *_) = parts(Scene(unknown, scene.values), (BudgetLine("probe_latch", {"period": 0.001, "feed": 60.0}),))
    assert stated_feed.factor[:n] == pytest.approx(part.factor[:n] / 3)


@pytest.mark.long
def test_random_walk_has_the_covariance_of_its_part(cell: Cell, found: dict[str, Estimate]) -> None:
    """Eight runs are few: the sum over all touches of what they do, not each entry."""
    e = found["S3"]
    (part, _) = parts(Scene(e.model, e.values), (BudgetLine("drift", {"amplitude": 0.002}),))
    t, n = e.model.touches.time - e.model.touches.time[0], len(e.model.touches)
    covariance = part.covariance[:n, :n]
    assert np.diag(covariance) == pytest.approx(0.002**2 * t / 3600, abs=1e-16)
    runs = np.array([effect_on_gaps(cell, e, {"cause": "random_walk", "amplitude": 0.002}, seed) for seed in range(8)])
    runs -= runs[:, :1]  # what happened before the first touch
    wanted = np.diag(covariance).sum()
    assert np.mean(np.sum(runs**2, axis=1)) == pytest.approx(wanted, rel=0.8)


@pytest.mark.long
def test_every_source_has_its_contract(found: dict[str, Estimate]) -> None:
    e = found["S3"]
    settings = {
        "drift": {"amplitude": 0.002, "shape": "exponential", "tau": 1800.0},
        "lobing": {"amplitude": 0.003},
        "form": {"std": 0.001, "facets": ("3", "5")},
        "wetness": {"range": 0.001},
        "rotary_positioning": {"axis": "C", "std": 0.0002},
        "indexation_seating": {"std": 0.0005},
        "probe_latch": {"period": 0.001},
    }
    size = len(e.model.touches) + 1
    for name in sources():
        part = parts(Scene(e.model, e.values), (BudgetLine(name, settings.get(name, {})),))[0]
        assert part.label == name and part.factor.shape[0] == size
        assert np.all(np.isfinite(part.factor))
        rng = np.random.default_rng(3)
        sample = draw(rng, 4000, *gaussian((part,)))
        assert sample.std(axis=0) == pytest.approx(np.sqrt(np.diag(part.covariance)), rel=0.09, abs=1e-12)


def test_the_bar_is_never_forgotten(found: dict[str, Estimate]) -> None:
    scene = Scene(found["S3"].model, found["S3"].values)
    assert [line.source for line in stated(scene)] == ["repeatability", "scale_bar"]
    assert [p.label for p in parts(scene, (BudgetLine("drift", {"amplitude": 0.001}),))] == ["drift", "scale_bar"]
    given = parts(scene, (BudgetLine("scale_bar", {"std": 0.004, "distribution": "rectangular"}),))
    assert [(p.label, p.law) for p in given] == [("scale_bar", "rectangular")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("contributions: [{source: drfit, amplitude: 0.1}]", "Did you mean 'drift'"),
        ("contributions: [{source: drift}]", "a value for 'amplitude'"),
        ("contributions: [{source: drift, amplitude: 0.1, taau: 5}]", "Did you mean 'tau'"),
        ("contributions: [{source: drift, amplitude: ten}]", "a finite number"),
        ("contributions: [{source: drift, amplitude: 0.1, shape: round}]", "random_walk, exponential, warm_up"),
        ("contributions: [{amplitude: 0.1}]", "no source"),
        ("parts: []", "unknown key 'parts'"),
    ],
)
def test_a_wrong_budget_names_file_line_and_what_is_allowed(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "uncertainty.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_budget(file)
    assert f"{file}:1" in str(caught.value)


# Monte Carlo


@pytest.mark.long
def test_trials_and_propagation_agree_within_3_percent_for_the_thesis_plan(cell: Cell, readings: Readings) -> None:
    for terms in ("S3", "S4"):
        a = analyse(cell.machine, cell.artefact, readings, (terms,), 3, FULL, Options(trials=10_000))
        assert np.abs(a.validation.std_ratio - 1).max() < 0.03
        assert a.run.count == 10_000 and a.run.lost == 0
        assert a.accuracy.rms < 0.01 and a.accuracy.std_ratio < 0.02


@pytest.mark.long
def test_with_touches_that_scatter_by_50_micrometres_they_do_not_agree(found: dict[str, Estimate]) -> None:
    """S4 is no longer linear over such noise: EB0C spreads by half as much again as the propagation says."""
    s = study_of(found["S4"], (BudgetLine("repeatability", {"std": 0.05}),))
    run = trials.run(s, 4096)
    ratio = dict(zip(s.names, run.deviation.std(axis=0, dtype=float), strict=True))
    assert ratio["EB0C"] > 1.3
    check = coverage.validate(s.std[s.outputs], run.deviation, 0.95, 1)
    assert not check.agrees[s.names.index("EB0C")]
    assert trials.accuracy(s, 6).rms > 0.02  # and the frozen Jacobian says that it is too coarse here


@pytest.mark.long
def test_a_rectangular_bar_is_not_validated_although_the_standard_deviations_agree(found: dict[str, Estimate]) -> None:
    lines = (BudgetLine("repeatability", {"std": 1e-5}), BudgetLine("scale_bar", {"std": 0.002, "distribution": "rectangular"}))
    s = study_of(found["S3"], lines)
    run = trials.run(s, 20_000)
    check = coverage.validate(s.std[s.outputs], run.deviation, 0.95, 1)
    i = s.names.index("EXX1")
    assert check.std_ratio[i] == pytest.approx(1.0, abs=0.02)
    assert not check.agrees[i]
    low, high = coverage.symmetric(run.deviation, 0.95)
    assert high[i] == pytest.approx(0.95 * np.sqrt(3), rel=0.02) and low[i] == pytest.approx(-0.95 * np.sqrt(3), rel=0.02)


@pytest.mark.long
def test_chord_and_full_iteration_end_at_the_same_place(found: dict[str, Estimate]) -> None:
    for terms, limit in (("S3", 0.002), ("S4", 0.05)):
        measured = trials.accuracy(study_of(found[terms]), 16)
        assert 0 < measured.largest < limit
    s = study_of(found["S3"])
    chord, full = trials.run(s, 8, 5), trials.run(s, 8, 5, full=True)
    assert full.rescued == 8 and chord.rescued == 0
    assert chord.deviation == pytest.approx(full.deviation, abs=0.002)


@pytest.mark.few(0)
def test_trials_that_the_chord_cannot_settle_are_solved_in_full(
    found: dict[str, Estimate], monkeypatch: pytest.MonkeyPatch
) -> None:
    s = study_of(found["S3"])
    monkeypatch.setattr(trials, "ENOUGH", 0.0)
    run = trials.run(s, 4)
    assert run.rescued == 4 and run.lost == 0


@pytest.mark.long
def test_any_number_of_workers_gives_the_same_trials(found: dict[str, Estimate]) -> None:
    s = study_of(found["S3"])
    backwards = trials.run(s, 2500, 7, mapper=lambda call, items: list(reversed([call(i) for i in reversed(list(items))])))
    assert np.array_equal(backwards.deviation, trials.run(s, 2500, 7).deviation)
    assert not np.array_equal(backwards.deviation, trials.run(s, 2500, 8).deviation)


@pytest.mark.long
def test_adaptive_trials_stop_when_stable_and_say_when_not(cell: Cell, readings: Readings) -> None:
    one: Analysis = analyse(cell.machine, cell.artefact, readings, ("S2",), 3, None, Options(adaptive=True))
    assert one.stable and one.blocks >= 2 and one.run.count == one.blocks * 10_000
    two = analyse(cell.machine, cell.artefact, readings, ("S2",), 3, None, Options(adaptive=True, digits=2, most=20_000))
    assert not two.stable and two.blocks == 2
    setup = analyse(cell.machine, cell.artefact, readings, ("S1",), 3, None, Options(adaptive=True))
    assert setup.stable and not setup.joint  # the stylus alone: no machine parameter, no joint region of them


# Regions


def test_joint_rectangle_lies_between_all_alike_and_independent() -> None:
    alike = np.full((6, 6), 0.999999) + 1e-6 * np.eye(6)
    assert coverage.rectangle_factor(alike, 0.95) == pytest.approx(1.96, abs=0.02)
    assert coverage.rectangle_factor(np.eye(6), 0.95) == pytest.approx(coverage.independent_factor(6, 0.95), abs=0.02)


def test_regions_of_normal_trials_contain_what_they_promise() -> None:
    rng = np.random.default_rng(5)
    root = rng.normal(size=(4, 4))
    values = rng.standard_normal((40_000, 4)) @ root.T
    values /= values.std(axis=0)
    assert coverage.ellipsoid_of(values, 0.95) == pytest.approx(coverage.ellipsoid_factor(4, 0.95), rel=0.01)
    k = coverage.rectangle_of(values, 0.95)
    assert k == pytest.approx(coverage.rectangle_factor(np.corrcoef(values.T), 0.95), abs=0.03)
    assert np.mean(np.all(np.abs(values) <= k, axis=1)) == pytest.approx(0.95, abs=1e-3)
    assert coverage.ellipsoid_of(np.column_stack([values, values[:, 0]]), 0.95) is None


def test_shortest_interval_of_a_skew_distribution_starts_at_its_edge() -> None:
    values = np.random.default_rng(6).exponential(size=(100_000, 1))
    low, high = coverage.shortest(values, 0.95)
    assert low[0] < 0.01 and high[0] == pytest.approx(-np.log(0.05), rel=0.02)
    with pytest.raises(InputError, match="--trials"):
        coverage.symmetric(values[:20], 0.95)


@pytest.mark.long
def test_student_parts_widen_the_trials_as_their_degrees_of_freedom_say(found: dict[str, Estimate]) -> None:
    e = found["S3"]
    n = len(e.model.touches)
    part = Part("pooled", np.vstack([0.001 * np.eye(n), np.zeros((1, n))]), "student", 8.0)
    s = study(e.model, e.values, e.sigma, (part,))
    run = trials.run(s, 20_000)
    assert run.deviation.std(axis=0, dtype=float)[: len(s.machine)] == pytest.approx(np.sqrt(8 / 6), rel=0.04)
    check = coverage.validate(s.std[s.outputs], run.deviation, 0.95, 1, s.dof)
    assert check.std_ratio == pytest.approx(1.0, abs=0.04)
    assert s.dof == pytest.approx(8.0)
