"""A parameter that begins to move after quiet nights: the state follows it, and the mornings say it with true values."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.nights_parts import Event, Story, nights

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.nightly.lag import WINDOWS, lagging
from tango_cnc.nightly.mail import message
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts

NAMES = [f"P{i}" for i in range(20)]
FRAME: Any = SimpleNamespace(machine=range(20), names=NAMES, wander=np.full(20, 1e-12), selection=SimpleNamespace(label=str))


def told(steps: np.ndarray, **more: dict[int, dict[str, Any]]) -> Any:
    """(n, 20) what each night adds, in standard deviations, oldest first; {night counted backwards: its members} → lag."""
    records = [
        {
            "parameters": {n: {"change": 1e-6 * step, "change_std": 1e-6} for n, step in zip(NAMES, row, strict=True)},
            "state": {"day": float(day)},
            **more.get("records", {}).get(len(steps) - 1 - day, {}),
        }
        for day, row in enumerate(steps[:-1])
    ]
    day = float(len(steps))
    before: Any = SimpleNamespace(mean=np.zeros(20), std=np.full(20, np.sqrt(2) * 1e-6), day=day - 1)
    after: Any = SimpleNamespace(mean=1e-6 * steps[-1], std=np.full(20, 1e-6), day=day)
    return lagging(FRAME, records[::-1], before, after)


@pytest.mark.few(0)
def test_quiet_nights_open_nothing_more_often_than_stated() -> None:
    rng = np.random.default_rng(11)
    opened_ = [told(rng.normal(size=(9, 20))) is not None for _ in range(300)]
    assert sum(opened_) <= 8  # one in a hundred, of all that is tried


@pytest.mark.parametrize(("step", "count"), [(2.5, 4), (3.5, 2), (-3.5, 2)])
def test_steps_the_same_way_open_that_parameter(step: float, count: int) -> None:
    steps = np.random.default_rng(5).normal(0, 0.3, (9, 20))
    steps[-count:, 7] += step
    found = told(steps)
    assert found.place == 7 and found.back >= count and found.rate > 1e-12


def test_steps_that_take_each_other_back_open_nothing() -> None:
    steps = np.zeros((9, 20))
    steps[-4:, 7] = (2.5, -2.5, 2.5, -2.5)
    assert told(steps) is None


@pytest.mark.parametrize("member", ["alarms", "opened", "repaired", "ignored"])
def test_it_looks_back_no_farther_than_what_was_told_or_opened(member: str) -> None:
    steps = np.zeros((9, 20))
    steps[-4:, 7] = 2.5
    assert told(steps) is not None
    assert told(steps, records={1: {member: ["x"]}}) is None  # one step since


@pytest.mark.parametrize("night", [6, 7, 8, 9])
def test_it_begins_with_no_state_from_before_an_alarm(night: int) -> None:
    """The state was opened for what the alarm found: followed anew without that, it would take nights to believe it."""
    steps = np.zeros((12, 20))
    steps[-7:, 7] = 2.0
    assert told(steps, records={night: {"alarms": ["x"]}}).back <= night - 1


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_night_without_a_state_before_the_steps_leaves_nothing_to_begin_with(count: int) -> None:
    """Readings in doubt, or a night that was not measured."""
    steps = np.zeros((9, 20))
    steps[-1:, 7] = 9.0
    steps[-3:, 8] = 3.5
    found = told(steps, records={count + 1: {"state": None}})
    assert found is None if count == 0 else found.back < count


def test_a_record_without_what_a_night_added_is_where_it_ends() -> None:
    steps = np.zeros((9, 20))
    steps[-4:, 7] = 2.5
    assert told(steps, records={2: {"parameters": {}}}) is None
    assert max(WINDOWS) < len(steps)


@pytest.mark.long
def test_what_begins_to_drift_after_quiet_nights_has_true_values_and_is_said(root: Path, tmp_path: Path) -> None:
    """Ten nights of a machine that hardly wanders teach the state that; then a squareness drifts for a week, and stands."""
    folder, records, off = root / "examples" / "trunnion", [], []
    cell, truth = read_cell(folder), read_world(folder / "world.yaml")
    story = Story((Event(11, drift={"EC0X": 3e-6}), Event(18, drift={"EC0X": -3e-6})), wander=0.1)
    with opened(tmp_path / "h.db") as history:
        for record, true in nights(cell, truth, history, 23, 101, story, Nightly(diagnose=False)):
            value = record["parameters"]["EC0X"]
            off.append((value["value"] - true.errors.get("EC0X", 0.0)) / value["std"])
            records.append(record)
    assert np.sum(np.abs(off[10:]) > 1.96) <= 2 and np.max(np.abs(off[10:])) < 3  # nine of 12 nights were outside, by up to 10
    first = next(i for i, r in enumerate(records) if r["alarms"])
    (alarm,) = records[first]["alarms"]
    assert 11 <= first <= 16 and alarm["parameter"] == "EC0X" and alarm["rate_per_day"] == pytest.approx(3e-6, rel=0.4)
    assert records[8]["night"] <= alarm["since"] <= records[10]["night"]  # it began the night after
    for quiet in records[12:first]:  # from the night on which it was followed anew
        assert "no alarm, but X axis out of square" in quiet["headline"] and quiet["trend"]["since"] == alarm["since"]
    assert records[12]["opened"] == ["EC0X"] and first > 12
    assert {"EC0X"} == {name for r in records for name in r.get("opened", ())}
    last = records[-1]
    assert last["standing"][0]["stands"] >= records[14]["night"] and "it has stood still since" in last["headline"]
    assert "reaches its limit" not in last["headline"] and "it has stood still since" in message(last, (), ())[1]
    assert "and has stood still since" in context(last, (), None, texts())["first"]["text"]
