"""A row that is there is not replaced by another one: SQLite deletes it without a word to the triggers of DELETE.

`INSERT OR REPLACE` and `REPLACE INTO` run them with recursive_triggers only, which a connection of another program has not set.
PostgreSQL has no such word; its ON CONFLICT DO UPDATE runs the triggers of UPDATE.
"""

from alembic import op

revision = "0003"
down_revision = "0002"

# A rowid that nobody has stated is −1 here: it is found before the row has one.
KEYS = {
    "entry": ("id = NEW.id", "machine_id = NEW.machine_id AND number = NEW.number"),
    **{name: ("entry_id = NEW.entry_id",) for name in ("night", "night_record", "night_readings", "night_estimate", "decision")},
    "night_parameter": (
        "machine_id = NEW.machine_id AND name = NEW.name AND entry_id = NEW.entry_id",
        "rowid = NEW.rowid",
    ),
    "compensation": ("entry_id = NEW.entry_id", "machine_id = NEW.machine_id AND line_sha256 = NEW.line_sha256"),
}


def upgrade() -> None:
    """Creates the triggers that refuse a row whose key is there."""
    if op.get_bind().dialect.name != "sqlite":
        return
    for table, keys in KEYS.items():
        there = " OR ".join(f"EXISTS (SELECT 1 FROM {table} WHERE {key})" for key in keys)
        op.execute(
            f"CREATE TRIGGER {table}_no_replace BEFORE INSERT ON {table} WHEN {there} "
            "BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END"
        )
