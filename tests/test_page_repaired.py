"""A repair that nobody has measured: the parts of its fault stay in question until a night says that it has helped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.alarms import SINCE_FAULT, lasting
from support.nights import M, night
from support.server import cell

from tango_cnc.history import Decision, opened
from tango_cnc.report.faults import earlier, unclosed
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.texts import say

LATER = "2026-11-20"
SINCE_ANY = "All that were made since Sun 25 Oct 2026, the last night without any of these changes."  # another is named first
SINCE_OTHER = "All that were made since Sat 31 Oct 2026, the last night without it."


def page(place: Path, action: str, *, other: bool, then: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
    """cell, what somebody answers on the morning of the last night, whether another alarm is open, nights after it → the page."""
    fault = lasting(2, 20.0)
    tonight = [lasting(8, 6.0, "EX0C", id="2026-11-01-020000-2")] if other else []
    records = [night(M, i) for i in (0, 1)] + [night(M, 2, "changed", alarms=[fault])]
    records.append(night(M, 8, "changed" if other else "good", alarms=tonight, standing=[fault]))
    cell(place, records=records)
    with opened(place / "history.db") as history:
        history.decide(M, Decision(fault["id"], action, "Dora", "", None, records[-1]["end_utc"].replace("T02", "T10")))
        for record in then:
            history.add_night(record)
        found, decisions = unclosed(history, M, LATER)
        newest = history.records(M, 1)[0]
    before = records[-1] if newest["verdict"] == "not_measured" else None
    return context(newest, tuple(decisions.values()), None, texts(), waiting=earlier(found), before=before)


@pytest.mark.few(1)
@pytest.mark.parametrize("missed", [False, True])
@pytest.mark.parametrize("other", [False, True])
def test_the_parts_of_a_repaired_fault_are_in_question_until_a_night_has_measured_it(
    tmp_path: Path, other: bool, missed: bool
) -> None:
    nothing = night(M, 9, "not_measured", status="missed", kind="none", limits=[], volume={}, parameters={})
    waiting = [lasting(8, 6.0, "EX0C", id="2026-11-01-020000-2")] if other else []
    told = page(tmp_path / "c", "repaired", other=other, then=(nothing | {"standing": waiting},) if missed else ())
    assert told["suspect"] == (SINCE_ANY if other else SINCE_FAULT) and told["answer"].may == "but" and told["count"] == int(other)
    assert other or any("it shows whether the repair has helped" in line for line in told["todo"])
    assert "Dora (repaired)" in " ".join(x["who"] for x in [told["first"], *told["also"]])


@pytest.mark.parametrize("other", [False, True])
def test_what_was_accepted_and_what_a_night_has_measured_since_is_over(tmp_path: Path, other: bool) -> None:
    """Accepted, the machine is like this now; measured, the page has the parts that were made until the repair."""
    told = page(tmp_path / "accepted", "accept", other=other)
    assert told["suspect"] == (SINCE_OTHER if other else "") and told["answer"].may == ("but" if other else "yes")
    helped = {"alarm": "2026-10-26-020000-1", "text": "It is back.", "since": "2026-10-25", "parameter": "EY0C"}
    waiting = [lasting(8, 6.0, "EX0C", id="2026-11-01-020000-2")] if other else []
    told = page(tmp_path / "measured", "repaired", other=other, then=(night(M, 9, repaired=[helped], standing=waiting),))
    assert told["suspect"] == (SINCE_OTHER if other else "")
    assert told["repaired"][0]["suspect"].startswith("All that were made between Sun 25 Oct 2026")


def test_the_first_date_of_a_story_is_that_of_the_part_that_was_repaired() -> None:
    """Two alarms of one parameter, of which the older was repaired: the parts since that one are in question all the same."""
    old, new = lasting(2, 20.0), lasting(6, 21.0)
    record = night(M, 8, "changed", standing=[new, old])
    done = Decision(old["id"], "repaired", "Dora", "", None, record["end_utc"].replace("T02", "T10"))
    assert context(record, (done,), None, texts())["suspect"] == SINCE_FAULT
    earlier_one = Decision(old["id"], "repaired", "Dora", "", None, "2026-10-27T10:00:00Z")
    assert context(record, (earlier_one,), None, texts())["suspect"].startswith("All that were made since Thu 29 Oct 2026")


def test_a_change_that_had_gone_back_before_the_repair_is_not_to_be_measured_again() -> None:
    gone = lasting(2, 20.0, now=say("night.alarms.gone_again_left", told="+1.0 ± 0.3 µm"), total=0.001)
    record = night(M, 8, standing=[gone])
    done = Decision(gone["id"], "repaired", "Dora", "", None, record["end_utc"].replace("T02", "T10"))
    told = context(record, (done,), None, texts())
    assert told["answer"].may == "yes" and "the day on which it went back" in told["suspect"]


def test_who_accepts_a_change_has_nothing_to_mend_and_has_sorted_no_part_from_beyond_the_limit() -> None:
    """168 µm until the knock made it 142, with 160 allowed: accepted, the page asked for maintenance and named no part any more."""
    fault = lasting(6, 20.0)
    record = night(M, 8, "changed", standing=[fault])
    signs = [(night(M, i)["night"], "changed" if i >= 6 else "out_of_limits" if i >= 3 else "good") for i in range(8, -1, -1)]
    asked = context(record, (), None, texts(), signs=signs)
    assert "Those since Tue 27 Oct 2026, too: the machine was beyond its limit then." in asked["suspect"]
    done = Decision(fault["id"], "accept", "Ann", "", None, record["end_utc"].replace("T02", "T10"))
    told = context(record, (done,), None, texts(), signs=signs)
    assert told["answer"].may == "yes" and told["todo"] == ["Nothing."]
    assert told["suspect"] == "Those made from Tue 27 Oct 2026 to Thu 29 Oct 2026: the machine was beyond its limit then."
    within = [(date, "changed") for date, _ in signs]
    assert context(record, (done,), None, texts(), signs=within)["suspect"] == ""


def test_who_accepts_a_change_of_a_machine_beyond_its_limit_has_not_put_it_right() -> None:
    fault = lasting(6, 20.0)
    record = night(M, 8, "out_of_limits", standing=[fault])
    done = Decision(fault["id"], "accept", "Ann", "", None, record["end_utc"].replace("T02", "T10"))
    told = context(record, (done,), None, texts())
    assert told["answer"].may == "no" and told["todo"][-1] == texts()("todo.limit")


def test_the_parts_of_a_fault_that_went_back_stay_in_question_beside_another_fault() -> None:
    knock = lasting(2, 20.0, now=say("night.alarms.gone_again_left", told="+0.1 ± 0.3 µm"), total=0.0001)
    other = lasting(8, 15.0, "EX0C")
    told = context(night(M, 8, "changed", alarms=[other], standing=[knock]), (), None, texts())["suspect"]
    assert told == f"{SINCE_OTHER} Those between Sun 25 Oct 2026 and the day on which another fault went back, too."
    older = lasting(1, 15.0, "EX0C")  # all since before the first of them are in question already
    told = context(night(M, 8, "changed", standing=[knock, older]), (), None, texts())["suspect"]
    assert told == "All that were made since Sat 24 Oct 2026, the last night without it."
