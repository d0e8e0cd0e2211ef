"""Repeated cycles and days (thesis chapters 5 and 8): pooled covariances, and whether a difference is one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_controller.simulate import simulate
from tango_cnc.commands.init import examples
from tango_cnc.files import read_cell
from tango_cnc.records import Cell, InputError, Readings, World
from tango_cnc.uncertainty import pooled, process
from tango_cnc.uncertainty.analysis import Analysis, Options, analyse, compare_runs, compare_subsets
from tango_cnc.uncertainty.inputs import BudgetLine

QUICK = Options(trials=2000)
NOISE = (BudgetLine("repeatability", {"std": 0.0007}),)


@pytest.fixture(scope="module")
def cell() -> Cell:
    return read_cell(examples()["hu40t"])


def world(seed: int, *effects: dict[str, object], **errors: float) -> World:
    return World(errors, {}, {}, 0.0007, effects, seed)


@pytest.fixture(scope="module")
def days(cell: Cell) -> Readings:
    """Four days of three cycles on a machine that warms up every morning."""
    warm = {"cause": "thermal_drift", "amplitude": 0.010, "tau": 4000.0, "direction": [0, 1, 0]}
    return simulate(cell.machine, cell.artefact, cell.strategy, world(3, warm, EX0C=-0.1), 3, 4)


@pytest.fixture(scope="module")
def analysed(cell: Cell, days: Readings) -> Analysis:
    return analyse(cell.machine, cell.artefact, days, ("S3",), 3, NOISE, QUICK)


# Pooling


def test_pooled_variances_are_those_of_hand_calculation() -> None:
    gaps = np.array([[[1.0], [3.0]], [[2.0], [6.0]]])  # two days, two cycles, one touch
    by_cycles, dof = pooled.deviations(gaps, "cycles")
    assert (float(np.sum(by_cycles**2)), dof) == (0.5 + 4.5, 2)
    by_days, dof = pooled.deviations(gaps, "days")
    assert (float(np.sum(by_days**2)), dof) == (2.0 + 8.0, 2)


@pytest.mark.long
@given(st.integers(2, 5), st.integers(2, 5), st.integers(0, 1000))
def test_pooling_by_cycles_forgets_what_every_day_does_alike_and_by_days_what_sets_days_apart(k: int, j: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    gaps = rng.normal(size=(k, j, 7))
    through_day, between_days = rng.normal(size=(1, j, 7)), rng.normal(size=(k, 1, 7))
    plain = {kind: pooled.deviations(gaps, kind)[0] for kind in ("cycles", "days")}  # type: ignore[arg-type]
    assert pooled.deviations(gaps + through_day, "cycles")[0] == pytest.approx(plain["cycles"], abs=1e-12)
    assert pooled.deviations(gaps + between_days, "days")[0] == pytest.approx(plain["days"], abs=1e-12)


@pytest.mark.long
def test_pooled_covariance_of_readings_propagates_to_that_of_the_estimates(cell: Cell, days: Readings) -> None:
    """U_y = C U_x Cᵀ of the pooled readings is the pooled covariance of the cycles' own nonlinear estimates."""
    a = analyse(cell.machine, cell.artefact, days, ("S3",), 3, (*NOISE, BudgetLine("scale_bar", {"std": 1e-9})), QUICK)
    assert a.repeated is not None and a.pool == "cycles"
    for kind, std in (("cycles", a.std_by["cycles"]), ("days", a.std_by["days"])):
        rows, dof = pooled.deviations(a.repeated.values, kind)  # type: ignore[arg-type]
        direct = np.sqrt(np.sum(rows**2, axis=0) / dof)[: len(std)]
        assert std == pytest.approx(direct, rel=0.01)


@pytest.mark.long
def test_warm_up_widens_the_intervals_by_days_and_not_by_cycles(analysed: Analysis) -> None:
    a = analysed
    i = a.study.names.index("EY0S")
    assert a.std_by["days"][i] > 2.5 * a.std_by["cycles"][i]
    assert a.std_by["cycles"][i] < 2 * a.std_by["budget"][i]
    assert a.std_of_mean is not None and a.std_of_mean[i] < a.std_by["cycles"][i]
    assert a.study.dof[i] == pytest.approx(9, rel=0.02)  # three cycles, four days: 3 · (4 − 1), and the bar that is sure


@pytest.mark.long
def test_what_no_repetition_shows_is_added_from_the_budget(cell: Cell, days: Readings, analysed: Analysis) -> None:
    lines = (*NOISE, BudgetLine("lobing", {"amplitude": 0.003}), BudgetLine("form", {"std": 0.001}))
    with_them = analyse(cell.machine, cell.artefact, days, ("S3",), 3, lines, QUICK)
    labels = [p.label for p in with_them.study.parts]
    assert labels == ["pooled by cycles", "lobing", "form", "scale_bar"]
    assert np.all(with_them.std >= analysed.std) and with_them.std[3] > 2 * analysed.std[3]


@pytest.mark.long
def test_incomplete_days_and_impossible_pools_are_refused(cell: Cell, days: Readings) -> None:
    missing = days.rows(~((days.day == 2) & (days.cycle == 3)))
    with pytest.raises(InputError, match="no cycle 3 on day 2"):
        pooled.split(missing)
    one_day = days.rows(days.day == 1)
    with pytest.raises(InputError, match="--pool cycles: found 1 day"):
        analyse(cell.machine, cell.artefact, one_day, ("S3",), 3, NOISE, replace(QUICK, pool="cycles"))
    assert analyse(cell.machine, cell.artefact, one_day, ("S3",), 3, NOISE, QUICK).pool == "days"
    with pytest.raises(InputError, match="--pool none"):
        analyse(cell.machine, cell.artefact, days, ("S3",), 3, NOISE, replace(QUICK, pool="none"))


@pytest.mark.long
def test_a_touch_that_one_cycle_missed_is_left_out_of_all(cell: Cell, days: Readings) -> None:
    status = list(days.status)
    status[5] = "miss"
    kept, _, _, left_out = pooled.split(replace(days, status=tuple(status)))
    assert left_out == 1 and all(6 not in group.touch for group in kept)


# Days and cycles


@pytest.mark.long
def test_change_through_the_day_is_seen_and_change_between_days_is_not_invented(analysed: Analysis) -> None:
    a = analysed
    assert a.repeated is not None
    own = a.study.machine
    table = process.day_and_cycle([a.study.names[i] for i in own], a.repeated.values[:, :, own])
    assert table.cycles_differ[table.names.index("EY0S")]
    assert not table.cycles_differ[table.names.index("EX0C")]
    assert not table.days_differ[table.names.index("EY0S")]
    assert np.ptp(table.cycle_means, axis=0)[table.names.index("EY0S")] > 0.002


@pytest.mark.long
def test_analysis_of_variance_errs_as_often_as_it_says() -> None:
    rng = np.random.default_rng(4)
    p = [process.day_and_cycle(["a"], rng.normal(size=(4, 5, 1))) for _ in range(2000)]
    for values in ([x.p_days[0] for x in p if x.p_days is not None], [x.p_cycles[0] for x in p if x.p_cycles is not None]):
        assert np.mean(np.array(values) < 0.05) == pytest.approx(0.05, abs=0.015)
    one_way = [process.one_way(["a"], "xyz", list(rng.normal(size=(3, 4, 1)))).p_value[0] for _ in range(2000)]
    assert np.mean(np.array(one_way) < 0.05) == pytest.approx(0.05, abs=0.015)


def test_one_day_gives_no_statement() -> None:
    table = process.day_and_cycle(["a"], np.random.default_rng(5).normal(size=(1, 4, 1)))
    assert table.p_days is None and not table.cycles_differ[0]
    with pytest.raises(InputError, match="one cycle on one day"):
        process.day_and_cycle(["a"], np.zeros((1, 1, 1)))


def test_holm_is_stricter_than_each_test_alone() -> None:
    assert process.holm(np.array([0.001, 0.02, 0.03, 0.5])).tolist() == [True, False, False, False]
    assert process.holm(np.array([0.04])).tolist() == [True]


# Runs and subsets


def test_a_moved_axis_differs_and_the_rest_does_not(cell: Cell) -> None:
    runs = {
        "before": simulate(cell.machine, cell.artefact, cell.strategy, world(1, EX0C=-0.1)),
        "after": simulate(cell.machine, cell.artefact, cell.strategy, world(2, EX0C=-0.096)),
    }
    (found,) = compare_runs(cell.machine, cell.artefact, runs, ("S3",), 3, NOISE)
    differing = [name for name, d in zip(found.names, found.differs, strict=True) if d]
    assert differing == ["EX0C"] and found.joint_p is not None and found.joint_p < 1e-6
    assert found.range[found.names.index("EX0C")] == pytest.approx(0.004, abs=0.001)


@pytest.mark.few(0)
def test_a_remount_moves_the_table_and_no_parameter(cell: Cell) -> None:
    """Dismount and remount: other facet offsets, other stylus; both are estimated anew with every run (Table 8-3)."""
    offsets = {f: 0.03 for f, facet in cell.artefact.facets.items() if facet.ball is None}
    runs = {
        "before": simulate(cell.machine, cell.artefact, cell.strategy, world(1, EX0C=-0.1)),
        "after": simulate(cell.machine, cell.artefact, cell.strategy, replace(world(2, EX0C=-0.1), facets=offsets)),
    }
    (found,) = compare_runs(cell.machine, cell.artefact, runs, ("S3",), 3, NOISE)
    assert not found.differs.any() and found.joint_p is not None and found.joint_p > 0.01


@pytest.mark.few(0)
def test_what_acts_on_both_runs_alike_cancels_in_their_difference(cell: Cell) -> None:
    runs = {str(i): simulate(cell.machine, cell.artefact, cell.strategy, world(i)) for i in (1, 2)}
    plain = compare_runs(cell.machine, cell.artefact, runs, ("S3",), 3, NOISE)[0]
    shared = (
        *NOISE,
        BudgetLine("lobing", {"amplitude": 0.01}),
        BudgetLine("scale_bar", {"std": 0.01}),
        BudgetLine("form", {"std": 0.01}),
    )
    found = compare_runs(cell.machine, cell.artefact, runs, ("S3",), 3, shared)[0]
    assert plain.u_difference is not None and found.u_difference is not None
    assert found.u_difference == pytest.approx(plain.u_difference, rel=0.05)


@pytest.mark.few(0)
def test_repeated_runs_are_also_judged_by_their_own_scatter(cell: Cell, days: Readings) -> None:
    runs = {"two days": days.rows(days.day <= 2), "two more": days.rows(days.day > 2)}
    both = compare_runs(cell.machine, cell.artefact, runs, ("S3",), 3, NOISE)
    assert [c.method[0] for c in both] == ["χ", "F"]
    assert not both[1].differs.any()


@pytest.mark.long
def test_subsets_of_one_run_share_its_noise(cell: Cell, days: Readings) -> None:
    one = days.rows((days.day == 1) & (days.cycle == 1))
    choices = {"all": range(1, 29), "fewer": [i for i in range(1, 29) if i not in (3, 9)]}
    found, condition = compare_subsets(cell.machine, cell.artefact, one, ("S3",), 3, NOISE, choices)
    separate = compare_runs(cell.machine, cell.artefact, {"a": one, "b": one}, ("S3",), 3, NOISE)[0]
    assert found.u_difference is not None and separate.u_difference is not None
    assert np.all(found.u_difference < 0.8 * separate.u_difference)
    assert len(condition) == 2 and all(c > 1000 for c in condition)
    assert not found.differs.any()
    with pytest.raises(InputError, match="found indexation 77"):
        compare_subsets(cell.machine, cell.artefact, one, ("S3",), 3, NOISE, {"a": [1, 77], "b": [2]})


@pytest.mark.long
def test_differences_of_subsets_have_the_stated_uncertainty(cell: Cell) -> None:
    """Eight machines, seventeen parameters: differences over their standard uncertainty have a variance of one."""
    choices = {"all": range(1, 29), "fewer": [i for i in range(1, 29) if i not in (3, 9, 15)]}
    ratio = []
    for seed in range(8):
        run = simulate(cell.machine, cell.artefact, cell.strategy, world(100 + seed))
        found, _ = compare_subsets(cell.machine, cell.artefact, run, ("S3",), 3, NOISE, choices)
        assert found.u_difference is not None
        ratio.append((found.values[1] - found.values[0]) / found.u_difference)
    assert np.mean(np.square(ratio)) == pytest.approx(1.0, abs=0.35)
