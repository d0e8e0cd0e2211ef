"""Mean, its uncertainty, one run, prediction: each interval holds as often as it says what it names, on machines that vary."""

from __future__ import annotations

import numpy as np
import pytest

from tango_cnc.records import InputError
from tango_cnc.uncertainty.repetitions import repetitions

MACHINES = 20_000


def drawn(days: int, runs: int, between: float, within: float, seed: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Runs (K, J, machines) and the run of a day that was not measured; the machine in the long run is at 0."""
    rng = np.random.default_rng([seed, days, runs])
    day = between * rng.standard_normal((days + 1, 1, MACHINES))
    every = day + within * rng.standard_normal((days + 1, runs, MACHINES))
    return every[:days], every[days, 0]


def shares(days: int, runs: int, between: float, within: float) -> tuple[float, float, float]:
    values, later = drawn(days, runs, between, within)
    found = repetitions(values, np.zeros(MACHINES))
    return (
        float(np.mean(np.abs(found.mean) <= found.of_mean.half)),
        float(np.mean(np.abs(later) <= found.one_run.half)),
        float(np.mean(np.abs(later - found.mean) <= found.prediction.half)),
    )


@pytest.mark.parametrize(("days", "runs", "between"), [(2, 3, 5.0), (4, 5, 1.0), (4, 5, 5.0)])
def test_each_interval_holds_what_it_names(days: int, runs: int, between: float) -> None:
    for share in shares(days, runs, between, 1.0):
        assert 0.93 <= share <= 0.97


@pytest.mark.parametrize(("days", "runs", "between"), [(2, 3, 0.0), (2, 3, 1.0), (4, 5, 0.0)])
def test_of_days_that_differ_little_intervals_are_wide_rather_than_narrow(days: int, runs: int, between: float) -> None:
    assert min(shares(days, runs, between, 1.0)) > 0.95


@pytest.mark.parametrize("between", [0.0, 0.5])
def test_days_that_happen_to_agree_do_not_make_the_mean_more_certain_than_its_runs(between: float) -> None:
    """One parameter in ten of two days: the daily means agree to a fiftieth of what the runs about them explain."""
    values, _ = drawn(2, 3, between, 1.0)
    days = values.mean(axis=1)
    apart = 3 * np.var(days, axis=0, ddof=1) / np.mean(np.var(values, axis=1, ddof=1), axis=0)
    found, agree = repetitions(values, np.zeros(MACHINES)), apart < 0.02
    assert 0.05 < np.mean(agree) < 0.15
    assert np.mean((np.abs(found.mean) <= found.of_mean.half)[agree]) > 0.93


def test_two_days_of_one_mean_by_hand() -> None:
    """Runs 1 and −1 on both days: of a run 2, four of them about one mean; Student's t of two degrees of freedom is 4.303."""
    found = repetitions(np.array([[[1.0], [-1.0]], [[1.0], [-1.0]]]), np.zeros(1))
    assert (found.of_mean.std[0], found.of_mean.dof[0]) == (pytest.approx(0.5**0.5), pytest.approx(2.0))
    assert found.of_mean.half[0] == pytest.approx(4.303 * 0.5**0.5, rel=1e-3)
    assert found.one_run.half[0] == pytest.approx(4.303 * 2**0.5, rel=1e-3)
    assert found.prediction.half[0] == pytest.approx(4.303 * 2.5**0.5, rel=1e-3)


def test_the_four_numbers_by_hand() -> None:
    """Days at 1 and 5, runs one beside them on either side."""
    found = repetitions(np.array([[[0.0], [2.0]], [[4.0], [6.0]]]), np.zeros(1))
    assert found.mean == 3.0
    assert (float(found.of_mean.std[0] ** 2), float(found.of_mean.dof[0])) == (pytest.approx(4.0), pytest.approx(1.0))
    assert float(found.one_run.std[0] ** 2) == pytest.approx(8 + 0.5 * 2)
    assert float(found.prediction.std[0] ** 2) == pytest.approx(8 + 0.5 * 2 + 4)


def test_what_no_repetition_shows_is_in_the_mean_and_not_in_where_the_next_run_will_be() -> None:
    values = np.array([[[0.0], [2.0]], [[4.0], [6.0]]])
    plain, more = repetitions(values, np.zeros(1)), repetitions(values, np.full(1, 3.0))
    assert more.of_mean.std[0] == pytest.approx(13.0**0.5)
    assert more.prediction.std[0] == plain.prediction.std[0]
    assert more.of_mean.dof[0] > plain.of_mean.dof[0]


def test_one_day_says_that_it_does_not_see_days_and_one_run_is_refused() -> None:
    found = repetitions(np.array([[[1.0], [2.0], [3.0]]]), np.zeros(1))
    assert "day to day" in found.text and found.of_mean.dof[0] == pytest.approx(2)
    with pytest.raises(InputError, match="two or more"):
        repetitions(np.ones((1, 1, 1)), np.zeros(1))
