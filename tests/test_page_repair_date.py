"""A repair that did not help leaves the change where it was: its date is that of the night that found it first, on every page."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.history import Decision, opened
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.one_date import begun
from tango_cnc.nightly.standing import standing, unheard
from tango_cnc.nightly.words import changed, headline, value
from tango_cnc.report.answer import Answer
from tango_cnc.report.days import day
from tango_cnc.report.repeated import as_decided, as_found, first_night
from tango_cnc.report.texts import texts
from tango_cnc.texts import instead, say
from tango_cnc.web.app import create
from tango_cnc.web.pages.fleet import brief
from tango_cnc.web.settings import Settings

M = "HU40T-like"
GOOD, HIT, AFTER, LAST = (night(M, i)["night"] for i in (7, 8, 9, 10))


def moved(date: str, text: str, **more: Any) -> dict[str, Any]:
    """date of the night, its sentence → an alarm of what moved in the night that ended HIT."""
    return {**knock(date), "since": GOOD, "text": text, **more}


def repaired(folder: Path, nights: int, found: bool) -> Path:
    """folder, how many nights after the hit, whether the record says which night found it → cell whose repairs did not help."""
    records = [night(M, 7), night(M, 8, "changed", alarms=[moved(HIT, f"C axis has moved along X by +19.8 µm since {GOOD}")])]
    before = f"{HIT}-1"
    for i, date in enumerate((AFTER, LAST)[:nights]):
        own = {"alarm": before, "size_before": 0.0198, "back": 0.0} | ({"found": HIT} if found or i else {})
        text = f"C axis has moved along X by +19.8 µm since {GOOD}: the repair by Dora has not helped"
        records.append(night(M, 9 + i, "changed", alarms=[moved(date, text, repair=own)]))
        before = f"{date}-1"
    place = cell(folder, records=records)
    with opened(place / "history.db") as history:
        for i, date in enumerate((HIT, AFTER)[:nights]):
            ended = str(night(M, 8 + i)["end_utc"])
            history.decide(M, Decision(f"{date}-1", "repaired", "Dora", utc=ended))
    return place


@pytest.mark.parametrize(("nights", "found"), [(1, False), (1, True), (2, True)])
def test_the_change_has_the_date_of_the_night_that_found_it_after_a_repair_that_did_not_help(
    tmp_path: Path, nights: int, found: bool
) -> None:
    """Pages gave the change the date of the night before, and called the night after the repair the first night with the change."""
    place = repaired(tmp_path / "one", nights, found)
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        pages = {path: client.get(path).text for path in (f"/machine/{M}", "/", "/alarms", f"/machine/{M}/trend")}
    for path, text in pages.items():
        others = [f"{x} since {day(GOOD, texts())}" for x in ("made", "Steady")]  # the parts, and the first night of the curve
        assert text.count(f"since {day(GOOD, texts())}") == sum(text.count(x) for x in others), path
        assert f"since the night ending {day(HIT, texts())}" in text or f"since {day(HIT, texts())}" in text, path
    assert f"The night ending {day(HIT, texts())}. The night before was without it." in pages[f"/machine/{M}"]
    assert "the first one with it" not in pages[f"/machine/{M}"]
    assert f"made since {day(GOOD, texts())}, the last night without it" in pages[f"/machine/{M}"]
    told = CliRunner().invoke(tango, ["nightly", "-C", str(place), "--status"], catch_exceptions=False).output
    told = " ".join(told.partition("open alarm")[2].split())
    assert f"since the night ending {HIT}" in told and f"since {GOOD}" not in told


def test_the_second_morning_after_a_repair_that_did_not_help_has_the_same_date(tmp_path: Path) -> None:
    """The message of that morning dated the change by the night before it, whose parts are good."""
    after = datetime.fromisoformat(f"{LAST}T02:00:00+00:00").timestamp() / 86_400
    with opened(repaired(tmp_path / "one", 1, True) / "history.db") as history:
        stands = standing(history, M, after, {}, "check")
        history.decide(M, Decision(f"{AFTER}-1", "ignore", "Dora", until="2026-12-10", utc=f"{LAST}T00:30:00Z"))
        silent = unheard(history, M, after, {}, "check")
    told = message(
        night(M, 10, "changed", standing=stands, headline=say("night.words.no_alarm_but", text=stands[0]["text"])), (), ()
    )[1]
    assert f"since the night ending {HIT}: the repair" in told and f"since {GOOD}" not in told
    told = message(night(M, 10, unheard=silent), (), ())[1]
    assert "Dora ignores" in told and f"since the night ending {HIT}: the repair" in told and f"since {GOOD}" not in told


def test_what_stands_behind_a_limit_has_the_date_of_its_alarm(tmp_path: Path) -> None:
    """One message had two dates for one knock; --status called an old night the last one."""
    text = "C axis has moved along X by +19.8 µm since last night"
    cause = {"what": "volume", "parameter": "EX0C", "unit": "mm", "since": GOOD, "night": HIT, "size": 0.0198, "std": 0.0004}
    cause |= {"cause": "axis_location", "text": f"C axis has moved along X by +19.8 µm since {GOOD}", "rate_per_day": None}
    cause |= {"on_part": "x", "do": "y"}
    record = night(M, 8, "out_of_limits", alarms=[moved(HIT, text)], behind=[cause])
    told = message(record, (), ())[1]
    assert (
        f"behind volume: C axis has moved along X by +19.8 µm since the night ending {HIT}" in told and f"since {GOOD}" not in told
    )
    record["headline"] = say("changed.besides", text=text, other="more")
    place = cell(tmp_path / "one", records=[record])
    for words in (["nightly", "-C", str(place), "--status"], ["history", "list", "-C", str(place)], ["fleet", str(place)]):
        told = CliRunner().invoke(tango, words).output
        assert f"since the night ending {HIT}" in " ".join(told.split()) and "last night;" not in told, told


def test_an_alarm_that_goes_on_or_is_left_of_a_repair_has_the_night_that_found_it() -> None:
    left = {"id": f"{LAST}-1", "since": GOOD, "repair": {"alarm": f"{AFTER}-1", "found": HIT}, "text": f"It moved since {GOOD}"}
    assert first_night(left, LAST) == HIT and first_night({**left, "night": LAST}, LAST) == HIT
    assert as_found(left["text"], {"night": LAST, "alarms": [left]}) == f"It moved since the night ending {HIT}"
    assert first_night({"id": f"{LAST}-1"}, LAST) == LAST


def test_the_date_of_a_repair_stays_where_the_change_has_another_one() -> None:
    """A repair of the 27th, told beside a scatter since the 27th, became one of the night ending on the 28th."""
    text = say("changed.after_repair", text="touches scatter since 2026-11-27", owner="Dora", date="2026-11-27", what="")
    told = instead(text, "2026-11-27", say("morning.found", date="2026-11-28"))
    assert "since the night ending 2026-11-28" in told and "by Dora on 2026-11-27" in told


def test_what_stands_behind_a_limit_is_counted_from_the_knock_of_tonight_and_not_from_what_has_gone_back() -> None:
    """The mail blamed a repair for what the knock of tonight had done. The repaired change had gone back a night earlier."""
    left = say("night.alarms.gone_again_left", told="-0.1 ± 0.3 µm")
    gone = {"parameter": "EY0C", "size": 0.0166, "since": "2026-11-25", "rate_per_day": None, "now": left}
    back = {**gone, "size": -0.0175, "since": "2026-11-28", "now": "", "undoes": {"alarm": "2026-11-28-1"}}
    knocked = {**gone, "size": 0.0205, "since": "2026-11-29", "now": ""}
    assert begun([knocked, back, gone]) == {"EY0C": ("2026-11-29", 0.0205)}
    assert begun([knocked, {**gone, "now": ""}]) == {"EY0C": ("2026-11-25", 0.0166)}  # which stands: the older one counts


def test_the_mail_counts_a_change_and_its_way_back_as_one_story() -> None:
    """Three stories stood as four alarms, and one of them waited twice."""
    others = [{**knock(f"2026-11-0{i}"), "id": f"2026-11-0{i}-1", "parameter": f"EX{i}C"} for i in (1, 2, 3, 4)]
    back = {**others[0], "id": "2026-11-05-1", "undoes": {"alarm": "2026-11-01-1"}}
    more = {"now": "", "confirmed": None}
    listed = [{**a, **more, "night": str(a["id"])[:10]} for a in (*others[:3], back, others[3])]
    record = night(M, 12, "changed", standing=listed)
    assert "More alarms that wait: 1." in message(record, (), ())[1]
    assert "More alarms that wait" not in message({**record, "standing": listed[:4]}, (), ())[1]


@pytest.mark.parametrize("said", [False, True])
def test_the_headline_says_who_has_repaired_the_alarm_of_the_newest_night(tmp_path: Path, said: bool) -> None:
    """List, --status and history list named nobody until the next night."""
    record = night(M, 8, "changed", alarms=[moved(HIT, f"C axis has moved along X by +19.8 µm since {GOOD}")])
    record["headline"] = say("night.words.former_waits")
    done = [Decision(f"{HIT}-1", "repaired", "Dora, 4713", utc=f"{LAST}T09:30:00Z")] if said else []
    assert ("Dora, 4713 has repaired it" in as_decided(record, done)) == said
    two = {**record, "alarms": [*record["alarms"], {**record["alarms"][0], "id": f"{HIT}-2"}]}
    assert "has repaired it" not in as_decided(two, done)  # of several nobody knows which one is meant
    early = [Decision(f"{HIT}-1", "repaired", "Dora, 4713", utc=f"{GOOD}T09:30:00Z")]
    assert "has repaired it" not in as_decided(record, early)


def test_the_list_has_a_date_once() -> None:
    """Nothing complete was measured since Thu 26 Nov 2026, since Thu 26 Nov 2026."""
    date = "2026-11-26"
    why = texts()("may.late", date=day(date, texts()))
    told = Answer("but", "Yes, but", "late", "", why)
    _, cause = brief(told, (), False, "", texts(), date)
    assert cause.count(day(date, texts())) == 1
    other = Answer("but", "Yes, but", "late", "", "x: Nothing was measured")
    assert brief(other, (), False, "", texts(), date)[1].count(day(date, texts())) == 1


def test_the_table_of_nights_and_the_engineer_date_what_a_repair_has_left_by_the_night_that_found_it(tmp_path: Path) -> None:
    """Both dated it by the last night without it, one night early; all else on the page had the night that found it."""
    what = changed("EX0C", value(0.0198, "mm", 0.0004), GOOD)
    text = say("night.repaired.same", owner="Dora", date=HIT, what=what)
    left = moved(AFTER, text, repair={"alarm": f"{HIT}-1", "size_before": 0.0198, "back": 0.0, "found": HIT})
    later = {**left, "night": AFTER, "now": say("night.alarms.still_there", told=value(0.0199, "mm", 0.0004)), "total": 0.0199}
    records = [
        night(M, 7),
        night(M, 8, "changed", alarms=[moved(HIT, changed("EX0C", value(0.0198, "mm", 0.0004)))]),
        night(M, 9, "changed", alarms=[left]),
    ]
    records.append(night(M, 10, "changed", standing=[later]))
    records = [r | {"headline": headline(r)} for r in records]
    place = cell(tmp_path / "one", records=records)
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        page = " ".join(re.sub(r"<[^>]*>", " ", client.get(f"/machine/{M}").text).split())
    engineer = page.partition("For the engineer")[2]
    said, table = engineer.partition("Why this name")[0], engineer.partition("What it said")[2]
    assert f"since the night ending {HIT}" in said and GOOD not in said, said
    assert table.count(f"since the night ending {day(HIT, texts())}") >= 2 and f"since {day(GOOD, texts())}" not in table, table
