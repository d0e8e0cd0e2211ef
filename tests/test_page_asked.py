"""Whom to call: about what nobody has answered, also beside what somebody has; and what a night in doubt is about."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.alarms import lasting
from support.nights import M, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import Decision, opened
from tango_cnc.nightly.words import headline
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

UTC = "2026-11-01T10:00:00Z"
DOUBT = {"verdict": "doubtful", "carried": False, "plausible": {"verdict": "implausible", "reasons": ["touches do not repeat"]}}

MISSED: dict[str, Any] = {
    "verdict": "not_measured",
    "status": "missed",
    "kind": "none",
    "limits": [],
    "volume": {},
    "parameters": {},
}


def todo(record: dict[str, Any], *decisions: Decision) -> list[str]:
    return list(context(record, decisions, None, texts())["todo"])


def decided(a: dict[str, Any], action: str) -> Decision:
    return Decision(a["id"], action, "Emil, 4714", "", None, UTC)


@pytest.mark.parametrize("other", ["", "acknowledge"])
def test_somebody_is_called_about_what_nobody_has_answered_beside_what_somebody_has(other: str) -> None:
    """The box said that nobody had answered an alarm, and what to do named nobody to call: somebody had the larger one."""
    large, small = lasting(2, 30.0), lasting(6, 4.0, "EX0C", owner="Ann, 4711")
    done = [decided(large, "acknowledge"), *([decided(small, other)] if other else [])]
    told = context(night(M, 8, "changed", standing=[large, small]), done, None, texts())
    assert ("Nobody has answered the alarm of Fri 30 Oct 2026." in told["answer"].why) == (not other)
    assert any("Ann, 4711" in line for line in told["todo"]) == (not other)
    about = "This is about the alarm of Fri 30 Oct 2026, which nobody has answered."  # the page begins with the larger one
    assert any(about in line for line in told["todo"]) == (not other)


@pytest.mark.parametrize("action", ["acknowledge", "repaired"])
def test_somebody_is_called_about_a_night_in_doubt_though_somebody_has_what_was_found_before(action: str) -> None:
    fault = lasting(2, 20.0)
    own = {"standing": [fault], "owner": "Ann, 4711"}
    assert "Call Ann, 4711." in todo(night(M, 8, **DOUBT, **own), decided(fault, action))
    assert not any("Call" in line for line in todo(night(M, 8, "changed", **own), decided(fault, action)))


def test_the_list_names_the_doubt_of_a_night_in_doubt_and_not_what_was_found_before(tmp_path: Path) -> None:
    """It said: Make no parts on it, C axis has moved. Whoever read that waited for a repair and left the probe alone."""
    fault = lasting(2, 20.0)
    doubt = night(M, 8, **DOUBT, standing=[fault])
    records = [night(M, 2, "changed", alarms=[fault]), doubt | {"headline": headline(doubt)}]
    place = cell(tmp_path / "one", records=records)
    with opened(place / "history.db") as history:
        history.decide(M, Decision(fault["id"], "acknowledge", "Emil", ""))
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        summary = client.get("/").text.partition("<summary>")[2].partition("</summary>")[0]
    assert (
        "Make no parts on it" in summary and "Touches do not repeat, since Sun 1 Nov 2026." in summary and "C axis" not in summary
    )


@pytest.mark.few(1)
@pytest.mark.parametrize(("more", "unfolded"), [({"verdict": "changed"}, False), (DOUBT, True), (MISSED, True)])
def test_trend_and_nights_show_what_to_do_about_the_last_night_and_fold_what_is_of_an_earlier_alarm(
    tmp_path: Path, more: dict[str, Any], unfolded: bool
) -> None:
    """Under a night in doubt it was folded as well: an alarm of an earlier night was open."""
    fault = lasting(2, 20.0, decision=None)
    records = [night(M, 2, "changed", alarms=[fault]), night(M, 7, "changed", standing=[fault])]
    place = cell(tmp_path / "one", records=[*records, night(M, 8, **more, standing=[fault])])
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        for page in ("trend", "nights"):
            text = client.get(f"/machine/{M}/{page}").text
            assert ("<details open><summary><b>What to do:" in text) == unfolded, page
            assert "<summary><b>What to do:" in text
