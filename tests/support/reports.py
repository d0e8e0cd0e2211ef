"""A measured cell and the facts of its report; what stands in one, by its tags."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import pytest

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world, readings_text, write_text
from tango_cnc.iso230.signed import signed
from tango_cnc.plausible import judge
from tango_cnc.records import Cell, Readings
from tango_cnc.report.facts import Facts, Paper, Wishes, gather

ROOT = Path(__file__).parents[2]
EMPTY = {"meta", "img", "br", "hr"}
DAY = datetime(2026, 11, 23, 6, 0, tzinfo=UTC)


class Outline(HTMLParser):
    """Checks that every tag is closed in order, and collects headings, addresses and text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.headings: list[str] = []
        self.addresses: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "action", "srcset", "data")]
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)
        if "style" not in self.open and "script" not in self.open:
            self.text.append(data)


def outline(text: str) -> Outline:
    read = Outline()
    read.feed(text)
    assert not read.open
    return read


def folder_of(target: Path, name: str = "hu40t") -> Path:
    source = ROOT / "examples" / name
    for file in ("tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml"):
        write_text(target / file, (source / file).read_text(encoding="utf-8"))
    cell, world = read_cell(target), read_world(source / "world.yaml")
    write_text(target / "readings.csv", readings_text(simulate(cell.machine, cell.artefact, cell.strategy, world)))
    return target


def gathered(cell: Cell, readings: Readings, wishes: Wishes, paper: Paper) -> Facts:
    result = estimate(cell.machine, cell.artefact, readings, wishes.terms)
    return gather(cell, readings, wishes, paper, result, judge(cell, readings, result), sheet=signed(result))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return folder_of(tmp_path_factory.mktemp("report") / "cell")


@pytest.fixture(scope="module")
def facts() -> Facts:
    return _facts()


@cache
def _facts() -> Facts:
    """What tests of several files read: it takes two seconds."""
    cell = read_cell(ROOT / "examples" / "hu40t")
    world = read_world(ROOT / "examples" / "hu40t" / "world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world)
    paper = Paper(DAY, "0.0", owner="Ann <owner>", operator="Bob & Co")
    return gathered(cell, readings, Wishes(cell.terms, diagnosis=False), paper)
