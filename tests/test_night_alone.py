"""One error that moves alone: quiet nights say how fast it wanders, and it is tried by itself beside all directions together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.nights import knock, night
from support.nights_parts import Event, Story, nights

from tango_cnc import state as s
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.report.morning import render


@pytest.mark.long
def test_a_warm_night_and_its_way_back_teach_no_wander(root: Path, tmp_path: Path) -> None:
    """Warm by 8 K and as before, 60 µm and gone back, then 18 µm: a machine that wanders by 0.15 µm a day was taken for one that
    does 1.6, so that these 18 µm were no alarm.
    """
    cell, truth = read_cell(root / "examples" / "trunnion"), read_world(root / "examples" / "trunnion" / "world.yaml")
    cell = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[::3]))
    steps = Event(6, warmer=8.0), Event(7, warmer=-8.0), Event(8, {"EY0C": 0.06}), Event(11, {"EY0C": -0.06})
    story = Story((*steps, Event(13, {"EY0C": 0.018})), {"EY0C": 1.5e-3, "EX0S": 0.6e-3}, 0.5)
    with opened(tmp_path / "history.db") as history:
        records = [r for r, _ in nights(cell, truth, history, 13, 3, story, Nightly(diagnose=False, check_minutes=3))]
    assert [a["cause"] for a in records[5]["alarms"]] == ["temperature"] and records[10]["alarms"][0]["undoes"]
    state = records[11]["state"]
    assert state["learned"] == 10 and 1e3 * np.sqrt(max(state["rates"])) < 0.5, np.sqrt(state["rates"]) * 1e3
    (alarm,) = records[12]["alarms"]
    assert (alarm["cause"], alarm["parameter"]) == ("axis_location", "EY0C")
    assert alarm["size"] == pytest.approx(0.018, abs=0.001) and not records[12].get("trend")


def followed_of(places: int) -> tuple[s.State, Any]:
    """how many unknowns → a state of equal ones, and what touches of all of them say, for each value."""
    state = s.State(tuple(f"P{i}" for i in range(places)), np.zeros(places), 1e-3 * np.eye(places), 0.0, np.zeros(places), 1e-3)
    rows = np.vstack([np.eye(places), np.eye(places)])

    def told(value: np.ndarray) -> s.Seen:
        return s.Seen(rows, value, np.arange(1, len(rows) + 1), None)

    return state, told


@pytest.mark.parametrize(("nights", "sigmas", "alarms"), [(60.0, 5.6, True), (60.0, 4.0, False), (8.0, 5.6, False)])
def test_one_of_forty_that_stands_out_alarms_alone(nights: float, sigmas: float, alarms: bool) -> None:
    """Forty directions at once need 6.1 standard deviations; a rate that is known from eight nights needs more than 5.6."""
    state, told = followed_of(40)
    state = replace(state, agreement=(4000.0, 4000.0))
    value = np.zeros(80)
    value[[7, 47]] = 1e-3 * sigmas * np.sqrt(1.5)  # two touches and what was predicted
    value += 0.9e-3 * np.sqrt(1.5) * np.tile(np.where(np.arange(40) % 2, 1.0, -1.0) * (np.arange(40) != 7), 2)
    alone = s.Alone(np.arange(40), nights)
    assert s.judge(state, told(value), alone=alone).alarm(2 / 3 / 730) == alarms
    assert not s.judge(state, told(value)).alarm(2 / 3 / 730)


@pytest.mark.long
def test_both_tests_of_the_machine_share_what_one_had() -> None:
    """As many false alarms as stated, whatever is tried: of quiet nights one in fifty at that chance."""
    state, told = followed_of(12)
    state = replace(state, agreement=(1e5, 1e5))
    rng, alone, count = np.random.default_rng(7), s.Alone(np.arange(12), 1e6), 4000
    truths = rng.normal(0, 1e-3, (count, 12))
    scatter = rng.normal(0, 1e-3, (count, 24))
    below = [s.judge(state, told(np.tile(t, 2) + n), alone=alone).p_machine < 0.02 for t, n in zip(truths, scatter, strict=True)]
    assert 0.6 * 0.02 < np.mean(below) < 1.15 * 0.02


@pytest.mark.parametrize("open_alarm", [False, True])
def test_what_has_moved_without_an_alarm_is_on_the_page(open_alarm: bool) -> None:
    """The message said it, and the page said that nothing has changed, or named an alarm of a week ago alone."""
    text = "A axis has moved along Y by +18.0 ± 0.3 µm since 2026-11-01 (EY0A)"
    stands = [knock("2026-11-02") | {"night": "2026-11-02", "now": "", "rate_per_day": None}] if open_alarm else []
    moved = {"parameter": "EY0A", "text": text, "size": 0.018, "since": "2026-11-01"}
    record = night("M", 10, "changed" if open_alarm else "good", standing=stands, trend=moved)
    page = " ".join(render(record).split())
    assert "Moved, without an alarm" in page and "A axis has moved along Y by +18 µm since" in page
    assert "What changed</dt><dd>Nothing.<" not in page
    goes_on = [{**knock("2026-11-02"), "night": "2026-11-02", "now": "", "parameter": "EY0A", "rate_per_day": 0.001}]
    assert "Moved, without an alarm" not in render(night("M", 10, "changed", standing=goes_on, trend=moved))
