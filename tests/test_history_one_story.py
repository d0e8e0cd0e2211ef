"""A change and its way back are one story under two ids: who closes either has closed both, and every view says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.history.answers import every_decision
from tango_cnc.history.former import formers
from tango_cnc.nightly.again import after_a_repair
from tango_cnc.nightly.standing import standing
from tango_cnc.nightly.words import headline
from tango_cnc.report.faults import earlier, unclosed
from tango_cnc.report.morning import context
from tango_cnc.report.repeated import as_decided
from tango_cnc.report.texts import texts
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

M = "HU40T-like"
KNOCK, BACK = "2026-10-26-020000-1", "2026-10-29-020000-1"
LATER = "2026-11-20"
DAY = 20_771.0  # 2026-11-14


def moved(number: int, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, µm that the C axis has moved along Y → its alarm, as nights write them."""
    dates = [night(M, i)["night"] for i in (number - 1, number)]
    return {
        **{"id": f"{dates[1]}-020000-1", "cause": "axis_location", "parameter": "EY0C", "since": dates[0], "unit": "mm"},
        "text": f"C axis has moved along Y by {um:+.1f} ± 0.3 µm since last night (EY0C)",
        **{"size": um / 1e3, "std": 0.0003, "sigmas": 12.0, "rate_per_day": None, "instead": [], "owner": "Ann", "decision": None},
        **{"on_part_um": abs(2 * um), "on_part": "A part is off.", "do": "Ask who was at the machine."},
        **more,
    }


def story(folder: Path, *decisions: tuple[int, str, str], again: bool = False) -> Path:
    """folder, (night after which it was decided, alarm, action), whether it moves once more → a cell of nights 0 to 7: a knock in
    night 2 has gone back in night 5.
    """
    back = moved(5, -19.0, undoes={"alarm": KNOCK, "left": 0.001, "night": "2026-10-26", "size_before": 0.020})
    alarms = {2: [moved(2, 20.0)], 5: [back], 6: [moved(6, 20.0)] if again else []}
    place = cell(folder, records=[])
    with opened(place / "history.db") as history:
        for number in range(8):
            found = alarms.get(number, [])
            history.add_night(night(M, number, "changed" if found else "good", alarms=found))
            for after, alarm, action in decisions:
                if after == number:
                    until = "2026-12-10" if action == "ignore" else None
                    utc = night(M, number)["end_utc"].replace("T02", "T09")
                    history.decide(M, Decision(alarm, action, "Dora", "", until, utc))
    return place


def views(place: Path) -> dict[str, Any]:
    """cell → what each view of its alarms says that is open, and that somebody has answered and nobody has closed."""
    with opened(place / "history.db") as history:
        (one,) = history.fleet("2026-10-31T08:00:00+00:00")
        (former,) = formers(history, "another", place, within=True, today=LATER)
        open_, decided = unclosed(history, M, LATER)
        asked = {a["id"] for a in history.open_alarms(M, today=LATER)}
        return {
            **{"open": sorted(a["id"] for a in open_), "unanswered": sorted(asked), "count": one.alarms_open},
            **{"held": one.alarms_held, "former": sorted(a["id"] for a in former.alarms), "former_held": len(former.held)},
            "missing": sorted(a["id"] for a in open_ if a["id"] not in decided),
            "standing": sorted(a["id"] for a in standing(history, M, DAY, night(M, 7)["parameters"], "full")),
        }


NOTHING = {"open": [], "unanswered": [], "count": 0, "held": 0, "former": [], "former_held": 0, "missing": [], "standing": []}


@pytest.mark.few(1)
@pytest.mark.parametrize("action", ["repaired", "accept"])
@pytest.mark.parametrize("end", [KNOCK, BACK])
@pytest.mark.parametrize("before", [(), ((2, KNOCK, "acknowledge"),), ((6, BACK, "acknowledge"),)])
def test_who_closes_either_end_of_a_story_has_closed_both(tmp_path: Path, action: str, end: str, before: Any) -> None:
    assert views(story(tmp_path / "one", *before, (7, end, action))) == NOTHING


@pytest.mark.parametrize("end", [KNOCK, BACK])
def test_who_ignores_an_end_of_a_story_does_not_want_to_hear_of_either(tmp_path: Path, end: str) -> None:
    told = views(story(tmp_path / "one", (7, end, "ignore")))
    assert told["open"] == [KNOCK, BACK] and told["held"] == told["former_held"] == 2  # not closed, and both have an answer
    assert (told["unanswered"], told["count"], told["former"], told["missing"], told["standing"]) == ([], 0, [], [], [])


def test_who_answered_before_it_went_back_did_not_know_it(tmp_path: Path) -> None:
    told = views(story(tmp_path / "one", (3, KNOCK, "acknowledge")))
    assert told["unanswered"] == told["missing"] == told["former"] == [BACK] and told["count"] == told["held"] == 1
    assert told["open"] == told["standing"] == [KNOCK, BACK]
    assert views(story(tmp_path / "known", (6, KNOCK, "acknowledge")))["count"] == 0  # this one did


def test_a_repair_that_was_told_while_the_night_measured_is_what_went_back(tmp_path: Path) -> None:
    assert views(story(tmp_path / "one", (4, KNOCK, "repaired"))) == NOTHING
    accepted = views(story(tmp_path / "two", (4, KNOCK, "accept")))  # what was accepted is not there any more
    assert accepted["open"] == accepted["unanswered"] == accepted["standing"] == [BACK] and accepted["count"] == 1


@pytest.mark.parametrize("end", [KNOCK, BACK])
def test_what_moves_after_it_has_gone_back_stands_by_itself(tmp_path: Path, end: str) -> None:
    told = views(story(tmp_path / "one", (7, end, "repaired"), again=True))
    again = ["2026-10-30-020000-1"]
    assert told["open"] == told["unanswered"] == told["missing"] == told["standing"] == again and told["count"] == 1


@pytest.mark.few(1)
@pytest.mark.parametrize("end", [KNOCK, BACK])
def test_what_comes_back_after_either_was_repaired_names_that_repair(tmp_path: Path, end: str) -> None:
    place = story(tmp_path / "one", (7, end, "repaired"))
    with opened(place / "history.db") as history:
        again, other = after_a_repair(history, M, [moved(12, 20.0), moved(12, -20.0)])
    assert again["again"]["owner"] == "Dora" and "again" not in other


@pytest.mark.few(2)
@pytest.mark.parametrize("end", [KNOCK, BACK])
@pytest.mark.parametrize("action", ["repaired", "accept"])
def test_until_the_next_night_both_are_one_closed_story(tmp_path: Path, end: str, action: str) -> None:
    """The night before the answer had both ends of it."""
    place = story(tmp_path / "one")
    gone = say("night.alarms.gone_again_left", told="+1.0 ± 0.3 µm")
    back = moved(5, -19.0, undoes={"alarm": KNOCK, "left": 0.001}, total=-0.019, night="2026-10-29", now="")
    knock = moved(2, 20.0, total=0.001, night="2026-10-26", now=gone)
    with opened(place / "history.db") as history:
        history.add_night(night(M, 8, "changed", standing=[back, knock]))
        history.decide(M, Decision(end, action, "Dora", "", None, night(M, 8)["end_utc"].replace("T02", "T09")))
        record, decisions = history.records(M, 1)[0], every_decision(history, M)
        found, last = unclosed(history, M, LATER)
    for given in (decisions, tuple(last.values())):
        page = context(record, given, None, texts(), waiting=earlier(found))
        assert page["count"] == 0 and not page["also"] and page["first"]["decision"].owner == "Dora"
        assert "It has gone back since: 1 µm of 20 µm is left." in page["first"]["text"] and page["done"]
        assert ("it shows whether the repair has helped" in " ".join(page["todo"])) == (action == "repaired")


@pytest.mark.few(1)
@pytest.mark.parametrize("end", [KNOCK, BACK])
def test_no_page_and_no_command_names_a_repair_as_a_fault(tmp_path: Path, end: str) -> None:
    place = story(tmp_path / "one", (7, end, "repaired"))
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        pages = {path: client.get(path).text for path in ("/", "/alarms", f"/machine/{M}", "/metrics")}
    assert f'tango_machine_alarms_open{{machine="{M}"}} 0' in pages["/metrics"]
    for path in ("/", "/alarms", f"/machine/{M}"):
        standing_there = pages[path].partition("Decisions")[0]  # below that, what somebody has answered
        assert "Ask who was" not in standing_there and "by −19" not in standing_there and "Answer this" not in standing_there, path
    shown = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(place)]).output
    assert "open alarm" not in shown and BACK not in shown and KNOCK not in shown


def test_a_night_that_told_a_repair_and_its_way_back_tells_the_repair_alone() -> None:
    """Nights before this held have both: the repair that helped, and the alarm that it undoes, still standing."""
    back = moved(5, -19.0, undoes={"alarm": KNOCK, "left": 0.001}, total=-0.019, night="2026-10-29", now="")
    other = moved(6, 15.0, parameter="EX0S", total=0.015)
    helped = {"alarm": KNOCK, "text": "as before, after the repair by Dora on 2026-10-30: all of it", "since": "2026-10-25"}
    record = night(M, 7, "changed", standing=[back, other], repaired=[helped])
    closed = Decision(back["id"], "repaired", "Dora", utc=night(M, 6)["end_utc"])
    head = headline(record)
    assert "nobody has answered" in head and "as before, after the repair" in head
    told = as_decided(record | {"headline": head}, (closed,))
    assert "Dora has repaired it" in told and "nobody has answered" not in told and "as before, after the repair" in told
    page = context(record, (Decision(KNOCK, "repaired", "Dora", utc=night(M, 6)["end_utc"]),), None, texts())
    assert page["first"]["id"] == other["id"] and not page["also"] and page["count"] == 1
    assert page["suspect"].startswith("All that were made since Thu 29 Oct 2026")


def test_nobody_has_answered_and_it_is_one_open_alarm_in_every_count(tmp_path: Path) -> None:
    """One on the pages, two in the fleet, in /metrics and in the headline ("more open alarms: 1")."""
    place = story(tmp_path / "one")
    told = views(place)
    assert told["unanswered"] == told["former"] == [KNOCK] and told["count"] == 1 and told["held"] == 0
    assert views(story(tmp_path / "again", again=True))["count"] == 2  # and what moved after that
    back = moved(5, -19.0, undoes={"alarm": KNOCK, "left": 0.001}, night="2026-10-29", now="")
    knock = moved(2, 20.0, night="2026-10-26", now=say("night.alarms.gone_again_left", told="+1.0 ± 0.3 µm"))
    for alarms, standing_ in (([back], [knock]), ([], [back, knock]), ([], [knock, back])):
        record = night(M, 8, "changed", alarms=alarms, standing=standing_) | {"repaired": []}
        record["headline"] = headline(record)
        assert "more open alarms" not in record["headline"] and "more open alarms" not in as_decided(record, ())
    other = moved(7, 9.0, night="2026-10-31", now="")
    record = night(M, 8, "changed", standing=[other, back, knock]) | {"repaired": []}
    record["headline"] = headline(record)
    assert "more open alarms: 1" in record["headline"] and "more open alarms: 1" in as_decided(record, ())
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        assert f'tango_machine_alarms_open{{machine="{M}"}} 1' in client.get("/metrics").text
    shown = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(place)]).output
    assert shown.count("open alarm") == 1
