"""A shop reads everything in its own language: with the catalogue in other letters, no English is left on a page."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from click.testing import CliRunner
from starlette.testclient import TestClient
from support.translated import english, other, shop  # noqa: F401

from sim_controller.simulate import simulate
from tango_cnc.cli import tango
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.history import opened
from tango_cnc.iso230.signed import signed
from tango_cnc.nightly.mail import message
from tango_cnc.plausible import judge
from tango_cnc.records import Cell, Readings
from tango_cnc.report.compensated import held
from tango_cnc.report.days import day
from tango_cnc.report.facts import Paper, Wishes, gather
from tango_cnc.report.morning import render as morning
from tango_cnc.report.page import render
from tango_cnc.report.texts import texts, texts_of
from tango_cnc.texts import Said, carried, instead, joined, revived, say
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

ROOT = Path(__file__).parents[1]


def cell_of(name: str) -> tuple[Cell, Readings]:
    cell = read_cell(ROOT / "examples" / name)
    world = read_world(ROOT / "examples" / name / "world.yaml")
    return cell, simulate(cell.machine, cell.artefact, cell.strategy, world)


def report(cell: Cell, readings: Readings, shop: Path, diagnosis: bool) -> str:
    result = estimate(cell.machine, cell.artefact, readings, cell.terms)
    paper = Paper(datetime(2026, 11, 22, tzinfo=UTC), "0.1", simulated=True)
    facts = gather(
        cell, readings, Wishes(cell.terms, diagnosis=diagnosis), paper, result, judge(cell, readings, result), sheet=signed(result)
    )
    return render(facts, shop)


def names_of(cell: Cell) -> tuple[str, ...]:
    return cell.machine.name, cell.machine.topology, cell.artefact.name, cell.strategy.name, "bed", *map(str, cell.terms)


def test_a_shop_orders_its_dates_and_says_what_became_of_a_compensation(tmp_path: Path) -> None:
    """The date was that of English in every language, and "kept as far as seen" stood in a sentence of another one."""
    told = {"date.long": "{weekday}, {day}. {month} {year}", "date.short": "{day}. {month}", "code.kept_as_far_as_seen": "behalten"}
    told["night.in_control"] = "{event}"
    (tmp_path / "texts.toml").write_text("\n".join(f"{key} = {json.dumps(text)}" for key, text in told.items()), encoding="utf-8")
    t = texts_of(tmp_path)
    assert (day("2026-11-22", t), day("2026-11-22", t, False)) == ("Sun, 22. Nov 2026", "22. Nov")
    there = {"number": 1, "target": "siemens", "date": "2026-11-20", "event": "kept as far as seen", "measured": True}
    assert held({"in_control": there}, t) == "behalten"


@pytest.mark.long
def test_a_report_with_its_diagnosis(shop: Path) -> None:
    cell, readings = cell_of("hu40t")
    assert english(report(cell, readings, shop, diagnosis=True), *names_of(cell)) == []


def turned(cell: Cell, readings: Readings) -> Readings:
    position = readings.position.copy()
    position[:, cell.machine.column("C")] *= -1
    return replace(readings, position=position)


def half(cell: Cell, readings: Readings) -> Readings:
    return readings.rows(readings.touch % 2 == 0)


def chip(cell: Cell, readings: Readings) -> Readings:
    position = readings.position.copy()
    position[40:46, cell.machine.column("X")] += 0.4
    return replace(readings, position=position)


@pytest.mark.long
@pytest.mark.parametrize("spoilt", [turned, half, chip])
def test_a_report_of_readings_in_doubt(spoilt: Callable[[Cell, Readings], Readings], shop: Path) -> None:
    cell, readings = cell_of("hu40t")
    assert english(report(cell, spoilt(cell, readings), shop, diagnosis=False), *names_of(cell)) == []


@pytest.fixture(scope="module")
def nights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("nights")
    done = CliRunner().invoke(
        tango, ["history", "simulate", str(folder / "h.db"), "-C", str(ROOT / "examples" / "hu40t"), "--nights", "22"]
    )
    assert done.exit_code == 0, done.output
    return folder / "h.db"


@pytest.mark.long
def test_every_night_and_every_page_of_the_server(nights: Path, shop: Path) -> None:
    cell = read_cell(ROOT / "examples" / "hu40t")
    names = names_of(cell)
    with opened(str(nights), create=False) as history:
        for night in history.nights(cell.machine.name):
            record = history.night(night.entry).record
            assert english(morning(record, folder=shop), *names, night.night) == [], night.headline
    settings = Settings((), history=str(nights), templates=shop)
    with TestClient(create(settings), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        machine = re.findall(r'href="(/machine/[^"/]+)"', site.get("/").text)[0]
        first = re.findall(rf'href="({machine}/night/\d+)"', site.get(f"{machine}/nights").text)[0]
        for path in (
            "/",
            "/alarms",
            "/sign-in",
            "/nothing",
            machine,
            first,
            *(f"{machine}/{p}" for p in ("run", "trend", "nights")),
        ):
            assert english(site.get(path).text, *names) == [], path


def test_a_text_remembers_how_it_was_made(shop: Path) -> None:
    text = joined("; ", (say("night.alarms.still_there", told="5 µm"), "", say("judged.doubtful")))
    assert text == "still there: 5 µm; doubtful"
    assert texts_of(shop).of(text) == f"{other('still there')}: 5 µm; {other('doubtful')}"
    read = revived(json.loads(json.dumps(carried({"alarms": [{"text": text}], "night": "2026-11-22"}))))
    again = read["alarms"][0]["text"]
    assert isinstance(again, Said) and texts_of(shop).of(again) == texts_of(shop).of(text)
    assert read["night"] == "2026-11-22" and not isinstance(read["night"], Said)


def test_last_night_becomes_its_date_in_every_language(shop: Path) -> None:
    text = texts()("changed.unnamed", name="EX0C", size="9 µm", since=say("night.alarms.last_night"))
    assert isinstance(text, Said) and instead(text, "last night", "2026-11-21") == "EX0C has changed by 9 µm since 2026-11-21"
    assert "2026-11-21" in texts_of(shop).of(instead(text, "last night", "2026-11-21"))
    assert instead("It moved since last night", "last night", "2026-11-21") == "It moved since 2026-11-21"


@pytest.mark.long
def test_nights_of_no_machine_say_so(nights: Path) -> None:
    with opened(str(nights), create=False) as history:
        record = history.night(history.nights()[0].entry).record
    assert "SIMULATED" in morning(record) and "SIMULATED" not in morning({**record, "simulated": False})


@pytest.mark.long
def test_the_mail_and_the_lists_of_a_shop(nights: Path, shop: Path, tmp_path: Path) -> None:
    """`templates` in nightly.yaml: what the terminal says of a history, and every message, are in the other letters."""
    cell = read_cell(ROOT / "examples" / "hu40t")
    names = names_of(cell)
    ignored = re.compile(
        r"\x1b\[\d+m|tango \S+(?: \S+)*? --owner (?:…|NAME)|[0-9a-f]{32,}|\S*/\S*|pretravel|rad|\bnan\b|tango nightly --status"
    )

    def left(text: str) -> list[str]:
        return english(html.escape(ignored.sub(" ", text)), *names)

    t = texts_of(shop)
    with opened(str(nights), create=False) as history:
        for night in history.nights(cell.machine.name):
            subject, text = message(history.night(night.entry).record, (), (), (3, "0" * 64), (), t)
            assert left(f"{subject}\n{text}") == [], night.night
    (tmp_path / "nightly.yaml").write_text(f"nightly: 1\ntemplates: {shop}\n", encoding="utf-8")
    for words in (("list",), ("show", "last"), ("plot", "EX0C"), ("compare", "1"), ("causes",), ("verify",)):
        found = CliRunner().invoke(tango, ["history", *words, "-C", str(tmp_path), "--history", str(nights)])
        assert found.exception is None, (words, found.output)
        assert left(found.output) == [], words
