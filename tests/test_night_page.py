"""The first screen at six in the morning: what comes next, since when it moves, and what is open under another name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.nights import knock, night
from support.server import cell

from tango_cnc.cli import tango
from tango_cnc.history import Decision
from tango_cnc.history.former import Former
from tango_cnc.report.alarm import alarm
from tango_cnc.report.morning import context, render
from tango_cnc.report.texts import texts
from tango_cnc.report.tonight import by_tonight
from tango_cnc.report.units import Units
from tango_cnc.texts import say


@pytest.mark.parametrize(("action", "kind"), [("repaired", "full"), ("accept", "check")])
def test_the_page_names_the_night_that_comes_after_the_answer(action: str, kind: str) -> None:
    record = night("M", 9, "changed", alarms=[], standing=[knock("2026-11-01") | {"night": "2026-11-01", "now": "", "total": 0.02}])
    said = Decision("2026-11-01-1", action, "Ann", "new clamp", None, "2026-11-02T08:00:00Z")
    assert context(record, (), None, texts())["next"]["kind"] == "check"
    coming = context(record, (said,), None, texts())["next"]
    assert coming["kind"] == kind and ("new clamp" in coming["why"]) == (kind == "full")
    earlier = Decision("2026-11-01-1", action, "Ann", "new clamp", None, "2026-11-01T08:00:00Z")
    assert context(record, (earlier,), None, texts())["next"]["kind"] == "check"  # the night came after it


@pytest.mark.few(0)
def test_a_drift_has_moved_since_the_night_before_it_and_not_since_its_alarm() -> None:
    found = knock("2026-11-10") | {"since": "2026-11-07", "rate_per_day": 0.002, "steady": True}
    text = render(night("M", 17, "changed", alarms=[found]))
    assert "first with it" not in text
    told = "The night ending Sat 7 Nov was the last one without it. It has moved from the next night on;"
    assert f"{told} sure enough for an alarm on Tue 10 Nov." in text
    one = alarm(knock("2026-11-10") | {"since": "2026-11-07"}, None, Units(), texts())  # a knock: two nights were not measured
    assert not one["moves_from"]


@pytest.mark.parametrize(("alarms", "held", "may"), [(1, 0, "but"), (0, 1, "but"), (0, 0, "yes")])
def test_an_alarm_that_is_open_under_the_old_name_is_no_plain_yes(alarms: int, held: int, may: str) -> None:
    former = Former("OLD", 4, "2026-10-27", ({"id": "a"},) * alarms, ({"id": "b"},) * held).told("NEW", False)
    told = context(night("NEW", 5), (), None, texts(), former=(former,))["answer"]
    assert told.may == may and ("old name" in told.why) == (may == "but")
    assert context(night("NEW", 5, former=[former]), (), None, texts())["answer"].may == may


@pytest.mark.parametrize(
    ("total", "rate", "std", "effect"),
    [
        *((0.040, None, None, "80.0"), (0.021, None, None, "39.6"), (0.021, 0.001, None, "42.0"), (None, None, None, "39.6")),
        *(
            (0.021, None, 0.0004, "39.6"),
            (0.022, None, 0.0004, "44.0"),
            (0.0205, None, 0.0001, "39.6"),
        ),  # surely, and not by a hair
    ],
)
def test_what_an_alarm_does_to_a_part_is_that_of_tonight(
    total: float | None, rate: float | None, std: float | None, effect: str
) -> None:
    part = say("part.turned_since", since="2026-11-04", axis="C", angle="180", effect="39.6 µm")
    a: dict[str, Any] = {"on_part": part, "on_part_um": 39.6, "size": 0.0198, "total": total, "rate_per_day": rate, "now": ""}
    a |= {} if std is None else {"std": std}
    found = by_tonight(a)
    assert f"{effect} µm" in found["on_part"] and f"{found['on_part_um']:.1f}" == effect


@pytest.mark.few(1)
@pytest.mark.parametrize("columns", [None, 60, 34])
def test_the_list_of_status_keeps_to_a_terminal_and_stays_whole_in_a_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, columns: int | None
) -> None:
    folder = cell(tmp_path / "cell", "M", [night("M", i, headline="all is at rest, " * 8) for i in range(3)])
    monkeypatch.setattr("tango_cnc.commands._nightly_status.on_terminal", lambda: columns)
    text = CliRunner().invoke(tango, ["nightly", "-C", str(folder), "--status"], standalone_mode=False).output
    lines = [line for line in text.splitlines() if "rest" in line]
    if columns is None:
        assert len(lines) == 3 and text.count("all is at rest,") == 24
    else:
        assert max(map(len, lines)) <= columns and len(lines) > 3 and "2026-10-26" in text
