"""What the dates on record say of a night: nights that are missing, a clock that went back."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from support.answers import answered
from support.histories import knowledge, record
from support.nights_parts import Event, Story

from tango_cnc.history import opened
from tango_cnc.history.clock import asks, in_future, told
from tango_cnc.history.store import History
from tango_cnc.nightly.dates import clock_wrong, dated
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.words import headline
from tango_cnc.report import morning

MEASURED = datetime(2026, 10, 3, 2, 0, tzinfo=UTC)


def dates_of(history: History, clock: datetime) -> dict[str, Any]:
    return dated({}, history.as_of(lambda: clock), "M", clock, 1.0)


def test_a_clock_that_went_back_is_said(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(3), "touch\n1\n", knowledge(3))
        assert dates_of(history, MEASURED + timedelta(days=1)) == dates_of(history, MEASURED - timedelta(minutes=30)) == {}
        found = dates_of(history, MEASURED - timedelta(days=9))
        assert dated({}, history, "M", MEASURED - timedelta(days=9), 1.0) == {}, "an import has no clock"
    assert found == {"clock_back": record(3)["night"]}
    rest = {"limits": [], "preflight": [], "status": "complete", "machine_time_s": 60.0, "planned": 1, "cell": "c"}
    night = record(1) | rest | found
    assert "a night on record is dated 2026-10-03" in headline(night)
    assert "Look at the date and time of this computer" in message(night | {"headline": headline(night)}, (), ())[1]


def test_a_night_with_a_clock_that_was_ahead_hides_no_later_one(tmp_path: Path) -> None:
    """One night was dated 25 days too late; the next one, by a right clock, is the newest."""
    alarm = {"id": "1", "text": "it moved"}
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(2), "touch\n1\n", knowledge(2))
        history.add_night(record(28, alarms=[alarm]), "touch\n1\n", knowledge(28))
        history.add_night(record(3), "touch\n1\n", knowledge(3))
        assert history.nights("M")[0].night == "2026-10-28"
        right = history.as_of(lambda: MEASURED + timedelta(hours=4))
        assert [n.night for n in right.nights("M")] == ["2026-10-03", "2026-10-02"]
        assert [n.night for n in right.nights("M", last=1)] == ["2026-10-03"]
        known, last = right.latest_knowledge("M"), right.last("M")
        assert known is not None and known[0].night == "2026-10-03"
        assert last is not None and last.night.night == "2026-10-03"
        assert right.alarmed("M") == () and len(right.records("M")) == 2
        assert right.trend("M", right.parameters("M")[0]).nights[-1] == "2026-10-03"
        (standing,) = right.fleet((MEASURED + timedelta(days=3)).isoformat())
        assert standing.last is not None and standing.last.night == "2026-10-03" and standing.late
        assert standing.nights == 2 and standing.alarms_open == 0
        assert [n.night for n in right.ahead("M")] == ["2026-10-28"] and history.ahead("M") == ()
        assert in_future(right, "M") is None, "a night after it has measured"


def test_what_a_night_with_a_date_in_the_future_has_found_is_told_until_the_next_one(tmp_path: Path) -> None:
    """A clock that was a week ahead for one night: by the right clock its alarm was on no list."""
    alarm = {"id": "1", "text": "it moved"}
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(2), "touch\n1\n", knowledge(2))
        history.add_night(record(10, alarms=[alarm], verdict="changed", headline="it moved"), "touch\n1\n", knowledge(10))
        right = history.as_of(lambda: MEASURED + timedelta(hours=4))
        found = in_future(right, "M")
        assert found is not None and found.night == "2026-10-10" and asks(found)
        assert "is dated 2026-10-10, which lies in the future" in told(found) and "It said: it moved." in told(found)
        assert not clock_wrong(right, "M"), "one night on either side: nobody knows which date is right"
        history.add_night(record(11), "touch\n1\n", knowledge(11))
        assert clock_wrong(right, "M") and not clock_wrong(history.as_of(lambda: MEASURED + timedelta(days=30)), "M")
        history.add_night(record(3), "touch\n1\n", knowledge(3))
        assert in_future(right, "M") is None and not clock_wrong(right, "M")


def test_all_missing_nights_are_counted_not_only_those_on_record(tmp_path: Path) -> None:
    seven = {"last_measured": "2026-10-03", "unmeasured": [f"night {n}" for n in range(7)]}
    with opened(tmp_path / "history.db") as history:
        for every, missing in ((1.0, 109), (7.0, 15)):
            found = dated(seven, history, "M", MEASURED + timedelta(days=110), every)
            assert found == {"unmeasured_count": missing}
            said = headline(record(113) | {"limits": []} | seven | found)
            assert f"; {missing} nights before were not measured" in said
            assert said.endswith("look whether the date of this computer is right") == (missing > 30)
        assert dated(seven, history, "M", MEASURED + timedelta(days=8), 1.0) == {}, "all of them are on record"


@pytest.mark.long
def test_what_stands_behind_a_limit_has_the_date_of_the_alarm_that_found_it(root: Path, tmp_path: Path) -> None:
    """Its alarm was accepted, so that the next page has only what stands behind the limit: one change, one date."""
    story = Story((Event(6, {"EY0C": 0.020}),), wander=0.5)
    records = answered(root, tmp_path / "h.db", story, 8, {6: "accept"}, limits={"volume": 60.0})
    assert records[5]["alarms"] and not records[6]["alarms"] and records[6]["behind"][0]["night"] == records[5]["night"]
    pages = [morning.render(r).partition("For the engineer")[0] for r in records[5:8]]
    assert all(re.search(r"by \+2[01] µm since the night ending Tue 6 Oct 2026", page) for page in pages)
    assert all("Since the night ending Tue 6 Oct 2026 a part" in page for page in pages)
    assert not any(re.search("(?:µm since|Since) Mon 5 Oct 2026", page) for page in pages)
