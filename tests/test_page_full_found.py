"""A full measurement that has found a change is not ordered once more on its own morning."""

from __future__ import annotations

from typing import Any

import pytest
from support.nights import knock, night

from tango_cnc.nightly.mail import message
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts

M = "HU40T-like"
DO = texts()("cause.axis_location.do")


@pytest.mark.parametrize(
    ("kind", "status", "verdict", "asked"),
    [
        ("full", "complete", "changed", False),
        ("full", "complete", "out_of_limits", False),
        ("full", "partial", "changed", True),
        ("check", "complete", "changed", True),
    ],
)
def test_the_morning_of_a_full_measurement_orders_no_other_one(kind: str, status: str, verdict: str, asked: bool) -> None:
    """The night had touched 226 of 226, and an operator was sent to start the same again."""
    said: dict[str, Any] = {"kind": kind, "status": status, "next": {"kind": "check", "why": "nothing is too uncertain"}}
    record = night(M, 8, verdict, **said)
    record["alarms"] = [{**knock(record["night"]), "do": DO}]
    page = context(record, (), None, texts())
    order = " ".join(page["todo"])
    assert ("Run the full measurement." in order) == asked and "Ask who was at the machine." in order
    assert ("somebody has to start it" in page["next_kind"]) == (asked and bool(page["next_kind"]))
    about = message(record, (), ())[1].partition("what to do: Ask who was")[2].partition("owner:")[0]
    assert ("Run the full measurement." in about) == asked and "have maintenance look" in about


def test_a_drift_that_a_full_measurement_has_found_is_measured_again() -> None:
    record = night(M, 8, "changed", kind="full")
    record["alarms"] = [{**knock(record["night"]), "rate_per_day": 0.001, "steady": True, "do": DO}]
    assert "Run the full measurement." in message(record, (), ())[1]
