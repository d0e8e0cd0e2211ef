"""Questions to a database, straight to its driver: a statement is made into text once and not with every question.

A night asks some twenty times, mostly for a few rows, and what is made around a question took five times as long as its answer.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

from sqlalchemy import Dialect, Engine, Float, Integer, LargeBinary, Row, Select, String
from sqlalchemy.exc import OperationalError

from ..records import LinkError
from ._patience import gave_up

PLAIN = (Integer, Float, String, LargeBinary)  # kinds of columns that both drivers answer as they are


class _Text(NamedTuple):
    """A statement as one kind of database has it; the names of what is filled in, in its order, None where they are named there;
    what it holds by itself; how its answers are made.
    """

    text: str
    order: tuple[str, ...] | None
    own: Mapping[str, Any]
    row: Any


class UnreadableError(LinkError):
    """A history that was open does not answer any more. `engine`: its connections, by which it is known which one that was."""

    def __init__(self, message: str, engine: object) -> None:
        super().__init__(f"history: {message}")
        self.engine = engine


def answers(engine: Engine, wanted: Select[Any], given: Mapping[str, Any] | None) -> list[Row[Any]]:
    """database, question, what is filled in → its answers. Raises DBAPIError, UnicodeDecodeError."""
    said = _text(wanted, _Kind(engine.dialect.name, engine.dialect.driver, engine.dialect))
    if said is not None:
        values = {**said.own, **(given or {})}
        filled = values if said.order is None else tuple([values[name] for name in said.order])
        driver: Any = engine.dialect.dbapi
        try:
            with closing(engine.raw_connection()) as connection:
                try:
                    cursor = connection.cursor()
                    cursor.execute(said.text, filled)  # one statement: by itself it reads the database as it is at one moment
                    return list(map(said.row, cursor.fetchall()))
                except driver.OperationalError as error:  # one that is gone is not put back, which fails with a traceback
                    if engine.dialect.is_disconnect(error, connection.dbapi_connection, None):
                        connection.invalidate(error)
                    if gave_up(error):
                        raise OperationalError(said.text, None, error) from None
                    raise
        except (driver.Error, UnicodeDecodeError):
            pass  # asked once more below, where what is wrong is said as everywhere else
    with engine.connect() as connection:
        return list(connection.execute(wanted, given).all())


@dataclass(frozen=True)
class _Kind:
    """One kind of database with its driver: every engine has a dialect of its own, and the same texts."""

    name: str
    driver: str
    dialect: Dialect = field(compare=False)


@lru_cache(128)
def _text(wanted: Select[Any], kind: _Kind) -> _Text | None:
    """question, kind of database → its text; None for one whose text depends on how many values are filled in, or that
    has a column whose values are made into something else.
    """
    made: Any = wanted.compile(dialect=kind.dialect)
    columns = list(wanted.selected_columns)
    if made.post_compile_params or not all(isinstance(column.type, PLAIN) for column in columns):
        return None
    names = [str(column.name) for column in columns]
    row: Any = namedtuple("Answer", names, rename=True)  # type: ignore[misc]  # of two columns of one name the first has it
    return _Text(str(made), tuple(made.positiontup) if made.positional else None, made.params, row._make)
