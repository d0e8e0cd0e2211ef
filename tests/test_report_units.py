"""A report that `tango serve` shows is in the unit of its pages, whichever unit was asked for when it was written."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.cli import tango
from tango_cnc.report.charts import still
from tango_cnc.report.units import Units
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

MACHINE = "/machine/HU40T-like"


def shown(folder: Path, system: str) -> tuple[str, str]:
    """cell, unit of the pages → the page around its report, the report in its frame."""
    app = create(Settings((folder,)))
    app.state.tango.units = Units("inch" if system == "inch" else "mm")
    with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
        return site.get(f"{MACHINE}/report").text, site.get(f"{MACHINE}/report/alone").text


@pytest.mark.few(0)
def test_a_framed_report_is_in_the_unit_of_its_page(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one")
    assert CliRunner().invoke(tango, ["simulate", "-C", str(folder)], standalone_mode=False).exception is None
    for own, other in (("mm", "inch"), ("inch", "mm")):
        asked = ["report", "-C", str(folder), "--unit", own, "--no-diagnosis", "--no-pictures"]
        found = CliRunner().invoke(tango, asked, standalone_mode=False)
        assert found.exception is None, found.output
        assert not (folder / f"report.{own}.html").exists() and (folder / f"report.{other}.html").is_file()
        written = (folder / "report.html").read_text(encoding="utf-8")
        assert ("µin" in written) == (own == "inch")
        for system in ("mm", "inch"):
            page, report = shown(folder, system)
            assert ("µin" in report) == (system == "inch") and "may be in mm" not in page, (own, system)
            assert (report == written) == (own == system)


@pytest.mark.long
def test_a_report_of_before_says_that_it_may_be_in_the_other_unit(tmp_path: Path) -> None:
    folder = cell(tmp_path / "one", records=[])
    (folder / "report.html").write_text("<p>12 mm</p>", encoding="utf-8")
    assert "may be in mm" in shown(folder, "inch")[0] and "may be in mm" not in shown(folder, "mm")[0]
    outside = tmp_path / "outside.html"
    outside.write_text("secret", encoding="utf-8")
    (folder / "report.inch.html").symlink_to(outside)
    assert shown(folder, "inch")[1] == "<p>12 mm</p>"


@pytest.mark.long
def test_a_kept_page_of_a_night_is_in_the_unit_of_the_pages(tmp_path: Path) -> None:
    """morning.html stayed in mm; a night now keeps it in both units, and one of before says in which it is."""
    one = night("HU40T-like", 0)
    folder = cell(tmp_path / "one", records=[one])
    kept = folder / one["artefacts"]["folder"]
    kept.mkdir(parents=True)
    outside = tmp_path / "outside.html"
    outside.write_text("secret", encoding="utf-8")
    (kept / "morning.html").write_text("<p>21 µm</p>", encoding="utf-8")
    (kept / "morning.inch.html").symlink_to(outside)

    def page_and_file(system: str) -> tuple[str, str]:
        app = create(Settings((folder,)))
        app.state.tango.units = Units("inch" if system == "inch" else "mm")
        with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as site:
            return site.get(f"{MACHINE}/night/1/morning.html").text, site.get(f"{MACHINE}/night/1/morning.html/alone").text

    page, file = page_and_file("inch")
    assert "That page alone, to print or keep" in page and "The report alone" not in page
    assert "This page was kept in mm." in page and file == "<p>21 µm</p>"
    assert "kept in mm" not in page_and_file("mm")[0]
    (kept / "morning.inch.html").unlink()
    (kept / "morning.inch.html").write_text("<p>0.0008 in</p>", encoding="utf-8")
    page, file = page_and_file("inch")
    assert "kept in mm" not in page and file == "<p>0.0008 in</p>" and page_and_file("mm")[1] == "<p>21 µm</p>"


def test_how_many_times_too_long_deviations_are_drawn_has_no_unit() -> None:
    def data(per_micron: float) -> dict[str, Any]:
        words = dict.fromkeys(("outside", "inside"), "") | {"scale": "drawn {factor} times too long"}
        sets = [{"title": "", "values": [value * per_micron for value in (-1.0, 2.0)]}] * 2
        place = {"points": [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]], "normals": [[0.0, 0.0, 1.0]] * 2, "facets": [], "size": 100.0}
        return place | {"sets": sets, "unit": "", "per_mm": 1e3 * per_micron, "words": words}

    times = [re.findall(r"drawn ([\d,]+) times", still(data(per_micron))) for per_micron in (1.0, Units("inch").per_micron)]
    assert times == [["15,000"]] * 2, "2 µm are drawn as 30 mm"
