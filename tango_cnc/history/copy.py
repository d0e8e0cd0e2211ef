"""A history → another one, row by row: backup, restore, and the way from SQLite to PostgreSQL are the same thing."""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import func, insert, select, text
from sqlalchemy.exc import DBAPIError

from ..records import InputError, LinkError, TangoError
from . import _tables as t
from ._database import first_line, shown
from .store import History, opened

AT_ONCE = 500  # rows


def copied(history: History, place: str | Path) -> int:
    """history, file name or URL of an empty one → entries that are there now. Raises InputError where there are some already.

    The copy is verified; a file that is not what was copied is taken away again.
    """
    with opened(place) as target:
        ours = False
        try:
            with (
                history.engine.connect() as source,
                target.engine.connect().execution_options(writes=True) as sink,
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
            wrong = target.verify()
            if wrong:
                raise LinkError(f"{shown(place)}: the copy is not what was copied: {wrong[0]}")
            return sum(number for number, _ in target.newest_hashes().values())
        except (TangoError, DBAPIError) as error:
            if ours and isinstance(place, Path):
                for ending in ("", "-wal", "-shm"):
                    Path(f"{place}{ending}").unlink(missing_ok=True)
            if isinstance(error, DBAPIError):
                why = first_line(error)
                raise LinkError(f"history: it cannot be copied ({why}). If it is damaged, take an older backup") from None
            raise
