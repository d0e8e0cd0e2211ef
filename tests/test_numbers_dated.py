"""Every number of a page says of which night it is, and who was asked says when; one colour has one meaning."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import pytest
from click.testing import CliRunner
from support.alarms import alarm
from support.nights import M, dated, knock, night
from support.pages import read
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.history import Decision
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.words import headline
from tango_cnc.report.answer import answer, renamed, said_cut_off
from tango_cnc.report.charts import tip
from tango_cnc.report.days import day
from tango_cnc.report.faults import answered, faults
from tango_cnc.report.morning import next_night
from tango_cnc.report.pdf import TONES
from tango_cnc.report.reach import or_else, to_ask
from tango_cnc.report.signs import LEVELS, strip
from tango_cnc.report.suspects import beyond_before
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

FULL = {"check": "disk", "passed": False, "found": "only 3 MB are free", "do": "make room"}
NOTHING: dict[str, Any] = {"status": "failed", "kind": "none", "touches": 0, "parameters": None, "volume": None, "limits": []}


@pytest.mark.long
def test_numbers_beside_a_night_that_was_cut_off_name_their_own_night(tmp_path: Path) -> None:
    t, good = texts(), night(M, 1)
    found = answer(good, Units(), t)
    assert "(on " not in found.numbers
    told = renamed(found, said_cut_off(["2026-11-23T020000Z"]), t)
    assert told.numbers == f"{found.numbers} (night ending {day(good['night'], t)})"
    place = cell(tmp_path / "one", records=[night(M, 0, **dated(1))])
    (place / "nights" / "begun").mkdir(parents=True)
    (place / "nights" / "begun" / f"{datetime.now(UTC) - timedelta(hours=5):%Y-%m-%dT%H%M%SZ}").write_text("", encoding="utf-8")
    of = day(dated(1)["night"], t)
    for path in ("/", f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights"):
        assert f"(night ending {of})" in read(place, path), path


@pytest.mark.few(0)
def test_the_tab_of_the_newest_night_has_its_date(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night(M, 0, **dated(2)), night(M, 1, **dated(1))])
    of = day(dated(1)["night"], texts(), False)
    for path in ("", "/trend", "/nights", "/files", "/run", "/report", "/night/1"):
        assert f"Newest night ending {of} Run" in read(place, f"/machine/{M}{path}"), path


def test_what_kept_a_night_from_beginning_stands_in_the_box() -> None:
    t, good, full = texts(), night(M, 1), night(M, 2, "not_measured", preflight=[FULL], **NOTHING)
    assert "nothing was measured last night (only 3 MB are free)" in answer(full, Units(), t, before=good).why
    assert "Last night could not begin: only 3 MB are free." in answer(full, Units(), t, before=good, old=30).why
    silent = night(M, 2, "not_measured", why="no answer", **NOTHING)
    assert "last night. This is what was known" in answer(silent, Units(), t, before=good).why
    nowhere = renamed(answer(good, Units(), t), said_cut_off(["x"], {"x": "unsent"}), t)  # not even its record could be written
    assert "Is the disk full?" in nowhere.why


def test_two_numbers_of_one_event_name_their_nights() -> None:
    alarm = knock("2026-11-05") | {"night": "2026-11-05", "now": say("night.alarms.still_there", told="+18.6 ± 0.4 µm")}
    (found,) = faults(night(M, 14, "changed", standing=[alarm | {"total": 0.0186}]), (), {}, Units(), texts())
    of = day(night(M, 14)["night"], texts())
    assert f"Still there: +19 µm (night ending {of})." in found["text"]
    sure = alarm | {"total": 0.0215, "now": say("night.alarms.still_there", told="+21.5 ± 0.3 µm")}
    (found,) = faults(night(M, 14, "changed", standing=[sure]), (), {}, Units(), texts())
    assert "by +22 µm since" in found["text"] and "it was +20 µm." in found["text"] and found["on_part_um"] == pytest.approx(21.5)
    half = alarm | {"total": 0.008, "now": say("night.alarms.now", told="+8.0 ± 0.4 µm")}
    (found,) = faults(night(M, 14, "changed", standing=[half]), (), {}, Units(), texts())
    assert "by +8 µm since" in found["text"]
    assert (
        f"That is the number of the night ending {of}; in the night of the alarm, Thu 5 Nov 2026, it was +20 µm." in found["text"]
    )


def test_who_was_asked_first_and_when_stands_before_who_is_called_next() -> None:
    t, first = texts(), {"owner": "Roy", "silent": 12, "decision": None, "night": "2026-11-17"}
    told = to_ask({"owner": "Roy", "deputy": "Berg, 4730"}, [first], t)
    assert told == "Call Berg, 4730: Roy was asked first, on Tue 17 Nov 2026, and has not answered."
    again = to_ask({"owner": "Roy, 4711", "deputy": "Berg"}, [first | {"owner": "Roy, 4711"}], t)
    assert again == "Call Roy, 4711 again, asked on Tue 17 Nov 2026 without an answer. Then call Berg."
    assert or_else("Roy", 12, "Berg", t) == "Next: call Berg." and or_else("Roy", 0, "Berg", t) == "Else call Berg."


def test_who_has_not_answered_for_days_is_not_called_first_about_what_is_of_this_morning() -> None:
    """One date: since when nobody has answered, and when who is called next was asked first."""
    t, own = texts(), {"owner": "Ann, 4711", "deputy": "Bob, 4712"}
    older = knock("2026-11-05") | {"night": "2026-11-05", "owner": own["owner"], "parameter": "EY0C"}
    tonight = knock("2026-11-17") | {"owner": own["owner"], "size": 0.06, "on_part_um": 60.0}
    record = night(M, 24, "changed", alarms=[tonight], standing=[older], **own)
    found = faults(record, (), {}, Units(), t)
    assert [a["night"] for a in found] == ["2026-11-17", "2026-11-05"]
    wanted = "Call Bob, 4712: Ann, 4711 was asked first, on Thu 5 Nov 2026, and has not answered."
    assert [*(a["who"] for a in found), to_ask(own, found, t)] == [wanted] * 3
    assert answered(found, record)[0] == found[0]["asked"] == "2026-11-05"
    other = faults(record | {"standing": [older | {"owner": "Eve, 4719"}]}, (), {}, Units(), t)
    assert "asked this morning" in next(a["who"] for a in other if a["owner"] == own["owner"])


def test_who_has_the_first_step_of_a_drift_is_not_asked_about_the_next_one() -> None:
    """ "Call Eve Roth: asked on Fri 6 Nov": she has the alarm of the 4th; Ann Meier was asked about that of the 6th."""
    own = {"owner": "Ann, 4711", "deputy": ""}
    first = alarm(4, 4.0, "EY0C", total=0.009, owner=own["owner"])
    then = alarm(6, 5.0, "EY0C", total=0.005, owner=own["owner"])
    decided = Decision(first["id"], "acknowledge", "Eve", "", None, f"{first['night']}T08:00:00Z")
    record = night(M, 9, "changed", standing=[first, then], **own)
    (found,) = faults(record, (), {first["id"]: decided}, Units(), texts())
    assert found["owner"] == own["owner"] and found["asked"] == then["night"]
    for told in (found["who"], to_ask(own, [found], texts())):
        assert told.startswith("Call Ann, 4711") and "Eve" not in told


def test_no_page_sends_its_reader_to_himself() -> None:
    """Who reads may be the foreman: the sentence says who decides, and holds for whoever reads."""
    t = texts()
    assert [key for key in t.keys if "foreman" in t.of(str(t._flat[key])).lower()] == []
    assert "Whoever leads the shift decides" in t("morning.nobody")


def test_a_verdict_has_one_colour_and_a_shape_of_its_own() -> None:
    t = texts()
    nights = [(date(2026, 11, i + 1), 50.0, level) for i, level in enumerate(("good", "look", "stop"))]
    curve = tip(nights, 60.0, "µm", t, 400, 200)
    for verdict, level in (("good", "good"), ("changed", "look"), ("out_of_limits", "stop")):
        assert LEVELS[verdict] == level and TONES[level] in strip([("2026-11-01", verdict, "")], "", t)
        assert f'fill="{TONES[level]}"' in curve
    style = (Path(__file__).parents[1] / "tango_cnc/report/templates/style.css").read_text(encoding="utf-8")
    assert all(f"--{level}:{TONES[level]}" in style for level in ("good", "look", "stop"))
    assert re.search(r"@media print\{@page\{margin:\d+mm\}.*th\.n\{white-space:normal\}", style)


@pytest.mark.long
def test_the_list_says_since_when(tmp_path: Path) -> None:
    t, full = texts(), [FULL]
    alarm = knock(dated(1)["night"]) | {"id": f"{dated(1)['night']}-1", "since": dated(2)["night"]}
    knocked = [night(M, 0, **dated(2)), night(M, 1, "changed", alarms=[alarm], **dated(1))]
    beyond = [night(M, 0, **dated(3)), *(night(M, i, "out_of_limits", **dated(3 - i)) for i in (1, 2))]
    nothing = [night(M, 0, **dated(3)), *(night(M, i, "not_measured", preflight=full, **NOTHING, **dated(3 - i)) for i in (1, 2))]
    for number, (records, ago) in enumerate(((knocked, 1), (beyond, 2), (nothing, 2), ([night(M, 0, **dated(40))], 40))):
        place = cell(tmp_path / str(number), records=records)
        (place / "nightly.yaml").write_text("nightly: 1\n", encoding="utf-8")
        first = read(place, "/").partition("Night ending")[0]
        assert f", since {day(dated(ago)['night'], t)}." in first, number  # with its year, as every other date of the row
    assert ", since" not in read(cell(tmp_path / "good", records=[night(M, 0, **dated(0))]), "/")


def test_an_alarm_is_a_row_with_its_verdict_and_cause_and_the_rest_is_folded(tmp_path: Path) -> None:
    alarm = knock(dated(1)["night"]) | {"id": f"{dated(1)['night']}-1", "since": dated(2)["night"]}
    place = cell(tmp_path / "one", records=[night(M, 0, **dated(2)), night(M, 1, "changed", alarms=[alarm], **dated(1))])
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        card = site.get("/alarms").text.partition("<article")[2].partition("</article>")[0]
    row, _, rest = card.partition('<details class="rest">')
    shown = " ".join(re.sub(r"<[^>]+>", " ", row.partition(">")[2]).split())
    assert shown.startswith(f"{M} May I make parts? Yes, but") and "moved along X" in shown and len(shown) < 200
    assert "What it does to parts" in rest and "What to do" in rest and "What it does" not in row


def test_a_night_that_ended_before_anything_was_sent_has_not_moved_the_machine(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night(M, 0, **dated(1))])
    stamp = f"{datetime.now(UTC) - timedelta(hours=5):%Y-%m-%dT%H%M%SZ}"
    (place / "nights" / "begun").mkdir(parents=True)
    (place / "nights" / "begun" / stamp).write_text("", encoding="utf-8")
    (place / "nights" / stamp).mkdir()
    for path in ("", "/nights"):
        text = read(place, f"/machine/{M}{path}")
        assert "the machine has not moved" in text and "may still be moving" not in text and "What changed Nothing." not in text


def test_of_two_nights_of_one_day_the_earlier_one_may_have_been_within() -> None:
    """Parts were those "since Mon 30 Nov, the last night within. Those since Mon 30 Nov, too: it was beyond then"."""
    beyond = [("2026-11-30", "out_of_limits"), ("2026-11-29", "out_of_limits")]
    assert beyond_before([*beyond, ("2026-11-28", "good")], "2026-11-30") == "2026-11-29"
    assert beyond_before([beyond[0], ("2026-11-30", "good"), *beyond[1:]], "2026-11-30") == ""


@pytest.mark.few(1)
@pytest.mark.parametrize(("system", "row", "box"), [("mm", "85 µm", "85 µm"), ("inch", "0.0034 in", "0.0034 in")])
def test_a_number_of_a_night_is_rounded_once(system: Literal["mm", "inch"], row: str, box: str, tmp_path: Path) -> None:
    """85.47 was 85 in the box of the answer, and in the row of the night 86: the sentence has 85.5, which was rounded again."""
    limit = {"what": "volume", "value": 85.4702, "unit": "µm", "low": 84.0, "high": 87.0, "limit": 60.0, "passed": False}
    one = night(M, 1, "out_of_limits", limits=[limit], volume={"worst_um": 85.4702, "rms_um": 9.8, "std_um": 0.9})
    two = {**night(M, 0), "volume": {"worst_um": 51.47, "rms_um": 9.8, "std_um": 0.9}}
    two["change"] = two["change"] | {"p_value": None}
    place = cell(tmp_path / "one", records=[two | {"headline": headline(two)}, one | {"headline": headline(one)}])
    app = create(Settings((place,)))
    app.state.tango.units = Units(system)
    with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        text = site.get(f"/machine/{M}").text
    assert f"Volume is {row}, " in text and f"Largest error at the tool tip: {box}, " in text.replace("<b>", "")
    assert f"the largest error at the tool tip is {'51 µm' if system == 'mm' else '0.0020 in'}" in text
    engineer = text.partition("For the engineer")[2]
    assert ("Volume is 85.5 µm, 60 µm" if system == "mm" else "Volume is 3365.0 µin, ") in engineer


@pytest.mark.few(1)
@pytest.mark.parametrize("rate", [None, 0.004])
def test_an_alarm_has_the_date_of_its_night_in_every_line(rate: float | None, tmp_path: Path) -> None:
    """A drift had the date of the night before as soon as it was known to be one, and an open alarm at the computer always."""
    text = say("changed.unnamed", name="EX0C", size="+20 µm", since="last night")
    alarm = knock("2026-11-05") | {"text": text, "since": "2026-11-04", "night": "2026-11-05", "rate_per_day": rate}
    (found,) = faults(night(M, 12, "changed", alarms=[alarm]), (), {}, Units(), texts())
    assert "since the night ending Thu 5 Nov 2026" in found["text"] and "Wed 4 Nov" not in found["text"]
    place = cell(tmp_path / "one", records=[night(M, 0), night(M, 12, "changed", headline=text, alarms=[alarm])])
    said = CliRunner().invoke(tango, ["nightly", "--status", "-C", str(place)], standalone_mode=False).output
    line = next(x for x in said.splitlines() if "open alarm 2026-11-05-1" in x)
    assert "since the night ending 2026-11-05" in line and "2026-11-04" not in line and "last night" not in line


def test_what_somebody_has_repaired_is_to_be_measured_and_no_id_is_said() -> None:
    """What to do was what it was before the repair, and why the next night is a full one was the id of the alarm."""
    record = night(M, 14, "out_of_limits", standing=[knock("2026-11-05") | {"night": "2026-11-05", "now": ""}])
    for utc, said in (("2027-01-01T08:00:00Z", True), ("2026-11-06T08:00:00Z", False)):  # one before that night was measured by it
        decision = Decision("2026-11-05-1", "repaired", "Bo Roy", "", None, utc)
        (found,) = faults(record, (), {"2026-11-05-1": decision}, Units(), texts())
        assert (found["todo"] == "Run the full measurement: it shows whether the repair has helped.") == said
    why = str(next_night(record, [replace(decision, utc="2027-01-01T08:00:00Z")])["why"])
    assert "Bo Roy, 2027-01-01" in why and "2026-11-05-1" not in why


@pytest.mark.parametrize(("more", "warned"), [({}, True), ({"stands": "2026-11-07"}, False), ({"rate_per_day": None}, False)])
def test_the_message_of_a_drift_warns_of_a_new_location_as_the_page_does(more: dict[str, Any], warned: bool) -> None:
    drift = knock("2026-11-05") | {"night": "2026-11-05", "rate_per_day": 0.004, "now": "", "decision": None} | more
    text = message(night(M, 14, "changed", standing=[drift]), (), ())[1]
    assert ("Enter no new location of this axis in the control before it stands still" in text) == warned
