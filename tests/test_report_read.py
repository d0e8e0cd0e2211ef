"""What a reader meets in the report: a value with its unit, inches without a second "in", all that the answer rests on."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from support.nights import night
from support.reports import facts, folder, outline  # noqa: F401
from support.server import cell

from tango_cnc.commands.report import nights, paper
from tango_cnc.history import opened
from tango_cnc.report import page
from tango_cnc.report.facts import Facts
from tango_cnc.report.pdf import quoted
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units


@pytest.mark.few(0)
def test_a_value_stands_beside_its_unit(facts: Facts) -> None:
    """On a phone the unit was in a column to the right of the screen."""
    text = page.render(facts)
    table = text.partition('<table class="cards largest">')[2].partition("</table>")[0]
    values = re.findall(r'<td class="n value"><b>(.*?)</b>', table)
    assert len(values) == page.LARGEST
    assert all(re.fullmatch(r"−?[\d.]+ (?:µm|µrad|µm/m)", value) for value in values), values


@pytest.mark.few(0)
def test_no_number_in_inches_is_followed_by_the_word_in(facts: Facts) -> None:
    """It read as 0.00084 in in the night."""
    keys = ("report.since_then", "todo.grown", "morning.now_of", "morning.knocks", "morning.knocks_tonight", "part.whole")
    for key in keys:
        assert not re.search(r"\{\w+\} in\b", texts()._flat[key]), key
    inch = replace(facts, wishes=replace(facts.wishes, units=Units("inch")))
    text = page.render(inch)
    assert "scale bar 11.99483 in, standard uncertainty 19.7 µin" in text and "304.66" not in text


@pytest.mark.few(0)
def test_how_to_turn_the_picture_is_said_where_it_can_be_turned(facts: Facts) -> None:
    assert 'class="noprint turn-it">Turn it' in page.render(facts)
    assert "Turn it" not in texts()("fit.vectors")


@pytest.mark.few(0)
def test_the_auditor_sees_what_the_answer_rests_on(facts: Facts, tmp_path: Path) -> None:
    """nightly.yaml has limit and owner, the history has the answer; neither was in the list."""
    place = cell(tmp_path / "one", records=[night("HU40T-like", 0)])
    here = nights(place, facts.cell.machine, Units(), texts())
    with opened(place / "history.db") as history:
        number, digest = history.newest_hashes()["HU40T-like"]
    read = " ".join(outline(page.render(replace(facts, nights=here))).text)
    assert f"newest entry {number}, SHA-256 {digest}" in read
    (place / "readings.csv").write_text("touch\n", encoding="utf-8")
    files = paper(place, place / "readings.csv", "", "", place / "nightly.yaml").files
    assert "nightly.yaml" in {name for name, *_ in files}


@pytest.mark.few(0)
def test_a_report_says_neither_yes_nor_no_while_the_machine_measures(facts: Facts, tmp_path: Path) -> None:
    """It said Yes while a night was at work, where the pages and `--status` said Measuring."""
    known = nights(cell(tmp_path / "one", records=[night("HU40T-like", 0)]), facts.cell.machine, Units(), texts())
    assert known is not None and not known.busy
    assert page.as_json(replace(facts, nights=known))["may_make_parts"] != "wait"
    busy = replace(facts, nights=replace(known, busy=True))
    assert page.as_json(busy)["may_make_parts"] == "wait" and "Keep the door shut" in page.render(busy)


@pytest.mark.parametrize(("text", "kept"), [("W" * 300, False), ("0123456789abcdef" * 4, True), ("C axis, 4711", True)])
def test_a_name_as_long_as_a_line_breaks_on_paper_and_a_hash_can_be_copied(text: str, kept: bool) -> None:
    """A long name was cut off at the edge of the paper."""
    told = quoted(text)
    assert (told == f'"{text}"') == kept and told.replace("\u200b", "") == f'"{text}"'
    assert max(map(len, told.split("\u200b"))) < 70
