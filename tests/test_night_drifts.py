"""From its first sentence to its last morning a drift has one "since" and its own advice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.answers import answered
from support.nights_parts import Event, Story

from tango_cnc.nightly.drift import Drift
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.words import headline
from tango_cnc.report.alarm import alarm as shown
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.report.words import unforeseen
from tango_cnc.texts import say

STANDING: dict[str, Any] = {
    **{"id": "2026-10-10-1", "night": "2026-10-10", "cause": "axis_location", "parameter": "EB0C", "since": "2026-10-02"},
    **{"text": "it creeps", "do": say("night.drift_do", name="EB0C"), "on_part": "p", "size": 9e-6, "unit": "rad", "owner": None},
    **{"rate_per_day": 1e-6, "steady": True, "decision": None, "confirmed": "2026-10-11", "now": "it is +25 µrad now"},
}


def night(**more: Any) -> dict[str, Any]:
    record: dict[str, Any] = {
        **{"machine": "M", "cell": "/cells/m", "night": "2026-10-12", "kind": "full", "status": "complete", "why": ""},
        **{"verdict": "changed", "preflight": [], "touches": 9, "planned": 9, "machine_time_s": 60.0, "alarms": [], "limits": []},
        **{"owner": "Ann", **more},
    }
    return record | {"headline": headline(record)}


@pytest.mark.parametrize(
    ("by", "pace"), [(-1.0, ", 1.0 µm a day:"), (1.0, ", +1.0 µm a day:"), (0.5, "+1.0 µm a day (the first of them):")]
)
def test_the_pace_of_axes_that_no_touch_tells_apart_has_no_sign_of_one_of_them(by: float, pace: str) -> None:
    """Spindle by −20 µm or C axis by +20 µm, "−1 µm a day"."""
    told = Drift("EX0S", "2026-10-11", 0.02, 1e-3, "mm", 0.001, 9.0, 1e-9, 20.0, "p", "d", True, alike={"EX0C": by})
    assert pace in told.text, told.text


@pytest.mark.parametrize("steady", [True, False])
def test_a_drift_that_a_full_measurement_has_found_again_keeps_the_advice_of_a_drift(steady: bool) -> None:
    """What came at once is asked about; what goes on is looked for."""
    standing = STANDING | {"steady": steady, "do": STANDING["do"] if steady else say("cause.axis_location.do")}
    text = message(night(standing=[standing]), (), ())[1]
    page = shown(standing, None, Units(), texts())["todo"]
    assert ("Have clamping, bearing and screws" in text) == steady and ("Ask who was at the machine" in text) != steady
    assert text.count("Enter no new location of this axis") == steady and ("run the full measurement" in text) == steady
    assert ("Have clamping, bearing and screws" in page) == steady and ("Ask who was at the machine" in page) != steady


CHANGE = {"text": "one false alarm in 730 nights is expected", "limit": 1e-3}
ALARM: dict[str, Any] = {
    **{"id": "a", "cause": "axis_location", "parameter": "EY0C", "text": "it moved", "since": "2026-10-11", "sigmas": 9.0},
    **{"size": 0.02, "unit": "mm", "on_part": "p", "do": "ask", "owner": None, "rate_per_day": None},
}


@pytest.mark.parametrize(
    ("p", "more", "says"),
    [
        (0.7, {"verdict": "good"}, True),
        (0.45, {"trend": {"text": "it has moved by +3.1 ± 0.3 µm"}}, False),
        (0.45, {"verdict": "out_of_limits", "behind": [ALARM | {"what": "volume"}]}, False),
        (1e-9, {"alarms": [ALARM]}, True),
        (0.98, {"alarms": [ALARM | {"repair": {"alarm": "b"}}]}, False),  # a repair that was measured decided
        (5e-77, {"verdict": "good", "repaired": [{"text": "as before", "alarm": "b"}]}, False),
        (0.4, {"alarms": [ALARM | {"rate_per_day": 0.001}]}, False),  # many nights decided
        (0.9, {"standing": [STANDING]}, False),
        (1e-9, {"verdict": "good", "ignored": [{"text": "it moved", "owner": "Cy", "until": "2026-12-01"}]}, False),
    ],
)
def test_the_probability_by_chance_is_said_where_it_is_what_decided(p: float, more: dict[str, Any], says: bool) -> None:
    text = message(night(change=CHANGE | {"p_value": p}, **more), (), ())[1]
    assert ("probability by chance" in text) == says and "one false alarm in 730 nights is expected" in text


@pytest.mark.parametrize(("days", "told"), [(0.2, "in about a day"), (1.4, "in about a day"), (1.6, "in about 2 days")])
def test_a_limit_that_is_near_is_a_day_away_and_not_1_days(days: float, told: str) -> None:
    found = Drift("EY0C", "2026-10-11", 0.02, 1e-3, "mm", 0.001, 9.0, 1e-9, 20.0, "p", "d", True, limit="volume", nights=days)
    assert f"volume reaches its limit {told} if it goes on so" in found.text
    assert "reaches" not in unforeseen(found.text, "2026-10-20")


@pytest.fixture(scope="module")
def creep(root: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """→ nights of a rotary axis that tilts by a microradian a night, which nobody answers."""
    story = Story((Event(9, drift={"EB0C": 1e-6}),), wander=0.25)
    return answered(root, tmp_path_factory.mktemp("creep") / "h.db", story, 36, {}, limits={"EB0C": 40.0})


@pytest.mark.long
def test_a_drift_that_stands_looks_ahead_from_tonight(creep: list[dict[str, Any]]) -> None:
    """By the truth: a microradian a night from where the axis is, and none of the forecasts is that of the first night."""
    first = next(i for i, r in enumerate(creep) if r["alarms"])
    stands = [(i, r) for i, r in enumerate(creep) if r.get("standing") and i > first]
    assert len(stands) > 5
    for i, r in stands:
        (a,) = r["standing"]
        assert "reaches its limit" not in a["text"] and r["headline"].count("reaches its limit in about") == 1
        left = 40 - 1e6 * r["parameters"]["EB0C"]["value"]
        assert a["ahead"]["what"] == "EB0C" and a["ahead"]["days"] == pytest.approx(left, rel=0.3), (i, left)
        text = message(r, (), ())[1]
        assert "Have clamping, bearing and screws" in text and "Ask who was" not in text and a["ahead"]["text"] in text


@pytest.mark.long
def test_a_trend_is_reckoned_from_the_night_that_first_said_it(creep: list[dict[str, Any]]) -> None:
    first = next(i for i, r in enumerate(creep) if r["alarms"])
    told = [r["trend"] for r in creep[:first] if r.get("trend")]
    assert len(told) > 2 and len({t["since"] for t in told}) == 1
    assert all(a["size"] > 0.95 * b["size"] for a, b in zip(told[1:], told, strict=False))  # it does not jump back
