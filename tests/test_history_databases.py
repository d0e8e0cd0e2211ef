"""SQLite and PostgreSQL keep the same history: the same tests on both, two writers at once, and a process killed at any commit."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from sqlalchemy import event, text
from sqlalchemy.exc import DBAPIError
from support import postgres
from support.histories import EVENTS, knowledge, record

from tango_cnc.cli import tango
from tango_cnc.history import Decision, add_compensations, compensations, opened, shown
from tango_cnc.history.copy import copied
from tango_cnc.history.guards import unguarded
from tango_cnc.records import InputError, LinkError

Place = Callable[[], str | Path]


def test_nights_decisions_trends_and_the_chain(history_place: Place) -> None:
    with opened(history_place()) as history:
        for day in range(1, 8):
            alarms = [{"id": f"2026-10-{day:02d}-1", "cause": "step"}] if day == 5 else []
            history.add_night(record(day, alarms=alarms, headline=f"µm, “{day}”"), f"touch\n{day}\n", knowledge(day))
        history.decide("M", Decision("2026-10-05-1", "ignore", "Ann", until="2026-11-01", utc="2026-10-05T08:00:00Z"))
        assert [n.night for n in history.nights("M", since="2026-10-03", before="2026-10-06")] == [
            "2026-10-05",
            "2026-10-04",
            "2026-10-03",
        ]
        assert np.allclose(history.trend("M", "EX0C", since="2026-10-06").value, [0.006, 0.007])
        stored = history.night(history.nights("M", last=1)[0].entry)
        assert stored.night.headline == "µm, “7”" and stored.readings == "touch\n7\n"
        assert stored.knowledge is not None and np.allclose(stored.knowledge.covariance, knowledge(7).covariance)
        assert history.decisions("M")[0].until == "2026-11-01"
        add_compensations(history, "M", "/cells/m", EVENTS)
        assert add_compensations(history, "M", "/cells/m", EVENTS) == 0
        assert [e.event for e in compensations(history, "M")] == ["rolled back", "written", "proposed"]
        assert history.verify() == ()
        for change in ("UPDATE night SET verdict = 'good'", "UPDATE compensation SET text = ''", "DELETE FROM compensation"):
            with pytest.raises(DBAPIError, match="append-only"), history.engine.begin() as connection:
                connection.execute(text(change))
        with pytest.raises(InputError, match="finite"):
            history.add_night(record(8, residual={"rms_um": float("inf")}))
        assert len(history.nights("M")) == 7


@pytest.mark.long
@pytest.mark.system("pg_lsclusters")
def test_a_password_of_the_database_is_in_the_environment(postgres_server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    place = postgres.database(postgres_server).replace("tango@", "tango:${FLEET}@")
    with pytest.raises(InputError, match=r"found \$\{FLEET\}, and the environment has no variable"), opened(place):
        pass
    monkeypatch.setenv("FLEET", "p@ss/w:o#rd")  # signs that part a URL
    with opened(place) as history:
        assert history.engine.url.password == "p@ss/w:o#rd"


@pytest.mark.long
@pytest.mark.system("pg_lsclusters")
def test_a_server_that_stops_is_said_without_a_traceback(caplog: pytest.LogCaptureFixture) -> None:
    """A night in whose middle it was stopped wrote 25 lines of them beside its answer."""
    psycopg = pytest.importorskip("psycopg")
    with postgres.server() as server, opened(postgres.database(server)) as history:
        history.add_night(record(1), None)
        stop, over = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> pg_backend_pid()", list[bool]()

        def stopped(*_: object) -> None:
            if not over:
                over.append(True)
                with psycopg.connect(f"{server}/postgres", autocommit=True) as other:
                    other.execute(stop)
                time.sleep(0.5)

        event.listen(history.engine, "checkout", stopped)  # between the look at a connection and the question
        assert history.knows("M") and over
    assert not [r.message for r in caplog.records if r.exc_info]


@pytest.mark.long
@pytest.mark.system("pg_lsclusters")
def test_who_is_refused_looks_at_user_and_password(postgres_server: str) -> None:
    place = postgres.database(postgres_server).replace("tango@", "nobody-of-this-name@")
    with pytest.raises(LinkError, match="are user and password right"), opened(place):
        pass


def test_no_message_has_the_password_of_a_database() -> None:
    assert shown("postgresql://tango:s@ecret@host/db") == "postgresql://tango:***@host/db"
    assert shown("postgresql://tango@host/db") == "postgresql://tango@host/db" and shown("history.db") == "history.db"
    with pytest.raises(InputError) as error, opened("mysql://tango:secret@host/db"):
        pass
    assert "secret" not in str(error.value)


@pytest.mark.few(0)
def test_a_backup_is_the_same_and_comes_back(history_place: Place, tmp_path: Path) -> None:
    first, second = history_place(), history_place()
    with opened(first) as history:
        for day in (1, 2, 3):
            history.add_night(record(day), f"touch\n{day}\n", knowledge(day))
        newest = history.newest_hashes()
        assert copied(history, tmp_path / "copy.db") == (3, {})
        with pytest.raises(InputError, match="not empty"):
            copied(history, first if not isinstance(first, Path) else tmp_path / "copy.db")
    with opened(tmp_path / "copy.db", create=False) as copy:
        assert copied(copy, second) == (3, {})
    with opened(second) as history:
        assert history.newest_hashes() == newest and history.verify() == ()
        history.add_night(record(4))
        assert history.verify() == ()


WRITER = """
import sys
sys.path.insert(0, {tests!r})
from support.histories import knowledge, record
from tango_cnc.history import opened
with opened({place!r}) as history:
    print("ready", flush=True)
    for day in range({first}, {last}):
        history.add_night(record(1 + day % 27, {machine!r}), "touch\\n" * 40, knowledge(day))
        print(day, flush=True)
"""


def writer(place: str | Path, first: int, last: int, machine: str = "M") -> subprocess.Popen[str]:
    source = WRITER.format(tests=str(Path(__file__).parent), place=str(place), first=first, last=last, machine=machine)
    return subprocess.Popen([sys.executable, "-c", source], stdout=subprocess.PIPE, text=True)


@pytest.mark.long
def test_two_nights_at_once_make_one_chain(history_place: Place) -> None:
    where = history_place()
    both = [writer(where, 0, 15), writer(where, 100, 115)]
    assert [p.wait(120) for p in both] == [0, 0]
    with opened(where) as history:
        assert len(history.nights("M")) == 30
        assert history.verify() == ()


@pytest.mark.long
def test_what_was_acknowledged_survives_a_kill_and_nothing_is_half(history_place: Place) -> None:
    """Killed after a random time, again and again: every night that the writer has reported is there, whole."""
    where = history_place()
    rng = np.random.default_rng(7)
    done = 0
    for _ in range(int(os.environ.get("TANGO_KILLS", "6"))):
        process = writer(where, done, done + 1000)
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(float(rng.uniform(0.0, 0.4)))
        process.send_signal(signal.SIGKILL)
        reported = process.stdout.read().split()
        process.wait()
        with opened(where) as history:
            there = len(history.nights("M")) if "M" in history.machines() else 0
            assert done + len(reported) <= there <= done + len(reported) + 1
            assert history.verify() == ()
        done = there


FIRST = Path(__file__).parent / "reference" / "history_0001.sql"


def test_a_history_of_the_first_schema_is_read_and_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "old.db"
    plain = sqlite3.connect(file)
    plain.executescript(FIRST.read_text(encoding="utf-8"))
    plain.close()
    with opened(file, create=False) as history:
        assert [n.night for n in history.nights("M")] == ["2026-10-02", "2026-10-01"]
        assert history.open_alarms("M") == () and history.decisions("M")[0].owner == "Ann"
        assert history.verify() == ()
        history.add_night(record(3), "touch\n3\n", knowledge(3))
        assert add_compensations(history, "M", "/cells/m", EVENTS) == 3
        assert history.verify() == ()


SECOND = FIRST.with_name("history_0002.sql")  # of November 2026, as version 0.1.0 made it
REPLACED = (
    "INSERT OR REPLACE INTO {table} SELECT * FROM {table} WHERE rowid = {row}",
    "REPLACE INTO {table} SELECT * FROM {table} WHERE rowid = {row}",
    "UPDATE OR REPLACE {table} SET rowid = rowid WHERE rowid = {row}",
)


@pytest.mark.parametrize("from_file", [False, True])
def test_no_row_of_sqlite_is_replaced_by_another_one(tmp_path: Path, from_file: bool) -> None:
    """A connection of another program has recursive_triggers off: what REPLACE deletes there, no trigger of DELETE sees."""
    file = tmp_path / "history.db"
    plain = sqlite3.connect(file)
    plain.executescript(SECOND.read_text(encoding="utf-8"))
    if not from_file:  # the schema of today from its first step on
        plain.close()
        file = tmp_path / "new.db"
        with opened(file) as history:
            for day in (1, 2):
                history.add_night(record(day, alarms=[{"id": f"2026-10-0{day}-1"}]), f"touch\n{day}\n", knowledge(day))
            history.decide("M", Decision("2026-10-02-1", "accept", "Ann"))
            add_compensations(history, "M", "/cells/m", EVENTS)
    with opened(file, create=False) as history:  # which brings the schema up to date
        assert history.verify() == () and len(history.nights("M")) == 2
    plain = sqlite3.connect(file)
    assert plain.execute("PRAGMA recursive_triggers").fetchone() == (0,)
    kept = "SELECT tbl_name FROM sqlite_master WHERE type = 'trigger' AND name LIKE '%no_delete'"
    tables = [name for (name,) in plain.execute(kept)]
    assert len(tables) == 8
    for table in tables:
        (row,) = plain.execute(f"SELECT max(rowid) FROM {table}").fetchone()
        for change in REPLACED:
            with pytest.raises(sqlite3.IntegrityError, match="append-only"):
                plain.execute(change.format(table=table, row=row))
    for change in (  # the other keys of a row
        "REPLACE INTO entry SELECT NULL, machine_id, number, kind, utc, content, previous, hash FROM entry WHERE id = 2",
        "REPLACE INTO night_parameter (rowid, machine_id, name, entry_id, start_utc, value, std, unit) "
        "VALUES (1, 1, 'X', 1, '', 0, 0, '')",
        "REPLACE INTO compensation SELECT 1, machine_id, number, target, event, text, before_um, promised_um, measured_um, line, "
        "line_sha256, utc FROM compensation LIMIT 1",
    ):
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            plain.execute(change)
    plain.close()
    with opened(file, create=False) as history:
        history.add_night(record(3), "touch\n3\n", knowledge(3))
        assert add_compensations(history, "M", "/cells/m", EVENTS) == 0
        assert history.verify() == () and len(history.nights("M")) == 3


def test_a_row_that_is_there_is_not_taken_for_another_one_on_conflict(history_place: Place) -> None:
    """PostgreSQL has no REPLACE: INSERT … ON CONFLICT DO UPDATE is an update there as well, and SQLite has both."""
    with opened(history_place()) as history:
        history.add_night(record(1), "touch\n1\n", knowledge(1))
        for change in (
            "INSERT INTO night_record SELECT * FROM night_record WHERE true ON CONFLICT (entry_id) DO UPDATE SET json = '{}'",
            "INSERT INTO entry SELECT * FROM entry WHERE true ON CONFLICT (machine_id, number) DO UPDATE SET content = ''",
        ):
            with pytest.raises(DBAPIError, match="append-only"), history.engine.begin() as connection:
                connection.execute(text(change.replace("'{}'", "'[]'")))
        assert history.verify() == ()


@pytest.mark.long
def test_a_broken_chain_is_in_the_backup_and_named_and_the_other_machines_are_whole(history_place: Place, tmp_path: Path) -> None:
    place = history_place()
    with opened(place) as history:
        for machine in ("M", "N"):
            for day in (1, 2, 3):
                history.add_night(record(day, machine), f"touch\n{day}\n", knowledge(day))
        with history.engine.connect().execution_options(writes=True) as connection, connection.begin():
            if history.engine.dialect.name == "sqlite":
                connection.execute(text("DROP TRIGGER entry_no_update"))
                connection.execute(text("DROP TRIGGER night_record_no_delete"))
            else:
                connection.execute(text("ALTER TABLE entry DISABLE TRIGGER ALL"))
                connection.execute(text("ALTER TABLE night_record DISABLE TRIGGER ALL"))
            connection.execute(text("UPDATE entry SET content = previous WHERE id = 5"))
            connection.execute(text("DELETE FROM night_record WHERE entry_id = 6"))
        assert set(history.broken()) == {"N"}
    where = str(place)
    said = CliRunner().invoke(tango, ["history", "verify", "--history", where], standalone_mode=False)
    assert said.return_value == 1 and "of entry, night_record: its triggers were taken out" in said.output
    made = CliRunner().invoke(tango, ["history", "backup", "--history", where, str(tmp_path / "copy.db")], standalone_mode=False)
    assert made.return_value == 1 and "6 entries" in made.output
    assert "N: its chain is broken" in made.output and "entry 2" in made.output and "M:" not in made.output
    with opened(tmp_path / "copy.db", create=False) as copy:
        assert set(copy.broken()) == {"N"} and len(copy.nights("M")) == 3
    back = ["history", "restore", "--history", str(tmp_path / "back.db"), str(tmp_path / "copy.db")]
    again = CliRunner().invoke(tango, back, standalone_mode=False)
    assert again.return_value == 1 and "N: its chain is broken" in again.output
    with opened(tmp_path / "back.db", create=False) as history:
        assert len(history.nights("M")) == 3 and unguarded(history.engine) == ()


def test_what_cannot_be_read_of_one_machine_is_named_and_the_others_are_verified(tmp_path: Path) -> None:
    with opened(tmp_path / "history.db") as history:
        for machine in ("M", "N"):
            history.add_night(record(1, machine), "touch\n1\n", knowledge(1))
        with history.engine.connect().execution_options(writes=True) as connection, connection.begin():
            connection.execute(text("DROP TRIGGER night_parameter_no_update"))
            connection.execute(text("UPDATE night_parameter SET value = 'abc' WHERE entry_id = 2"))
        (wrong,) = history.verify()
        assert wrong.startswith("N: value: found 'abc'") and "verify" not in wrong


def test_a_history_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "newer.db"
    with opened(file) as history, history.engine.connect().execution_options(writes=True) as connection, connection.begin():
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(InputError, match="newer version"), opened(file):
        pass
