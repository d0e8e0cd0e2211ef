"""A history → another one, row by row: backup, restore, and the way from SQLite to PostgreSQL are the same thing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from sqlalchemy import Connection, func, insert, select, text
from sqlalchemy.exc import StatementError

from ..records import InputError, LinkError, TangoError
from . import _tables as t
from ._database import first_line, shown
from .store import History, opened

AT_ONCE = 500  # rows


class Copied(NamedTuple):
    """Entries that are there now, and what is wrong with the chains of the history itself, by machine ('': of none)."""

    entries: int
    broken: Mapping[str, Sequence[str]]


def copied(history: History, place: str | Path) -> Copied:
    """history, file name or URL of an empty one → what is there now. Raises InputError where there are some already.

    The copy is verified; a file that is not what was copied is taken away again. A chain that somebody has broken is copied as it
    is: it must not keep the other machines from their backup.
    """
    with opened(place) as target:
        ours = False
        try:
            with (
                history.engine.connect() as source,
                target.engine.connect().execution_options(writes=True) as sink,
                _as_it_is(sink),
                sink.begin(),
            ):
                if sink.execute(select(func.count()).select_from(t.machine)).scalar():
                    raise InputError(f"{shown(place)}: found a history that is not empty; allowed: a new file or an empty database")
                ours = True
                for one in t.metadata.sorted_tables:
                    rows = source.execute(select(one).order_by(*one.primary_key.columns)).mappings()
                    while some := rows.fetchmany(AT_ONCE):
                        sink.execute(insert(one), [dict(row) for row in some])
                if target.engine.dialect.name == "postgresql":
                    for name in ("machine", "entry"):
                        sink.execute(text(f"SELECT setval(pg_get_serial_sequence('{name}', 'id'), (SELECT max(id) FROM {name}))"))
            wrong = target.broken()
            if wrong and (new := _new(wrong, history.broken())):
                raise LinkError(f"{shown(place)}: the copy is not what was copied: {new}")
            return Copied(sum(number for number, _ in target.newest_hashes().values()), wrong)
        except (TangoError, StatementError) as error:  # of a value that the database refuses, or that its library cannot write
            if ours and isinstance(place, Path):
                for ending in ("", "-wal", "-shm"):
                    Path(f"{place}{ending}").unlink(missing_ok=True)
            if isinstance(error, StatementError):
                why = first_line(error)
                raise LinkError(f"history: it cannot be copied ({why}). If it is damaged, take an older backup") from None
            raise


@contextmanager
def _as_it_is(sink: Connection) -> Iterator[None]:
    """connection to an empty history → within it SQLite takes rows that belong to nothing, too: their chain was broken before."""
    if sink.dialect.name != "sqlite":
        yield
        return
    cursor = sink.connection.cursor()
    cursor.execute("PRAGMA foreign_keys=OFF")
    try:
        yield
    finally:
        cursor.execute("PRAGMA foreign_keys=ON")
        cursor.close()


def _new(copy: Mapping[str, Sequence[str]], own: Mapping[str, Sequence[str]]) -> str:
    """what is wrong with a copy, with what was copied → the first sentence of the copy alone; '' where both say the same."""
    return next((text for name, texts in copy.items() for text in texts if text not in own.get(name, ())), "")
