"""What a tired reader of the pages has misread: which night a date is of, how old the page is, whom to ask, what a limit is for."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from support.nights import BEYOND, M, dated, night, story
from support.pages import read
from support.server import PASSWORD, cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.files.artefact import read_artefact
from tango_cnc.files.nightly import read_nightly
from tango_cnc.nightly.words import changed, headline
from tango_cnc.records import InputError
from tango_cnc.report.may import parts_first
from tango_cnc.report.morning import context, who_of
from tango_cnc.report.plain import plain, signed
from tango_cnc.report.reach import to_ask
from tango_cnc.report.repeated import as_decided
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts.number import number
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings
from tango_cnc.web.users import add_user

PATHS = (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights")


def html(place: Path, path: str) -> str:
    """cell, path → its page."""
    with TestClient(create(Settings((place,))), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        return str(site.get(path).text)


@pytest.mark.few(0)
def test_a_page_says_when_it_was_made_and_a_night_when_it_ended(tmp_path: Path) -> None:
    """A date beside 'night of' was read as the evening, and 10 h ago as the time of day."""
    place = cell(tmp_path / "one", records=story("changed"))
    for path in (*PATHS, "/", "/alarms"):
        text = read(place, path)
        assert re.search(r"This page: \d\d:\d\d \S+, \w{3} \d", text), path
        assert not re.search(r"[Nn]ight of \w{3} \d", text), path
    assert re.search(r"Night ending \w{3} \d+ \w{3} \d{4}, ended \d\d:\d\d", read(place, PATHS[0]))


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", ["changed", "moving"])
def test_the_answer_comes_before_simulated_and_both_stand_in_one_box(tmp_path: Path, kind: str) -> None:
    place = cell(tmp_path / "one", records=[r | {"simulated": True} for r in story(kind)])
    for path in PATHS:
        text = html(place, path)
        box = re.search(r'<section class="(?:verdict|progress).*?</section>', text, re.DOTALL)
        assert box is not None and text.count("SIMULATED") == 1, path
        assert 0 < box[0].index("May I make parts?") < box[0].index("SIMULATED"), path


@pytest.mark.few(0)
def test_what_is_said_beside_a_night_that_was_cut_off_is_red_and_below_the_answer(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=story("changed"))
    (place / "nights" / "begun").mkdir(parents=True)
    (place / "nights" / "begun" / "2026-11-23T020000Z").write_text("", encoding="utf-8")
    (place / "nights" / "2026-11-23T020000Z").mkdir()
    (place / "nights" / "2026-11-23T020000Z" / "planned.json").write_text("{}", encoding="utf-8")
    for path in PATHS:
        text = html(place, path)
        assert text.index("Not yet") < text.index('<p class="told stop" role="alert">') and "was cut off" in text, path


@pytest.mark.parametrize(
    ("kind", "wanted"), [("changed", "A full measurement, by itself."), ("moving", ""), ("nothing", ""), ("good", "Short check.")]
)
def test_the_next_night_and_what_to_do_are_one_order(kind: str, wanted: str) -> None:
    record, now = story("changed" if kind == "good" else kind)[1], {"kind": "full" if kind == "changed" else "check", "why": ""}
    record = night(M, 1, "good", **dated(0)) if kind == "good" else record
    if kind == "changed":
        record = {**record, "alarms": [{**a, "do": "Run the full measurement."} for a in record["alarms"]]}
    found = context({**record, "next": now}, (), None, texts(), before=story(kind)[0] if kind in ("moving", "nothing") else None)
    told = found["next_kind"]
    assert (wanted.lower().startswith(told.partition(".")[0].lower().rstrip(".")) and bool(told)) if wanted else told == ""
    if kind == "changed":
        only = context({**record, "next": {"kind": "check", "why": ""}}, (), None, texts())["next_kind"]
        assert "stands in for no full measurement" in only


@pytest.mark.few(0)
def test_who_is_named_anywhere_is_asked_where_no_owner_is(tmp_path: Path) -> None:
    t = texts()
    assert to_ask({"owner": "", "deputy": "Bob, 4712"}, (), t) == "Call Bob, 4712. No owner is named for this machine."
    other: list[dict[str, Any]] = [{"owner": "", "decision": None}, {"owner": "Ann, 4711", "decision": None}]
    assert to_ask({"owner": ""}, other, t).startswith("Call Ann, 4711.")
    assert to_ask({"owner": ""}, (), t).startswith("Ask whoever leads the shift: NOBODY")
    assert who_of(None, {"owner": "", "deputy": "Bob, 4712"}, (), t).startswith("Call Bob, 4712.")
    made = [{**r, "owner": None, "alarms": [{**a, "owner": None} for a in r["alarms"]]} for r in story("changed")]
    place = cell(tmp_path / "one", records=made)
    (place / "nightly.yaml").write_text("nightly: 1\ndeputy: Bob, 4712\n", encoding="utf-8")
    for path in (*PATHS, "/", "/alarms", f"/machine/{M}/run"):
        assert "NOBODY" not in read(place, path), path
        assert path.endswith("/run") or "Call Bob, 4712." in read(place, path), path


@pytest.mark.few(0)
def test_a_limit_says_what_it_is_for_and_who_has_stated_it(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=story("beyond"))
    assert "Nobody has written what this limit is for" in read(place, "/")
    stated = "nightly: 1\nlimits: {volume: 45}\nlimits_for: housings of gearbox 4711, K. Blum\n"
    (place / "nightly.yaml").write_text(stated, encoding="utf-8")
    assert read_nightly(place).limits_for == "housings of gearbox 4711, K. Blum"
    for path in (*PATHS, "/"):
        assert "The limit: housings of gearbox 4711, K. Blum." in read(place, path), path


def test_a_report_under_a_no_lets_no_part_be_made() -> None:
    """The box said No, and what to do began with the first part."""
    t = texts()
    told = context(story("beyond")[1], (), None, t)["answer"]
    do = ["Look first for what has moved.", t("morning.parts_first"), t("morning.call", owner="Ann")]
    assert parts_first(told, do, t) == [t("may.brief_no"), do[0], do[2]]
    assert parts_first(told, [t("morning.cut_off_todo"), *do], t)[:2] == [t("morning.cut_off_todo"), t("may.brief_no")]
    changed = context(story("changed")[1], (), None, t)["answer"]
    assert parts_first(changed, do, t) == [do[1], do[0], do[2]]  # the box and the list begin with one thing


def test_under_the_no_of_its_readings_a_report_asks_for_no_parts_though_the_night_did() -> None:
    """The night said Yes, but; the readings of the morning are beyond the limit: "4. Make parts while the machine is at its usual
    temperature" stood below "1. Make no parts on it"."""
    t = texts()
    warm = f"The machine is 5.3 K warmer. {t('cause.temperature.do')}"
    told = parts_first(context(story("beyond")[1], (), None, t)["answer"], [warm], t)
    assert (
        told[0] == t("may.brief_no") and "Make parts" not in told[1] and "The machine is 5.3 K warmer. Let the machine" in told[1]
    )
    assert parts_first(context(story("changed")[1], (), None, t)["answer"], [warm], t) == [warm]


@pytest.mark.parametrize(("name", "allowed"), [("'f1 '", "without a blank"), ("' f1'", "without a blank")])
def test_a_facet_that_no_table_of_readings_can_name_is_refused(tmp_path: Path, name: str, allowed: str) -> None:
    file = tmp_path / "artefact.yaml"
    file.write_text(f"name: x\nfacets:\n  {name}: {{point: [0, 0, 0], normal: [0, 0, 1]}}\n", encoding="utf-8")
    with pytest.raises(InputError, match=allowed):
        read_artefact(file)


def test_a_key_that_turns_the_text_behind_it_is_written_out(tmp_path: Path) -> None:
    file = tmp_path / "artefact.yaml"
    file.write_text('name: x\nfacets:\n  "a\\u202eb": {point: [0, 0, 0], normal: [0, 0, 1]}\n', encoding="utf-8")
    with pytest.raises(InputError) as found:
        read_artefact(file)
    assert "\u202e" not in str(found.value) and "facets.a\\u202eb" in str(found.value)


def test_a_name_that_turns_the_text_behind_it_is_refused(tmp_path: Path) -> None:
    """A telephone number behind it was shown backwards."""
    (tmp_path / "nightly.yaml").write_text('nightly: 1\nowner: "Ann \\u202e4711"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"U\+202E"):
        read_nightly(tmp_path)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("proxied", "headers", "status"), [(False, {}, 200), (True, {}, 403), (True, {"x-forwarded-for": "127.0.0.1"}, 200)]
)
def test_behind_a_proxy_that_names_nobody_no_request_counts_as_one_of_this_computer(
    tmp_path: Path, proxied: bool, headers: dict[str, str], status: int
) -> None:
    """Names, alarms and verdicts of every machine were open to everybody behind such a proxy."""
    users = tmp_path / "users.json"
    add_user(users, "ann", PASSWORD, "view")
    settings = Settings((cell(tmp_path / "one", records=story("changed")),), users=users, behind_proxy=proxied)
    with TestClient(create(settings), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        assert site.get("/metrics", headers=headers).status_code == status


@pytest.mark.parametrize(
    ("since", "wanted"), [("2026-11-10", "since the night ending 2026-11-11"), ("2026-11-08", "since 2026-11-08")]
)
def test_a_headline_about_a_limit_has_the_date_of_the_night_that_found_it(since: str, wanted: str) -> None:
    """The box said 'since Wed 11 Nov', the card of the nights 'since Tue 10 Nov', of one change."""
    behind = [
        {"what": "volume", "parameter": "EY0C", "text": changed("EY0C", "+18 µm", since), "since": since, "night": "2026-11-11"}
    ]
    record = night(M, 5, "out_of_limits", limits=[BEYOND], behind=behind, night="2026-11-29")
    record["headline"] = headline(record)
    assert wanted in as_decided(record, ()) and since in record["headline"]


def test_an_answer_among_the_alarms_stands_behind_its_question(tmp_path: Path) -> None:
    """Below "Open alarms" the heading "trunnion No" read as no alarm."""
    assert re.search(rf"{M} May I make parts\? (?:No|Yes, but)", read(cell(tmp_path / "one", records=story("changed")), "/alarms"))


def test_nothing_has_no_sign() -> None:
    """ "The whole error is −0 µm", "-0.0 ± 0.3 µm is left"."""
    u, t = Units(), texts()
    assert number(-0.04, "µm", 0.3) == "+0.0 ± 0.3 µm" and number(-0.04, "µm", signed=False) == "0.0 µm"
    assert plain("it is -0.04 ± 0.3 µm, X +0.0 µm, Y -0.6 µm", u, t) == "it is 0 µm, X 0 µm, Y −0.6 µm"
    assert (signed(-0.02, "µm", u, t), signed(-0.6, "µm", u, t)) == ("0 µm", "−0.6 µm")
