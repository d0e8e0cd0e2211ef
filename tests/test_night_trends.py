"""What goes on night after night: three scales together, and a slow creep that comes to a limit."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from support.answers import answered
from support.nights_parts import Event, Story

from tango_cnc.files import read_cell
from tango_cnc.history import opened
from tango_cnc.nightly.control import reached
from tango_cnc.nightly.course import is_steady
from tango_cnc.nightly.dates import date_of
from tango_cnc.nightly.drift import drift_of
from tango_cnc.nightly.lookback import looked_back
from tango_cnc.nightly.sway import swayed
from tango_cnc.report.faults import faults
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.state.naming import alike_scales

ALIKE = {"EXX1": 1.5e-6, "EYY1": 1.5e-6, "EZZ1": 1.5e-6}


@pytest.mark.parametrize(("size", "best"), [((20, 19, 22), None), ((0, 19, 1), 1), ((1, 0, -20), 2), ((-5, -6, -5), None)])
def test_scales_that_changed_alike_are_told_from_one_that_changed(size: tuple[float, ...], best: int | None) -> None:
    shared = 4.0 * np.eye(3) + 5.0  # what carries the absolute length is common to them
    assert alike_scales(np.array(size, dtype=float), shared) == best


@pytest.mark.parametrize(
    ("values", "steady"),
    [
        ((0, 1, 2, 3, 4, 5), True),
        ((0, 20), False),
        ((0, 1, 2, 3, 24, 25, 26, 27, 28, 29, 30, 31, 52), False),
        ((0, 2, 3), True),
        ((10.65, 15.03, 14.61, 16.25, 17.68, 18.81), False),  # newest first
    ],
)
def test_a_drift_with_a_knock_in_it_is_not_night_after_night(values: tuple[float, ...], steady: bool) -> None:
    assert is_steady([float(v) for v in values], float(values[-1] - values[0])) == steady


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(8))
def test_a_slow_drift_beside_a_swing_is_a_sentence_and_a_swing_is_none(root: Path, seed: int) -> None:
    """0.3 µm a day from night 18 on, and ±2 µm with the hall: ten mornings of twelve said "nothing has changed"."""
    cell, rng, night = read_cell(root / "examples" / "hu40t"), np.random.default_rng(seed), np.arange(40)
    followed = SimpleNamespace(machine=[0], names=("EX0C",), units=("mm",), families=("location",))

    def worst(moved: Any) -> float:
        return abs(float(moved[0])) * 1e3

    known = cast(Any, SimpleNamespace(cell=cell, followed=followed, labels=("EX0C",), worst=worst))

    def told(values: Any) -> list[Any]:
        records = [
            {
                "night": f"{n}",
                "state": {"day": 20_500.0 + n},
                "parameters": {"EX0C": {"value": float(v), "std": 2e-4}},
                "alarms": [],
            }
            for n, v in enumerate(values)
        ]
        nights = range(20, len(values))
        state = [SimpleNamespace(mean=np.array([values[n]]), std=np.array([2e-4]), day=20_500.0 + n) for n in nights]
        return [swayed(known, records[:n][::-1], cast(Any, after)) for n, after in zip(nights, state, strict=True)]

    swing = 2e-3 * np.sin(2 * np.pi * night / 9.3 + rng.uniform(0, 6)) + rng.normal(0, 3e-4, 40)
    assert not any(told(swing)) and not any(told(rng.normal(0, 1.5e-3, 40))) and not any(told(rng.normal(0, 2e-4, 40)))
    drifts = told(swing + 3e-4 * np.maximum(night - 17, 0))
    assert all(drifts[-5:])
    last = drifts[-1]
    assert last.size == pytest.approx(5.2e-3, abs=1e-3) and not last.alarms and not last.steady
    assert "on the mean of 10 nights: it goes to and fro" in last.text and "Ask who" not in last.do


@pytest.mark.few(0)
@pytest.mark.parametrize("size", [0.005, 0.008])
def test_a_knock_after_nights_that_went_the_same_way_is_named_with_its_night(root: Path, size: float) -> None:
    """5 µm in one night were "night after night, not at once"; of 8 µm nothing said that they came last night."""
    cell = read_cell(root / "examples" / "hu40t")
    nights = (-18.81, -17.68, -16.25, -14.61, -15.03)
    followed = SimpleNamespace(machine=[0], names=("EX0C",), units=("mm",), families=("location",))
    known = cast(Any, SimpleNamespace(cell=cell, followed=followed, labels=("EX0C",), worst=lambda moved: 9.0))
    after = cast(Any, SimpleNamespace(mean=np.array([-15.03e-3 + size]), std=np.array([2e-4]), day=20_523.0))
    records = [
        {"night": f"2026-03-{6 + n:02d}", "state": {"day": 20_518.0 + n}, "parameters": {"EX0C": {"value": v * 1e-3, "std": 2e-4}}}
        for n, v in enumerate(nights)
    ][::-1]
    moved = float(after.mean[0]) - nights[0] * 1e-3
    found = drift_of(known, 0, records[-1], moved, 3e-4, after, 9.0, 1e-9, records)
    assert not found.steady and "night after night" not in found.text
    assert f"since 2026-03-06 (EX0C); {size * 1e3:+.1f} µm of it came in the night ending {date_of(20_523.0)}" in found.text
    assert "Ask who was at the machine" in found.do


def test_a_limit_is_reached_where_the_error_grows_to_it_and_not_where_it_shrinks() -> None:
    followed = cast(
        Any, SimpleNamespace(machine=[0, 1], names=("EX0C", "EC0X"), units=("mm", "rad"), selection=SimpleNamespace(label=str))
    )
    lever = np.zeros((2, 3, 2))
    lever[:, 0, 0] = 1.0, -1.0
    mean, a_day = np.array([0.010, 10e-6]), np.array([0.0, 0.4e-6])
    limit = {"what": "EC0X", "limit": 20.0, "passed": True}
    assert reached(followed, lever, mean, a_day, limit) == pytest.approx(25.0)
    assert reached(followed, lever, mean, -a_day, limit) == pytest.approx(75.0)  # through zero, to the other side
    assert reached(followed, lever, mean, np.array([0.001, 0.0]), limit) == np.inf
    assert reached(followed, lever, mean, a_day, limit | {"passed": False}) == np.inf  # the limit itself says that
    volume = {"what": "volume", "limit": 15.0, "passed": True}
    assert reached(followed, lever, mean, np.array([0.001, 0.0]), volume) == pytest.approx(5.0)
    assert reached(followed, lever, mean, np.array([-0.001, 0.0]), volume) == pytest.approx(25.0)
    assert reached(followed, lever, mean, a_day, volume) == np.inf


@pytest.mark.long
def test_three_scales_that_grow_together_are_one_trend_of_the_machine(root: Path, tmp_path: Path) -> None:
    records = answered(root, tmp_path / "h.db", Story((Event(6, drift=ALIKE),), wander=0.5), 24, {}, example="hu40t")
    told = [r["trend"] for r in records if r.get("trend")] + [a for r in records for a in r["alarms"]]
    assert told and {x["parameter"] for x in told} == {"scales"}
    (alarm,) = [a for r in records for a in r["alarms"]]
    assert alarm["cause"] == "scales" and alarm["rate_per_day"] == pytest.approx(1.5e-6, rel=0.3)
    assert "alike" in alarm["text"] and "a day" in alarm["text"] and "temperature" in alarm["do"] and "clamp" not in alarm["do"]
    assert "still there" in records[-1]["standing"][0]["now"] or "it is" in records[-1]["standing"][0]["now"]
    (shown,) = faults(records[-1], (), {}, Units(), texts())
    assert "temperature" in shown["todo"] and "bearing" not in shown["todo"]
    with opened(tmp_path / "h.db") as history:
        (one,) = looked_back(history, records[0]["machine"])
    assert (one.parameter, one.cause) == ("scales", "drift") and abs(one.size - 1.5e-6) < 4 * one.std


@pytest.mark.long
def test_one_scale_that_grows_alone_is_that_scale(root: Path, tmp_path: Path) -> None:
    records = answered(root, tmp_path / "h.db", Story((Event(6, drift={"EYY1": 1.5e-6}),), wander=0.5), 24, {}, example="hu40t")
    told = [r["trend"] for r in records if r.get("trend")] + [a for r in records for a in r["alarms"]]
    assert told and {x["parameter"] for x in told} == {"EYY1"}
    with opened(tmp_path / "h.db") as history:
        assert [(f.parameter, f.cause) for f in looked_back(history, records[0]["machine"])] == [("EYY1", "drift")]


@pytest.mark.long
def test_a_squareness_that_creeps_says_when_it_reaches_its_limit_and_does_not_alarm(root: Path, tmp_path: Path) -> None:
    """0.4 µrad a night from 12 on: 30 after 45 nights."""
    story, limits = Story((Event(6, drift={"EC0X": 0.4e-6}),), wander=0.25), {"EC0X": 30.0}
    records = answered(root, tmp_path / "h.db", story, 40, {}, seed=5, limits=limits)
    told = [(i, r["trend"]) for i, r in enumerate(records) if r.get("trend")]
    assert told and {t["parameter"] for _, t in told} == {"EC0X"} and all(r["verdict"] == "good" for r in records)
    last, trend = told[-1]
    assert trend["limit"] == "EC0X" and "reaches its limit in about" in records[last]["headline"]
    assert trend["nights"] == pytest.approx(50 - last, abs=15)  # 30 µrad: 45 nights after the fifth
