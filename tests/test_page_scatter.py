"""A probe whose single touches scatter: the first order is the probe's, and a sound probe no longer scatters on any page."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from support.nights import M, knock, night
from support.pages import plain_of, seen
from support.server import cell

from tango_cnc.history import Decision, opened
from tango_cnc.nightly.mail import message
from tango_cnc.texts import say

BY_OTHERS = "Measure the first part that is set up with the probe by other means than this probe."


def scatter(date: str, then: bool = False) -> dict[str, Any]:
    """date of the night → the alarm of its touches."""
    text = say(f"changed.noise_level{'_then' if then else ''}", size="8.56 µm", usual="0.71 µm")
    return knock(date) | {
        **{
            "id": f"{date}-2",
            "cause": "noise_level",
            "parameter": "probe",
            "text": text,
            "since": date,
            "size": 0.00856,
            "std": 1e-3,
        },
        **{"on_part_um": 8.6, "on_part": "Probed set-ups scatter by 8.6 µm.", "do": "Look at the probe.", "instead": []},
    }


def surfaces(place: Path) -> list[str]:
    return [plain_of(seen(place, path)) for path in ("/", f"/machine/{M}", f"/machine/{M}/trend", "/alarms")]


@pytest.mark.few(0)
@pytest.mark.parametrize("ignored", [True, False])
def test_the_first_order_is_that_of_the_probe_that_scatters(tmp_path: Path, ignored: bool) -> None:
    """Beside an axis that somebody ignores the list named that axis, and let its part be measured with this probe."""
    before, date = night(M, 7)["night"], night(M, 8)["night"]
    axis = knock(before) | {"rate_per_day": None}
    record = night(
        M, 8, "changed", alarms=[scatter(date)], standing=[] if ignored else [axis | {"night": before, "now": "", "total": None}]
    )
    place = cell(tmp_path / "one", records=[night(M, 7, "changed", alarms=[axis]), record])
    if ignored:
        with opened(place / "history.db") as history:
            history.decide(M, Decision(axis["id"], "ignore", "Ann", until=f"{datetime.now() + timedelta(days=300):%Y-%m-%d}"))
    wanted = BY_OTHERS if ignored else "Measure the first part before you go on, by other means than this probe."
    for text in surfaces(place):
        assert wanted in text, text
    row = surfaces(place)[0]
    assert ("Single touches scatter by 8.6 µm" in row.partition(BY_OTHERS)[2][:90]) == ignored
    assert ignored or wanted.rstrip(".") in message(record, (), ())[1]


def test_a_probe_that_is_sound_again_no_longer_scatters_on_any_page(tmp_path: Path) -> None:
    """Its own night had 0.71 µm; pages and mail said "Single touches scatter by 8.6 µm" in the present tense."""
    before = night(M, 7)["night"]
    now = {"now": say("night.alarms.scatter_gone", told="0.71 µm"), "total": 0.00071, "night": before, "decision": None}
    record = night(M, 8, "changed", alarms=[], standing=[scatter(before, then=True) | now])
    place = cell(tmp_path / "one", records=[night(M, 7, "changed", alarms=[scatter(before)]), record])
    for text in surfaces(place):
        assert "ingle touches scatter by" not in text, text
    page = surfaces(place)[1]
    assert "Single touches scattered by 8.6 µm" in page and "That is gone again: they scatter by 0.7 µm." in page
    assert "Parts that were set up or measured with the probe between" in page and "All that were made between" not in page
    subject, mail = message(record, (), ())
    assert "scattered by 8.56 µm" in mail and "gone again: they scatter by 0.71 µm" in mail and "CHANGED" not in subject
