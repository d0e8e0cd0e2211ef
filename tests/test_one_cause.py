"""The list of machines, the page of a machine, the alarms and the report name one cause, count the same and say who has it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from support.nights import night
from support.server import cell

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.history import Decision, opened
from tango_cnc.report.faults import faults
from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

NAME = "HU40T-like"


def moved(number: int, parameter: str, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, parameter, µm → its alarm."""
    dates = [night("M", i)["night"] for i in (number - 1, number)]
    return {
        **{"id": f"{dates[1]}-020000-{parameter}", "cause": "axis_location", "parameter": parameter, "since": dates[0]},
        **{"text": f"{parameter} has moved by {um:+.1f} µm since last night", "unit": "mm", "size": um / 1e3, "std": 0.0003},
        **{"on_part_um": um, "on_part": "Parts are off.", "do": "Look at it.", "rate_per_day": None, "decision": None},
        "owner": "Ann",
        **more,
    }


def pages(place: Path) -> dict[str, str]:
    """cell → {address: what it says, without its tags}."""
    settings = Settings((place,), late_hours=1e6)
    with TestClient(create(settings), base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:
        texts = {path: client.get(path).text for path in ("/", "/alarms", f"/machine/{NAME}")}
    return {path: re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text)) for path, text in texts.items()}


@contextmanager
def looked_at(place: Path, every: float) -> Iterator[Callable[[], str]]:
    """cell, seconds between two looks → looks at the list of machines."""
    now = [0.0]
    app = create(Settings((place,), late_hours=1e6))
    app.state.tango.places.clock = lambda: now[0]
    with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 5000)) as client:

        def shown() -> str:
            now[0] += every
            return client.get("/").text

        yield shown


def test_the_largest_open_alarm_comes_first_though_somebody_has_it(tmp_path: Path) -> None:
    """20 µm that Ben has looked into for a week come before 9 µm that nobody has answered; both are open."""
    large, small = moved(2, "EX0C", 20.0), moved(3, "EY0C", 9.0)
    records = [night(NAME, i) for i in (0, 1)]
    records += [night(NAME, 2, "changed", alarms=[large]), night(NAME, 3, "changed", alarms=[small])]
    records += [night(NAME, 4, "changed", standing=[large, small])]
    place = cell(tmp_path / "one", records=records)
    with opened(place / "history.db") as history:
        history.decide(NAME, Decision(large["id"], "acknowledge", "Ben", "a clamp is ordered"))
    seen = pages(place)
    for path, text in seen.items():
        assert text.index("C axis off in X has moved") > 0, path
        assert "Ben (acknowledged)" in text, path
        if "C axis off in Y has moved" in text:  # the list names the first one alone
            assert text.index("C axis off in X has moved") < text.index("C axis off in Y has moved"), path
    assert re.search(r"Open alarms .* 2 ", seen["/"].partition("Last nights")[2][:900]) or " 2 " in seen["/"]
    assert "Open alarms: 2" in seen[f"/machine/{NAME}"] and "Open alarms: 2. Without an answer: 1." in seen["/alarms"]
    assert "C axis off in Y" not in seen["/"]
    for path in ("/", f"/machine/{NAME}"):
        assert "Nobody has answered the alarm of Tue 27 Oct 2026." in seen[path], path


@pytest.mark.long
def test_what_stands_behind_a_crossed_limit_is_the_cause_on_every_page_and_is_no_alarm(tmp_path: Path) -> None:
    """It is asked of whoever is asked about the alarm of the same axis, with since when."""
    limit = {"what": "volume", "value": 142.0, "low": 140.0, "high": 144.0, "limit": 120.0, "unit": "µm", "passed": False}
    behind = {"what": "volume", "parameter": "EX0C", "size": -0.093, "unit": "mm", "since": "", "on_part_um": 187.0}
    behind |= {"text": "most of it comes from EX0C: -93.3 ± 0.5 µm, which does 124.4 µm of it", "do": "Have it compensated."}
    knock = moved(2, "EX0C", 20.0)
    records = [night(NAME, i, "out_of_limits", limits=[limit], behind=[behind]) for i in (0, 1)]
    records += [night(NAME, 2, "out_of_limits", limits=[limit], behind=[behind], alarms=[knock])]
    records += [night(NAME, 3, "out_of_limits", limits=[limit], behind=[behind], standing=[knock])]
    seen = pages(cell(tmp_path / "one", records=records))
    for path, text in seen.items():
        first = text.index("Most of it comes from C axis off in X: −93 µm, which does 124 µm of it.")
        assert "Call Ann: asked on Mon 26 Oct 2026, not answered for" in text[max(first - 300, 0) : first + 400], path
        assert "C axis off in X has moved" not in text[:first], path
    assert "Open alarms: 1" in seen[f"/machine/{NAME}"] and "Open alarms: 1. Without an answer: 1." in seen["/alarms"]


@pytest.mark.long
def test_what_was_accepted_is_named_in_the_list_as_on_the_page_and_counts_no_more(tmp_path: Path) -> None:
    knock = moved(2, "EX0C", 20.0)
    records = [night(NAME, i) for i in (0, 1)] + [night(NAME, 2, "changed", alarms=[knock])]
    place = cell(tmp_path / "one", records=records)
    with opened(place / "history.db") as history:
        history.decide(NAME, Decision(knock["id"], "accept", "Cid"))
    seen = pages(place)
    for path in ("/", f"/machine/{NAME}"):
        assert "C axis off in X has moved" in seen[path] and "Cid (accepted)" in seen[path], path
        assert "Open alarms:" not in seen[path], path
    assert "No alarm is open." in seen["/alarms"]


@pytest.mark.long
@pytest.mark.parametrize("owner", ["", "Ann, 4711"])
def test_every_row_that_needs_somebody_names_him(owner: str, tmp_path: Path) -> None:
    """Also a night that is not believed, one that did not measure, and a machine that was never measured."""
    said = f"Call {owner}." if owner else "NOBODY is named for this machine. Whoever leads the shift decides"
    unmeasured = night(NAME, 1, "not_measured", status="failed", why="no answer", limits=[], volume=None, parameters=None)
    for number, records in enumerate(([night(NAME, 0), night(NAME, 1, "doubtful")], [night(NAME, 0), unmeasured], [])):
        place = cell(tmp_path / str(number), records=records)
        if not records:
            (place / "history.db").unlink()
        if owner:
            (place / "nightly.yaml").write_text(f"nightly: 1\nowner: '{owner}'\n", encoding="utf-8")
        seen = pages(place)
        for path in ("/", f"/machine/{NAME}"):
            assert said in seen[path], (number, path)
    assert "Make no parts with tight limits on it." in seen[f"/machine/{NAME}"]


@pytest.mark.long
def test_every_sentence_of_a_row_ends(tmp_path: Path) -> None:
    """A sentence without its full stop reads as if it were cut off."""
    records = [night(NAME, i) for i in (0, 1)] + [night(NAME, 2, "changed", alarms=[moved(2, "EX0C", 20.0)])]
    records += [night(NAME, 3, "changed", standing=[moved(2, "EX0C", 20.0, now="still there: +19.9 µm")])]
    seen = pages(cell(tmp_path / "one", records=records))
    assert all("Still there: +20 µm. " in text for text in seen.values())
    doubt = night(NAME, 1, "doubtful", headline="the readings are not to be relied on: 9 of 74 touches do not fit")
    assert "9 of 74 touches do not fit. " in pages(cell(tmp_path / "two", records=[night(NAME, 0), doubt]))["/"]


@pytest.mark.long
def test_an_error_just_within_its_limit_does_not_look_like_the_limit(tmp_path: Path) -> None:
    """59.7 µm beside 60 µm would both be 60; a sentence on the first screen ends."""
    limit = {"what": "volume", "value": 59.7, "low": 59.0, "high": 59.9, "limit": 60.0, "unit": "µm", "passed": True}
    partial = {"status": "partial", "touches": 58, "planned": 84, "why": "the door was opened"}
    seen = pages(cell(tmp_path / "one", records=[night(NAME, 0), night(NAME, 1, limits=[limit], **partial)]))
    for path in ("/", f"/machine/{NAME}"):
        assert "Largest error at the tool tip: 59.7 µm, 60 µm allowed" in seen[path], path
    assert "The door was opened. " in seen[f"/machine/{NAME}"]


@pytest.mark.long
def test_what_another_program_adds_is_shown_after_five_seconds(tmp_path: Path) -> None:
    """A decision at the computer, and a night: what is kept of the machine before is not shown again."""
    knock = moved(2, "EX0C", 20.0)
    records = [night(NAME, i) for i in (0, 1)] + [night(NAME, 2, "changed", alarms=[knock])]
    place = cell(tmp_path / "one", records=records)
    with looked_at(place, every=6.0) as shown:
        assert "Call Ann" in shown()
        with opened(place / "history.db") as history:
            history.decide(NAME, Decision(knock["id"], "acknowledge", "Ben"))
        assert "Ben (acknowledged)" in shown()
        with opened(place / "history.db") as history:
            history.decide(NAME, Decision(knock["id"], "accept", "Cid"))
        assert "Cid (accepted)" in shown()
        with opened(place / "history.db") as history:
            history.add_night(night(NAME, 3), None)
        text = shown()
        assert "Night ending Tue 27 Oct 2026" in text and "Cid" not in text and ">Yes<" in text


@pytest.mark.long
def test_causes_are_told_anew_once_something_was_written_and_not_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With an alarm on each of two hundred machines every look after half a minute took seconds of the processor."""
    asked: list[Any] = []
    monkeypatch.setattr("tango_cnc.web.pages.fleet.faults", lambda *a, **k: asked.append(a) or faults(*a, **k))
    knock = moved(2, "EX0C", 20.0)
    place = cell(tmp_path / "one", records=[night(NAME, 0), night(NAME, 1), night(NAME, 2, "changed", alarms=[knock])])
    with looked_at(place, every=45.0) as shown:
        assert all("Call Ann" in shown() for _ in range(8)) and len(asked) == 1
        for who in ("Ben", "Dan"):  # counts of alarms stay as they are from one to the other
            with opened(place / "history.db") as history:
                history.decide(NAME, Decision(knock["id"], "acknowledge", who))
            assert f"{who} (acknowledged)" in shown()
        assert len(asked) == 3
