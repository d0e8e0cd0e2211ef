"""A full measurement that has found a change is not ordered once more on its own morning."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.nights import knock, night

from tango_cnc.nightly.mail import message
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts, texts_of

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


def test_a_shop_has_its_own_sentence_for_that_morning(tmp_path: Path) -> None:
    """The English sentence was cut out of what the shop says: in another language, or put otherwise, it stayed."""
    own = {"do": "Frag nach, und miss alles.", "do_found": "Frag nach."}
    text = "[cause.axis_location]\n" + "".join(f'{key} = "{said}"\n' for key, said in own.items())
    (tmp_path / "texts.toml").write_text(text, encoding="utf-8")
    t = texts_of(tmp_path)
    record = night(M, 8, "changed", kind="full", next={"kind": "check", "why": "nothing is too uncertain"})
    record["alarms"] = [{**knock(record["night"]), "do": DO}]
    assert "Frag nach." in context(record, (), None, t)["todo"]
    assert "what to do: Frag nach.\n" in message(record, (), (), t=t)[1]


@pytest.mark.parametrize(("found", "told"), [("no answer. Is it switched on?", "Is it switched on?"), ("no answer.", "no answer.")])
def test_what_to_see_to_ends_with_one_sign(found: str, told: str) -> None:
    """ "… no other program connected to it?." """
    failed = {"check": "control", "passed": False, "found": found, "do": ""}
    record = night(M, 8, "not_measured", status="failed", kind="none", preflight=[failed], limits=[], alarms=[])
    (line,) = (x for x in context(record, (), None, texts())["todo"] if x.startswith("See to the "))
    assert line.endswith(told) and not line.endswith(("?.", ".."))
