"""A night that was cut off has a journal, and the next one makes readings of it: nothing measured is lost."""

from __future__ import annotations

import os
import shutil
import signal
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.dialects import EXAMPLE
from support.nights import into
from support.nights import night as invented
from support.nights_parts import (
    JOURNAL,
    KEPT,
    PLANNED,
    RealDisk,
    executed_until,
    keep_readings,
    newest_run,
    note_planned,
    told_of_signals,
)
from support.refusingdisk import Disk, refusing
from support.runs import Control, Result, cell, readings  # noqa: F401

from tango_cnc.cli import tango
from tango_cnc.commands.report import nights
from tango_cnc.files import read_cell
from tango_cnc.history import opened
from tango_cnc.link.lock import broken_off, ended, holding
from tango_cnc.link.measure import silence_after
from tango_cnc.link.rest import durations
from tango_cnc.nightly.mail import message
from tango_cnc.plan import part, plan
from tango_cnc.records import LinkError
from tango_cnc.report.answer import said_cut_off
from tango_cnc.report.facts import NewestNight
from tango_cnc.report.orders import orders
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units

STAMP = "2026-10-03T020000Z"


@pytest.fixture
def night(cell: Path) -> Path:
    """→ folder of a night that was cut off after four touches: its mark, what it was to touch, its journal."""
    assert Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    folder = cell / "nights" / STAMP
    folder.mkdir(parents=True)
    shutil.copy(cell / JOURNAL, folder / JOURNAL)
    note_planned(folder, "full", ())
    RealDisk(cell).begin(STAMP, "2026-10-03T02:00:00Z")
    return folder


def test_its_journal_becomes_readings_once_nobody_is_at_work_there(cell: Path, night: Path) -> None:
    made, before = plan(read_cell(cell)), (night / JOURNAL).read_bytes()
    asked: list[tuple[str, list[int]]] = []
    with holding(cell, "tango nightly"):
        keep_readings(cell, lambda kind, touches: made)
    assert not (night / KEPT[1]).exists()
    keep_readings(cell, lambda kind, touches: asked.append((kind, list(touches))) or made)
    assert asked == [("full", [])] and list(readings(cell, f"nights/{STAMP}/{KEPT[1]}").touch) == [1, 2, 3, 4]
    assert (night / JOURNAL).read_bytes() == before
    (night / KEPT[1]).write_text("what is there stays\n")
    keep_readings(cell, lambda kind, touches: made)
    assert (night / KEPT[1]).read_text() == "what is there stays\n"


@pytest.mark.long
def test_readings_that_the_disk_refused_are_made_though_the_night_is_on_record(cell: Path, night: Path) -> None:
    """They were made of marked nights alone, and a mark is gone once the night is on record; nobody heard of the disk."""
    made = plan(read_cell(cell))
    with refusing(Disk((night,), 0)):
        said = keep_readings(cell, lambda kind, touches: made)
    assert said == (f"nights/{STAMP}/readings.partial.csv could not be written (No space left on device)",)
    assert not (night / KEPT[1]).exists() and not list(night.glob(".readings*"))
    RealDisk(cell).ended(STAMP)
    assert keep_readings(cell, lambda kind, touches: made) == ()
    assert list(readings(cell, f"nights/{STAMP}/{KEPT[1]}").touch) == [1, 2, 3, 4]


@pytest.mark.long
def test_what_does_not_fit_holds_no_night_up_and_makes_nothing_up(cell: Path, night: Path) -> None:
    made = plan(read_cell(cell))
    keep_readings(cell, lambda kind, touches: part(made, [1, 2, 3]))
    for spoilt in ("{", "[]", '{"kind": "full"}', '{"kind": "full", "touches": ["x"]}', None):
        if spoilt is None:
            (night / PLANNED).unlink()
        else:
            (night / PLANNED).write_text(spoilt)
        keep_readings(cell, lambda kind, touches: made)
    assert not (night / KEPT[1]).exists() and (night / JOURNAL).exists()


def test_the_next_night_listens_before_it_sends_where_the_last_run_did_not_end(cell: Path, night: Path) -> None:
    """A control that nobody can ask went on with the program of a night that was killed, and began the next one after it."""
    made = plan(read_cell(cell))
    assert silence_after(newest_run(cell, "2026-10-04T020000Z")[1], made) > 1.5 * max(durations(made).values())
    assert silence_after(newest_run(cell, STAMP)[1], made) == 0.0  # no night was before that one
    later = cell / "nights" / "2026-10-04T020000Z"
    later.mkdir()
    (cell / JOURNAL).unlink()
    assert Result("run", "-C", cell, "--port", Control(cell).url).code == 0
    shutil.copy(cell / JOURNAL, later / JOURNAL)
    assert silence_after(newest_run(cell, "2026-10-05T020000Z")[1], made) == 0.0  # this one came to its end


def test_a_night_waits_until_a_program_that_was_left_behind_must_be_over(cell: Path, night: Path) -> None:
    """A line that was cut may carry nothing of what the control prints: silence alone proves nothing there."""
    made = plan(read_cell(cell))
    until = executed_until(cell, "2026-10-03T021000Z", made)
    assert until is not None
    lasts = until - datetime(2026, 10, 3, 2, tzinfo=UTC)
    assert timedelta(seconds=sum(durations(made).values())) < lasts < timedelta(hours=1)
    assert executed_until(cell, STAMP, made) is None


def test_a_night_waits_for_the_program_of_a_run_that_was_killed_outside_the_nights(cell: Path, night: Path) -> None:
    """After a `tango run` that was killed a night passed its preflight, and sent its program to a control that still moved."""
    made, tonight = plan(read_cell(cell)), f"{datetime.now(UTC) + timedelta(minutes=1):%Y-%m-%dT%H%M%SZ}"
    shutil.copy(night / JOURNAL, cell / JOURNAL)
    shutil.rmtree(cell / "nights")
    until = executed_until(cell, tonight, made)
    assert until is not None and until > datetime.now(UTC)
    assert silence_after(newest_run(cell, tonight)[1], made) > 0.0
    assert executed_until(cell, STAMP, made) is None
    (cell / JOURNAL).unlink()
    assert Result("run", "-C", cell, "--port", Control(cell).url).code == 0
    assert executed_until(cell, tonight, made) is None


@pytest.mark.few(0)
def test_a_run_that_broke_off_is_said_until_it_ends_or_a_night_has_measured(cell: Path) -> None:
    """Its page said to look at the machine, and the list beside it: Yes."""
    assert broken_off(cell) is None
    assert Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    at = broken_off(cell)
    assert at is not None and at == (cell / JOURNAL).stat().st_mtime
    with (cell / JOURNAL).open("ab") as file:
        file.write(b"00000000 5\n00000000 [1]\n{")  # a damaged end is no answer, and no error of a page
    at = (cell / JOURNAL).stat().st_mtime
    assert broken_off(cell) == at
    with holding(cell, "tango run"):
        assert broken_off(cell) is None
    (cell / JOURNAL).rename(cell / "after.journal")  # of 'tango run --readings after.csv'
    assert broken_off(cell) == at
    (cell / "after.journal").rename(cell / JOURNAL)
    night = cell / "nights" / "2026-10-04T020000Z"
    night.mkdir(parents=True)
    (night / "readings.csv").write_text("")
    os.utime(night / "readings.csv", (at - 1, at - 1))
    assert broken_off(cell) == at
    os.utime(night / "readings.csv", (at + 1, at + 1))
    assert broken_off(cell) is None
    os.utime(night / "readings.csv", (at - 1, at - 1))
    os.utime(cell / JOURNAL, (time.time() - 25 * 3600, time.time() - 25 * 3600))
    assert broken_off(cell) is None, "no program goes on for a day"
    (cell / JOURNAL).unlink()
    other = ("--readings", cell / "after.csv")  # as after a compensation
    assert Result("run", "-C", cell, *other, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    assert broken_off(cell) == (cell / "after.journal").stat().st_mtime
    assert Result("run", "-C", cell, "--port", Control(cell).url).code == 0
    assert broken_off(cell) is None


def test_a_report_of_that_morning_is_no_plain_yes() -> None:
    """The newest night on record was good; the one after it was killed while the control went on."""
    record = {"verdict": "good", "night": "2026-10-02", "status": "complete"}
    good = NewestNight("2026-10-02", "good", "nothing has changed", 0, record=record)
    machine, t = read_cell(EXAMPLE).machine, texts()
    assert good.answer(Units(), t, machine).may == "yes"
    told = replace(good, former=said_cut_off([STAMP])).answer(Units(), t, machine)
    assert told.word == "Not yet" and told.level == "stop" and "cut off" in told.why
    assert orders(told, record, (), "check", Units(), t, machine, said_cut_off([STAMP]))[0].startswith("Look at the machine first")


@pytest.mark.long
def test_a_night_that_the_history_did_not_take_was_not_cut_off(cell: Path, night: Path) -> None:
    """The database went away while it measured: its result waits in its folder, and nothing executes a program any more."""
    (night / "unkept.json").write_text("{}")
    assert ended(cell, [STAMP]) == {STAMP: "waiting"}
    said = said_cut_off([STAMP], ended(cell, [STAMP]))
    record = {"verdict": "good", "night": "2026-10-02", "status": "complete"}
    good = NewestNight("2026-10-02", "good", "nothing has changed", 0, record=record)
    machine, t = read_cell(EXAMPLE).machine, texts()
    found = replace(good, former=said).answer(Units(), t, machine)
    assert found.word == "Yes, but" and "not in the history" in found.why
    steps = orders(found, record, (), "check", Units(), t, machine, said)
    assert any("See to the history" in step for step in steps) and not any("Look at the machine" in step for step in steps)
    for left in cell.glob("readings*"):  # of the run that made the journal of this night; it broke off itself
        left.unlink()
    done = CliRunner().invoke(tango, ["nightly", "-C", str(cell), "--status"])
    assert "its result is kept in the cell" in done.output and "may still execute" not in done.output


def test_a_signal_ends_a_night_as_an_error_until_its_result_is_kept() -> None:
    """SIGTERM before the first touch or in the diagnosis ended it without a record; within the history it would tear that apart."""
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(LinkError, match="ended from outside"), told_of_signals():
        signal.raise_signal(signal.SIGTERM)
    with told_of_signals() as ending:
        ending()
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["moved", "cut off", "run broke off", "beyond", "old", "measured"])
def test_terminal_and_message_say_not_yet_where_the_page_does(cell: Path, kind: str) -> None:
    """One verdict: page, list, report, status, fleet and the message of the night."""
    start = datetime.now(UTC).replace(microsecond=0) - timedelta(days=40 if kind == "old" else 1)
    first = {"night": f"{start:%Y-%m-%d}"} | {key: f"{start:%Y-%m-%dT%H:%M:%SZ}" for key in ("start_utc", "end_utc")}
    name, verdict = read_cell(cell).machine.name, "out_of_limits" if kind == "beyond" else "good"
    records = [invented(name, 0, verdict, **first)]
    if kind in ("moved", "beyond", "old"):
        now = {"night": f"{datetime.now(UTC):%Y-%m-%d}"} | {
            k: f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}" for k in ("start_utc", "end_utc")
        }
        nothing = {"status": "failed", "kind": "none", "touches": 0, "parameters": None, "volume": None, "limits": []}
        known = {"last_measured": first["night"], "last_verdict": verdict, "moved": True, "why": "silent", "preflight": []}
        known |= {"stale_nights": 40} if kind == "old" else {}
        records.append(invented(name, 1, "not_measured", **nothing, **known, **now))
    if kind == "cut off":
        (cell / "nights" / STAMP).mkdir(parents=True)
        note_planned(cell / "nights" / STAMP, "full", ())
        RealDisk(cell).begin(STAMP, "2026-10-03T02:00:00Z")
    if kind == "run broke off":
        assert Result("run", "-C", cell, "--port", Control(cell, stop=4).url, "--timeout", "0.4").code == 3
    with opened(cell / "history.db") as history:
        into(history, records)
    word = {"beyond": "No", "old": "Nobody knows", "measured": "Yes"}.get(kind, "Not yet")
    runs = {
        one: CliRunner().invoke(tango, [*one.split(), str(cell)], standalone_mode=False) for one in ("nightly --status -C", "fleet")
    }
    status, fleet = (" ".join(run.output.split()) for run in runs.values())
    assert f"May I make parts? {word}" in status and ("Look at the machine first" in status) == (kind != "measured")
    assert (f" {word} " in fleet) == (kind != "measured"), fleet
    found = nights(cell, read_cell(cell).machine, Units(), texts())
    assert found is not None and found.answer(Units(), texts(), read_cell(cell).machine).word == word
    if len(records) > 1:
        text = message(records[1], (), ())[1]
        assert f"May I make parts? {word}. Look at the machine first" in text.split("\n\n")[0], text
