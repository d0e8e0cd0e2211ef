"""A night that ends too early or does not begin: its own sentence comes first, and what it left open is still told."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from click.testing import CliRunner, Result
from support.histories import knowledge, record
from support.nights import knock
from support.nights_parts import nights_of

from tango_cnc.cli import tango
from tango_cnc.files import read_cell
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import Decision, History, opened
from tango_cnc.link.lock import holding
from tango_cnc.nightly import Measured
from tango_cnc.nightly.dates import since
from tango_cnc.nightly.mail import message
from tango_cnc.nightly.night import known_before, night
from tango_cnc.nightly.ports import Ports, PreflightPoint
from tango_cnc.plan import plan
from tango_cnc.records import InputError, LinkError
from tango_cnc.report.answer import answer
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.texts import joined, say

SILENT = "the control has been silent for longer than 41 s; all is sent. 19 of 226 touches are recorded. Look at the machine."
MISSING = joined(
    "",
    (
        say(
            "plausible.readings.planned_touches_missing_made_no",
            count=207,
            expected=226,
            numbers="20, 21, 22 and 204 more",
            word="",
        ),
    ),
)
POINT = ("check", "passed", "found", "do")
NOTHING: dict[str, Any] = {"status": "failed", "kind": "none", "verdict": "not_measured", "touches": 0, "parameters": {}}


class Stopped:
    """The world of one night: its control stops as the test says, and it keeps every message that the night sends."""

    def __init__(self, why: str, nothing: bool, unjudged: Exception | None, points: Sequence[PreflightPoint]) -> None:
        self.points = points
        self.why, self.nothing, self.unjudged, self.posted = why, nothing, unjudged, ""

    def __getattr__(self, name: str) -> Any:
        return lambda *given: ()

    def free_mb(self) -> float:
        return 1e6

    def post(self, stamp: str, text: str) -> None:
        self.posted = text

    def preflight(self, kind: str, touches: Any) -> Sequence[PreflightPoint]:
        return self.points

    def choice(self, past: Any, day: float) -> Any:
        return "full", "", ()

    def measure(self, kind: str, touches: Any) -> Measured:
        if self.nothing:
            raise LinkError(self.why)
        return Measured(cast(Any, np.zeros(19)), "touch\n1\n", 226, 60.0, self.why, (), (), False)

    def analysed(self, *given: Any) -> Any:
        if self.unjudged is not None:
            raise self.unjudged
        plausible = {"verdict": "implausible", "reasons": [MISSING]}
        return {"verdict": "doubtful", "plausible": plausible, "carried": False, "next": None}, None, {}


def told(
    history: History,
    why: str,
    nothing: bool = False,
    unjudged: Exception | None = None,
    points: Sequence[PreflightPoint] = (),
) -> tuple[dict[str, Any], str]:
    """history, why the control ended, whether before any touch, why nobody judges the readings, preflight → record and message."""
    world, now = Stopped(why, nothing, unjudged, points), datetime(2026, 10, 9, 2, tzinfo=UTC)

    class Free:
        def __enter__(self) -> None: ...
        def __exit__(self, *given: object) -> None: ...

    clock = SimpleNamespace(now=lambda: now)
    ports = Ports(
        cast(Any, clock), cast(Any, world), cast(Any, world), cast(Any, world), history, cast(Any, world), cast(Any, Free())
    )
    return night("M", "/cells/m", Nightly(owner="Ann"), ports), world.posted


@pytest.fixture
def history(tmp_path: Path) -> Any:
    with opened(tmp_path / "history.db") as found:
        found.add_night(record(1), "touch\n1\n", knowledge(1))
        yield found


def test_why_a_night_broke_off_comes_before_any_guess(history: History) -> None:
    found, text = told(history, SILENT)
    assert found["status"] == "partial" and found["verdict"] == "doubtful"
    assert "broke off after 19 of 226 touches: the control has been silent for longer than 41 s" in found["headline"]
    assert "alarm screen of its control" in text and SILENT[4:-1] in text
    assert "battery" not in text and "stylus" not in text and "door" not in text


def test_a_night_that_somebody_stopped_says_so(history: History) -> None:
    found, text = told(history, "stopped by the user. 24 of 226 touches are recorded.")
    assert "stopped by the user after 19 of 226 touches" in found["headline"] and "Ask who stopped" in text
    assert "battery" not in text and "door" not in text


def test_a_silent_control_sends_people_to_its_alarm_screen(history: History) -> None:
    found, text = told(history, "the control does not answer", nothing=True)
    assert found["verdict"] == "not_measured" and "alarm screen of its control" in text


def test_a_night_that_did_not_measure_still_asks_for_an_answer_to_an_alarm(history: History) -> None:
    history.add_night(record(2, verdict="changed", alarms=[knock("2026-10-02")]), "touch\n1\n", knowledge(2))
    found, text = told(history, "the control does not answer", nothing=True)
    assert [a["id"] for a in found["standing"]] == ["2026-10-02-1"]
    assert "alarm of 2026-10-02" in text and "tango history decide 2026-10-02-1" in text


def test_what_is_known_is_of_the_last_night_that_was_believed(history: History) -> None:
    history.add_night(record(2, verdict="doubtful", parameters={}), "touch\n1\n")
    known = known_before("M", cast(Ports, SimpleNamespace(past=history)))
    assert (known["last_measured"], known["last_carried"]) == (record(2)["night"], record(1)["night"])
    told = {
        **record(3, verdict="doubtful", parameters={}),
        **known,
        "carried": False,
        "preflight": [],
        "owner": "",
        "cell": "",
        "limits": [{"what": "volume", "value": 68.0, "unit": "µm", "limit": 60.0, "passed": False}],
        "planned": 74,
    }
    text = message({**told, "headline": "", "artefacts": {"folder": ""}, "machine_time_s": 1.0}, (), ())[1]
    assert f"what is known is that of {record(1)['night']}" in text and f"that of {record(2)['night']}" not in text
    assert "68.0" not in text  # what is not believed crosses no limit


def test_a_page_calls_nothing_known_of_a_night_in_doubt() -> None:
    before = record(2, verdict="doubtful", limits=[])
    told = answer(record(3, **NOTHING, limits=[]), Units(), texts(), "", before)
    assert told.may == "no" and "2 Oct 2026 were in doubt" in told.why and "was known" not in told.why


def test_a_night_refused_while_another_is_at_work_stands_behind_it_everywhere(history: History) -> None:
    """It began a minute later, and ended at once; the one at work ended an hour later."""
    work = {"start_utc": "2026-10-03T02:00:00Z", "end_utc": "2026-10-03T03:00:00Z"}
    refused = NOTHING | {"status": "refused", "start_utc": "2026-10-03T02:01:00Z", "end_utc": "2026-10-03T02:01:01Z"}
    history.add_night(record(3, **refused, headline="not begun"))
    begun = datetime.fromisoformat(work["start_utc"]).timestamp() / 86_400
    assert "not measured" not in since(history, "M", begun).words  # tonight is the one at work
    history.add_night(record(3, verdict="out_of_limits", **work), "touch\n1\n", knowledge(3))
    assert [n.status for n in history.nights("M")][:2] == ["complete", "refused"]
    assert [n.verdict for n in history.nights("M", last=1)] == ["out_of_limits"] and len(history.nights(last=2)) == 2


def test_nights_that_cannot_be_compared_say_why(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(1), "touch\n1\n", knowledge(1))
        history.add_night(record(2, verdict="doubtful", parameters={}), "touch\n1\n")
    words = ["history", "compare", record(1)["night"], "last", "--history", str(tmp_path / "history.db")]
    found = CliRunner().invoke(tango, words, standalone_mode=False)
    assert isinstance(found.exception, InputError) and f"{record(2)['night']} is in doubt" in str(found.exception)


@pytest.mark.long
def test_a_limit_in_the_wrong_unit_asks_whether_that_is_meant(root: Path) -> None:
    cell = read_cell(root / "examples" / "hu40t")
    for name, limit, meant in (("volume", 0.030, "30"), ("EC0Y", 0.02, "20")):
        with pytest.raises(InputError, match=f"Did you mean {meant}\\?"):
            nights_of(cell, Nightly(limits={name: limit}), plan(cell))


@pytest.mark.parametrize(
    ("action", "until", "words"), [("ignore", None, "ignore without until when"), ("accept", "2026-12-01", "ignore only")]
)
def test_a_decision_with_or_without_its_date_is_a_sentence(history: History, action: str, until: str | None, words: str) -> None:
    history.add_night(record(2, verdict="changed", alarms=[knock("2026-10-02")]), "touch\n1\n", knowledge(2))
    with pytest.raises(InputError, match=words) as found:
        history.decide("M", Decision("2026-10-02-1", action, "Ann", "", until, "2026-10-05T08:00:00Z"))
    assert "None" not in str(found.value)


def invoked(args: list[str]) -> Result:
    return CliRunner().invoke(tango, args, standalone_mode=False)


@pytest.mark.few(0)
def test_a_night_that_was_cut_off_is_told_before_the_next_one(tmp_path: Path) -> None:
    """After a kill the machine may still move: status and fleet end with 1, and say to look at it. One at work is no trouble."""
    folder = tmp_path / "cell"
    assert CliRunner().invoke(tango, ["init", "--example", "trunnion", str(folder)]).exit_code == 0
    with opened(folder / "history.db") as history:
        now = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
        good = record(3, start_utc=now, end_utc=now) | {"machine": read_cell(folder).machine.name}
        history.add_night(good, "touch\n1\n", knowledge(3))
    asked = (["nightly", "-C", str(folder), "--status"], ["fleet", str(folder)])
    assert [invoked(one).return_value for one in asked] == [0, 0]
    begun = folder / "nights" / "begun"
    begun.mkdir(parents=True)
    (begun / "2026-11-23T020000Z").write_text("2026-11-23T02:00:00Z")
    (begun.parent / "2026-11-23T020000Z").mkdir()
    (begun.parent / "2026-11-23T020000Z" / "planned.json").write_text("{}")  # written before anything is sent
    with holding(folder, "tango nightly"):
        runs = [invoked(one) for one in asked]
        assert [r.return_value for r in runs] == [0, 0] and "at work: the night 2026-11-23T020000Z" in runs[0].output
    for one in asked:
        run = invoked(one)
        assert run.return_value == 1 and "Look at the machine first" in " ".join(run.output.split())
    told = json.loads(invoked([*asked[0], "--json", "-"]).output)
    assert told["cut_off"] == ["2026-11-23T020000Z"]


def test_a_control_that_may_still_execute_a_program_is_looked_at_before_anything_else(history: History) -> None:
    """The preflight refused the night for that, and its message began with a first part to be measured."""
    history.add_night(record(8), "touch\n8\n", knowledge(8))
    point = PreflightPoint("control", False, "it may execute that program until 03:10", "Look at the machine.", moving=True)
    found, text = told(history, "", points=(point,))
    assert found["verdict"] == "not_measured" and found["moved"] is True and set(found["preflight"][-1]) == set(POINT)
    assert "Not yet" in text and "stop it at the control" in text
    assert "Look at the machine first" in text and "Measure the first part" not in text
    still, _ = told(history, "", points=(replace(point, moving=False),))
    assert "moved" not in still


def test_readings_that_the_history_keeps_from_being_judged_are_not_in_doubt(history: History) -> None:
    """A database that was switched off in the night sent a mechanic to the stylus, and called the readings wrong."""
    away = LinkError("history: it cannot be read (server closed the connection); is the database switched on?")
    found, text = told(history, "", unjudged=away)
    assert (found["verdict"], found["touches"], found["artefacts"]["readings"]) == ("not_measured", 0, "readings.csv")
    assert "19 touches were made and are kept, but nobody has judged them" in text and "database switched on" in text
    assert "stylus" not in text and "relied on" not in text
    assert "nothing was measured" not in text and "what was measured is kept, and nobody has judged it" in text
    assert "what to do: Have the database with the history looked at" in text and "Put it right" not in text
