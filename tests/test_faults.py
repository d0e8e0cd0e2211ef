"""What is wrong with a machine is told once, with one size, on every page; and no sign says what the answer does not."""

from __future__ import annotations

import os
import re
import time
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import pytest
from support.nights import night
from support.server import Recorded, cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import Compensation, Decision
from tango_cnc.report.compensated import last_written
from tango_cnc.report.days import day, ended
from tango_cnc.report.faults import faults
from tango_cnc.report.morning import context, render
from tango_cnc.report.suspects import last_within
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

HOST = "http://127.0.0.1"


def step(number: int, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, µm that the C axis has moved along Y that night → its alarm, as nights write them."""
    dates = [night("M", i)["night"] for i in (number - 1, number)]
    return {
        **{"id": f"{dates[1]}-020000-1", "cause": "axis_location", "parameter": "EY0C", "since": dates[0], "unit": "mm"},
        "text": f"C axis has moved along Y by {um:+.1f} ± 0.3 µm since last night (EY0C)",
        **{"size": um / 1e3, "std": 0.0003, "sigmas": 12.0, "rate_per_day": None, "instead": [], "owner": "Ann", "decision": None},
        **{"on_part_um": 2 * um, "on_part": f"A part whose zero was found at C 0 is off by up to {2 * um:.1f} µm at 180°."},
        "do": "Ask who was at the machine.",
        **more,
    }


def asked(folder: Path, path: str) -> str:
    with TestClient(create(Settings((folder,))), base_url=HOST, client=("127.0.0.1", 5000)) as client:
        return client.get(path).text


def test_of_a_stylus_that_moved_twice_the_newest_is_told_first() -> None:
    """It went 15 µm and came back: the first alarm alone would say that it is 15 µm off."""
    stylus = {"cause": "stylus", "parameter": "stylus", "on_part_um": None, "on_part": "", "do": "Look at the stylus."}
    away, back = (
        "the tip of the stylus has moved by 15.1 µm (Z +15.1 µm)",
        "the tip of the stylus has moved by 15.7 µm (Z -15.7 µm)",
    )
    old, new = step(2, 15.1, **stylus, text=away, night=night("M", 2)["night"]), step(5, 15.7, **stylus, text=back)
    record = night("M", 5, "changed", alarms=[new], standing=[old])
    (one,) = faults(record, (), {}, Units(), texts())
    assert one["text"].index("Z −16 µm") < one["text"].index("Before that: The tip") < one["text"].index("Z +15 µm")


def test_the_same_words_of_two_nights_stand_once_with_both_dates() -> None:
    """The machine is not as it was. Before that: The machine is not as it was."""
    nothing = {
        "cause": "unknown",
        "parameter": "several",
        "size": 0.0,
        "unit": "",
        "on_part": "",
        "text": "the machine has changed",
    }
    old, new = step(2, 0.0, **nothing, night=night("M", 2)["night"]), step(5, 0.0, **nothing)
    (one,) = faults(night("M", 5, "changed", alarms=[new], standing=[old]), (), {}, Units(), texts())
    assert one["text"].count("The machine has changed") == 1 and "Before that" not in one["text"]
    assert all(day(a["id"][:10], texts()) in one["text"] for a in (old, new))


@pytest.mark.long
def test_a_cause_that_moves_every_night_is_one_drift_with_one_size_on_every_page(tmp_path: Path) -> None:
    """3.6 and 3.9 µm by alarm, 11.2 µm in all: what stands now counts, and nobody enters a location that is wrong tomorrow."""
    limit = {"what": "volume", "value": 66.0, "low": 65.0, "high": 67.0, "limit": 60.0, "unit": "µm", "passed": False}
    now = [step(3, 3.9, total=0.0075), step(2, 3.6, total=0.0112)]
    records = [
        *(night("HU40T-like", i) for i in (0, 1)),
        night("HU40T-like", 2, "changed", alarms=[step(2, 3.6)]),
        night("HU40T-like", 3, "changed", alarms=[step(3, 3.9)]),
        night("HU40T-like", 4, "out_of_limits", limits=[limit], standing=now),
    ]
    place = cell(tmp_path / "one", records=records)
    for path in ("/", "/alarms", "/machine/HU40T-like"):
        text = asked(place, path).partition("For the engineer")[0]
        assert (
            "C axis has moved along Y by +11 µm since the night ending Mon 26 Oct 2026. It has moved 2 times the same way" in text
        ), path
        assert "3.6 µm" not in text and "3.9 µm" not in text and "7.2 µm" not in text, path
        assert path == "/" or ("off by up to 22 µm" in text and "Enter no new location" in text), path
        assert "Ask who was at the machine" not in text
    machine = asked(place, "/machine/HU40T-like").partition("For the engineer")[0]
    assert (
        "All that were made since Sun 25 Oct 2026: the machine began to change then, although Tue 27 Oct 2026 was still" in machine
    )


def test_one_knock_that_stays_keeps_its_sentence_and_its_advice() -> None:
    knock = step(2, 20.0, total=0.0203)
    (found,) = faults(night("M", 3, "changed", standing=[knock]), (), {}, Units(), texts())
    assert not found["drifts"] and found["todo"] == "Ask who was at the machine." and "40 µm" in found["on_part"]
    half = [step(2, 20.0, total=0.008), step(3, -12.0, total=-0.012)]
    (back,) = faults(night("M", 3, "changed", standing=half), (), {}, Units(), texts())
    assert not back["drifts"] and "by +8 µm since" in back["text"] and "16 µm" in back["on_part"]  # what stands now, no drift


@pytest.mark.parametrize("rest", [{}, {"now": "grows"}], ids=["gone", "one of two"])
def test_a_drift_that_has_gone_back_is_no_drift_and_comes_before_no_knock(rest: dict[str, Any]) -> None:
    """Its mail said "gone again: +0.5 µm is left", its page "Spindle, which drifts: have clamping and screws looked at"."""
    back = say("night.alarms.gone_again_left", told="+0.5 ± 0.5 µm")
    drift = step(2, -3.8, rate_per_day=-0.0019, total=0.0005, now=back)
    record = night("M", 4, "changed", standing=[drift, *([step(3, -3.7, rate_per_day=-0.0019) | rest] if rest else [])])
    (found,) = faults(record, (), {}, Units(), texts())
    assert bool(found["drifts"]) == bool(rest) and bool(found["gone"]) != bool(rest)  # one of its nights alone is not all of it
    if not rest:
        assert "It has gone back since: 0.5 µm of 3.8 µm is left." in found["text"] and "clamping" not in found["todo"]


def test_an_alarm_speaks_of_the_change_and_says_what_the_error_is_in_all() -> None:
    """+20 µm of a change beside −93 µm in all: a man who corrects by the wrong one makes it worse."""
    said = texts()("part.turned", axis="C", angle="180", effect="40.0 µm")  # as nights wrote it before

    def told(whole: float, verdict: str = "changed", **more: Any) -> dict[str, Any]:
        known = {"EY0C": {"value": whole / 1e3, "std": 0.0005, "unit": "mm", "seen": True}}
        record = night("M", 3, verdict, standing=[step(2, 20.0, total=0.02, on_part=said, **more)], parameters=known)
        return faults(record, (), {}, Units(), texts())[0]

    large = told(-93.0)
    assert (
        large["on_part"].startswith("Since the night ending Mon 26 Oct 2026 a part")
        and "40 µm different from before" in large["on_part"]
    )
    assert large["whole"].startswith(
        "The whole error (C axis off in Y), measured in the night ending Tue 27 Oct 2026, is −93 µm; it was −113 µm before the "
        "change."
    )
    assert large["whole"].endswith("It is smaller than before. Correct the whole error, not the change.")
    assert "not the change" in told(50.0)["whole"]
    assert "It is nearly right now: do not correct the change." in told(3.0)["whole"]
    assert "larger than before" in told(20.0)["whole"]
    assert told(3.0, "doubtful")["whole"] == ""  # numbers of such a night are not acted on
    assert "orrect" not in told(20.0, rate_per_day=0.001)["whole"]  # what goes on is corrected by no number


def test_what_does_more_to_a_part_comes_first_and_no_sentence_says_last_night() -> None:
    """Also before what stands behind a limit; what stands there comes before others that were answered."""
    spindle = step(
        1, 12.0, parameter="EX0S", id="2026-10-25-1", on_part_um=12.0, text="spindle has moved by 12 µm since last night"
    )
    limit = {"behind": [{"what": "volume", "parameter": "EX0S", "size": 0.012, "unit": "mm", "text": "x", "since": ""}]}
    found = faults(night("M", 3, "out_of_limits", standing=[step(2, 11.0), spindle], **limit), (), {}, Units(), texts())
    assert [a["parameter"] for a in found] == ["EY0C", "EX0S"]
    assert all("last night" not in a["text"] for a in found) and "since the night ending Sun 25 Oct 2026" in found[1]["text"]


def test_who_is_asked_hears_since_when_and_nobody_is_loud() -> None:
    for days, wanted in ((2, "asked this morning"), (3, "not answered since yesterday"), (5, "not answered for 3 days")):
        (found,) = faults(night("M", days), [step(2, 20.0)], {}, Units(), texts())
        assert found["who"].startswith("Call Ann: ") and wanted in found["who"]
    (found,) = faults(night("M", 2), [step(2, 20.0, owner=None)], {}, Units(), texts())
    assert "NOBODY" in found["who"]


@pytest.mark.long
def test_a_machine_that_is_being_measured_says_neither_yes_nor_no(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night("HU40T-like", 0)])
    run = Recorded(place, 393)
    run.begin()
    for _ in range(170):
        run.touch()
    for path in ("/", "/machine/HU40T-like"):
        text = asked(place, path)
        assert "Measuring" in text and "15 min left" in text and "Keep the door shut" in text, path
        assert not re.findall(r"<b>Yes|>Yes[,<]", text), path
    old = time.time() - 3600  # it was cut off an hour ago: nobody waits for it
    os.utime(place / "readings.journal", (old, old))
    assert "15 min left" not in asked(place, "/") and "reported nothing for 60 min" in asked(place, "/machine/HU40T-like/run")


@pytest.mark.long
def test_a_night_that_stopped_has_no_green_sign_and_says_what_to_do_with_parts(tmp_path: Path) -> None:
    stopped = night("HU40T-like", 1, status="partial", touches=58, planned=84, why="the door was opened")
    place = cell(tmp_path / "one", records=[night("HU40T-like", 0), stopped])
    text = asked(place, "/machine/HU40T-like").partition("For the engineer")[0]
    strip = re.findall(r'<div class="strip">(.*?)</svg>', text, re.DOTALL)[0]
    assert strip.count("<circle") == 2 and strip.count("#00694c") == 1  # one green dot, one half ring
    assert "Last 2 nights" in text and "Nothing was seen in what was measured." in text and "(measurement incomplete)" in text
    assert "only 58 of 84 touches were made" in text and "Put right what stopped it." in text


@pytest.mark.few(0)
def test_the_page_of_alarms_has_no_command_for_a_man_at_the_machine(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night("HU40T-like", 2, "changed", alarms=[step(2, 20.0)], owner="Ann")])
    (place / "nightly.yaml").write_text("nightly: 1\nowner: Ann\nstale_days: 36500\n", encoding="utf-8")
    text = asked(place, "/alarms")
    shown = re.sub(r"<details>.*?</details>", "", text, flags=re.DOTALL)
    assert "Call Ann: asked on " in shown and "tango history" not in shown and str(place) not in text
    assert 'class="alarm-card look"' in text


def test_the_last_night_within_the_limit() -> None:
    nights = [("d", "not_measured"), ("c", "out_of_limits"), ("b", "doubtful"), ("a", "changed")]
    assert last_within(nights) == "a" and last_within(nights[2:]) == "" and last_within([("c", "out_of_limits")]) == ""


def test_dates_are_said_as_people_say_them() -> None:
    t, now = texts(), datetime(2026, 11, 23, 6, 0, tzinfo=UTC)
    for number in range(1, 29):
        told = day(f"2026-02-{number:02d}", t)
        assert told == date(2026, 2, number).strftime("%a ") + f"{number} Feb 2026"
    assert day("never", t) == "never"
    moments = ("23T05:30:00", "23T02:00:00", "20T06:00:00", "12T18:00:00")  # the last: ten days and a half
    assert [ended(f"2026-11-{d}Z", t, now).rpartition(", ")[2] for d in moments] == [
        *("30 min ago", "4 h ago", "3 days ago", "10 days ago")
    ]
    assert "ago" not in ended("2026-11-23T02:00:00Z", t) and ended("", t, now) == ""
    assert "4 h ago" in context(night("M", 0), (), None, t, now=datetime(2026, 10, 24, 6, 4, tzinfo=UTC))["ended"]


def test_parts_to_check_begin_with_the_earliest_open_fault_of_the_machine() -> None:
    """The C axis drifts since the 25th, the spindle moved a night before: parts were off before the limit was crossed."""
    spindle = step(1, 12.0, parameter="EX0S", id="2026-10-25-1")
    record = night("M", 5, "out_of_limits", standing=[step(4, 3.9, total=0.0039), step(2, 3.6, total=0.0112), spindle])
    told = context(record, (), None, texts(), within="2026-10-27")["suspect"]
    assert told.startswith("All that were made since Sat 24 Oct 2026:") and "Tue 27 Oct 2026 was still within" in told
    told = context(record, (), None, texts(), within="2026-10-23")["suspect"]
    assert told == "All that were made since Fri 23 Oct 2026, the last night within the limit."
    seen = [Decision(a["id"], "acknowledge", "Ann") for a in record["standing"]]  # who looks into it has not put it right
    assert "Sat 24 Oct" in context(record | {"verdict": "changed"}, seen, None, texts())["suspect"]


def test_parts_made_beyond_a_limit_before_the_newest_fault_are_named_as_well() -> None:
    """A knock that made the error smaller: the nights before it were beyond the limit, one way back to the 25th."""
    record = night("M", 12, "changed", alarms=[step(12, 20.0)])
    verdicts = {"2026-11-05": "changed", "2026-11-04": "out_of_limits", "2026-11-03": "not_measured", "2026-11-02": "out_of_limits"}
    before = {"2026-11-01": "good", "2026-10-31": "out_of_limits"}
    told = context(record, (), None, texts(), signs=[*verdicts.items(), *before.items()])["suspect"]
    assert told == (
        "All that were made since Wed 4 Nov 2026, the last night without it. "
        "Those since Mon 2 Nov 2026, too: the machine was beyond its limit then."
    )
    inside = [(date, "changed") for date in verdicts]
    assert "Those since" not in context(record, (), None, texts(), signs=inside)["suspect"]


def test_what_tonight_confirmed_is_dated_once_that_night_is_read_later() -> None:
    now = say("night.alarms.confirmed", told="+20.1 ± 0.5 µm")
    fault = faults(night("M", 5, "changed", standing=[step(2, 20.0, total=0.020, now=now)]), (), {}, Units(), texts())[0]
    assert "confirmed by the full measurement of Thu 29 Oct 2026" in fault["text"] and "tonight" not in fault["text"]


@pytest.mark.long
def test_who_has_it_stands_right_below_the_answer_and_nobody_is_loud(tmp_path: Path) -> None:
    for owner, mark in ((None, '<dd class="loud">NOBODY'), ("Ann", "<dd>Call Ann")):
        records = [night("HU40T-like", 2, "changed", alarms=[step(2, 20.0, owner=owner)], owner=owner)]
        text = asked(cell(tmp_path / str(owner), records=records), "/machine/HU40T-like")
        assert re.search(rf'</section>\s*<dl class="facts">\s*<dt>Whom to ask</dt>{mark}', text)


def test_a_night_that_tonight_is_compared_with_keeps_its_date() -> None:
    """The change is of the night that found it; it is warmer than in the night before that."""
    before, found = (night("M", i)["night"] for i in (4, 5))
    text = say("changed.warmer", size="8.0 µm", kelvin="5.8", sensor="bed", now="25.7", then="19.9", night=before)
    (one,) = faults(night("M", 5, "changed", alarms=[step(5, 8.0, cause="temperature", text=text)]), (), {}, Units(), texts())
    assert f"than on {day(before, texts())} (19.9 °C)" in one["text"] and day(found, texts()) not in one["text"]


def test_what_was_done_is_not_ordered_again() -> None:
    """A full measurement that found it again, a compensation written after the drift, a short check in the night to come."""
    do = texts()("cause.axis_location.do")
    for number, wanted in ((7, False), (8, True)):  # night 7 measures in full, night 8 does not
        knock = step(2, 20.0, total=0.0203, do=do)
        (found,) = faults(night("M", number, "changed", standing=[knock]), (), {}, Units(), texts())
        assert ("Run the full measurement" in found["todo"]) is wanted and "have the compensation written" in found["todo"]
    gone = step(2, 20.0, total=0.008, do=do)
    assert "Run the full" in faults(night("M", 7, "changed", standing=[gone]), (), {}, Units(), texts())[0]["todo"]

    drift = [step(3, 3.9, total=0.0075), step(2, 3.6, total=0.0112)]
    other = step(1, 5.0, parameter="EX0S", id="2026-10-25-1", on_part_um=5.0, do=do)
    for written, wanted in (("", True), ("2026-10-24", True), ("2026-10-28", False)):  # on the 27th it moved last
        events = [Compensation(0, f"{written}T12:00:00Z", 1, "table", "written", "", None, None, None)] if written else []
        first, second = faults(night("M", 4, standing=[*drift, other]), (), {}, Units(), texts(), events=events)
        assert ("Enter no new location" in first["todo"]) is wanted and ("written on" in first["todo"]) is not wanted
        assert second["todo"].startswith("End the drift first (C axis). Then: ")
    stopped = night("M", 1, status="partial", touches=58, planned=84, why="the door was opened")
    for kind, wanted in (("check", False), ("full", True)):
        page = render(stopped | {"next": {"kind": kind, "why": ""}}).partition("For the engineer")[0]
        assert ("wait for that of tonight" in page) is wanted


def test_a_compensation_that_was_taken_back_was_not_written() -> None:
    def event(number: int, utc: str, what: str) -> Compensation:
        return Compensation(0, utc, number, "table", what, "", None, None, None)

    events = [event(2, "2026-10-30T06:00:00Z", "rolled back"), event(2, "2026-10-29T06:00:00Z", "written")]
    assert last_written(events) == ""
    assert last_written([*events, event(1, "2026-10-20T06:00:00Z", "written")]) == "2026-10-20"
