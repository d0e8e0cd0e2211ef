"""What stands beside an answer: parts, exit statuses, dates and commands say the same as the answer."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import M, knock, night
from support.pages import plain_of, seen
from support.server import cell

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.nightly import exit_of
from tango_cnc.report.answer import Answer
from tango_cnc.report.morning import context
from tango_cnc.report.orders import parts_since
from tango_cnc.report.repeated import as_found, on_another_day
from tango_cnc.report.texts import texts
from tango_cnc.texts import say
from tango_cnc.web.pages.fleet import brief


def test_parts_of_nights_that_were_within_the_limit_are_not_said_to_be_beyond_it() -> None:
    """Newer readings said No; the parts since 25 Nov "may be beyond the limit", though five nights since then had 55 of 80 µm."""
    drift: dict[str, Any] = {"begun": "2026-11-25", "gone": False, "decision": None, "older": True}
    (told,) = parts_since("2026-11-30", [drift], {}, texts())
    assert "since the night ending Mon 30 Nov 2026: they may be beyond the limit." in told
    assert "Those made since the night ending Wed 25 Nov 2026 may have what has been open since then." in told
    (alone,) = parts_since("2026-11-30", [], {}, texts())
    assert alone == "Check the parts that were made since the night ending Mon 30 Nov 2026: they may be beyond the limit."


@pytest.mark.few(1)
@pytest.mark.parametrize("passed", [True, None])
def test_a_limit_that_is_not_certain_is_no_exit_status_0_anywhere(tmp_path: Path, passed: bool | None) -> None:
    """`tango nightly` and `tango fleet` ended with 0, `--status` with 1, and the page said Yes, but."""
    now = datetime.now(UTC)
    began, end = ((now - timedelta(hours=h)).strftime("%Y-%m-%dT%H:%M:%SZ") for h in (3, 2))
    limit = {"what": "volume", "unit": "µm", "value": 89.6, "low": 88.0, "high": 91.2, "limit": 90.0, "passed": passed}
    record = night(M, 8, limits=[limit], start_utc=began, end_utc=end) | {"night": f"{now.astimezone():%Y-%m-%d}"}
    place, wanted = cell(tmp_path / "one", records=[record]), int(passed is None)
    assert exit_of(record) == wanted and exit_of(record | {"verdict": "changed"}) == 1
    for words in (["fleet", str(place), "--late", "10000"], ["nightly", "-C", str(place), "--status"]):
        assert int(CliRunner().invoke(tango, words, standalone_mode=False).return_value or 0) == wanted, words
    text = plain_of(seen(place, f"/machine/{M}"))
    assert ("allowed, not certain to be within" in text) == ("Yes, but" in text) == bool(wanted)


def test_parts_since_the_last_believed_night_are_in_question_where_the_readings_are_in_doubt() -> None:
    told = context(night(M, 9, "doubtful", last_carried="2026-11-01"), (), None, texts())["suspect"]
    assert told == "All that were made since Sun 1 Nov 2026, the last night that is believed."


def test_a_list_that_is_read_on_another_day_has_no_last_night() -> None:
    """ "+5.4 ± 0.6 µm of it since last night: the alarm … goes on" stood in the status for nights of a week ago."""
    on = say("night.goes_on.text", step="+5.4 ± 0.6 µm", since=say("night.alarms.last_night"), night="2026-11-22")
    alarm = knock(night(M, 8)["night"]) | {"text": say("changed.unknown"), "goes_on": {"step": 0.0054, "std": 0.0006, "text": on}}
    record = night(M, 8, "changed", alarms=[alarm], headline=say("changed.besides", text=alarm["text"], other=on))
    told = on_another_day(as_found(record["headline"], record), record)
    assert "+5.4 ± 0.6 µm of it since the night before: the alarm of 2026-11-22 goes on" in told and "last night" not in told


def test_who_has_an_alarm_reads_on_alarms_how_to_close_it(tmp_path: Path) -> None:
    """Of an alarm that somebody ignores it handed out `acknowledge`, and `--status` `repaired`."""
    alarm = knock(night(M, 8)["night"])
    place = cell(tmp_path / "one", records=[night(M, 7), night(M, 8, "changed", alarms=[alarm])])
    assert "--action acknowledge --owner NAME" in seen(place, "/alarms")
    with opened(place / "history.db") as history:
        until = f"{datetime.now() + timedelta(days=30):%Y-%m-%d}"
        history.decide(M, Decision(alarm["id"], "ignore", "Ann Meier", until=until))
    text = seen(place, "/alarms")
    assert "--action repaired --owner &#39;Ann Meier&#39;" in text and "--action acknowledge" not in text


@pytest.mark.parametrize("held", [False, True])
def test_a_change_and_its_way_back_are_answered_by_one_command(tmp_path: Path, held: bool) -> None:
    """One open alarm, "Without an answer: 1", and two commands below it; --status had one."""
    first = {**knock(night(M, 8)["night"]), "size": 0.0226}
    back = {**knock(night(M, 9)["night"]), "size": -0.0226, "undoes": {"alarm": first["id"], "left": 0.0, "std": 0.0003}}
    records = [night(M, 7), night(M, 8, "changed", alarms=[first]), night(M, 9, "changed", alarms=[back])]
    place = cell(tmp_path / "one", records=records)
    if held:  # before it went back: the way back is asked for by itself
        with opened(place / "history.db") as history:
            history.decide(M, Decision(first["id"], "acknowledge", "Zoë"))
            history.decide(M, Decision(back["id"], "acknowledge", "Zoë"))
    text = seen(place, "/alarms")
    assert "Open alarms: 1." in text or held
    assert text.count("tango history decide") == 1 and f"decide {first['id']} " in text


def test_the_last_decision_counts_whatever_the_clock_of_who_made_the_one_before(tmp_path: Path) -> None:
    """Acknowledged where the clock was a week ahead, then accepted: `decide` said closed, the page "has acknowledged"."""
    alarm = knock(night(M, 8)["night"])
    place = cell(tmp_path / "one", records=[night(M, 7), night(M, 8, "changed", alarms=[alarm])])
    ahead = f"{datetime.now(UTC) + timedelta(days=7):%Y-%m-%dT%H:%M:%SZ}"
    with opened(place / "history.db") as history:
        history.decide(M, Decision(alarm["id"], "acknowledge", "Zoë", utc=ahead))
        history.decide(M, Decision(alarm["id"], "accept", "Ann"))
        assert [d.action for d in history.decisions(M)] == ["acknowledge", "accept"] and not history.open_alarms(M)
    text = plain_of(seen(place, f"/machine/{M}"))
    assert "Zoë" not in text and "Open alarms" not in text


def test_a_machine_that_no_night_has_measured_has_no_age(tmp_path: Path) -> None:
    """ "measured 2 days ago", of a night that failed in its checks, beside "This machine was never measured."."""
    failed = night(M, 8, "not_measured", status="failed", kind="none", why="no answer", volume=None, limits=[], parameters={})
    text = plain_of(seen(cell(tmp_path / "one", records=[failed]), "/"))
    assert "This machine was never measured." in text and "measured 2" not in text and "ago" not in text


def test_alarms_names_a_machine_whose_repair_no_night_has_measured(tmp_path: Path) -> None:
    """ "No alarm is open." stood there, and nothing of a machine that was No: repaired by word alone."""
    alarm = knock(night(M, 8)["night"])
    limit = {"what": "volume", "unit": "µm", "value": 107.0, "low": 106.0, "high": 108.0, "limit": 90.0, "passed": False}
    place = cell(tmp_path / "one", records=[night(M, 7), night(M, 8, "out_of_limits", alarms=[alarm], limits=[limit])])
    with opened(place / "history.db") as history:
        history.decide(M, Decision(alarm["id"], "repaired", "Zoë"))
    text = plain_of(seen(place, "/alarms"))
    assert "No alarm is open." in text and "Make no parts on it." in text and "107 µm, 90 µm allowed" in text
    assert "Run the full measurement: it shows whether the repair has helped." in text


def test_the_row_of_a_machine_that_moved_within_its_run_has_one_since() -> None:
    """ "C axis has moved along Y by +30 µm since then, since Mon 30 Nov 2026"."""
    told = Answer("no", "No", "doubtful", "", "")
    said = "Not to be relied on: the machine moved: C axis has moved along Y by +30 µm since then. Only the full run …"
    assert brief(told, (), False, said, texts(), "2026-11-30")[1].endswith(
        "C axis has moved along Y by +30 µm since then (the night ending Mon 30 Nov 2026)."
    )
