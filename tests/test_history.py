"""A history keeps what was added, whole and in order, refuses changes, and says when somebody has changed it all the same."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from support.histories import COMPENSATION, EVENTS, knowledge, record

from tango_cnc.cli import tango
from tango_cnc.history import Decision, History, _chain, add_compensations, compensations, opened
from tango_cnc.history.picture import standardised
from tango_cnc.records import InputError, LinkError
from tango_cnc.state import charts


@pytest.fixture
def history(tmp_path: Path) -> Any:
    with opened(tmp_path / "history.db") as found:
        for day in (1, 2, 3):
            found.add_night(record(day), f"touch,time_s\n1,{day}\n", knowledge(day))
        yield found


def test_what_was_added_comes_back_whole(history: History) -> None:
    assert [n.night for n in history.nights("M")] == ["2026-10-03", "2026-10-02", "2026-10-01"]
    stored = history.night(history.nights("M", last=1)[0].entry)
    assert stored.record == record(3)
    assert stored.readings == "touch,time_s\n1,3\n"
    assert stored.knowledge is not None and stored.knowledge.names == knowledge(3).names
    assert np.array_equal(stored.knowledge.values, knowledge(3).values)
    assert np.allclose(stored.knowledge.covariance, knowledge(3).covariance, rtol=0, atol=1e-15)
    assert np.allclose(history.trend("M", "EX0C").value, [0.001, 0.002, 0.003])
    assert history.verify() == ()


def test_a_night_in_doubt_has_no_error_at_the_tool_tip(history: History) -> None:
    """Curves, bars and exports had 16 mm of it, beside which all other nights were flat."""
    history.add_night(record(4, verdict="doubtful", volume={"worst_um": 16087.0}), None, None)
    assert [n.volume_um for n in history.nights("M", last=1)] == [None]
    assert history.fleet("2026-10-04T08:00:00Z", 36.0)[0].last.volume_um is None
    assert history.night(4).night.volume_um is None and history.verify() == ()


def test_rows_cannot_be_changed_through_the_database(history: History, tmp_path: Path) -> None:
    add_compensations(history, "M", "/cells/m", EVENTS)
    plain = sqlite3.connect(tmp_path / "history.db")
    for table in ("entry", "night", "night_record", "night_parameter", "night_readings", "night_estimate", "compensation"):
        column = "id" if table == "entry" else "entry_id"
        for change in (f"UPDATE {table} SET {column} = 9", f"DELETE FROM {table}"):
            with pytest.raises(sqlite3.Error, match="append-only"):
                plain.execute(change)
    plain.close()
    assert history.verify() == ()


NUMBERS = ("alarms", "p_value", "touches", "rms_um", "volume_um", "duration_s")
SPOILT = {
    "a word of a night": "UPDATE night SET verdict = 'good ' WHERE entry_id = 2",
    **{f"{column} of a night": f"UPDATE night SET {column} = {column} + 1 WHERE entry_id = 2" for column in NUMBERS},
    "a night of another machine": "UPDATE night SET machine_id = 2 WHERE entry_id = 2",
    "a parameter": "UPDATE night_parameter SET value = 0 WHERE entry_id = 2",
    "the unit of a parameter": "UPDATE night_parameter SET unit = 'rad' WHERE entry_id = 2",
    "the moment of a parameter": "UPDATE night_parameter SET start_utc = '2027-10-02T02:00:00Z' WHERE entry_id = 2",
    "a parameter of another machine": "UPDATE night_parameter SET machine_id = 2 WHERE entry_id = 2",
    "the readings": "UPDATE night_readings SET csv = (SELECT csv FROM night_readings WHERE entry_id = 1)",
    "the covariance": "UPDATE night_estimate SET numbers = (SELECT numbers FROM night_estimate WHERE entry_id = 1)",
    "two names of the estimate": 'UPDATE night_estimate SET names = \'["EA0B", "EX0C", "EXt", "EZf3"]\' WHERE entry_id = 2',
    "a name of the estimate": "UPDATE night_estimate SET names = replace(names, 'EX0C', 'EY0C') WHERE entry_id = 2",
    "the record": "UPDATE night_record SET json = replace(json, 'nothing has', 'much has') WHERE entry_id = 2",
    "a decision": "UPDATE decision SET owner = 'somebody else'",
    "an event of a compensation": "UPDATE compensation SET measured_um = 0.1",
    "a link": "UPDATE entry SET previous = hash WHERE id = 2",
    "an entry that is gone": "DELETE FROM entry WHERE id = 2",
    "the moment of an entry": "UPDATE entry SET utc = '2026-10-02T03:00:00Z' WHERE id = 2",
}


@pytest.mark.few(2)
@pytest.mark.parametrize("what", SPOILT)
def test_who_removes_the_triggers_and_changes_something_is_found(tmp_path: Path, what: str) -> None:
    file = tmp_path / "history.db"
    with opened(file) as history:
        for day in (1, 2, 3):
            told = {"change": {"p_value": 0.4}, "residual": {"rms_um": 0.7}, "volume": {"worst_um": 12.5}}
            told |= {"alarms": [{"id": f"2026-10-{day:02d}-1"}]}
            history.add_night(record(day, **told), f"touch\n{day}\n", knowledge(day))
        history.add_night(record(1, "another"))
        history.decide("M", Decision("2026-10-03-1", "accept", "Ann"))
        add_compensations(history, "M", "/cells/m", EVENTS)
        assert history.verify() == ()
    plain = sqlite3.connect(file)
    for (name,) in plain.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        plain.execute(f"DROP TRIGGER {name}")
    plain.execute(SPOILT[what])
    plain.commit()
    plain.close()
    with opened(file) as history:
        assert history.verify("M")


def test_a_history_from_before_names_were_hashed_verifies_as_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as earlier, opened(tmp_path / "history.db") as history:
        earlier.setattr(_chain, "content_of_night", lambda *held: _chain.content_without_names(*held[:3]))
        for day in (1, 2):
            history.add_night(record(day), f"touch\n{day}\n", knowledge(day))
    with opened(tmp_path / "history.db") as history:
        history.add_night(record(3), "touch\n3\n", knowledge(3))
        history.add_night(record(4))
        assert history.verify() == ()


def test_a_decision_needs_an_alarm_an_owner_and_a_known_action(history: History) -> None:
    history.add_night(record(4, alarms=[{"id": "2026-10-04-1", "cause": "step"}], verdict="changed"))
    assert [a["id"] for a in history.open_alarms("M")] == ["2026-10-04-1"]
    for wrong, word in (
        (Decision("2026-10-05-1", "accept", "Ann"), "no alarm"),
        (Decision("2026-10-04-1", "approve", "Ann"), "'approve'"),
        (Decision("2026-10-04-1", "accept", " "), "owner"),
        (Decision("2026-10-04-1", "ignore", "Ann"), "until"),
        (Decision("2026-10-04-1", "accept", "Ann", until="2026-11-01"), "until"),
        (Decision("2026-10-04-1", "ignore", "Ann", until="soon"), "date"),
        (Decision("2026-10-04-1", "ignore", "Ann", until="2025-01-01"), "is over"),
        (Decision("2026-10-04-1", "ignore", "Ann", until="2062-12-05"), "more than a year from now; allowed: 20"),
    ):
        with pytest.raises(InputError, match=word):
            history.decide("M", wrong)
    history.decide("M", Decision("2026-10-04-1", "repaired", "Ann", "new clamp", utc="2026-10-04T08:00:00Z"))
    assert history.open_alarms("M") == ()
    assert history.decisions("M") == (Decision("2026-10-04-1", "repaired", "Ann", "new clamp", None, "2026-10-04T08:00:00Z", "M"),)


def test_what_happened_to_a_compensation_is_added_once_and_in_order(history: History) -> None:
    assert add_compensations(history, "M", "/cells/m", EVENTS[:1]) == 1
    assert add_compensations(history, "M", "/cells/m", EVENTS) == 2
    assert add_compensations(history, "M", "/cells/m", EVENTS) == 0
    found = compensations(history, "M")
    assert [(e.event, e.before_um, e.promised_um, e.measured_um, e.text) for e in found] == [
        ("rolled back", None, None, 58.0, "a sign is wrong"),
        ("written", None, None, None, ""),
        ("proposed", 30.0, 2.0, None, ""),
    ]
    with pytest.raises(InputError, match="'forgotten'"):
        add_compensations(history, "M", "/cells/m", [{**COMPENSATION, "event": "forgotten"}])
    with pytest.raises(InputError, match="compensation"):
        add_compensations(history, "M", "/cells/m", [{"event": "written"}])
    with pytest.raises(InputError, match="finite"):
        add_compensations(history, "M", "/cells/m", [{**EVENTS[2], "measured_um": float("nan")}])
    assert len(compensations(history, "M", since="2026-10-03T10:00:00Z")) == 2 and history.verify() == ()


def test_a_fleet_says_who_is_late_and_who_alarms(history: History) -> None:
    history.add_night(record(3, "late", start_utc="2026-10-01T02:00:00Z"))
    history.add_night(record(3, "alarmed", alarms=[{"id": "2026-10-03-1"}]))
    history.add_night(record(3, "fails", status="failed"))
    fleet = {s.machine: (s.alarms_open, s.late, s.nights) for s in history.fleet("2026-10-03T06:00:00+00:00")}
    assert fleet == {"M": (0, False, 3), "late": (0, True, 1), "alarmed": (1, False, 1), "fails": (0, True, 1)}


def test_what_is_no_history_is_refused_and_left_alone(tmp_path: Path) -> None:
    other = tmp_path / "notes.db"
    other.write_bytes(b"these are notes, and no database at all" * 30)
    with pytest.raises((InputError, LinkError), match=r"notes\.db"), opened(other):
        pass
    assert other.read_bytes().startswith(b"these are notes")
    with pytest.raises(InputError, match="no such history"), opened(tmp_path / "none.db", create=False):
        pass
    with pytest.raises(InputError, match="allowed"), opened("mysql://host/name"):
        pass
    assert not (tmp_path / "none.db").exists()


def test_a_night_with_a_number_that_is_not_finite_is_refused_whole(history: History) -> None:
    with pytest.raises(InputError, match="finite"):
        history.add_night(record(4, residual={"rms_um": float("nan")}))
    assert len(history.nights("M")) == 3


def test_a_trend_is_drawn_on_the_terminal(history: History, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for day in range(1, 9):
        history.add_night(record(day))
    monkeypatch.setenv("COLUMNS", "60")
    where = ["history", "plot", "--history", str(tmp_path / "history.db"), "--machine", "M"]
    drawn = CliRunner().invoke(tango, where)
    assert drawn.exit_code == 0, drawn.output
    lines = drawn.output.splitlines()
    assert all(len(line) <= 60 for line in lines)
    assert " → " in lines[0] and set(lines[0]) & set("▁▂▃▄▅▆▇█")
    assert CliRunner().invoke(tango, [*where, "--chart", "ewma"]).exit_code != 0


def test_a_history_whose_end_was_cut_off_shows_against_the_hash_of_a_message(history: History, tmp_path: Path) -> None:
    number, digest = history.newest_hashes()["M"]
    assert number == 3
    history.engine.dispose()
    plain = sqlite3.connect(tmp_path / "history.db")
    where = ["history", "verify", "--history", str(tmp_path / "history.db"), "--holds", digest]
    assert CliRunner().invoke(tango, where, standalone_mode=False).return_value == 0
    guards = plain.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
    for name, _ in guards:
        plain.execute(f"DROP TRIGGER {name}")
    for table in ("night", "night_record", "night_parameter", "night_readings", "night_estimate"):
        plain.execute(f"DELETE FROM {table} WHERE entry_id = 3")
    plain.execute("DELETE FROM entry WHERE id = 3")
    for _, made in guards:
        plain.execute(made)  # who takes an entry away puts them back
    plain.commit()
    plain.close()
    assert CliRunner().invoke(tango, where[:-2], standalone_mode=False).return_value == 0  # the chain itself is whole
    cut = CliRunner().invoke(tango, where, standalone_mode=False)
    assert cut.return_value == 1 and "was cut off" in cut.output


def test_a_chart_divides_every_change_by_what_was_expected_of_its_night(history: History) -> None:
    """Full nights move a value ten times as far as checks, as they should: no chart takes that for an alarm. A knock is one."""
    rng, value, size = np.random.default_rng(2), 0.0, 0
    for day in range(1, 31):
        size = 1e-3 if day % 5 == 0 else 1e-4
        step = size * float(rng.normal()) if day != 20 else 8e-3
        value += step
        told = {"EX0C": {"value": value, "std": 1e-4, "unit": "mm", "change": step, "change_std": size}}
        history.add_night(record(day, machine="K", parameters=told))
    trend = history.trend("K", "EX0C")
    assert list(np.flatnonzero(charts.shewhart(standardised(history, trend)).alarm)) == [19]
    history.add_night(record(31, machine="K", parameters={"EX0C": {"value": value, "std": 1e-4, "unit": "mm"}}))
    assert len(standardised(history, history.trend("K", "EX0C"))) == 31  # a night from before that was kept


def test_a_parameter_that_goes_one_way_is_read_back_with_its_night(history: History) -> None:
    """`trend` of a record is one thing, `behind` a list of them."""
    trend = {"parameter": "EX0C", "text": "EX0C moves", "size": 0.002}
    entry = history.add_night(record(5, trend=trend, behind=[{"what": "volume", "text": "EX0C moves"}]))
    assert history.night(entry).record["trend"] == trend and history.verify() == ()


def test_a_history_that_cannot_be_written_is_read_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a file?#%.db"
    with opened(file) as history:
        history.add_night(record(1))
    before = {x.name: x.read_bytes() for x in tmp_path.iterdir()}
    monkeypatch.setattr("tango_cnc.history._database.writable", lambda file: False)
    with opened(file) as history:
        assert len(history.nights("M")) == 1 and history.verify() == ()
        with pytest.raises(LinkError, match="could not be written"):
            history.add_night(record(2))
    assert {x.name: x.read_bytes() for x in tmp_path.iterdir()} == before


def test_nights_that_only_a_writer_can_read_are_not_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with opened(tmp_path / "h.db") as history:
        history.add_night(record(1))
        monkeypatch.setattr("tango_cnc.history._database.writable", lambda file: False)
        with pytest.raises(LinkError, match=r"newest nights are in h\.db-wal"), opened(tmp_path / "h.db"):
            pass
