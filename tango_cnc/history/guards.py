"""The triggers that refuse to change, delete or replace an entry: which of them a database still has."""

from __future__ import annotations

from sqlalchemy import Engine, text

from ..texts import say
from . import _tables as t

FREE = "machine"  # names alone: an entry has the name in its hash
OF_SQLITE = ("update", "delete", "replace")
ASKED = {
    "sqlite": "SELECT name FROM sqlite_master WHERE type = 'trigger'",
    "postgresql": "SELECT tgname AS name FROM pg_trigger WHERE NOT tgisinternal AND tgenabled <> 'D'",
}


def unguarded(engine: Engine) -> tuple[str, ...]:
    """database of a history → names of the tables in which anybody may change an entry, as a sentence; () for none.

    Somebody has taken the triggers out. The chain shows what is changed, and nothing refuses it any more.
    """
    open_ = without_triggers(engine)
    return (say("cli.history.unguarded", tables=", ".join(open_)),) if open_ else ()


def without_triggers(engine: Engine) -> list[str]:
    """database of a history → names of the tables in which anybody may change an entry, in the order of the alphabet."""
    kind = engine.dialect.name
    with engine.connect() as connection:
        there = {row.name for row in connection.execute(text(ASKED[kind]))}
    wanted = {
        table.name: {f"{table.name}_no_{what}" for what in OF_SQLITE} if kind == "sqlite" else {f"{table.name}_append_only"}
        for table in t.metadata.sorted_tables
        if table.name != FREE
    }
    return sorted(table for table, names in wanted.items() if names - there)
