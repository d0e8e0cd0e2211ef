"""A drift of one week is told alike in every place: alarm, many nights at once, the sentence below its curve."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from support.answers import answered
from support.nights_parts import Event, Story, followed

from tango_cnc.history import opened
from tango_cnc.nightly.lookback import looked_back
from tango_cnc.report.course import course, drift_told
from tango_cnc.report.texts import texts

BEGUN, RESTS = "2026-10-09", "2026-10-16"  # the last night before it, the last one that it moved in


@pytest.mark.long
@pytest.mark.parametrize(("name", "rate", "factor"), [("EY0C", 0.0015, 1e3), ("EB0C", 2.5e-6, 1e6)])
def test_a_week_of_drift_has_one_date_and_one_rate(root: Path, tmp_path: Path, name: str, rate: float, factor: float) -> None:
    story = Story((Event(10, drift={name: rate}), Event(17, drift={name: -rate})), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 20, {}, seed=12)
    (alarm,) = [a for r in records for a in r["alarms"]]
    with opened(tmp_path / "h.db") as history:
        found = looked_back(history, "trunnion")
        alarms = {s.night.entry: s.record["alarms"] for s in history.alarmed("trunnion")}
        past = history.trend("trunnion", name)
    (drift,) = [f for f in found if f.parameter == name]
    assert drift.cause == "drift" and drift.since == alarm["since"] and abs(drift.size - rate) < 3 * drift.std < rate
    assert abs(date.fromisoformat(drift.since) - date.fromisoformat(BEGUN)).days <= 1
    assert abs(date.fromisoformat(drift.until) - date.fromisoformat(RESTS)).days <= 1
    table = followed(found, texts())
    assert f"a day since {drift.since}; at rest since {drift.until}" in " ".join(table.split())
    days = np.arange(len(past.value), dtype=float)
    told = drift_told(alarms, past.entries, past.nights, name)
    said = course(date(2026, 10, 1), days, past.value * factor, past.std * factor, [], None, "µm", texts(), told)
    assert said.startswith("A drift: moved by +") and "at rest since then" in said
    assert f" {int(drift.since[-2:])} Oct 2026 to" in said


def curve(values: Sequence[float], told: tuple[int, int] | None) -> str:
    value = np.array(values)
    return course(
        date(2026, 10, 1), np.arange(len(value), dtype=float), value, np.full(len(value), 0.3), [], None, "µm", texts(), told
    )


def test_the_sentence_of_a_curve_tells_the_drift_of_its_alarm() -> None:
    quiet, week = [0.0] * 10, [1.6, 3.2, 4.8, 6.4, 8.0, 9.6, 11.2]
    assert curve([*quiet, *week], (9, 12)) == "A drift: rises by 11 µm a week since Sat 10 Oct 2026."
    assert curve([*quiet, *(-v for v in week)], (9, 12)) == "A drift: falls by 11 µm a week since Sat 10 Oct 2026."
    rested = curve([*quiet, *week, 11.2, 11.1, 11.3], (9, 12))
    assert rested == "A drift: moved by +11 µm from Sat 10 Oct 2026 to Sat 17 Oct 2026, at rest since then."
    assert "drift" not in curve([*quiet, *week], None)


def test_what_is_told_of_a_curve_is_its_last_steady_drift() -> None:
    nights = [f"2026-10-{n:02}" for n in range(1, 9)]
    steady = {"parameter": "EX0C", "since": "2026-10-03", "rate_per_day": 1e-3, "steady": True}
    entries = list(range(1, 9))
    assert drift_told({5: [steady], 6: [steady]}, entries, nights, "EX0C") == (2, 4)  # one that goes on is told by several
    assert drift_told({5: [steady | {"steady": False}]}, entries, nights, "EX0C") is None
    assert drift_told({5: [steady | {"rate_per_day": None}]}, entries, nights, "EX0C") is None
    assert drift_told({5: [steady]}, entries, nights, "EY0C") is None
    assert drift_told({5: [steady | {"since": "2026-09-01"}]}, entries, nights, "EX0C") is None  # before the curve begins


@pytest.mark.long
def test_what_stands_behind_a_limit_counts_from_the_night_of_its_alarm(root: Path, tmp_path: Path) -> None:
    """And so does the trend of a drift that goes on after its alarm: a page has one date for one movement."""
    story = Story((Event(10, drift={"EY0C": 0.0012}),), wander=1.0)
    records = answered(root, tmp_path / "h.db", story, 24, {}, seed=3, limits={"volume": 53.0})
    compared = 0
    for r in records:
        alarms = {a["parameter"]: a["since"] for a in (*r["alarms"], *r.get("standing", ()))}
        for told in (*r.get("behind", ()), *([r["trend"]] if r.get("trend") else ())):
            compared += told["parameter"] in alarms
            assert alarms.get(told["parameter"], told["since"]) == told["since"]
    assert compared > 10


@pytest.mark.long
def test_a_drift_that_rests_is_not_predicted(root: Path, tmp_path: Path) -> None:
    story = Story((Event(10, drift={"EY0C": 0.0012}), Event(18, drift={"EY0C": -0.0012})), wander=0.3)
    records = answered(root, tmp_path / "h.db", story, 24, {}, seed=1, limits={"volume": 90.0})
    own = [next((a for a in r.get("standing", ()) if a["parameter"] == "EY0C"), None) for r in records]
    assert all(a is None or a.get("ahead") for a in own[14:17]) and own[16] is not None  # while it goes on
    assert not any(a.get("ahead") for a in own[17:] if a) and all(a.get("slowed") or a.get("stands") for a in own[17:] if a)
    assert all(a["stands"] for a in own[20:] if a)
