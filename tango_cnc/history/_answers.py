"""Questions to a database as its driver has them: a statement is made into text once and not with every question.

A night asks some twenty times, mostly for a few rows: making the text took longer than the answer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from sqlalchemy import Dialect, Engine, Float, Integer, LargeBinary, Row, Select, String

PLAIN = (Integer, Float, String, LargeBinary)  # kinds of columns that both drivers answer as they are


class _Text(NamedTuple):
    """A statement as one kind of database has it; the names of what is filled in, in its order, None where they are named there;
    what it holds by itself."""

    text: str
    order: tuple[str, ...] | None
    own: Mapping[str, Any]


def answers(engine: Engine, wanted: Select[Any], given: Mapping[str, Any] | None) -> list[Row[Any]]:
    """database, question, what is filled in → its answers. Raises DBAPIError, UnicodeDecodeError."""
    with engine.connect() as connection:
        said = _text(wanted, engine.dialect)
        if said is None:
            return list(connection.execute(wanted, given).all())
        values = {**said.own, **(given or {})}
        filled = values if said.order is None else tuple(values[name] for name in said.order)
        return list(connection.exec_driver_sql(said.text, filled).all())


@lru_cache(128)
def _text(wanted: Select[Any], dialect: Dialect) -> _Text | None:
    """question, kind of database → its text; None for one whose text depends on how many values are filled in, or that
    has a column whose values are made into something else.
    """
    made: Any = wanted.compile(dialect=dialect)
    if made.post_compile_params or not all(isinstance(column.type, PLAIN) for column in wanted.selected_columns):
        return None
    return _Text(str(made), tuple(made.positiontup) if made.positional else None, made.params)
