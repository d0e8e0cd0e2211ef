"""One number, one headline and one order wherever a machine is listed: pages, `/metrics`, `tango fleet` and `--status`."""

from __future__ import annotations

import json
import re
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.alarms import alarm, warm
from support.nights import M, night
from support.pages import site_of
from support.server import cell

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.loaded import Happened
from tango_cnc.nightly.words import headline
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.texts import say

UTC = "2026-11-02T08:00:00Z"


def standing(a: dict[str, Any]) -> dict[str, Any]:
    """→ the record of a night after that of the alarm, which nobody has answered."""
    record = night(M, 8, "changed", standing=[a | {"total": a["size"]}])
    return record | {"headline": headline(record)}


def told(*command: str) -> Any:
    return json.loads(CliRunner().invoke(tango, [*command, "--json", "-"], catch_exceptions=False).output)


def decide(place: Path, a: dict[str, Any], action: str) -> None:
    until = date.today().isoformat() if action == "ignore" else None
    with opened(place / "history.db") as history:
        history.decide(M, Decision(a["id"], action, "Emil", "", until))


def test_json_has_the_headline_of_the_table_with_who_has_answered(tmp_path: Path) -> None:
    """`tango fleet --json` said that nobody had answered an alarm that somebody had."""
    a = alarm(6, 20.0)
    place = cell(tmp_path / "one", records=[night(M, 6, "changed", alarms=[a]), standing(a)])

    def said() -> tuple[str, str]:
        (machine,) = told("fleet", str(place))["machines"]
        return machine["last"]["headline"], told("nightly", "-C", str(place), "--status")["nights"][0]["headline"]

    assert all("nobody has answered" in x and "Emil" not in x for x in said())
    decide(place, a, "acknowledge")
    assert all("Emil has it" in x and "nobody" not in x for x in said())
    for command in (("fleet", str(place)), ("nightly", "-C", str(place), "--status")):
        text = " ".join(CliRunner().invoke(tango, command, catch_exceptions=False).output.split())
        assert "Emil has it" in text, command


@pytest.mark.parametrize(("action", "who"), [("acknowledge", "Emil has it since "), ("ignore", "Emil ignores it until ")])
def test_the_status_lists_an_alarm_that_somebody_has_until_it_is_closed(tmp_path: Path, action: str, who: str) -> None:
    """It was in no line of its own: only one without an answer was, though the pages counted both as open."""
    a = alarm(6, 20.0)
    place = cell(tmp_path / "one", records=[night(M, 6, "changed", alarms=[a]), standing(a)])

    def said() -> tuple[str, list[str], int]:
        done = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"], standalone_mode=False)
        lines = [x for x in done.output.splitlines() if f"open alarm {a['id']}: " in x]
        return "".join(lines), [x["id"] for x in told("nightly", "-C", str(place), "--status")["held_alarms"]], done.return_value

    assert "--action acknowledge --owner NAME" in said()[0] and said()[1] == []
    decide(place, a, action)
    line, held, status = said()
    assert who in line and "--action repaired --owner Emil" in line and held == [a["id"]] and status == 1
    decide(place, a, "accept")
    assert said()[:2] == ("", [])


def test_a_change_has_one_date_in_every_line_of_the_status(tmp_path: Path) -> None:
    """Nine lines apart one change was since the 29th, the night before it, and since the night ending on the 30th."""
    a = alarm(6, 20.0)
    place = cell(tmp_path / "one", records=[night(M, 6, "changed", alarms=[a]), standing(a)])
    text = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"], catch_exceptions=False).output
    assert len(re.findall(r"since the night ending 2026-10-30", text)) >= 2 and a["since"] == "2026-10-29"
    assert "since 2026-10-29" not in text


@pytest.mark.few(1)
@pytest.mark.parametrize(("action", "counts"), [("", (1, 1)), ("acknowledge", (1, 0)), ("ignore", (1, 0)), ("accept", (0, 0))])
def test_metrics_count_open_alarms_as_the_pages_do_and_those_without_an_answer_apart(
    tmp_path: Path, action: str, counts: tuple[int, int]
) -> None:
    """An alarm that somebody has and nobody has closed was open on the pages and none in `/metrics`."""
    a = alarm(6, 20.0)
    place = cell(tmp_path / "one", records=[night(M, 6, "changed", alarms=[a]), standing(a)])
    if action:
        decide(place, a, action)
    with site_of(place, late_hours=1e6) as client:
        text, page = client.get("/metrics").text, client.get(f"/machine/{M}").text
    names = ("open", "unanswered")
    assert tuple(int(re.findall(rf"tango_machine_alarms_{n}{{[^}}]*}} (\d+)", text)[0]) for n in names) == counts
    assert ("Open alarms: 1" in " ".join(re.sub(r"<[^>]+>", " ", page).split())) == bool(counts[0])


def test_metrics_count_what_is_one_cause_once_also_without_an_answer(tmp_path: Path) -> None:
    """Three open and three unanswered, where the page had three open, two without an answer."""
    a, b = alarm(4, 20.0), alarm(6, 9.0)
    place = cell(tmp_path / "one", records=[night(M, 4, "changed", alarms=[a]), night(M, 6, "changed", alarms=[b], standing=[a])])
    with site_of(place, late_hours=1e6) as client:
        text = client.get("/metrics").text
    assert all(f'tango_machine_alarms_{n}{{machine="{M}"}} 1' in text for n in ("open", "unanswered"))
    (machine,) = told("fleet", str(place))["machines"]
    assert (machine["alarms_unanswered"], machine["alarms_open"], machine["alarms_held"]) == (2, 2, 0)
    line = CliRunner().invoke(tango, ["fleet", str(place)]).output.splitlines()[1]
    assert re.search(r"changed +1 ", line), line  # its table had two


@pytest.mark.parametrize("older", ["", "acknowledge"])
def test_the_box_says_since_when_nobody_has_answered_also_where_last_night_found_something_else(older: str) -> None:
    """Of an alarm of last night nobody can have answered yet; that of an earlier one waited just as on other machines."""
    first, tonight = alarm(2, 20.0), warm(8, 9.0)
    done = (Decision(first["id"], older, "Emil", "", None, UTC),) if older else ()
    why = context(night(M, 8, "changed", alarms=[tonight], standing=[first]), done, None, texts())["answer"].why
    assert ("nobody has answered since Mon 26 Oct 2026" in why) == (not older)
    assert "1 Nov" not in why


@pytest.mark.few(0)
def test_machines_stand_in_one_order_in_the_list_and_on_alarms(tmp_path: Path) -> None:
    """A machine whose large fault was repaired stood before others by that fault, and after them on Alarms by what was open."""
    large, small, middle = alarm(6, 30.0), alarm(6, 4.0, parameter="EY0C"), alarm(6, 12.0)
    places = []
    for name, alarms in (("a repaired", [large, small]), ("b middle", [middle])):
        record = night(name, 8, "changed", standing=alarms)
        places.append(cell(tmp_path / name[0], name, [night(name, 6, "changed", alarms=alarms), record]))
    with opened(places[0] / "history.db") as history:
        history.decide("a repaired", Decision(large["id"], "repaired", "Emil", "", None, UTC))
    with site_of(*places, late_hours=1e6) as client:
        for path in ("/", "/alarms"):
            text = client.get(path).text
            assert text.index("b middle") < text.index("a repaired"), path


@pytest.mark.parametrize("written", [False, True])
def test_a_compensation_that_is_written_takes_no_size_back_to_that_of_its_alarm(written: bool) -> None:
    """The page said 20 µm, that of the alarm's night, without a date; `--status` had the 9 µm of the newest night."""
    record = night(M, 8, "changed", standing=[alarm(6, 20.0, total=0.009, now=say("night.alarms.now", told="+9.0 ± 0.4 µm"))])
    events = (Happened("2026-11-01T10:00:00Z", 1, "linuxcnc", "written"),) if written else ()
    text = context(record, (), None, texts(), events=events)["first"]["text"]
    assert "has moved along X by +9 µm since" in text and "still there" not in text
    assert "That is the number of the night ending Sun 1 Nov 2026; in the night of the alarm" in text
