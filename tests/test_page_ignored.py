"""What somebody asks to be ignored gives no order: what to do is about what is open beside it, and names that."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from support.alarms import lasting
from support.nights import NOTHING, M, night
from support.pages import read
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.commands.report import nights
from tango_cnc.files import read_cell
from tango_cnc.history import Decision, opened
from tango_cnc.report.days import day
from tango_cnc.report.morning import context
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

UNTIL = "2027-12-10"
LARGE_DO, SMALL_DO = "Have the large one compensated.", "Have maintenance look at the small one."
FIRST = "Measure the first part before you go on."


def decided(a: dict[str, Any], action: str = "ignore", until: str | None = UNTIL) -> Decision:
    return Decision(a["id"], action, "Emil", "", until if action == "ignore" else None, "2026-11-01T10:00:00Z")


def two() -> tuple[dict[str, Any], dict[str, Any]]:
    """→ a large change, and a small one of another parameter that nobody has answered."""
    return lasting(2, 30.0, do=LARGE_DO), lasting(6, 4.0, "EX0C", do=SMALL_DO)


def test_what_to_do_is_about_what_is_open_and_not_about_what_is_ignored() -> None:
    large, small = two()
    told = context(night(M, 8, standing=[small, large]), (decided(large),), None, texts())
    assert told["first"]["id"] == large["id"] and [a["id"] for a in told["also"]] == [small["id"]]  # by size, as ever
    assert told["todo"][0] == FIRST and told["todo"][1].startswith("Call Ann.")
    (own,) = (line for line in told["todo"] if SMALL_DO in line)
    assert own.startswith("C axis has moved along X by +4 µm since") and LARGE_DO not in " ".join(told["todo"])
    both = context(night(M, 8, standing=[small, large]), (), None, texts())
    assert LARGE_DO in both["todo"] and SMALL_DO not in " ".join(both["todo"])  # nobody ignores it: the larger one


@pytest.mark.parametrize("until", ["2026-10-31", "2026-11-01"])
def test_what_was_ignored_until_a_day_asks_again_after_it(until: str) -> None:
    large, small = two()
    told = context(night(M, 8, standing=[small, large]), (decided(large, until=until),), None, texts())
    assert (LARGE_DO in told["todo"]) == (until < night(M, 8)["night"])


@pytest.mark.parametrize(("verdict", "wanted"), [("good", FIRST), ("out_of_limits", texts()("todo.limit"))])
def test_where_all_is_ignored_nothing_asks_for_a_repair_but_a_limit(verdict: str, wanted: str) -> None:
    large, _ = two()
    told = context(night(M, 8, verdict, standing=[large]), (decided(large),), None, texts())
    assert wanted in told["todo"] and LARGE_DO not in " ".join(told["todo"]) and len(told["todo"]) <= 2


def test_what_is_closed_beside_what_is_ignored_asks_for_nothing() -> None:
    large, small = two()
    told = context(night(M, 8, standing=[small, large]), (decided(large), decided(small, "accept")), None, texts())
    assert told["todo"] == [FIRST]


def test_what_somebody_has_and_does_not_ignore_still_asks() -> None:
    large, small = two()
    told = context(night(M, 8, standing=[small, large]), (decided(large, "acknowledge"),), None, texts())
    assert LARGE_DO in told["todo"]


@pytest.mark.few(0)
def test_every_page_and_the_report_have_one_order(tmp_path: Path) -> None:
    large, small = two()
    records = [night(M, 2, "changed", alarms=[large]), night(M, 6, "changed", alarms=[small])]
    place = cell(tmp_path / "one", records=[*records, night(M, 8, standing=[small, large])])
    with opened(place / "history.db") as history:
        history.decide(M, Decision(large["id"], "ignore", "Emil", "", date.today().isoformat()))
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        for path in (f"/machine/{M}", "/alarms", f"/machine/{M}/trend"):
            text = client.get(path).text.partition("For the engineer")[0]
            assert SMALL_DO in text and LARGE_DO not in text, path
    found = nights(place, read_cell(place).machine, Units(), texts())
    assert (
        found is not None and found.named and SMALL_DO in found.todo[-1] and found.todo[-1].startswith("C axis has moved along X")
    )


@pytest.mark.parametrize("action", ["ignore", "accept"])
def test_a_change_that_went_back_last_night_and_is_ignored_is_no_reason_to_measure_a_part(action: str) -> None:
    """The night saw it gone back, and its alarm is of that night; the box said Measure the first part all the same."""
    knock = lasting(6, 20.0, total=0.0001, now=say("night.alarms.gone_again_left", told="-0.1 ± 0.3 µm"))
    back = lasting(8, -19.9, undoes={"alarm": knock["id"], "left": -0.0001}, total=None)
    decisions = tuple(decided(a, action) for a in (knock, back))
    told = context(night(M, 8, "changed", alarms=[back], standing=[knock]), decisions, None, texts())
    assert told["answer"].may == "yes" and told["todo"] == ["Nothing."] and told["first"]["gone"]
    assert told["suspect"].endswith("and Sun 1 Nov 2026, the first night without it again.")
    asked = context(night(M, 8, "changed", alarms=[back], standing=[knock]), (), None, texts())
    assert asked["answer"].may == "but" and FIRST in asked["todo"]


@pytest.mark.few(0)
def test_who_let_an_alarm_be_until_a_day_has_answered_it_until_then(tmp_path: Path) -> None:
    """ "Nobody has answered since Thu 5 Nov": somebody had, on the 23rd, until the 26th."""
    large = lasting(2, 30.0, do=LARGE_DO)
    place = cell(tmp_path / "one", records=[night(M, 2, "changed", alarms=[large]), night(M, 8, "changed", standing=[large])])
    with opened(place / "history.db") as history:
        history.decide(M, replace(decided(large, until="2026-10-30"), utc="2026-10-27T10:00:00Z"))
    text = read(place, f"/machine/{M}")
    assert "asked on Sat 31 Oct 2026" in text and "on Mon 26 Oct 2026, not" not in text
    newest = read(place, f"/machine/{M}/night/2")  # "Who has it: Emil (ignored), until Fri 30 Oct" stood there
    for told in (text, newest):
        assert "nobody has answered since Sat 31 Oct 2026" in told and "Emil (ignored)" not in told


def test_the_order_about_what_is_open_stands_after_a_check_that_failed_and_has_its_own_date_in_the_list(tmp_path: Path) -> None:
    """ "The stylus has moved by 6.1 µm, since Fri 27 Nov": since then nothing was measured; and nobody was asked to look at it."""
    t, before = texts(), night(M, 8, "changed", alarms=[lasting(8, 30.0, do=LARGE_DO)])
    failed = [{"check": "control", "passed": False, "found": "the port does not open. Is it on?", "do": "Switch it on."}]
    records = [before, *(night(M, i, "not_measured", preflight=failed, **NOTHING) for i in (9, 10))]
    told = context(records[-1], (), None, t, waiting=before["alarms"], before=before)
    assert told["todo"].index("Switch it on.") < next(i for i, x in enumerate(told["todo"]) if LARGE_DO in x)
    assert "(the port does not open)." in told["answer"].why  # the rest of it stands below
    listed = read(cell(tmp_path / "one", records=records), "/")
    assert f"has moved along Y by +30 µm, since {day(before['night'], t)}." in listed.partition("Largest error")[0]
