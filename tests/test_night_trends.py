"""What goes on night after night: three scales together, and a slow creep that comes to a limit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.answers import answered
from support.nights_parts import Event, Story

from tango_cnc.history import opened
from tango_cnc.nightly.control import reached
from tango_cnc.nightly.course import is_steady
from tango_cnc.nightly.lookback import looked_back
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
    [((0, 1, 2, 3, 4, 5), True), ((0, 20), False), ((0, 1, 2, 3, 24, 25, 26, 27, 28, 29, 30, 31, 52), False), ((0, 2, 3), True)],
)
def test_a_drift_with_a_knock_in_it_is_not_night_after_night(values: tuple[float, ...], steady: bool) -> None:
    assert is_steady([float(v) for v in values], float(values[-1])) == steady


def test_a_limit_is_reached_where_the_error_grows_to_it_and_not_where_it_shrinks() -> None:
    from types import SimpleNamespace
    from typing import Any, cast

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
