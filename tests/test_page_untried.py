"""Parts of a fault that somebody says to have repaired stay in question until a night that is believed has measured the repair,
whatever was answered before, and whatever came between.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.alarms import SINCE_FAULT, lasting
from support.nights import M, night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.commands.report import nights
from tango_cnc.files import read_cell
from tango_cnc.history import Decision, opened
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

DOUBT = {"verdict": "doubtful", "carried": False, "plausible": {"verdict": "implausible", "reasons": ["touches do not repeat"]}}
NOTHING: dict[str, Any] = {"status": "missed", "kind": "none", "limits": [], "volume": {}, "parameters": {}}
HELPED = {"alarm": "2026-10-26-020000-1", "text": "It is back.", "since": "2026-10-25", "parameter": "EY0C"}


def at(record: dict[str, Any], hour: int) -> str:
    return str(record["end_utc"]).replace("T02", f"T{hour:02d}")


def shop(folder: Path, nights_after: list[dict[str, Any]], ignored: bool = False) -> Path:
    """folder, nights after the repair, whether the fault was to be ignored before → a cell: a knock in night 2, which somebody
    says to have repaired on the morning of night 8.
    """
    fault = lasting(2, 20.0)
    records = [night(M, i) for i in (0, 1)] + [night(M, 2, "changed", alarms=[fault])]
    silent = {
        "alarm": fault["id"],
        "owner": "Emil",
        "until": "2026-11-30",
        **{k: fault[k] for k in ("night", "text", "now", "total")},
    }
    records.append(night(M, 8, "good", **({"unheard": [silent]} if ignored else {"standing": [fault]})))
    place = cell(folder, records=records)
    with opened(place / "history.db") as history:
        if ignored:
            history.decide(M, Decision(fault["id"], "ignore", "Emil", "", "2026-11-30", at(records[2], 10)))
        history.decide(M, Decision(fault["id"], "repaired", "Dora", "", None, at(records[-1], 10)))
        for record in nights_after:
            history.add_night(record)
    return place


def shown(place: Path) -> tuple[str, str]:
    """cell → the page of its machine, before the engineer's part, and the list of machines."""
    with TestClient(create(Settings((place,), late_hours=1e6)), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        return client.get(f"/machine/{M}").text.partition("For the engineer")[0], client.get("/").text


def untried(place: Path) -> dict[str, str]:
    """cell → {parameter: who says to have repaired it, and no night has measured it}, as the report has it."""
    found = nights(place, read_cell(place).machine, Units(), texts())
    assert found is not None
    return dict(found.repaired)


@pytest.mark.few(2)
@pytest.mark.parametrize("ignored", [False, True])
@pytest.mark.parametrize("after", ["none", "doubt", "doubt, then nothing"])
def test_the_parts_stay_named_until_a_night_that_is_believed(tmp_path: Path, after: str, ignored: bool) -> None:
    """They vanished with the first night after the repair, though its readings were in doubt; and of a fault that somebody had
    ignored before it was repaired they vanished at once.
    """
    more = [] if after == "none" else [night(M, 9, **DOUBT)]
    more += [night(M, 10, "not_measured", **NOTHING)] if after.endswith("nothing") else []
    place = shop(tmp_path / "one", more, ignored)
    page, listed = shown(place)
    assert SINCE_FAULT in page and "Dora (repaired)" in page
    assert untried(place) == {"EY0C": "Dora"} and "C axis has moved along Y by +20 µm" in page
    assert after != "none" or "Measure the first part" in listed


@pytest.mark.few(1)
@pytest.mark.parametrize("ignored", [False, True])
def test_a_night_that_has_measured_it_says_which_parts_had_it(tmp_path: Path, ignored: bool) -> None:
    place = shop(tmp_path / "one", [night(M, 9, **DOUBT), night(M, 10, repaired=[HELPED])], ignored)
    page, _ = shown(place)
    assert SINCE_FAULT not in page and not untried(place)
    assert "All that were made between Sun 25 Oct 2026, the last night without the fault, and the repair." in page


def test_a_repair_that_was_said_while_a_night_measured_waits_for_the_next_one(tmp_path: Path) -> None:
    """Where it says what became of it, it has measured it."""
    for record, waits in ((night(M, 9), True), (night(M, 9, repaired=[HELPED]), False)):
        place = shop(tmp_path / str(waits), [])
        with opened(place / "history.db") as history:
            history.decide(M, Decision(HELPED["alarm"], "repaired", "Dora", "", None, record["start_utc"].replace(":00Z", ":30Z")))
            history.add_night(record)
        assert bool(untried(place)) == waits


def test_who_accepts_it_after_all_has_ended_the_question(tmp_path: Path) -> None:
    place = shop(tmp_path / "one", [night(M, 9, **DOUBT)])
    with opened(place / "history.db") as history:
        history.decide(M, Decision(HELPED["alarm"], "accept", "Ann", "", None, at(night(M, 9), 11)))
    page, _ = shown(place)
    assert SINCE_FAULT not in page and not untried(place)
