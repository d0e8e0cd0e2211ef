"""Histories that a bad disk or a stranger has spoilt: their bytes, and what stands in their rows."""

from __future__ import annotations

import random
import sqlite3
import zlib
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from sqlalchemy import Engine, create_engine

from support.histories import EVENTS, knowledge, record
from support.mutants import BYTES, Reader, spoilt
from tango_cnc.history import Decision, History, _database, add_compensations, compensations, opened
from tango_cnc.records import InputError, LinkError

ANEW = 0.1  # part of the files that are read as the first one of a process
MIGRATE = _database._migrate
ENGINES: dict[str, Engine] = {}
ODD = [None, 0, -1, 1 << 62, 2.5, 9e999, "", "x", b"", b"x", "2026-10-01", "{}", "[]", "null", "9" * 400, "\x00"]


def good(folder: Path) -> bytes:
    """→ a history of two nights, an alarm, a decision and the events of a compensation, in one file, without its triggers."""
    file = folder / "made.db"
    with opened(file) as history:
        history.add_night(record(1, alarms=[{"id": "2026-10-01-1", "cause": "step"}]), "touch\n1\n", knowledge(1))
        history.add_night(record(2), "touch\n2\n", knowledge(2))
        history.decide("M", Decision("2026-10-01-1", "repaired", "Ann", utc="2026-10-01T08:00:00Z"))
        add_compensations(history, "M", "/cells/m", EVENTS)
    plain = sqlite3.connect(file)
    plain.execute("PRAGMA journal_mode=DELETE")
    for (name,) in plain.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        plain.execute(f'DROP TRIGGER "{name}"')
    plain.commit()
    plain.execute("VACUUM")
    plain.close()
    data = file.read_bytes()
    file.unlink()
    return data


def damaged(data: bytes, rng: random.Random) -> bytes:
    """file → the same with bytes changed, zeroed, moved or cut off: what a disk does."""
    made = bytearray(data)
    for _ in range(rng.randrange(1, 4)):
        at, long = rng.randrange(len(made)), rng.choice([1, 1, 2, 8, 60, 512, 4096])
        match rng.randrange(8):
            case 0:
                made[at : at + long] = bytes(len(made[at : at + long]))
            case 1:
                other = rng.randrange(len(made))
                made[at : at + long] = made[other : other + len(made[at : at + long])]
            case 2 if rng.random() < 0.2:
                del made[at:]
                made = made or bytearray(b"S")
            case 3:
                word = rng.choice(BYTES)[: len(made) - at]
                made[at : at + len(word)] = word
            case 4:
                at %= 512  # the head and the schema
                made[at % len(made)] = rng.randrange(256)
            case _:
                made[at] = rng.randrange(256)
    return bytes(made)


@cache
def _places(data: bytes) -> list[tuple[str, str, int, Any]]:
    """file → table, column, row and value of everything in it."""
    plain = sqlite3.connect(":memory:")
    plain.deserialize(data)
    found = []
    for (table,) in plain.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name").fetchall():
        columns = [row[1] for row in plain.execute(f"PRAGMA table_info({table})")]
        for row in plain.execute(f"SELECT rowid, {', '.join(columns)} FROM {table}").fetchall():
            found += [(table, column, row[0], value) for column, value in zip(columns, row[1:], strict=True)]
    plain.close()
    return found


def rewritten(data: bytes, rng: random.Random) -> bytes:
    """file → the same with another value in one to three places: what a stranger with an editor of databases does."""
    plain = sqlite3.connect(":memory:")
    plain.deserialize(data)
    plain.execute("PRAGMA ignore_check_constraints=ON")
    for _ in range(rng.randrange(1, 4)):
        table, column, row, value = rng.choice(_places(data))
        other: Any = rng.choice(ODD)
        if isinstance(value, bytes) and rng.random() < 0.8:
            other = spoilt(value, rng)
        elif isinstance(value, str) and rng.random() < 0.8:
            other = spoilt(value.encode(), rng).decode("utf-8", "replace")
        try:
            plain.execute(f"UPDATE OR REPLACE {table} SET {column} = ? WHERE rowid = ?", (other, row))
        except sqlite3.Error:  # what the database itself refuses
            continue
    plain.commit()
    made = plain.serialize()
    plain.close()
    return made


def _engine(url: Any, **more: Any) -> Engine:
    """As SQLAlchemy's, but one for the same name: what it has compiled is most of the time of a small file. The pool is new."""
    if str(url) not in ENGINES:
        if len(ENGINES) > 20:  # names drawn by chance
            ENGINES.clear()
        ENGINES[str(url)] = create_engine(url, **more)
    return ENGINES[str(url)]


@cache
def _empty() -> bytes:
    """→ a history in which nothing is, of the schema of today."""
    with TemporaryDirectory() as place:
        file = Path(place, "empty.db")
        with patch.object(_database, "_migrate", MIGRATE), opened(file):
            pass
        plain = sqlite3.connect(file)
        plain.execute("PRAGMA journal_mode=DELETE")
        plain.close()
        return file.read_bytes()


def migrated(engine: Engine) -> None:
    """As the history's own, but a new file gets its schema at once: Alembic takes ten times as long as the rest of a small file."""
    file = Path(str(engine.url.database))
    if not file.exists():
        file.write_bytes(_empty())
    MIGRATE(engine)


def read(folder: Path) -> Any:
    """folder with history.db → what commands and pages ask a history for: some of it, which depends on the file."""
    file = folder / "history.db"
    for ending in ("-wal", "-shm", "-journal"):
        Path(f"{file}{ending}").unlink(missing_ok=True)
    chance = random.Random(zlib.crc32(file.read_bytes()))
    refused: list[Exception] = []
    found: list[Any] = []
    engines = nullcontext() if chance.random() < ANEW else patch.object(_database, "create_engine", _engine)
    with engines, opened(file, create=False) as history:
        for question in chance.sample(QUESTIONS, 5):
            try:
                found.append(question(history, chance))
            except REFUSES as error:
                refused.append(error)
    if refused:
        raise refused[0]
    return found


def _one(names: Sequence[str], chance: random.Random) -> str:
    return chance.choice([*names, "M"])


def _trend(history: History, chance: random.Random) -> Any:
    machine = _one(history.machines(), chance)
    return history.trend(machine, chance.choice([*history.parameters(machine), "EX0C"]))


QUESTIONS: list[Callable[[History, random.Random], Any]] = [
    lambda history, chance: history.fleet("2026-10-03T06:00:00Z"),
    lambda history, chance: history.verify() and None,
    lambda history, chance: history.newest_hashes(),
    lambda history, chance: [history.night(night.entry) for night in history.nights()],
    lambda history, chance: history.records_of([night.entry for night in history.nights()]),
    lambda history, chance: history.records(_one(history.machines(), chance), last=5),
    lambda history, chance: history.latest_knowledge(_one(history.machines(), chance)),
    lambda history, chance: history.open_alarms(_one(history.machines(), chance)),
    lambda history, chance: history.decisions(_one(history.machines(), chance)),
    lambda history, chance: compensations(history, _one(history.machines(), chance)),
    _trend,
]
REFUSES = (InputError, LinkError)
DATABASES = {
    "history.db": Reader("history.db", good, read, damaged, REFUSES),
    "history-rows": Reader("history.db", good, read, rewritten, REFUSES),
}
