"""A report whose readings are newer than the newest night, and say No: every page of the machine says it."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.nights import night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

M = "HU40T-like"
PATHS = (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights")


def seen(place: Path, path: str) -> str:
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        return client.get(path).text


@pytest.mark.parametrize("after", ["newest", "earlier", ""])
def test_pages_have_the_no_of_a_report_that_is_newer_than_the_newest_night(tmp_path: Path, after: str) -> None:
    place = cell(tmp_path / "one", records=[night(M, 7), night(M, 8)])
    ended = night(M, 8 if after == "newest" else 7)["end_utc"]
    head = f'<meta name="tango-no-after" content="{ended}">' if after else ""
    (place / "report.html").write_text(f"<!DOCTYPE html><html><head>{head}</head><body>No</body></html>", encoding="utf-8")
    framed = seen(place, f"/machine/{M}/report").partition('class="today')[2].partition("</p>")[0]
    assert ("Make no parts on it: the readings of the report are newer" in framed) == (after == "newest")
    assert framed.startswith(" stop") == (after == "newest")
    for path in PATHS:
        assert ("Readings that are newer than this night say No" in seen(place, path)) == (after == "newest"), path


def test_a_file_that_is_no_report_says_nothing(tmp_path: Path) -> None:
    place = cell(tmp_path / "one", records=[night(M, 8)])
    for content in (b"\xff\xfe\x00", b"", b'<meta name="tango-no-after" content="<script>">', b"x" * 3_000_000):
        (place / "report.html").write_bytes(content)
        assert "say No" not in seen(place, f"/machine/{M}") and "say No" not in seen(place, f"/machine/{M}/report")
