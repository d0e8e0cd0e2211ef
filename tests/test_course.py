"""A curve in one sentence: what it does, since when, and what of its limit. The truth is what the series was made from."""

from __future__ import annotations

from datetime import date

import numpy as np
import pytest

from tango_cnc.history import Decision
from tango_cnc.report.course import by_repairs, course, jumps_of, jumps_of_tip
from tango_cnc.report.texts import texts

FIRST = date(2026, 10, 24)
DAYS = np.arange(30.0)


def said(value: np.ndarray, jumps: list[tuple[int, float]] | None = None, limit: float | None = None, std: float = 0.3) -> str:
    return course(FIRST, DAYS[: len(value)], value, np.full(len(value), std), jumps or [], limit, "µm", texts())


@pytest.mark.parametrize(
    ("rate", "jump", "limit", "wanted"),
    [
        (0.0, 0.0, None, "Steady since Sat 24 Oct 2026."),
        (0.3, 0.0, None, "Rises by 2.1 µm a week since Sat 24 Oct 2026."),
        (-0.3, 0.0, None, "Falls by 2.1 µm a week since Sat 24 Oct 2026."),
        (0.0, 20.0, None, "Jumped by +20 µm on Thu 5 Nov 2026, steady since then."),
        (0.3, -20.0, 100.0, "rises by 2.1 µm a week since then. Within its limit of 100 µm."),
        (0.0, 0.0, 60.0, "Within its limit of 60 µm."),
        (0.0, 0.0, 40.2, "Too close to its limit of 40.2 µm to be sure."),
        (0.0, 20.0, 45.0, "Beyond its limit of 45 µm."),
        (0.3, 0.0, 52.0, "Within its limit of 52 µm; at this rate until about Thu 3 Dec 2026."),
        (-0.3, 20.0, 50.0, "Beyond its limit of 50 µm; at this rate within it from about "),
    ],
)
def test_what_a_curve_does(rate: float, jump: float, limit: float | None, wanted: str) -> None:
    value = 40.0 + rate * DAYS
    value[12:] += jump
    assert wanted in said(value, [(12, jump)] if jump else [], limit), said(value, [(12, jump)] if jump else [], limit)


def test_a_steady_curve_is_called_steady_and_a_negative_value_counts_by_its_size() -> None:
    """Of 200 curves that only scatter by what they are known to, at most 5 % have a direction."""
    rng = np.random.default_rng(7)
    wrong = sum("Steady" not in said(40.0 + rng.normal(0, 0.3, 30)) for _ in range(200))
    assert wrong <= 10
    for nights in (5, 9, 16, 30):  # nor has more than one in four of a machine that wanders by three times what is known of it
        walks = 40.0 + np.cumsum(rng.normal(0, 0.3, (200, nights)), axis=1)
        assert sum(not said(walk, std=0.1).startswith(("Steady", "To and fro")) for walk in walks) <= 50, nights
    falling = -40.0 - 0.3 * DAYS  # its size grows
    assert "Falls by 2.1 µm a week" in said(falling, limit=52.0) and "until about Thu 3 Dec 2026" in said(falling, limit=52.0)
    assert "Too few nights" in said(np.array([40.0, 41.0])) and said(np.array([40.0])) == ""
    assert "It is the last of 2 jumps." in said(np.r_[np.zeros(5), np.full(5, 9.0), np.full(10, 18.0)], [(5, 9.0), (10, 9.0)])


def test_what_swings_by_far_more_than_it_is_known_to_is_not_steady() -> None:
    """5 µm of a drift in a swing of ± 2 µm, known to ± 0.2: "steady since 2 March"."""
    rng = np.random.default_rng(11)
    swing = 2.0 * np.sin(1.3 * DAYS) + rng.normal(0, 0.2, 30)
    text = said(swing, std=0.2)
    assert text.startswith("To and fro between −") and "no drift stands out" in text and "Steady" not in text
    assert f"and {swing.max():+.1f} µm since Sat 24 Oct 2026" in text
    jumped = np.r_[np.zeros(10), 20.0 + swing[10:]]
    assert "Jumped by +20 µm" in said(jumped, [(10, 20.0)], std=0.2) and "since then to and fro between" in said(
        jumped, [(10, 20.0)], std=0.2
    )


def test_jumps_are_the_alarms_of_nights_and_no_drift_is_one() -> None:
    knock = {"parameter": "EX0C", "size": 0.02, "rate_per_day": None, "cause": "axis_location"}
    alarms = {
        7: [knock],
        9: [{**knock, "rate_per_day": 0.001}],
        5: [{**knock, "parameter": "EY0C"}],
        8: [{**knock, "cause": "stylus"}],
    }
    assert jumps_of(alarms, (5, 6, 7, 9), "EX0C", 1e3) == [(2, 20.0)]
    tip = np.array([40.0, 40.0, 60.0, 80.0, 99.0])
    assert jumps_of_tip(alarms, (5, 6, 7, 8, 9), tip, 0.5) == [(2, 20.0)]  # a stylus moves no part, and a drift is no jump
    assert jumps_of_tip(alarms, (5, 6, 7), np.array([40.0, 40.0, 40.5]), 0.5) == []


def test_what_a_repair_has_put_back_is_a_jump_and_three_nights_show_no_rate() -> None:
    """The curve fell by 35 µm a week since a knock that was put right after three nights, and rose by 4.7 before that."""
    knocked = {"id": "2026-11-21-1", "parameter": "EY0C", "size": 0.04, "rate_per_day": None, "cause": "axis_location"}
    value, std = 1e-3 * np.array([25.0, 25.0, 65.0, 65.7, 66.3, 26.4, 26.0, 25.8, 26.1, 26.2, 26.0]), np.full(11, 3e-4)
    starts = [f"2026-11-{19 + i}T02:00:00Z" for i in range(11)]
    done = [
        Decision("2026-11-21-1", "repaired", "Zoë", utc="2026-11-23T10:00:00Z"),
        Decision("x", "repaired", "Zoë", utc=starts[8]),
    ]
    back = by_repairs({2: [knocked]}, done, starts, "EY0C", (value, std))
    assert [place for place, _ in back] == [5] and back[0][1] == pytest.approx(-0.0399)
    assert by_repairs({2: [knocked]}, done, starts, "EX0C", (value, std)) == []
    jumps = jumps_of({2: [knocked]}, range(11), "EY0C", 1e3, back)
    assert [place for place, _ in jumps] == [2, 5]
    told = said(1e3 * value, jumps)
    assert "Jumped by −40 µm on Thu 29 Oct 2026, steady since then. It is the last of 2 jumps." in told
    assert said(1e3 * value[:5], jumps[:1]) == "Jumped by +40 µm on Mon 26 Oct 2026."
