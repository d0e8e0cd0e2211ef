"""One first thing to do on every page: the machine that may still move, then parts, then whom to ask, then the repair."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.nights import NOTHING, M, dated, knock, night, story
from support.pages import read, seen
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.files.nightly import read_nightly
from tango_cnc.nightly.mail import message
from tango_cnc.report.answer import answer, renamed, said_cut_off
from tango_cnc.report.faults import faults
from tango_cnc.report.morning import context
from tango_cnc.report.orders import of_faults
from tango_cnc.report.reach import or_else, to_ask
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.report.words import subject
from tango_cnc.texts import say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("kind", "first"),
    [
        ("changed", "Measure the first part"),
        ("beyond", "Make no parts on it"),
        ("probe", "Measure the first part that is set up with the probe"),
        ("moving", "Look at the machine"),
        ("nothing", "Measure the first part"),
        ("doubtful", "Make no parts on it"),
    ],
)
def test_box_list_orders_alarm_and_mail_begin_with_one_thing(tmp_path: Path, kind: str, first: str) -> None:
    place = cell(tmp_path / "one", records=story(kind))
    (place / "nightly.yaml").write_text("nightly: 1\nowner: Ann, 4711\n", encoding="utf-8")
    for path in (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights"):
        text = read(place, path).partition("For the engineer")[0]
        answer = re.search(
            r"May I make parts\? (?:No|Not yet|Yes, but)(?: (?:Changed|Out of limits|Not measured|In doubt))? (\w.*)", text
        )
        assert answer is not None and answer[1].startswith(first), (path, text[:400])
        assert re.search(f"What to do:? {first}", text), path
    assert re.search(rf"(?:these|moving) (?:● .*measured )?(?:No|Not yet|Yes, but) {M}.*? {first}", read(place, "/"))
    if kind in ("changed", "beyond", "probe"):
        assert f"What to do {first}" in read(place, "/alarms")
    assert first in message(story(kind)[1], (), ())[1].split("\n\n")[0]


def test_orders_go_from_the_machine_to_parts_to_people_to_the_repair() -> None:
    before, last = story("moving")
    todo = context(last, (), None, texts(), before=before, owner="Ann, 4711")["todo"]
    assert [next(i for i, x in enumerate(todo) if w in x) for w in ("alarm screen", "first part", "Call Ann")] == [0, 1, 2]
    todo = context(story("changed")[1], (), None, texts(), owner="Ann, 4711")["todo"]
    assert "first part" in todo[0] and todo[1].startswith("Call Ann") and "collision" in todo[2]


@pytest.mark.parametrize("verdict", ["good", "changed"])
@pytest.mark.parametrize("more", [{}, {"waiting": "2026-11-01"}, {"has": "Ann"}])
def test_a_machine_that_may_still_move_is_not_yet_whatever_alarm_it_has(verdict: str, more: dict[str, str]) -> None:
    """An alarm left "Yes, but: measure the first part" above the order to look at the machine first."""
    told = renamed(answer(night(M, 1, verdict), Units(), texts(), **more), said_cut_off(["2026-11-29T020000Z"]), texts())
    assert (told.word, told.level) == ("Not yet", "stop") and told.why.startswith("Look at the machine first")


@pytest.mark.parametrize(
    ("verdict", "old", "word"), [("out_of_limits", 0, "No"), ("doubtful", 0, "No"), ("good", 20, "Nobody knows")]
)
def test_a_machine_that_may_still_move_is_looked_at_before_anything_else(verdict: str, old: int, word: str) -> None:
    cut = said_cut_off(["2026-11-29T020000Z"])
    told = renamed(answer(night(M, 1, verdict), Units(), texts(), old=old), cut, texts())
    assert told.word == word and told.why.startswith("Look at the machine first")
    last = {**night(M, 2, "not_measured"), "moved": True}
    told = answer(last, Units(), texts(), before=night(M, 1, verdict), old=old)
    assert told.word == word and told.why.startswith("Look at the machine first")


def test_of_two_faults_every_step_names_its_axis() -> None:
    """ "Enter no new location" of the one beside "have the compensation written" of the other read as opposite orders."""
    spindle = {"parameter": "EX0S", "todo": "…", "alone": "Have the new location entered.", "drifts": False, "decision": None}
    table = {"parameter": "EY0C", "todo": "Have the clamping looked at. Enter no new location.", "drifts": True, "decision": None}
    first, second = of_faults([spindle, table], texts())
    assert first == "C axis, which drifts: have the clamping looked at. Enter no new location."
    assert second == "Spindle, after that: have the new location entered."


@pytest.mark.parametrize(
    ("owner", "days", "deputy", "wanted"),
    [
        ("Ann, 4711", 0, "", ""),
        ("ann@shop.example", 1, "Bob, 12", ""),
        ("Ann, 4711", 2, "", "No deputy is named: without an answer, whoever leads the shift decides."),
        ("Ann, 4711", 12, "Bob, 4712", "Next: call Bob, 4712."),
        ("Ann", 0, "", "No telephone number is stated: look for Ann. Whoever leads the shift decides until then."),
        ("Ann", 0, "Bob, 4712", "Else call Bob, 4712."),
        ("Ann", 3, "", "No telephone number and no deputy are stated: whoever leads the shift decides."),
    ],
)
def test_who_does_not_answer_or_has_no_telephone_has_somebody_else_beside(owner: str, days: int, deputy: str, wanted: str) -> None:
    assert or_else(owner, days, deputy, texts()) == wanted
    asked = to_ask({"owner": owner, "deputy": deputy}, [{"owner": owner, "silent": days, "decision": None}], texts())
    other = f"Call {deputy}, or {owner}." if deputy else f"Call {owner}. Without an answer, whoever leads the shift decides."
    assert asked == (other if wanted else f"Call {owner}.")
    assert to_ask({"owner": owner}, [{"owner": owner, "decision": object()}], texts()) == ""
    assert to_ask({"owner": ""}, (), texts()).startswith("Ask whoever leads the shift: NOBODY is named")


@pytest.mark.few(0)
def test_a_deputy_is_stated_in_nightly_yaml_and_stands_on_pages_and_in_the_message(tmp_path: Path) -> None:
    old = dated(4)
    alarm = knock(old["night"]) | {
        "id": f"{old['night']}-1",
        "since": dated(5)["night"],
        "owner": "Ann, 4711",
        "night": old["night"],
    }
    nights = [night(M, 0, "changed", alarms=[alarm], **old), night(M, 1, "changed", standing=[alarm], **dated(0))]
    place = cell(tmp_path / "one", records=nights)
    for stated, wanted in (
        ("", "No deputy is named: without an answer, whoever leads the shift decides."),
        ("deputy: Bob, 4712\n", "Call Bob, 4712: Ann, 4711 was asked first, on"),
    ):
        (place / "nightly.yaml").write_text(f"nightly: 1\nowner: Ann, 4711\n{stated}", encoding="utf-8")
        for path in (f"/machine/{M}", f"/machine/{M}/trend", "/alarms", "/"):
            assert wanted in read(place, path), path
    assert read_nightly(place).deputy == "Bob, 4712"
    told = message(nights[1] | {"owner": "Ann, 4711", "deputy": "Bob, 4712"}, (), ())[1]
    assert "owner: Ann, 4711; if nobody answers: Bob, 4712" in told
    told = message(nights[1] | {"owner": None, "standing": [{**alarm, "owner": None}], "deputy": "Bob, 4712"}, (), ())[1]
    assert "owner: Bob, 4712. No owner is named for this machine." in told and "NOBODY" not in told


@pytest.mark.few(0)
def test_age_and_simulated_are_the_same_on_every_page(tmp_path: Path) -> None:
    """The newest night measured nothing: the page counts the hours since the one that did, which a simulator made."""
    place = cell(tmp_path / "one", records=story("nothing"))
    assert "measured 24 h ago" in read(place, "/")
    assert re.search("nothing measured. Last measured: night ending .{15}, 24 h ago", read(place, f"/machine/{M}"))
    for path in ("/", *(f"/machine/{M}{x}" for x in ("", "/trend", "/nights", "/report", "/files"))):
        assert read(place, path).count("SIMULATED") == 1, path


@pytest.mark.few(0)
def test_the_list_has_a_heading_for_each_group_and_says_what_a_number_is(tmp_path: Path) -> None:
    places = []
    for i, kind in enumerate(("nothing", "beyond", "moving", "changed")):
        made = [x | {"machine": f"M{i}", "simulated": i == 0} for x in story(kind)]
        places.append(cell(tmp_path / f"m{i}", f"M{i}", made))
    with TestClient(create(Settings(tuple(places))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        page = site.get("/").text
    order = re.findall(r"<h2>(.*?)</h2>|/machine/(M\d)\"", page)
    first = [
        "Look at these first: they may still be moving",
        "M2",
        "Make no parts on these",
        "M1",
        "Measure the first part on these",
    ]
    assert [a or b for a, b in order] == [*first, "M3", "M0"]
    assert page.count("1 open alarm<") == 2 and page.count('<span class="mark">SIMULATED') == 1


def test_the_first_screen_has_the_size_that_counts_and_the_rest_is_folded() -> None:
    alarm = knock("2026-11-05") | {"id": "2026-11-05-1", "night": "2026-11-05", "since": "2026-11-04", "total": 0.0199}
    alarm |= {
        "size": 0.0198,
        "now": "still there: +19.9 µm",
        "text": "The tip has moved by 16 µm (X +16.2 µm, Y +0.1 µm, Z −0.2 µm)",
    }
    first = context(night(M, 12, "changed", standing=[alarm]), (), None, texts())["first"]
    assert first["brief"] == "The tip has moved by 16 µm." and "Still there: +20 µm" in first["text"] and "Y +0.1" in first["text"]
    grown = context(night(M, 12, "changed", standing=[alarm | {"total": 0.04}]), (), None, texts())["first"]
    assert "+" in grown["brief"] or "40 µm" in grown["brief"]  # how far it has come by now is no detail


def test_what_drifts_is_named_by_its_axis() -> None:
    t = texts()
    assert [subject(name, None, t) for name in ("EY0C", "EX0S", "EXX1")] == ["C axis", "spindle", "scale of X"]


@pytest.mark.few(1)
@pytest.mark.parametrize("verdict", ["changed", "out_of_limits", "doubtful"])
def test_nobody_is_told_when_to_make_parts_below_make_no_parts(verdict: str, tmp_path: Path) -> None:
    """ "Make no parts on it." stood above "Make parts while the machine is at its usual temperature", and both in the message."""
    told = {"cause": "temperature", "parameter": "temperature", "text": "the machine has moved with its temperature"}
    told |= {"do": say("cause.temperature.do"), "on_part": "Warm and cold parts differ.", "rate_per_day": None}
    old = knock("2026-11-20") | told | {"night": "2026-11-20", "since": "2026-11-19", "now": "", "total": None}
    record = night(M, 30, verdict, standing=[old], **dated(0)) | {"headline": "as it is"}
    place = cell(tmp_path / "one", records=[record])
    usual, forbidden = "Make parts while the machine is", verdict != "changed"
    assert (usual in message(record, (), ())[1]) is not forbidden
    for path in ("/alarms", f"/machine/{M}") if verdict != "doubtful" else ("/alarms",):
        page = read(place, path)
        assert (usual in page) is not forbidden and ("come to its usual temperature" in page) is (verdict == "out_of_limits"), path


@pytest.mark.parametrize("confirmed", [None, "2026-11-26"])
def test_no_compensation_is_asked_for_a_change_that_made_the_error_nearly_nothing(confirmed: str | None) -> None:
    """ "Have the compensation written" stood above "It is nearly right now: do not correct the change"."""
    do = say("cause.axis_location.do")
    a = knock("2026-11-25") | {"id": "2026-11-25-1", "night": "2026-11-25", "since": "2026-11-24", "size": 0.0198, "do": do}
    a |= {"now": "", "total": 0.0198, "confirmed": confirmed}
    for value, right in ((0.0011, True), (-0.091, False)):
        record = night(M, 30, "changed", standing=[a])
        record["parameters"]["EX0C"] |= {"value": value, "seen": True}
        (one,) = faults(record, (), {}, Units(), texts())
        assert ("do not correct the change" in one["whole"]) is right
        for told in (one["todo"], message(record, (), ())[1]):
            assert ("have the compensation written" in told) is not right, told
            assert ("ave no compensation written" in told) is right and "have maintenance look" in told
            assert ("two measurements show" in told) is bool(confirmed)


def test_nobody_makes_a_first_part_on_a_machine_that_no_night_has_measured(tmp_path: Path) -> None:
    """The mail said "Measure the first part before you go on", its page "Nobody knows" and nothing of parts."""
    failed = [{"check": "control", "passed": False, "found": "the port does not open", "do": ""}]
    never = night(M, 0, "not_measured", preflight=failed, **NOTHING, **dated(0))
    mail = message(never, (), ())[1]
    assert "May I make parts? Nobody knows. Make no parts with tight limits on it." in mail and "first part" not in mail
    place = cell(tmp_path / "one", records=[never])
    for path in ("/", f"/machine/{M}", f"/machine/{M}/trend"):
        text = seen(place, path)
        assert "Nobody knows" in text and "Make no parts with tight limits on it." in text and "first part" not in text, path
    page = seen(place, f"/machine/{M}").partition("For the engineer")[0]
    assert page.count("ort does not open") == 1, page


def test_a_night_that_broke_off_begins_with_the_machine_that_may_go_on() -> None:
    """18 of 226 touches, and the control may still execute the rest: that stood third, below "Make no parts on it"."""
    why = say("night.broken.broke_off", made="18", planned="226", why="the control has been silent for longer than 47 s")
    record = night(M, 1, "doubtful", status="partial", plausible={"verdict": "doubtful", "reasons": [why]}, owner="Ann")
    told = context(record, (), None, texts())
    assert told["todo"][0].startswith("Look at the machine, and at the alarm screen") and told["todo"][1] == "Make no parts on it."
    assert sum("Look at the machine" in line for line in told["todo"]) == 1
    mail = message(record, (), ())[1]
    assert mail.index("if it moves, stop it at the control. Make no parts on it.") < mail.index("* ")
