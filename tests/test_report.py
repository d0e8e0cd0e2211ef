"""The report: one file that stands alone, whose verdict is the worst of all checks, with every text in one place."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from support.reports import facts, folder, gathered, outline  # noqa: F401

from tango_cnc.cli import tango
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_readings, write_text
from tango_cnc.judgement import Judgement
from tango_cnc.nightly.words import headline, value
from tango_cnc.records import InputError, TangoError
from tango_cnc.report import page, pdf
from tango_cnc.report.answer import by_limit
from tango_cnc.report.characters import bar, colored, sparkline
from tango_cnc.report.checks import verdict
from tango_cnc.report.drawings import drawing
from tango_cnc.report.facts import Facts, NewestNight, Wishes, effects
from tango_cnc.report.later import newer_answer
from tango_cnc.report.may import _after, may
from tango_cnc.report.orders import parts_since
from tango_cnc.report.repeated import as_decided
from tango_cnc.report.svg import Canvas, Mark, Plotted, chart, ticks
from tango_cnc.report.terminal import summary
from tango_cnc.report.texts import texts, texts_of
from tango_cnc.report.units import Units
from tango_cnc.report.verdict import Check, worst_of
from tango_cnc.report.words import spoken
from tango_cnc.terms import causes
from tango_cnc.texts import say

ROOT = Path(__file__).parents[1]


def report(folder: Path, *options: str) -> Result:
    return CliRunner().invoke(tango, ["report", "-C", str(folder), *options], standalone_mode=False)


@pytest.mark.long
def test_the_command_writes_a_page_and_a_pdf_and_says_the_verdict(folder: Path) -> None:
    pytest.importorskip("typst")
    found = report(folder, "--pdf", str(folder / "report.pdf"), "--json", "-", "--limit-um", "50")
    assert found.exception is None, found.output
    data = json.loads(found.stdout)
    assert data["overall"] == "look" and data["verdict"] == "trustworthy"
    assert data["checks"][-1]["name"] == "limit"
    assert 100 < data["volume_worst_um"] < 140
    assert 0.9 < data["held_out"]["ratio_to_expected"] < 1.1
    names = list(data["effects_um"])
    assert names[0] == "EX0C"
    assert {"machine.yaml", "readings.csv", "tango.yaml"} <= {f["file"] for f in data["files"]}
    assert "world.yaml" not in {f["file"] for f in data["files"]}
    pdf = (folder / "report.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-") and len(pdf) < 2_000_000
    page_text = (folder / "report.html").read_text(encoding="utf-8")
    assert len(page_text.encode()) < 2_000_000
    assert "Make no parts on it before it is put right." in " ".join(outline(page_text).text)


@pytest.mark.long
def test_the_page_needs_no_network(facts: Facts) -> None:
    text = page.render(facts)
    read = outline(text)
    assert read.addresses == []
    addresses = set(re.findall(r"(?:https?:)?//[a-z][\w.]*", text))
    assert addresses == {"http://www.w3.org"}  # the name of SVG, which nothing loads
    assert "@import" not in text and "url(" not in text


def test_the_page_has_every_section_and_what_an_auditor_asks_for(facts: Facts) -> None:
    read = outline(page.render(facts))
    keys = (
        *("todo", "largest", "fit", "predicts", "volume", "diagnosis", "trend", "compensation", "iso", "parameters"),
        *("setup", "unseen", "uncertainty", "audit"),
    )
    assert read.headings == [texts()(f"report.{key}") for key in keys]
    text = " ".join(read.text)
    assert "C axis off in X" in text
    assert re.search(r"−11[34]\.\d+", text)  # EX0C, µm
    for wanted in (
        "squareness",
        "Ann <owner>",
        "Bob & Co",
        "2026-11-23 06:00:00 UTC",
        "repeats to 0.7 µm",
        "scale bar 304.6686 mm",
    ):
        assert wanted in text, wanted


@pytest.mark.few(0)
def test_a_simulation_says_so_beside_its_verdict(facts: Facts) -> None:
    """Nobody takes the page of a simulated machine for one of a real machine."""
    line = texts()("audit.simulated")
    assert line not in page.render(facts)
    made_up = page.render(replace(facts, paper=replace(facts.paper, simulated=True)))
    assert made_up.index('<section class="verdict') < made_up.index(line) < made_up.index('<section class="todo')


def test_the_chain_of_axes_stands_below_the_answer(facts: Facts) -> None:
    """Who makes parts reads the answer before a code that only the engineer can read."""
    text = page.render(facts)
    assert 0 < text.index("May I make parts?") < text.index(f"Chain of axes: {facts.cell.machine.topology}")
    assert facts.cell.machine.topology not in text.partition("May I make parts?")[0]


def test_file_date_and_owner_stand_at_the_top(facts: Facts) -> None:
    paper = replace(facts.paper, readings="readings.csv", measured="2026-11-22T21:00:00Z")
    top = page.render(replace(facts, paper=paper)).partition('<section class="verdict')[0]
    assert "readings.csv, of Sun 22 Nov 2026, 21:00 UTC" in top
    assert "Ann &lt;owner&gt;" in top


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("measured", "said", "todo"),
    [
        ("2026-11-21T21:00:00Z", "The readings of this report were made before it", "Go by the page of the newest night"),
        ("2026-11-22T09:00:00Z", "The readings of this report were made after it", "Call Ann"),
        ("", "is not on record", "Go by the page of the newest night"),
    ],
)
def test_readings_say_whether_they_are_older_than_the_newest_night(measured: str, said: str, todo: str, facts: Facts) -> None:
    paper = replace(facts.paper, measured=measured, owner="Ann")
    last = NewestNight("2026-11-22", "changed", "C axis has moved", 1, "2026-11-22T02:30:00Z")
    text = page.render(replace(facts, paper=paper, nights=last))
    assert said in text and todo in text


@pytest.mark.long
def test_a_report_says_what_the_page_of_the_machine_says(facts: Facts, tmp_path: Path) -> None:
    """One answer, one number and one cause for one state, whatever the readings of the report are."""
    from starlette.testclient import TestClient
    from support.nights import knock, night
    from support.server import cell

    from tango_cnc.commands.report import nights
    from tango_cnc.web.app import create
    from tango_cnc.web.settings import Settings

    limit = {"what": "volume", "value": 51.0, "low": 50.0, "high": 52.0, "limit": 45.0, "unit": "µm", "passed": False}
    stories = {
        "no": [night("HU40T-like", i, "out_of_limits", limits=[limit]) for i in range(2)],
        "but": [night("HU40T-like", 0), night("HU40T-like", 1, "changed", alarms=[knock("2026-10-25")])],
        "missed": [night("HU40T-like", 0), night("HU40T-like", 1, "not_measured", limits=[], volume=None)],
    }
    for name, records in stories.items():
        folder = cell(tmp_path / name, records=records)
        here = replace(facts, nights=nights(folder, facts.cell.machine, Units(), texts()))
        with TestClient(create(Settings((folder,))), base_url="http://127.0.0.1") as client:
            there = client.get("/machine/HU40T-like").text
        assert _answer(page.render(here)) == _answer(there), name
        assert page.as_json(here)["may_make_parts"] == ("no" if name == "no" else "but")
        assert here.nights is not None and (not here.nights.cause or here.nights.cause.rstrip(".") in there)


def _answer(text: str) -> tuple[str, str]:
    """page → the word of the answer and the numbers beside it."""
    box = text.partition('<section class="verdict')[2].partition("</section>")[0]
    return re.findall(r"<b>([^<]*)", box)[0].strip(), "".join(re.findall(r'class="numbers">([^<]*)', box))


@pytest.mark.long
def test_the_number_of_a_report_is_that_of_a_night_from_the_same_readings(facts: Facts, tmp_path: Path) -> None:
    """Over every corner of the touched ranges; between touched positions there is another, smaller one, and it says so."""
    from tango_cnc.history import opened
    from tango_cnc.state.volume import of_estimate

    place = tmp_path / "history.db"
    shutil.copytree(ROOT / "examples" / "hu40t", tmp_path / "cell")
    arguments = ["history", "simulate", str(place), "-C", str(tmp_path / "cell"), "--nights", "1"]
    assert CliRunner().invoke(tango, arguments, standalone_mode=False).exception is None
    with opened(place, create=False) as history:
        entry = history.nights("HU40T-like")[0].entry
        recorded, text = history.night(entry).record["volume"], history.readings_of([entry])[entry]
    write_text(tmp_path / "night.csv", text)
    readings = read_readings(tmp_path / "night.csv", facts.cell.machine, facts.cell.artefact)
    found = of_estimate(estimate(facts.cell.machine, facts.cell.artefact, readings, facts.cell.terms))
    assert found is not None and found.worst * 1e3 == pytest.approx(recorded["worst_um"], rel=1e-3)
    assert facts.tip is not None and facts.within is not None and facts.within[0] < 0.9 * facts.tip.worst
    rows = page.context(facts)["volume"]["rows"]
    assert [row["where"] for row in rows][:2] == [texts()("volume.corners"), texts()("volume.touched")]


@pytest.mark.long
def test_a_report_without_a_limit_says_how_to_state_one(facts: Facts) -> None:
    """'A limit is missing' above 'Nothing. Keep this report.' helps nobody."""
    assert facts.wishes.limit is None
    found = page.context(facts)
    assert found["may"].word == "Nobody knows"
    assert any("State a limit" in line for line in found["todo"]) and any("--limit-um" in line for line in found["office"])
    assert "Nothing. Keep this report." not in page.render(facts) and "--limit-um" in summary(facts, 200)
    judged = replace(facts, wishes=replace(facts.wishes, limit=1.0))
    assert not any("State a limit" in line for line in page.context(judged)["todo"]) and "--limit-um" not in summary(judged, 200)


@pytest.mark.few(0)
def test_a_parameter_that_is_not_to_be_trusted_is_marked_where_it_is_first_seen(facts: Facts) -> None:
    name = page.context(facts)["largest"][0]["name"]
    doubted = replace(facts, judgement=replace(facts.judgement, untrusted=(name,)))
    first = page.render(doubted).partition("Does the model fit the touches?")[0]
    assert f"but {name} must not be used" in first and f'<code>{name}</code> <span class="key">' in first
    assert "must not be used" not in page.render(facts)


def test_old_readings_do_not_say_good_beside_a_night_that_does_not(facts: Facts) -> None:
    t = texts()
    quiet = verdict(replace(facts, nights=NewestNight("2026-11-22", "good", "as it should be", 0)), t)
    assert [c.level for c in quiet.checks if c.name == "nights"] == ["good"]
    limits = [{"what": "volume", "value": 50.0, "low": 48.0, "high": 52.0, "unit": "µm", "limit": 80.0, "passed": True}]
    told = NewestNight("2026-11-22", "good", "", 0, record={"verdict": "good", "night": "2026-11-22", "limits": limits})
    for limit, word in ((None, "Yes"), (0.08, "Yes"), (0.09, "Yes"), (0.051, "Yes, but"), (0.04, "No")):
        asked = replace(facts, nights=told, wishes=replace(facts.wishes, limit=limit))
        answer = told.answer(asked.wishes.units, t, asked.cell.machine, limit)
        assert answer.word == word and (limit != 0.04 or "50 µm, 40 µm allowed" in answer.numbers)
    bad = verdict(replace(facts, nights=NewestNight("2026-11-22", "out_of_limits", "volume is 75.9 µm, 60 µm are allowed.", 4)), t)
    assert bad.level == "look" and bad.worst is not None and bad.worst.name == "nights"
    assert all(part in page.sentence(bad, t) for part in ("Sun 22 Nov 2026", "76 µm", "Open alarms: 4"))
    assert "Call Ann <owner> about its alarms." in bad.worst.todo and "tango " not in bad.worst.todo
    assert verdict(replace(facts, nights=NewestNight("2026-11-22", "good", "", 1)), t).worst.name == "nights"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("since", "rate", "dated"), [("20", None, "night ending Sat 21 Nov 2026"), ("12", 0.002, "Thu 12 Nov 2026")]
)
@pytest.mark.parametrize("beyond", [True, False])
def test_the_box_of_the_nights_dates_an_alarm_by_the_night_that_raised_it(
    since: str, rate: float | None, dated: str, beyond: bool, facts: Facts
) -> None:
    """It had the date of the night before: one change with two dates on one page. A drift keeps the date since which it goes on."""
    text = say("changed.unnamed", name="EY0C", size="+20 µm", since=f"2026-11-{since}")
    alarm = {"id": "2026-11-21-020000-1", "night": "2026-11-21", "since": f"2026-11-{since}", "text": text, "rate_per_day": rate}
    alarm |= {"parameter": "EY0C", "decision": None, "owner": None, "now": ""}
    limits = [{"what": "volume", "value": 75.9, "unit": "µm", "limit": 60.0, "passed": not beyond}]
    record: dict[str, Any] = {"night": "2026-11-22", "kind": "check", "status": "complete", "standing": [alarm], "limits": limits}
    record |= {"verdict": "out_of_limits" if beyond else "changed", "alarms": []}
    record |= {"headline": headline(record)}

    def boxed(nights: NewestNight) -> Check:
        return next(c for c in verdict(replace(facts, nights=nights), texts()).checks if c.name == "nights")

    for said in (as_decided(record, ()), record["headline"]):
        box = boxed(NewestNight("2026-11-22", record["verdict"], said, 1, record=record))
        assert f"+20 µm since {'the ' if rate is None else ''}{dated}" in box.text and "Fri 20" not in box.text
    tonight = {**record, "night": "2026-11-21", "standing": [], "alarms": [alarm | {"text": text.but(since="last night")}]}
    box = boxed(NewestNight("2026-11-21", record["verdict"], headline(tonight), 1, record=tonight))
    assert "the night before" not in box.text and (rate is not None or f"since the {dated}" in box.text)


def test_the_box_of_the_nights_has_the_size_that_an_alarm_has_on_its_page(facts: Facts) -> None:
    """It had +19 µm, the number of the night of the alarm, where the page had +21 µm."""
    text = say("changed.unnamed", name="EY0C", size=value(0.0191, "mm", 0.0005), since="2026-11-11")
    alarm = {"id": "2026-11-12-020000-1", "night": "2026-11-12", "since": "2026-11-11", "text": text, "rate_per_day": None}
    alarm |= {"parameter": "EY0C", "decision": None, "owner": None, "unit": "mm", "size": 0.0191, "std": 0.0005, "total": 0.0212}
    alarm |= {"now": say("night.alarms.still_there", told=value(0.0212, "mm", 0.0005))}
    limits = [{"what": "volume", "value": 75.9, "unit": "µm", "limit": 60.0, "passed": False}]
    record: dict[str, Any] = {"night": "2026-11-30", "kind": "check", "status": "complete", "standing": [alarm], "limits": limits}
    record |= {"verdict": "out_of_limits", "alarms": []}
    record |= {"headline": headline(record)}
    night = NewestNight("2026-11-30", "out_of_limits", as_decided(record, ()), 1, record=record)
    box = next(c for c in verdict(replace(facts, nights=night), texts()).checks if c.name == "nights")
    assert "by +21 µm since the night ending Thu 12 Nov 2026" in box.text and "+19" not in box.text


def test_letters_of_pictures_are_legible_on_paper() -> None:
    """A drawing of 36 pt had letters of 3.7 pt, a picture over half a page such of 5.5 pt."""
    drawn = '<svg xmlns="x" viewBox="0 0 108 78" width="108" height="78" font-size="10"><text font-size="40">X</text></svg>'
    assert pdf.legible(drawn, 54.0) == drawn.replace('"10"', '"13"')  # 6.5 pt at half its size
    assert pdf.legible(drawn, 108.0) == drawn and pdf.legible("<svg>", 5.0) == "<svg>"


@pytest.mark.long
def test_inches_change_every_length_and_no_ratio(facts: Facts) -> None:
    inch = replace(facts, wishes=replace(facts.wishes, units=Units("inch")))
    here, there = (page.context(f)["parameters"] for f in (facts, inch))
    one = {row["name"]: row for row in here}
    two = {row["name"]: row for row in there}
    assert two["EX0C"]["unit"] == "µin"
    assert two["EX0C"]["number"] == pytest.approx(one["EX0C"]["number"] / 0.0254)
    assert two["EYY1"]["unit"] == "µin/in" and two["EYY1"]["number"] == pytest.approx(one["EYY1"]["number"])
    assert two["EA0C"]["unit"] == "µrad" and two["EA0C"]["number"] == pytest.approx(one["EA0C"]["number"])
    assert "µm" not in " ".join(t for t in outline(page.render(inch)).text if "uncertainty" not in t and "µm/m" not in t)


@pytest.mark.few(0)
def test_the_places_of_slices_and_covariates_are_in_inch_too(facts: Facts) -> None:
    """A slice at Z 336 mm stands at 13.2 in, and no axis of a picture says mm."""
    from tango_cnc.report.charts import _placed
    from tango_cnc.report.slices import _placed as place

    inch = replace(facts, wishes=replace(facts.wishes, units=Units("inch")))
    text = page.render(inch)
    assert not re.findall(r">[^<]*\bmm<", text) and re.findall(r">Z, in<", text)
    assert place("Z", 335.9, True, Units("inch")) == "Z 13.2" and place("Z", -335.9, True, Units()) == "Z −336"
    assert place("B", 75.2, False, Units("inch")) == "B 75°"
    assert _placed(np.array([254.0]), "mm", "µin")[0] == pytest.approx(10) and _placed(np.array([1.0]), "deg", "µin")[1] == "deg"


LEVELS = [("good",), ("good", "look"), ("stop", "good"), ("look", "stop", "look")]


@pytest.mark.parametrize("levels", LEVELS)
def test_the_verdict_is_the_worst_and_nothing_is_green_beside_a_stop(levels: Any) -> None:
    found = worst_of([Check(str(i), level, "", "") for i, level in enumerate(levels)])
    order = ("good", "look", "stop")
    assert order.index(found.level) == max(map(order.index, levels))
    if found.level == "stop":
        assert not [c for c in found.checks if c.level == "good" and not c.open]


@pytest.mark.few(0)
def test_every_box_knows_of_a_result_that_must_not_be_used(facts: Facts) -> None:
    spoilt = replace(facts, result=replace(facts.result, sigma=0.05))
    judged = verdict(spoilt, texts())
    assert judged.level == "stop" and judged.worst is not None and judged.worst.name == "fit"
    text = page.render(spoilt)
    assert '<div class="check good">' not in text
    assert "Do not use these numbers" in text


def test_an_implausible_result_has_nothing_green(facts: Facts) -> None:
    lulled = replace(facts, judgement=Judgement("implausible", ("scale of X: −2 000 019 µm/m",)))
    judged = verdict(lulled, texts())
    assert judged.level == "stop" and judged.worst is not None and judged.worst.name == "plausible"
    text = page.render(lulled)
    assert '<div class="check good">' not in text and "−2 000 019 µm/m" in text


@pytest.mark.long
def test_half_of_the_touches_missing_is_no_good_result(facts: Facts) -> None:
    keep = np.arange(len(facts.readings)) % 2 == 0
    cell = facts.cell
    half = gathered(cell, facts.readings.rows(keep), replace(facts.wishes, diagnosis=False), facts.paper)
    judged = verdict(half, texts())
    assert judged.level == "stop"
    assert next(c for c in judged.checks if c.name == "complete").level == "stop"


@pytest.mark.long
def test_a_touch_that_does_not_fit_is_named_with_its_place(facts: Facts) -> None:
    position = facts.readings.position.copy()
    position[99, :3] += 0.03
    chipped = gathered(facts.cell, replace(facts.readings, position=position), replace(facts.wishes, diagnosis=False), facts.paper)
    assert page.as_json(chipped)["outliers"] == [100]
    context = page.context(chipped)
    assert context["flagged"][0]["touch"] == "100" and context["flagged"][0]["where"]
    assert "100" in context["flagged"][0]["touch"] and len(context["todo"]) > 1


@pytest.mark.long
def test_with_setup_terms_alone_it_does_not_praise_the_machine(facts: Facts) -> None:
    bare = gathered(facts.cell, facts.readings, Wishes(("S1",), diagnosis=False), facts.paper)
    judged = verdict(bare, texts())
    assert judged.level == "stop"
    assert "its tool tip cannot be predicted" in " ".join(outline(page.render(bare)).text)


def test_what_names_of_machine_and_facets_hold_is_text_and_no_markup(facts: Facts) -> None:
    evil = "<script>alert(1)</script>\"'&{{7*7}}"
    machine = replace(facts.cell.machine, name=evil)
    text = page.render(replace(facts, cell=replace(facts.cell, machine=machine)))
    assert "<script>alert" not in text and "49" not in re.findall(r"<h1>(.*?)</h1>", text)[0]
    assert "alert(1)" in " ".join(outline(text).text)


@pytest.mark.few(0)
def test_a_shop_can_change_templates_and_texts(facts: Facts, tmp_path: Path) -> None:
    (tmp_path / "texts.toml").write_text('[level]\ngood = "In Ordnung"\n', encoding="utf-8")
    assert "In Ordnung" in page.render(facts, tmp_path)
    (tmp_path / "report.html").write_text("<p>{{ machine.name }}: {{ t('level.good') }}</p>", encoding="utf-8")
    assert page.render(facts, tmp_path) == "<p>HU40T-like: In Ordnung</p>"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[level]\nfine = "x"\n', "unknown key 'level.fine'"),
        ('[fit]\ncounts = "{touch}"\n', "found {touch}"),
        ('[fit]\ncounts = "{touches"\n', "texts.toml"),
        ("level = [", "texts.toml"),
    ],
)
def test_mistakes_in_texts_are_told(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "texts.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(said)):
        texts_of(tmp_path)


@pytest.mark.long
def test_a_mistake_in_a_template_is_told_with_its_line(facts: Facts, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("<p>\n{{ machine.name }\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"report\.html:2"):
        page.render(facts, tmp_path)
    for mistake in ("nothing_like_it", "machine.name.nothing_like_it.more", "1 / 0", "''.__class__"):
        (tmp_path / "report.html").write_text("<p>\n\n{{ " + mistake + " }}", encoding="utf-8")
        with pytest.raises(InputError, match=re.escape(f"{tmp_path / 'report.html'}:3: ")):
            page.render(facts, tmp_path)


def test_every_text_that_is_used_is_there() -> None:
    source = ""
    for part in ("report", "web", "nightly"):
        for file in (ROOT / "tango_cnc" / part).rglob("*"):
            if file.suffix in (".py", ".html", ".typ"):
                source += file.read_text(encoding="utf-8")
    used = set(re.findall(r"""\bt\(\s*["']([a-z_]+\.[a-z0-9_]+)["']""", source))
    started = {key for key in used if key.endswith("_")}  # the rest of their name is computed
    assert not used - started - set(texts().keys)
    assert all(any(key.startswith(start) for key in texts().keys) for start in started)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("EX0C", "C axis off in X"),
        ("EA0B", "B axis tilted about X"),
        ("EB0Z", "Z axis out of square, turned about Y"),
        ("EY0S", "spindle off in Y"),
        ("EXX1", "scale of X"),
        ("EYY1-EXX1", "scale of Y against X"),
        ("EBBb", "backlash of B (half the reversal value)"),
        ("EYX2", "straightness of X in Y, quadratic part"),
        ("EXC3", "run-out of C in X, cubic part"),
        ("ECZ1", "tilt of Z about Z while it moves, linear part"),
        ("thermal_drift", "thermal_drift"),
    ],
)
def test_names_in_words_and_drawings(name: str, words: str) -> None:
    machine = read_cell(ROOT / "examples" / "hu40t").machine
    assert spoken(name, machine) == words
    assert ("<svg" in drawing(name, machine)) == name.startswith("E")


@pytest.mark.parametrize(
    ("low", "high", "most", "wanted"),
    [
        (0.0, 10.0, 5, [0, 2, 4, 6, 8, 10]),
        (0.3, 1.9, 3, [0.5, 1.0, 1.5]),  # 1 alone would show no scale
        (-0.7, 9.3, 2, [0, 5]),
        (2.0, 2.0, 5, [2]),
        (120.4, 129.9, 4, [122.5, 125, 127.5]),
    ],
)
def test_an_axis_has_two_numbers_at_least(low: float, high: float, most: int, wanted: list[float]) -> None:
    assert ticks(low, high, most) == pytest.approx(wanted)


def test_pictures_for_the_terminal() -> None:
    assert sparkline([0, 1, 2, 3, 4, 5, 6, 7]) == "▁▂▃▄▅▆▇█"
    assert sparkline([1, float("nan"), 1]) == "▄ ▄"
    assert len(sparkline(list(range(1000)), 20)) == 20
    assert bar(5, 2, 10, 21) == "··········│··══●══···"
    assert bar(0, 1, 10, 21).count("●") == 1

    class Terminal:
        def isatty(self) -> bool:
            return True

    assert colored("x", "stop", out=Terminal(), environ={"TERM": "xterm"}) == "\x1b[31mx\x1b[0m"
    assert colored("x", "stop", out=Terminal(), environ={"TERM": "xterm", "NO_COLOR": "1"}) == "x"


@pytest.mark.parametrize("columns", [40, 80, 132])
def test_the_summary_keeps_to_the_width_of_the_terminal(facts: Facts, columns: int) -> None:
    lines = summary(facts, columns).splitlines()
    assert max(map(len, lines)) <= columns
    assert (
        "May I make parts? Nobody knows." in lines[0]
        and any("Look" in line for line in lines)
        and any("EX0C" in line for line in lines)
    )
    pairs = {r["name"]: (r["low"], r["high"]) for r in page.parameters(facts, texts(), most=8)}
    for line in lines:
        if "…" in line and line.split()[0] in pairs:  # no number is cut off
            low, high = pairs[line.split()[0]]
            assert line.endswith(f"{low} … {high}")


@pytest.mark.long
def test_the_trend_of_a_history_and_what_a_compensation_promised_are_on_the_page(facts: Facts, tmp_path: Path) -> None:
    from support.server import cell as with_nights

    from tango_cnc.commands.report import trend

    folder = with_nights(tmp_path / "cell")
    past = trend(folder, "HU40T-like", ["EX0C", "NOTHING"], texts())
    assert past is not None and [s["title"] for s in past["series"]] == ["EX0C"]
    assert past["series"][0]["unit"] == "µm" and sum(past["series"][0]["alarm"]) == 1
    assert trend(tmp_path, "HU40T-like", ["EX0C"], texts()) is None
    rows = [("rms", 50.0, 4.0, 4.4), ("p95", 90.0, 8.0, None)]
    done = {"target": "siemens", "date": "2026-11-01", "event": "kept", "rows": rows}
    values = page.context(replace(facts, trend=past, compensations=(done,)))
    assert len(values["trend"]) == 1 and "<svg" in values["trend"][0]["picture"]
    assert "Jumped by +20 µm on Thu 5 Nov 2026" in values["trend"][0]["said"]
    assert values["compensations"][0]["rows"][0] == ("rms error of the tool tip, µm", "50.0", "4.0", "4.4")
    assert values["compensations"][0]["rows"][1][-1] == "–"


def test_what_a_cause_says_can_be_translated(tmp_path: Path) -> None:
    (tmp_path / "texts.toml").write_text('[diagnosed.chip]\nmeaning = "ein Span"\n', encoding="utf-8")
    assert texts_of(tmp_path)("diagnosed.chip.meaning") == "ein Span"
    assert all(texts()(f"diagnosed.{name}.{what}") for name in causes() for what in ("text", "says", "meaning", "advice"))


@pytest.mark.parametrize(("limit", "status"), [("50", 1), ("500", 0)])
@pytest.mark.long
def test_a_machine_beyond_its_limit_ends_with_a_status_of_its_own(limit: str, status: int, folder: Path) -> None:
    """The numbers can be used, the machine cannot: a script sees it."""
    found = report(folder, "--no-diagnosis", "--no-pictures", "-o", str(folder / "limit.html"), "--limit-um", limit)
    assert found.exception is None and found.return_value == status


@pytest.mark.long
def test_a_no_by_the_last_night_ends_with_a_status_of_its_own(tmp_path: Path) -> None:
    """These readings are within the limit; the night after them was not."""
    from support.nights import night

    from tango_cnc.history import opened

    cell = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", cell)
    (cell / "nightly.yaml").write_text("nightly: 1\nlimits: {volume: 60}\n")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(cell)], standalone_mode=False).exception is None
    arguments = ("--no-diagnosis", "--no-pictures", "-o", str(tmp_path / "r.html"))
    assert report(cell, *arguments).return_value == 0
    limit = {"what": "volume", "value": 102.0, "low": 100.0, "high": 104.0, "limit": 60.0, "unit": "µm", "passed": False}
    last = night("trunnion", 0, "out_of_limits", limits=[limit], volume={"worst_um": 102.0, "std_um": 1.0})
    with opened(cell / "history.db") as history:
        history.add_night(last, "touch\n1\n")
    assert report(cell, *arguments).return_value == 1


def test_a_looser_limit_judges_the_night_as_well_as_a_stricter_one() -> None:
    limit = {"what": "volume", "value": 51.0, "unit": "µm", "low": 50.0, "high": 52.0, "limit": 30.0, "passed": False}
    record = {"verdict": "out_of_limits", "limits": [limit], "volume": {"worst_um": 51.0, "std_um": 0.5}}
    looser, strict = by_limit(record, 200.0), by_limit(record | {"verdict": "good", "limits": [limit | {"limit": 90.0}]}, 40.0)
    assert (looser["verdict"], looser["limits"][0]["limit"], looser["limits"][0]["passed"]) == ("good", 200.0, True)
    assert by_limit(record | {"alarms": [{}]}, 200.0)["verdict"] == "changed" and strict["limits"][0]["passed"] is False
    other = {"what": "EX0C", "value": 30.0, "unit": "µm", "low": 29.0, "high": 31.0, "limit": 20.0, "passed": False}
    assert by_limit(record | {"limits": [limit, other]}, 200.0)["verdict"] == "out_of_limits"
    (bare,) = by_limit(record | {"verdict": "good", "limits": []}, 51.2)["limits"]  # a night without a limit
    assert bare["passed"] is None and bare["limit"] == 51.2 and by_limit(record, None) is record


@pytest.mark.parametrize(
    ("asked", "stated", "may_", "why", "basis"),
    [
        (0.2, 0.03, "but", "By the 30 µm of nightly.yaml the answer is: No", "200 µm was asked for in this report alone"),
        (0.2, 0.3, "yes", "", "nightly.yaml states 300 µm"),
        (0.12, None, "yes", "", "the limit that is stated now: 120 µm; that of the night was 90 µm"),
        (0.04, None, "no", "before it is put right", "the limit that is stated now: 40 µm; that of the night was 90 µm"),
        (0.09, None, "yes", "", "as on the page of the machine"),
    ],
)
def test_the_answer_is_by_the_limit_that_is_asked_for_and_says_which_it_was(
    facts: Facts, asked: float, stated: float | None, may_: str, why: str, basis: str
) -> None:
    limit = {"what": "volume", "value": 51.0, "unit": "µm", "low": 50.0, "high": 52.0, "limit": 90.0, "passed": True}
    record = {"verdict": "good", "night": "2026-11-20", "limits": [limit], "volume": {"worst_um": 51.0, "std_um": 0.5}}
    found = NewestNight("2026-11-20", "good", "nothing has changed", 0, "2026-11-20T02:30:00+00:00", record)
    told = may(replace(facts, nights=found, wishes=replace(facts.wishes, limit=asked, stated=stated)), texts())
    assert told.answer.may == may_ and why in told.answer.why and basis in told.basis
    assert f"51 µm, {1e3 * asked:.0f} µm allowed" in told.answer.numbers
    late = may(
        replace(facts, nights=replace(found, late="2026-11-10"), wishes=replace(facts.wishes, limit=asked, stated=stated)), texts()
    )
    assert late.answer.may != "yes" and why in late.answer.why  # what else makes it a "but" hides nothing


@pytest.mark.long
def test_figures_are_those_of_tango_iso230_and_what_is_withheld_has_no_number(facts: Facts) -> None:
    sheet = facts.sheet
    assert not isinstance(sheet, str)
    shown = {f["name"]: f for f in page.as_json(facts)["iso230"] if not f["fitted_alone"]}
    assert {name: f["value"] for name, f in shown.items()} == {f.name: f.value for f in sheet.figures}
    assert any(f["value"] is None for f in shown.values())
    rows = page.context(facts, texts())["iso"]
    for name in {f.name for f in sheet.figures}:  # the gain of EZZ may be withheld, and its linearity not
        withheld = [f for f in sheet.figures if f.name == name and f.value is None]
        without = [r for r in rows if r["name"] == name and r["value"] == "–"]
        assert len(without) == len(withheld)
        assert all(any(all(motion in r["note"] for motion in f.mixed) for r in without) for f in withheld)
    listed = " ".join(page.context(facts, texts())["unseen"])
    assert all(f.name in listed for f in sheet.figures if f.value is None and not f.name.endswith((" ends", " zone")))
    assert texts()("unseen.none") not in listed
    assert any(text.startswith("EZZb") for text in page.as_json(facts)["not_identifiable"])
    assert "EYY1 may hold EAY" in listed
    alone = [r for r in rows if texts()("iso.alone") in r["note"]]
    assert {r["name"] for r in alone} >= {"C to B", "C to X"}


def test_the_page_is_not_written_under_the_name_of_a_pdf(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"tango report -C \S+ --pdf"):
        CliRunner().invoke(
            tango, ["report", "-C", str(tmp_path), "-o", str(tmp_path / "x.pdf")], standalone_mode=False, catch_exceptions=False
        )
    assert not (tmp_path / "x.pdf").exists()


def test_what_a_line_allows_stands_where_no_point_is() -> None:
    """Nights right above the limit at the left end and far below it at the right: the text goes to the right end."""
    x = np.arange(22.0)
    y = np.where(x < 11, 171.0, 145.0)
    drawn = chart([Plotted(x, y, "squares")], Canvas(860, 240, from_zero=True), [Mark("160 µm allowed", y=160.0)])
    (place,) = re.findall(r"<text ([^>]*)>160 µm allowed", drawn)
    assert 'text-anchor="end"' in place
    low = chart([Plotted(x, y - 100, "squares")], Canvas(860, 240, from_zero=True), [Mark("160 µm allowed", y=160.0)])
    (place,) = re.findall(r"<text ([^>]*)>160 µm allowed", low)
    assert "text-anchor" not in place


@pytest.mark.few(0)
@pytest.mark.parametrize("name", ["heading", "sentence"])
def test_the_head_of_a_table_is_on_the_page_of_its_first_row(name: str, tmp_path: Path) -> None:
    """At every height of the page at which the table may begin."""
    typst = pytest.importorskip("typst")
    template = (Path(page.__file__).parent / "templates" / "report.typ").read_text(encoding="utf-8")
    defined = template[template.index("#show heading.where(level: 1)") : template.index("#text(18pt")]

    def mark(what: str, height: int) -> str:
        return f'[#context [#metadata(("{what}", {height}, here().page())) <mark>] {what}]'

    def begun(height: int) -> str:
        before = f"= {mark('before', height)[1:-1]}" if name == "heading" else f"#before-table{mark('before', height)}"
        head, first = mark("head", height), mark("first", height)
        return f"#v({height}mm)\n{before}\n#rows((1fr, 1fr), (left, left), head: ({head}, [b]), {first}, [#v(9mm)], [3], [4])\n"

    source = tmp_path / "x.typ"
    pages = "#pagebreak()\n".join(begun(height) for height in range(150, 262, 2))
    source.write_text(f'#set page(paper: "a4", margin: 18mm)\n{defined}\n{pages}', encoding="utf-8")
    at: dict[int, dict[str, int]] = {}
    for found in json.loads(typst.query(str(source), "<mark>")):
        what, height, number = found["value"]
        at.setdefault(height, {}).setdefault(what, number)  # where the head is printed first
    assert len(at) == 56 and all(len(found) == 3 for found in at.values())
    assert not [height for height, found in at.items() if len(set(found.values())) != 1]


@pytest.mark.few(0)
@pytest.mark.parametrize(("larger", "verdict"), [(0.5, "good"), (0.5, "changed"), (1.0, "good")])
def test_readings_newer_than_the_night_say_of_which_run_each_number_is(facts: Facts, larger: float, verdict: str) -> None:
    """The error of the night is half that of these readings, or the same."""
    assert facts.tip is not None
    here = 1e3 * facts.tip.worst
    there = larger * here
    limit = {"what": "volume", "value": there, "unit": "µm", "low": there - 1, "high": there + 1, "limit": 1000.0, "passed": True}
    record = {"verdict": verdict, "night": "2026-11-20", "limits": [limit], "volume": {"worst_um": there, "std_um": 0.5}}
    record["parameters"] = {n: {"value": larger * p.value, "std": 1e-6} for n, p in facts.result.parameters.items()}
    paper = replace(facts.paper, measured="2026-11-20T09:00:00Z")
    orders = ("Measure the first part before you go on.", "Call Bob.", "Ask who was at the machine.")
    moved = {"cause": "Spindle has moved. Still there.", "brief": "Spindle has moved.", "todo": orders, "asks": orders[1]}
    moved = moved if verdict == "changed" else {}
    night = NewestNight("2026-11-20", verdict, "", 0, "2026-11-20T02:30:00+00:00", record, **moved)
    newer = replace(facts, nights=night, paper=paper, wishes=replace(facts.wishes, limit=1.0))
    told, found = may(newer, texts()), page.context(newer)
    yes = replace(told.answer, may="yes")
    assert _after(yes, newer, texts()).may == ("but" if larger < 1 else "yes")
    assert told.answer.may == "but" and f"{here:.0f} µm, 1000 µm allowed" in told.answer.numbers
    assert "Fri 20 Nov 2026" in told.run and told.run in page.render(newer)
    assert f"before them, it was {there:.0f} µm" in told.run
    lines = " ".join(found["todo"])
    if verdict == "changed":  # as the box begins and as the page of the machine has it; one person is called
        assert found["cause"] == "Spindle has moved." and found["todo"][:2] == list(orders[:2])
        assert f"{orders[2]} Show this report as well: it is newer than the night." in lines and "about what" not in lines
    assert ("Look for what has moved since the night." in lines) == (larger < 1)


@pytest.mark.few(3)
@pytest.mark.parametrize("limit", [1e-3, 1.0])
@pytest.mark.parametrize(("simulated", "of_night"), [(False, False), (True, False), (True, True)])
def test_a_report_that_says_no_after_the_night_carries_it_for_the_pages(
    facts: Facts, limit: float, simulated: bool, of_night: bool
) -> None:
    """Above the No of newer readings the page of the server said Yes, but."""
    record = {"verdict": "good", "night": "2026-11-20", "volume": {"worst_um": 0.5, "std_um": 0.1}, "simulated": of_night}
    night = NewestNight("2026-11-20", "good", "", 0, "2026-11-20T02:30:00+00:00", record)
    paper = replace(facts.paper, measured="2026-11-20T09:00:00Z", simulated=simulated)
    told = page.as_json(replace(facts, nights=night, paper=paper, wishes=replace(facts.wishes, limit=limit)))
    wanted = limit < 1 and simulated <= of_night
    assert told["no_after"] == ("2026-11-20T02:30:00+00:00" if wanted else None)
    assert page.as_json(facts)["no_after"] is None


def test_a_report_that_says_no_after_the_night_orders_what_the_pages_of_the_machine_order(facts: Facts) -> None:
    """It called nobody, and left out the parts that were made since the night."""
    assert facts.tip is not None
    volume = {"worst_um": 500 * facts.tip.worst, "std_um": 0.5}
    record: dict[str, Any] = {"verdict": "good", "night": "2026-11-20", "volume": volume}
    record["parameters"] = {n: {"value": 0.5 * p.value, "std": 1e-6} for n, p in facts.result.parameters.items()}
    there, limit = 500 * facts.tip.worst, 750 * facts.tip.worst
    record["limits"] = [
        {"what": "volume", "value": there, "unit": "µm", "low": there, "high": there, "limit": limit, "passed": True}
    ]
    parts = tuple(parts_since("2026-11-20", (), {}, texts()))
    more: dict[str, Any] = {"todo": ("Nothing.",), "asks": "Call Ann.", "parts": parts}
    night = NewestNight("2026-11-20", "good", "", 0, "2026-11-20T02:30:00+00:00", record, **more)
    paper = replace(facts.paper, measured="2026-11-20T09:00:00Z", simulated=False)
    do = page.context(replace(facts, nights=night, paper=paper, wishes=replace(facts.wishes, limit=limit / 1e3)))["todo"]
    since = "Check the parts that were made since the night ending Fri 20 Nov 2026: they may be beyond the limit."
    assert do[:3] == ["Make no parts on it.", "Call Ann.", since] and do[3].startswith("Look for what has moved since the night. ")
    assert "Have the largest errors compensated or repaired. Then run the full measurement." in do[4:]


@pytest.mark.few(1)
@pytest.mark.parametrize("owner", ["", "Dora, 4713"])
def test_a_report_asks_who_has_repaired_what_has_moved_since_the_night(facts: Facts, owner: str) -> None:
    """It sent somebody to look for what had moved; the repair of that morning had moved it."""
    assert facts.tip is not None
    record: dict[str, Any] = {
        "verdict": "good",
        "night": "2026-11-20",
        "volume": {"worst_um": 500 * facts.tip.worst, "std_um": 0.5},
    }
    record["parameters"] = {n: {"value": 0.5 * p.value, "std": 1e-6} for n, p in facts.result.parameters.items()}
    name = next(iter(effects(facts.result)))
    night = NewestNight("2026-11-20", "good", "", 0, "2026-11-20T02:30:00+00:00", record, repaired={name: owner} if owner else {})
    paper = replace(facts.paper, measured="2026-11-20T09:00:00Z")
    (line,) = [x for x in page.context(replace(facts, nights=night, paper=paper))["todo"] if "by the readings of the report" in x]
    assert line.startswith("Ask Dora, 4713 what was done" if owner else "Look for what has moved since the night.")


@pytest.mark.few(1)
@pytest.mark.parametrize(("has", "asks", "calls"), [("Bob", "", False), ("", "Call Bob.", True), ("Bob", "Call Cy.", True)])
def test_a_report_calls_nobody_about_what_somebody_has(facts: Facts, has: str, asks: str, calls: bool) -> None:
    record = {"verdict": "changed", "night": "2026-11-20", "limits": [], "volume": None}
    more: dict[str, Any] = {"has": has, "asks": asks, "owner": "Bob", "todo": ("Measure the first part.", "Ask.")}
    night = NewestNight("2026-11-20", "changed", "", 1, "2026-11-20T02:30:00+00:00", record, **more)
    newer = replace(facts, nights=night, paper=replace(facts.paper, measured="2026-11-20T09:00:00Z"))
    assert ("Call Bob about what the night has found" in " ".join(page.context(newer)["todo"])) == calls


@pytest.mark.few(0)
def test_a_share_is_one_of_the_number_beside_it(facts: Facts) -> None:
    """169 µm by these readings, and below it "which does 122 µm of it", which was of the 137 µm of the night."""
    assert facts.tip is not None
    there = 500.0 * facts.tip.worst
    limit = {"what": "volume", "value": there, "unit": "µm", "low": there - 1, "high": there + 1, "limit": 1.0, "passed": False}
    record = {"verdict": "out_of_limits", "night": "2026-11-20", "limits": [limit], "volume": {"worst_um": there, "std_um": 0.5}}
    share = "Most of it comes from C axis off in X: −91 µm, which does 122 µm of it."
    values: dict[str, Any] = {"cause": share, "brief": share, "todo": ("Have it compensated.",), "share": True}
    night = NewestNight("2026-11-20", "out_of_limits", "", 1, "2026-11-20T02:30:00+00:00", record, **values)
    paper = replace(facts.paper, measured="2026-11-20T09:00:00Z")
    newer = replace(facts, nights=night, paper=paper, wishes=replace(facts.wishes, limit=1e-3))
    told, found = may(newer, texts()), page.context(newer)
    assert told.by_night and f"{1e3 * facts.tip.worst:.0f} µm, 1 µm allowed" in told.answer.numbers
    assert (
        told.cause.startswith("The largest part of it comes from")
        and "122" not in told.cause
        and "122" not in " ".join(found["todo"])
    )
    name = next(iter(effects(facts.result)))
    found_ = facts.result.parameters[name]
    assert found_.unit == "mm" and told.cause.rpartition(": ")[2][0] == ("−" if found_.value < 0 else "+")  # as below it
    own = replace(newer, paper=replace(paper, measured="2026-11-20T02:10:00Z"))  # readings of that night: the number is its own
    assert may(own, texts()).cause == share
    moved = replace(newer, nights=replace(night, cause="Spindle has moved.", brief="", share=False))
    assert may(moved, texts()).cause == "Spindle has moved."  # what has changed is no share


def test_a_report_with_nothing_to_do_is_written(facts: Facts) -> None:
    """It ended with 'No first item' and wrote nothing."""
    values = page.context(facts) | {"todo": []}
    assert texts()("todo.nothing") in page.render(facts, None, values)


@pytest.mark.long
def test_what_must_not_be_used_is_in_the_sentence_about_the_numbers(facts: Facts) -> None:
    """'The numbers can be used' stood above a row that said 'Do not use'."""
    (name,) = [row["name"] for row in page.parameters(facts, texts(), most=1)]
    doubted = replace(facts, judgement=replace(facts.judgement, untrusted=(name,)))
    assert f"Do not use: {name}" in page.context(doubted)["trusted"] and "Do not use" not in page.context(facts)["trusted"]
    assert f"Do not use: {name}" in summary(doubted, 100) and "Do not use:" not in summary(facts, 100)


@pytest.mark.long
def test_a_mistake_is_named_where_no_page_can_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sense of an axis was wrong, a second fit did not settle, and that was all that was said."""

    def lost(*args: object, **more: object) -> None:
        raise TangoError("estimate: the iteration did not settle")

    cell = Path(shutil.copytree(ROOT / "examples" / "trunnion", tmp_path / "cell"))
    assert CliRunner().invoke(tango, ["simulate", "-C", str(cell)]).exit_code == 0
    machine = cell / "machine.yaml"
    machine.write_text(
        re.sub(r"(A: .*direction: \[)1,", r"\g<1>-1,", machine.read_text(encoding="utf-8"), count=1), encoding="utf-8"
    )
    monkeypatch.setattr("tango_cnc.commands.report.gather", lost)
    with pytest.raises(TangoError, match=r"no page was written.*did not settle(.|\n)*most likely: .*A turns the other way"):
        CliRunner().invoke(tango, ["report", "-C", str(cell)], standalone_mode=False, catch_exceptions=False)
    assert not (cell / "report.html").exists()


@pytest.mark.parametrize("changed", [False, True])
def test_a_report_of_newer_readings_orders_what_the_pages_order_where_it_says_yes_but(facts: Facts, changed: bool) -> None:
    """It said "Look for what has moved" alone: no first part, nobody to call, and "this axis" of another one below it."""
    assert facts.tip is not None
    there = 500 * facts.tip.worst
    record: dict[str, Any] = {"verdict": "good", "night": "2026-11-20", "volume": {"worst_um": there, "std_um": 0.5}}
    record["parameters"] = {n: {"value": 0.5 * p.value, "std": 1e-6} for n, p in facts.result.parameters.items()}
    drift, first = "Have this axis looked at.", "Measure the first part before you go on."
    more: dict[str, Any] = {"todo": ("Nothing.",), "asks": "Call Ann."}
    if changed:
        record["verdict"] = "changed"
        more |= {"todo": (first, "Call Ann.", drift), "cause": "Spindle has moved.", "brief": "Spindle has moved."}
    night = NewestNight("2026-11-20", str(record["verdict"]), "", 0, "2026-11-20T02:30:00+00:00", record, **more)
    paper = replace(facts.paper, measured="2026-11-20T09:00:00Z", simulated=False)
    newer = replace(facts, nights=night, paper=paper, wishes=replace(facts.wishes, limit=2 * facts.tip.worst))
    do, told = page.context(newer)["todo"], page.as_json(newer)
    assert do[:2] == [first, "Call Ann."] and do[2].startswith("Look for what has moved since the night. ")
    assert [x for x in do[3:] if drift in x] == ([f"Spindle has moved. {drift}"] if changed else [])
    assert told["may_make_parts"] == "but" and told["after"] == "2026-11-20T02:30:00+00:00" and told["no_after"] is None
    kept = newer_answer(newer)
    assert kept.may == "but" and kept.grown and kept.tip_um == 1e3 * facts.tip.worst and kept.moved is not None
    assert " by the readings of the report; the night ending Fri 20 Nov 2026 has " in summary(newer, 9999)  # and on the terminal
