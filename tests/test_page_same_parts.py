"""The page of the newest night says what that of the machine says, and a curve says up to which night it is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from support.nights import knock, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

M = "HU40T-like"


def seen(place: Path, *paths: str) -> list[str]:
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        return [" ".join(re.sub(r"<[^>]+>", " ", client.get(path).text).split()) for path in paths]


def test_the_page_of_the_newest_night_names_the_same_parts_as_that_of_its_machine(tmp_path: Path) -> None:
    """ "… the last night within the limit" on one of them, "… the last night without it" on the other."""
    beyond: dict[str, Any] = {
        "what": "volume",
        "value": 78.4,
        "unit": "µm",
        "low": 77.0,
        "high": 79.0,
        "limit": 70.0,
        "passed": False,
    }
    records = [night(M, 6), night(M, 7, "out_of_limits", limits=[beyond], alarms=[knock(night(M, 6)["night"])])]
    place = cell(tmp_path / "one", records=records)
    parts = [
        re.findall(r"All that were made since [^.]*\.", text) for text in seen(place, f"/machine/{M}", f"/machine/{M}/night/2")
    ]
    assert parts[0] == parts[1] and len(parts[0]) > 0 and "the last night within the limit" in parts[0][0]


@pytest.mark.parametrize("doubt", [True, False])
def test_a_curve_ends_before_readings_that_are_in_doubt(tmp_path: Path, doubt: bool) -> None:
    place = cell(tmp_path / "one", records=[night(M, i) for i in range(6)] + [night(M, 6, "doubtful" if doubt else "good")])
    for text in seen(place, f"/machine/{M}", f"/machine/{M}/trend"):
        assert ("as the readings since then are in doubt: " in text) == doubt, text
