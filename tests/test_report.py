"""The HTML report: one file that stands alone, says what a machinist needs, and shows what the estimate found."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from sim_controller.simulate import simulate
from tango_cnc.cli import tango
from tango_cnc.files import read_cell, read_world, readings_text, write_text
from tango_cnc.report.words import spoken

ROOT = Path(__file__).parents[1]
EMPTY = {"meta", "img", "br", "hr"}


class Outline(HTMLParser):
    """Checks that every tag is closed in order, and collects headings, sources and text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.headings: list[str] = []
        self.links: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)
        self.text.append(data)


def folder_of(target: Path, chip: bool = False) -> Path:
    source = ROOT / "examples" / "hu40t"
    for name in ("tango.yaml", "machine.yaml", "artefact.yaml", "strategy.yaml"):
        write_text(target / name, (source / name).read_text(encoding="utf-8"))
    cell, world = read_cell(target), read_world(source / "world.yaml")
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world)
    if chip:
        position = readings.position.copy()
        position[99, 0] += 0.03
        position[99, 1] += 0.03
        position[99, 2] += 0.03
        readings = replace(readings, position=position)
    write_text(target / "readings.csv", readings_text(readings))
    return target


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return folder_of(tmp_path_factory.mktemp("report") / "cell")


def report(folder: Path, *options: str) -> Result:
    return CliRunner().invoke(tango, ["report", "-C", str(folder), *options], standalone_mode=False)


def outline(file: Path) -> Outline:
    page = Outline()
    page.feed(file.read_text(encoding="utf-8"))
    assert not page.open
    return page


def test_the_page_stands_alone_with_its_pictures(folder: Path) -> None:
    pytest.importorskip("matplotlib")
    found = report(folder)
    assert found.exception is None, found.output
    page = outline(folder / "report.html")
    assert len(page.links) == 6
    for link in page.links:
        head, _, data = link.partition(",")
        assert head == "data:image/png;base64"
        assert base64.b64decode(data).startswith(b"\x89PNG")
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"(https?:)?//[a-z]", re.sub(r"base64,[A-Za-z0-9+/=]+", "", text))


def test_the_page_says_what_a_machinist_needs(folder: Path) -> None:
    assert report(folder, "--no-pictures").exception is None
    page = outline(folder / "report.html")
    assert page.headings == [
        "Largest errors",
        "Does it fit?",
        "Does it predict?",
        "Error of the tool tip over the working volume",
        "What cannot be seen",
        "ISO 230-1 figures",
        "All parameters",
        "Stylus and table",
    ]
    text = " ".join(page.text)
    assert "axis C off in X" in text
    assert re.search(r"-11[34]\.\d+ ±", text)  # EX0C, µm
    assert "squareness" in text
    assert not page.links


def test_the_largest_error_is_on_top(folder: Path) -> None:
    found = json.loads(report(folder, "--no-pictures", "--json", "-").stdout)
    names = list(found["effects_um"])
    assert names[0] == "EX0C"
    assert list(found["effects_um"].values()) == sorted(found["effects_um"].values(), reverse=True)
    assert 100 < found["volume_worst_um"] < 140
    assert 0.9 < found["held_out"]["ratio_to_expected"] < 1.1
    assert found["outliers"] == []


def test_a_touch_that_does_not_fit_is_named_with_its_place(tmp_path: Path) -> None:
    target = folder_of(tmp_path / "cell", chip=True)
    found = json.loads(report(target, "--no-pictures", "--json", "-").stdout)
    assert found["outliers"] == [100]
    text = " ".join(outline(target / "report.html").text)
    assert "Touches that do not fit" in text
    assert "Look at the touches that do not fit" in text


def test_without_matplotlib_the_page_is_still_written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tango_cnc.report.pictures.available", lambda: False)
    found = report(folder, "-o", str(folder / "bare.html"))
    assert "pip install 'tango-cnc[report]'" in found.stderr
    assert not outline(folder / "bare.html").links


def test_with_setup_terms_alone_it_does_not_praise_the_machine(folder: Path) -> None:
    report(folder, "--terms", "S1", "--no-pictures", "-o", str(folder / "s1.html"))
    text = " ".join(outline(folder / "s1.html").text)
    assert "nothing is known of its tool tip" in text
    assert "ask tango diagnose" in " ".join(text.split())


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("EX0C", "axis C off in X"),
        ("EA0B", "axis B tilted about X"),
        ("EB0Z", "axis Z out of square, turned about Y"),
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
def test_names_in_words(name: str, words: str) -> None:
    assert spoken(name, read_cell(ROOT / "examples" / "hu40t").machine) == words
