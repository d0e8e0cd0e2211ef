"""Order and numbers of what stands below the answer: what does more to a part first, each number with what it is of."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.alarms import alarm, warm
from support.nights import M, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.commands.report import nights
from tango_cnc.files import read_cell
from tango_cnc.history import Decision, opened
from tango_cnc.nightly.lengths import as_seen_last
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.standing import by_urgency, standing
from tango_cnc.report.days import day
from tango_cnc.report.faults import earlier, faults
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.report.tonight import by_tonight
from tango_cnc.report.units import Units
from tango_cnc.texts import joined, say
from tango_cnc.texts.number import number
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

UTC = "2026-11-02T08:00:00Z"


def decided(a: dict[str, Any], action: str) -> Decision:
    return Decision(a["id"], action, "Emil", "", "2026-12-10" if action == "ignore" else None, UTC)


@pytest.mark.parametrize("less", ["", "acknowledge", "ignore"])
@pytest.mark.parametrize("more", ["", "acknowledge", "ignore"])
def test_what_does_more_to_a_part_stands_first_whoever_has_it(more: str, less: str) -> None:
    axis, heat = alarm(2, 18.6, total=0.0186), warm(6, 18.9)
    decisions = {a["id"]: decided(a, what) for a, what in ((axis, more), (heat, less)) if what}
    found = faults(night(M, 9, "changed"), earlier([heat, axis]), decisions, Units(), texts())
    assert [a["id"] for a in found] == [axis["id"], heat["id"]]


def test_what_is_closed_or_of_the_probe_or_has_gone_back_comes_after_what_does_more() -> None:
    small, large = alarm(3, 4.0, parameter="EY0C", total=0.004), alarm(2, 30.0, total=0.030)
    stylus = alarm(4, 90.0, cause="stylus", parameter="stylus", on_part_um=None)
    decisions = {large["id"]: decided(large, "accept")}
    found = faults(night(M, 9, "changed", standing=[large, stylus, small]), (), decisions, Units(), texts())
    assert [a["id"] for a in found] == [small["id"], stylus["id"], large["id"]]
    gone = alarm(2, 30.0, total=0.001, now=say("night.alarms.gone_again_left", told="+1.0 ± 0.3 µm"))
    found = faults(night(M, 9, "changed", standing=[gone, small]), (), {}, Units(), texts())
    assert [(a["id"], a["gone"]) for a in found] == [(small["id"], False), (gone["id"], True)]


def test_the_error_at_the_tool_tip_says_that_it_is_of_all_causes() -> None:
    """75 µm before the first of two causes, 61 now: "smaller than before" below the second, which has made it larger."""
    volumes = {night(M, 1)["night"]: 75.0}
    record = night(
        M, 9, "changed", volume={"worst_um": 61.0, "std_um": 0.5}, standing=[warm(6, 90.0), alarm(2, 18.6, total=0.0186)]
    )
    both = context(record, (), None, texts(), volumes=volumes)
    assert both["first"]["cause_key"] == "temperature"
    assert both["grown"].startswith("All causes together: 75 µm on") and "smaller than before" in both["grown"]
    one = context(record | {"standing": [alarm(2, 18.6, total=0.0186)]}, (), None, texts(), volumes=volumes)
    assert one["grown"].startswith("75 µm on")
    closed = Decision(warm(6, 90.0)["id"], "accept", "Ann", utc=UTC)
    assert context(record, (closed,), None, texts(), volumes=volumes)["grown"].startswith("75 µm on")


@pytest.mark.few(1)
@pytest.mark.parametrize("grown", [True, False])
@pytest.mark.parametrize("word", ["now", "still_there", "confirmed", "was", "later"])
def test_an_open_alarm_has_one_size_at_the_computer(tmp_path: Path, word: str, grown: bool) -> None:
    """It had that of its night and that of last night in one line: +18.6 and +24.1 µm, or +18.6 and +18.9."""
    told, total = ("+24.1 ± 0.3 µm", 0.0241) if grown else ("+18.9 ± 0.3 µm", 0.0189)
    now: Any = say(
        f"night.alarms.{'now' if word == 'later' else word}", told=told, **({"night": "2026-11-01"} if word == "was" else {})
    )
    if word == "later":
        now = joined("; ", (now, say("night.alarms.came", size="+5.5 ± 0.3 µm", night="2026-10-30")))
    stands = alarm(2, 18.6, total=total, now=now)
    records = [night(M, 2, "changed", alarms=[alarm(2, 18.6)]), night(M, 9, "changed", standing=[stands])]
    place = cell(tmp_path / "one", records=records)
    said = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(place)]).output
    line = next(x for x in said.splitlines() if "open alarm 2026-10-26" in x)
    assert re.findall(r"[+−-][\d.]+ ± [\d.]+ µm", line) == ["+24.1 ± 0.3 µm" if grown else "+18.6 ± 0.3 µm"], line


@pytest.mark.parametrize("later", [False, True])
def test_an_open_alarm_of_another_night_has_its_temperature_in_the_past_at_the_computer(tmp_path: Path, later: bool) -> None:
    records = [night(M, 6, "changed", alarms=[warm(6, 18.9)])]
    records += [night(M, 9, "changed", standing=[warm(6, 18.9, total=None)])] if later else []
    said = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(cell(tmp_path / "one", records=records))]).output
    line = next(x for x in said.splitlines() if "open alarm 2026-10-30" in x)
    assert ("on 2026-10-30 the machine was 6.1 K warmer" in line) == later and ("the machine is 6.1 K" in line) != later


def test_what_has_gone_again_says_at_the_computer_what_is_left(tmp_path: Path) -> None:
    left = alarm(2, 18.6, total=0.0004, now=say("night.alarms.gone_again_left", told="+0.4 ± 0.3 µm"))
    records = [night(M, 2, "changed", alarms=[alarm(2, 18.6)]), night(M, 9, "changed", standing=[left])]
    said = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(cell(tmp_path / "one", records=records))]).output
    assert "by +18.6 ± 0.3 µm since" in said and "gone again: +0.4 ± 0.3 µm is left" in said


@pytest.mark.parametrize("key", ["changed.most", "changed.off"])
def test_a_report_knows_a_share_of_the_night_from_a_change(tmp_path: Path, key: str) -> None:
    values = {"name": "EX0C", "size": "-90.6 ± 0.4 µm", "share": "121.9 µm", "what": "C axis", "letter": "X", "since": "2026-10-26"}
    limit = {"what": "volume", "value": 137.0, "unit": "µm", "low": 136, "high": 138, "limit": 120.0, "passed": False}
    behind = {
        "what": "volume",
        "parameter": "EX0C",
        "text": say(key, **values),
        "since": "",
        "size": -0.09,
        "std": 0.0004,
        "unit": "mm",
    }
    behind |= {"on_part": "A part is off.", "do": "Have it compensated.", "rate_per_day": None, "cause": "axis_location"}
    place = cell(tmp_path / "one", records=[night(M, 9, "out_of_limits", limits=[limit], behind=[behind])])
    found = nights(place, read_cell(place).machine, Units(), texts())
    assert found is not None and found.share == (key == "changed.most") and "C axis" in found.cause


@pytest.mark.few(0)
def test_curves_of_one_page_write_their_dates_in_one_way(tmp_path: Path) -> None:
    with TestClient(create(Settings((cell(tmp_path / "one"),))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        for query in ("", "?parameter=EX0C"):
            text = client.get(f"/machine/{M}/trend{query}").text
            axes = re.findall(r">([^<>]* … [^<>]*\d{4}[^<>]*)</text>", text)
            assert axes and set(axes) == {"Sat 24 Oct 2026 … Sun 22 Nov 2026"}, axes


PAST = "On Fri 30 Oct 2026 the machine was 6.1 K warmer (bed 26.0 °C) than on Thu 29 Oct 2026 (19.9 °C) and had moved with it"


def test_a_temperature_of_another_night_is_told_with_that_night(tmp_path: Path) -> None:
    """Tonight has another one: the page beside it says 25.9 °C."""
    (tonight,) = faults(night(M, 6, "changed", alarms=[warm(6, 18.9)]), (), {}, Units(), texts())
    assert tonight["text"].startswith("The machine is 6.1 K warmer (bed 26.0 °C) than on Thu 29 Oct 2026")
    for old in (night(M, 9, "changed", standing=[warm(6, 18.9)]), night(M, 9)):  # as nights before this wrote it, too
        waits = () if old.get("standing") else earlier([warm(6, 18.9)])
        (one,) = faults(old, waits, {}, Units(), texts())
        assert one["text"].startswith(PAST), one["text"]
    (late,) = faults(night(M, 6, "changed", alarms=[warm(6, 18.9)]), (), {}, Units(), texts(), today="2026-11-02")
    assert late["text"].startswith(PAST)
    with opened(tmp_path / "h.db") as history:
        for number in range(9):
            history.add_night(night(M, number, alarms=[warm(6, 18.9)] if number == 6 else []))
        (stands,) = standing(history, M, 20_756.0, night(M, 8)["parameters"], "check")
    assert "on 2026-10-30 the machine was 6.1 K warmer (bed 26.0 °C)" in stands["text"] and "machine is" not in stands["text"]


def test_what_to_do_about_a_warm_night_has_its_date_later_on() -> None:
    values = {"kelvin": "6.1", "sensor": "bed", "now": "26.0", "then": "19.9", "night": night(M, 5)["night"], "follows": ""}
    do = say("night.sensors.colder_do", do="Ask who was at the machine.", **values)
    (tonight,) = faults(night(M, 6, "changed", alarms=[alarm(6, 20.0, do=do)]), (), {}, Units(), texts())
    assert "the machine is 6.1 K colder" in tonight["todo"]
    (later,) = faults(night(M, 9, "changed", standing=[alarm(6, 20.0, total=0.020, do=do)]), (), {}, Units(), texts())
    assert "on Fri 30 Oct 2026 the machine was 6.1 K colder (bed 26.0 °C)" in later["todo"] and "Ask who was" in later["todo"]


@pytest.mark.few(0)
def test_every_page_has_the_temperature_of_an_older_alarm_in_the_past(tmp_path: Path) -> None:
    records = [night(M, number) for number in range(10)]
    records[6] |= {"verdict": "changed", "alarms": [warm(6, 18.9)]}
    records[9] |= {"verdict": "changed", "standing": [warm(6, 18.9)]}
    place = cell(tmp_path / "one", records=records)
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        for path in ("/", "/alarms", f"/machine/{M}", f"/machine/{M}/trend"):
            text = client.get(path).text.partition("Nights</h2>")[0]
            assert PAST in text and "The machine is 6.1 K" not in text, path


def test_what_has_gone_again_stands_behind_what_is_there_and_a_stylus_that_may_be_an_axis_is_on_parts() -> None:
    """For a week the page began with a warm night that had gone again, and gave no order about the 21 µm that were there; "No
    others" stood above the 36 µm that parts may have.
    """
    t, date = texts(), night(M, 9)["night"]
    heat = warm(2, 90.0) | {"now": say("night.alarms.gone_again_left", told="0.5 µm"), "total": 0.0005}
    axis = say("part.pivot_since", axis="A", effect="36 µm", since=date, angle=120)
    stylus = alarm(6, 36.0, cause="stylus", parameter="stylus", do="Look at the stylus.", on_part=axis, total=None)
    record = night(M, 9, "changed", standing=[heat, stylus])
    page = context(record, (), None, t, machine=None)
    assert [a["id"] for a in (page["first"], *page["also"])] == [stylus["id"], heat["id"]]
    assert "Look at the stylus." in page["todo"] and page["todo"][0] == "Measure the first part before you go on."
    assert page["suspect"].startswith("All that were made since") and "No others" not in page["suspect"]
    alone = stylus | {"on_part": "Parts are not affected."}
    assert "No others" in context(night(M, 9, "changed", standing=[alone]), (), None, t)["suspect"]
    assert [a["id"] for a in by_urgency([heat, stylus])] == [stylus["id"], heat["id"]]


def test_a_night_that_measured_nothing_keeps_the_length_that_the_last_one_has_seen() -> None:
    """The message of the night before said 21.0 µm and 36 µm on a part, that of the night after it 6.1 µm and 10.6 µm."""
    old = alarm(6, 6.1, cause="stylus", parameter="stylus", total=None)
    seen = old | {"now": say("night.alarms.now", told="21.0 ± 1.0 µm"), "total": 0.021}
    records = [night(M, 9, "not_measured"), night(M, 8, "changed", standing=[seen])]
    (told,) = as_seen_last([old], records)
    assert told["total"] == 0.021 and told["now"] == f"it was 21.0 ± 1.0 µm in the night ending {records[1]['night']}"
    assert by_tonight(told)["on_part_um"] == pytest.approx(2 * 21.0)
    (drift,) = as_seen_last([old | {"rate_per_day": 0.002}], [records[0], {**records[1], "standing": [seen | {"stands": "x"}]}])
    assert drift["stands"] == "x" and "stands" not in told  # "it goes on night after night", which had stood still for days
    assert as_seen_last([old], records[:1]) == [old] and as_seen_last([old | {"cause": "table"}], [])[0]["total"] is None


def test_a_night_that_hardly_knows_how_far_it_is_by_now_gives_no_other_number() -> None:
    """-35.7 ± 37.8 µm of a change of −30 µm: the list and every page said that it had moved by −36 µm."""
    date = night(M, 9)["night"]
    old = alarm(2, -29.9, total=-0.0357, now=say("night.alarms.still_there", told=number(-35.7, "µm", 37.8)))
    (found,) = faults(night(M, 9, "changed", standing=[old]), (), {}, Units(), texts())
    assert "by −30 µm" in found["text"] and "36" not in found["text"] and found["on_part_um"] == pytest.approx(59.8)
    assert f"How much of it is there by now, the night ending {day(date, texts())} could not tell." in found["text"]
    sure = old | {"now": say("night.alarms.still_there", told=number(-35.7, "µm", 0.4))}
    (found,) = faults(night(M, 9, "changed", standing=[sure]), (), {}, Units(), texts())
    assert "by −36 µm" in found["text"]


def test_a_drift_has_one_order_in_the_message_and_its_page_counts_no_alarms() -> None:
    """ "Have the compensation written" stood above "Enter no new location before it stands still", and six nights of a drift
    were "2 times the same way".
    """
    u, t, date = Units(), texts(), night(M, 9)["night"]
    knocked = alarm(4, -2.5, "EY0C", total=-0.0112, do=say("cause.axis_location.do"), confirmed=night(M, 5)["night"])
    drift = alarm(6, -4.3, "EY0C", total=-0.0087, do=say("night.drift_do"), rate_per_day=-0.0021, steady=True)
    record = night(M, 9, "changed", standing=[knocked, drift])
    (found,) = faults(record, (), {}, u, t)
    assert "by −11 µm" in found["text"] and "It goes on night after night: a drift, not one knock." in found["text"]
    mail = message(record, (), ())[1]
    assert mail.count("Enter no new location") == 2 and "compensation written" not in mail and date in mail
    away = message(record | {"standing": [knocked, drift | {"size": 0.0043}]}, (), ())[1]
    assert "compensation written" in away  # the other way is another story
    stood = message(record | {"standing": [knocked, drift | {"stands": night(M, 7)["night"]}]}, (), ())[1]
    assert "before it stands still" not in stood and stood.count(str(say("morning.drift_stood_do"))) == 2


def test_what_went_back_tonight_has_the_date_of_tonight_in_both_its_alarms() -> None:
    """ "And the day on which it went back" stood below "and 2026-11-13, the first night without it again"."""
    went = alarm(7, 60.0, total=0.0001, now=say("night.alarms.gone_again_left", told="-0.1 µm"))
    back = alarm(9, -60.0, undoes={"alarm": went["id"], "left": 0.0001, "std": 0.0003}, decision=None, sigmas=50.0)
    mail = message(night(M, 9, "changed", alarms=[back], standing=[went]), (), ())[1]
    assert mail.count(f"and {night(M, 9)['night']}, the first night without it again") == 2 and "the day on which" not in mail
