"""What the control holds now is one answer, and message, page and alarms follow it: nobody enters the same correction twice."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from support.nights import night

from tango_cnc.history import Compensation, Decision
from tango_cnc.loaded import holds
from tango_cnc.nightly.control import Given
from tango_cnc.report.checks import _limit
from tango_cnc.report.compensated import as_loaded, dated, held
from tango_cnc.report.facts import Facts, LoadedCompensation, NewestNight
from tango_cnc.report.faults import faults
from tango_cnc.report.states import as_probed
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import say

DAY = {number: night("M", number)["night"] for number in range(8)}  # each begins at 02:00 UTC


def event(number: int, what: str, after: int, target: str = "fanuc") -> Compensation:
    """number of a compensation, what happened to it, after which night (at noon) → its line in the history."""
    return Compensation(after, f"{DAY[after]}T12:00:00Z", number, target, what, "", None, None, None)


FIRST = [event(1, "written", 0), event(1, "kept", 1)]


@pytest.mark.parametrize(
    ("events", "number", "word", "proven"),
    [
        ([], None, "", None),
        ([event(1, "proposed", 0)], None, "", None),
        ([event(1, "written", 0)], 1, "written", None),
        (FIRST, 1, "kept", 1),
        ([*FIRST, event(2, "proposed", 2)], 1, "kept", 1),
        ([*FIRST, event(2, "written", 2)], 2, "written", 1),
        ([*FIRST, event(2, "written", 2), event(2, "undecided", 3)], 2, "undecided", 1),
        ([*FIRST, event(2, "written", 2), event(2, "kept", 3)], 2, "kept", 2),
        ([*FIRST, event(2, "written", 2), event(2, "no help", 3)], 2, "no help", None),
        ([*FIRST, event(2, "written", 2), event(2, "rolled back", 3)], 1, "kept", 1),
        ([*FIRST, event(2, "written", 2), event(1, "kept", 3)], 2, "written", 1),  # measured once more: 2 stays the newest
        ([*FIRST, event(2, "written", 2, "haas")], 2, "written", None),  # another control proves nothing of this one
    ],
)
def test_the_control_holds_the_newest_that_was_not_rolled_back(
    events: list[Compensation], number: int | None, word: str, proven: int | None
) -> None:
    for ordered in (events, events[::-1]):  # files have the oldest first, histories the newest
        there = holds(ordered)
        assert (there and (there.number, there.event, there.proven)) == (number and (number, word, proven))


def knock(number: int, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, µm along X → the alarm of a machine that was hit in that night."""
    said = {"on_part_um": 2 * abs(um), "on_part": f"A part comes out up to {2 * abs(um):.1f} µm different from before."}
    return {
        **{"id": f"{DAY[number]}-020000-1", "cause": "axis_location", "parameter": "EX0S", "since": DAY[number - 1], "unit": "mm"},
        "text": f"spindle has moved along X by {um:+.1f} ± 0.2 µm since last night (EX0S)",
        **{"size": um / 1e3, "std": 0.0002, "sigmas": 90.0, "rate_per_day": None, "instead": [], "owner": "Ann", "decision": None},
        **{"do": texts()("cause.axis_location.do"), **said, **more},
    }


def written(number: int, um: float, compensation: int, taken_out: bool = False) -> dict[str, Any]:
    """night, µm, compensation → the alarm of the night after it was written, as nights write it."""
    given = Given(f"{DAY[number - 1]}T12:00:00Z", DAY[number - 1], compensation, "fanuc", taken_out)
    return given.told(knock(number, um))


def at(number: int, value: float, gone: float = 0.0, **more: Any) -> dict[str, Any]:
    """night, µm that EX0S is found at, µm that the control takes away of it → its record."""
    own = {"value": value / 1e3, "unit": "mm", "std": 2e-4, "low": 0.0, "high": 0.0, "change": 0.0, "seen": True}
    return night("M", number, "changed", parameters={"EX0S": own | {"in_control": gone / 1e3}}, **more)


# Kept compensation 1, a knock of 30 µm in night 3, compensation 2 written after it: its tables take 20 µm away, which probing
# sees, and its kinematics 10 µm, which it does not.
HIT = {"EX0S": {"value": -0.030, "change": -0.030, "in_control": 0.002}}
KNOCK = dated(knock(3, -30.0), {**at(3, 0.0), "parameters": HIT})
SECOND = [*FIRST, event(2, "written", 3)]
OPEN = {"number": 2, "target": "fanuc", "date": DAY[3], "event": "written", "measured": False, "beneath": 1}
KEPT = {**OPEN, "event": "kept", "measured": True}


def told(record: dict[str, Any], events: list[Compensation], *alarms: dict[str, Any], **more: Any) -> list[dict[str, Any]]:
    return faults(record, alarms, more.get("decisions", {}), Units(), texts(), today=str(record["night"]), events=events[::-1])


def test_nobody_is_asked_to_enter_what_the_second_compensation_holds() -> None:
    record = at(4, -8.0, 2.0, alarms=[written(4, 20.0, 2)], in_control=OPEN)
    (fault,) = told(record, SECOND, KNOCK)
    assert "Enter nothing again: compensation 2" in fault["todo"] and "compensation written" not in fault["todo"]
    assert "nobody knows" in fault["whole"] and "Correct" not in fault["whole"] and "µm" not in fault["whole"]
    assert "different from before" not in fault["on_part"] and fault["ids"] == [KNOCK["id"], record["alarms"][0]["id"]]
    said = held(record, texts())
    assert "Compensation 2 (fanuc) is noted as written" in said and "What compensation 1 takes away" in said


def test_a_kept_compensation_closes_its_stories_and_shows_what_was_before() -> None:
    """−2 µm before the knock, which its own night showed: it stays −2 whatever is loaded later."""
    record = at(5, -8.0, -8.5, in_control=KEPT)
    (fault,) = told(record, [*SECOND, event(2, "kept", 4)], KNOCK, dated(written(4, 20.0, 2), at(4, -8.0, 2.0)))
    assert "accept" in fault["office"] and "Enter nothing again" in fault["todo"]
    assert "nearly right" in fault["whole"] and "Correct" not in fault["whole"]
    assert re.search("in the night ending .{15}, is .0.5 µm; it was −2 µm before", fault["whole"]), fault["whole"]
    (again,) = told(at(5, -8.0, 20.0, in_control=KEPT), [*SECOND, event(2, "kept", 4)], KNOCK)
    assert "it was −2 µm before" in again["whole"]  # another number is taken off tonight, and not off that night
    (alone,) = told(record, [*SECOND, event(2, "kept", 4)], dated(written(4, 20.0, 2), at(4, -8.0, 2.0)))
    assert "was measured and kept" in alone["todo"] and "--measured" not in alone["office"] + alone["todo"]


def test_what_a_compensation_moved_is_no_drift() -> None:
    """Written (+20 µm), then taken out with a repair (+9 µm): the machine has not moved by itself at all."""
    back = [*SECOND, event(2, "kept", 4), event(2, "rolled back", 5)]
    given, out = (dated(written(n, um, 2, n == 6), at(n, 0.0)) for n, um in ((4, 20.0), (6, 9.0)))
    (fault,) = told(at(6, 0.0, 2.0), back, given, out)
    assert not fault["drifts"] and "drift" not in fault["text"] and "taken out of the control again" in fault["todo"]


def test_steps_with_a_compensation_or_a_repair_between_them_are_two_stories() -> None:
    steps = [dated(knock(n, 5.0, do="Look."), at(n, 0.0)) for n in (3, 5)]
    done = Decision("other", "repaired", "Ann", "", None, f"{DAY[4]}T12:00:00Z", "M")
    for events, decisions, drifts in (([], {}, True), ([event(1, "written", 3)], {}, False), ([], {"other": done}, False)):
        assert told(at(5, 10.0), events, *steps, decisions=decisions)[0]["drifts"] is drifts
    assert told(at(5, 10.0), [event(1, "written", 1)], *steps)[0]["drifts"]  # before the first step it explains nothing


def test_a_knock_after_a_kept_compensation_is_not_settled_by_it() -> None:
    """What came after it is a fault of its own, with its own advice: "close it by accept" holds for the older one only."""
    later = dated(knock(5, -30.0), at(5, -38.0, -8.0))
    found = told(at(5, -38.0, -8.0, in_control=KEPT), [*SECOND, event(2, "kept", 4)], KNOCK, later)
    assert [x["settled"] for x in found] == [False, True]
    assert "have the compensation written" in found[0]["todo"] and "accept" in found[1]["office"]


@pytest.mark.few(0)
def test_what_happened_since_the_night_is_said_beside_it() -> None:
    """Rolled back, and no night yet: the page does not ask to measure what is gone, and gives no whole error of before."""
    record = at(4, -8.0, 2.0, alarms=[written(4, 20.0, 2)], in_control=OPEN)
    events = [*SECOND, event(2, "rolled back", 4)]
    found = told(record, events, KNOCK)
    assert "the next night says" in found[0]["whole"] and "−30 µm" in found[0]["text"].replace("-", "−")
    assert not any("--measured" in x["office"] + x["todo"] for x in found)
    assert "is noted as rolled back" in held(record, texts(), events) and "--measured" not in held(record, texts(), events)


@pytest.mark.parametrize(
    ("measured", "age"),
    [("01:59:59", "older"), ("02:00:00", "own"), ("02:04:10", "own"), ("02:04:11", "newer")],
)
def test_the_readings_of_the_newest_night_are_its_own(measured: str, age: str) -> None:
    record = night("M", 3)
    nights = NewestNight(DAY[3], "good", "", 0, record["end_utc"], record)
    assert nights.beside(f"{DAY[3]}T{measured}+00:00") == age
    assert all(f"{member}.nights_{age}" in texts() for member in ("check", "verdict"))


def test_a_report_names_the_newest_and_what_is_off_its_limit() -> None:
    """Compensation 3 is undecided, 1 was kept: what 1 takes away is off, and 3 is named though the machine is within its limit."""
    control = LoadedCompensation(3, "fanuc", False, np.zeros(1), "undecided", 1)
    f = SimpleNamespace(tip=SimpleNamespace(worst=0.013, std=0.0005), factor=2.0, control=control)
    f.wishes = SimpleNamespace(limit=0.045, units=Units())
    said = _limit(cast(Facts, f), texts()).text
    assert "what compensation 1 (fanuc) takes away" in said and "compensation 3 (fanuc) is in the control (undecided)" in said
    told = as_probed(cast(Facts, f), texts())  # a tool tip of 3.4 µm stood above a spindle that is off by 35 µm
    assert told.startswith("Compensation 1 (fanuc) is in the control") and told.endswith("Enter none of these values.")
    f.control = None
    assert as_probed(cast(Facts, f), texts()) == ""


@pytest.mark.parametrize(
    ("events", "wanted"),
    [
        ([event(1, "written", 0), event(1, "no help", 1)], "Have compensation 1 (fanuc) taken out of the control today"),
        ([event(1, "written", 0), event(1, "no help", 1), event(1, "rolled back", 3)], "Enter nothing before the next night"),
        ([event(1, "proposed", 3)], "Have compensation 1 (fanuc) loaded into the control"),
        ([event(1, "proposed", 1)], "Have it compensated or repaired."),
        ([], "Have it compensated or repaired."),
    ],
)
def test_an_order_of_the_night_that_was_carried_out_since_is_not_given_again(events: list[Compensation], wanted: str) -> None:
    """Ten minutes after it was taken out: "load its undo/, then note that", which is refused; a proposal lay ready, on no page."""
    do = say("night.most_do")
    if [e.event for e in events][:1] == ["written"]:
        do = say("night.take_out", number=1, target="fanuc", event="no help")
    told = as_loaded({"utc": f"{DAY[2]}T02:00:00Z", "do": do, "id": "", "cause": "limit", "parameter": "EY0C"}, events)
    assert wanted in told["do"] and ("undo/" in told["do"]) == ("today" in wanted)
