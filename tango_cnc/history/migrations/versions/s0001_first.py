"""The first schema: machines, the chain of entries, nights with all that they measured, decisions; nothing can be changed."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

APPEND_ONLY = ("entry", "night", "night_record", "night_parameter", "night_readings", "night_estimate", "decision")


def upgrade() -> None:
    """Creates the tables and the triggers that refuse any change of a row."""
    op.create_table(
        "machine",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("name", sa.String(200), nullable=False, unique=True),
        sa.Column("cell", sa.Text, nullable=False),
        sa.Column("added_utc", sa.String(32), nullable=False),
    )
    op.create_table(
        "entry",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("machine_id", sa.Integer, sa.ForeignKey("machine.id"), nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("utc", sa.String(32), nullable=False),
        sa.Column("content", sa.String(64), nullable=False),
        sa.Column("previous", sa.String(64), nullable=False),
        sa.Column("hash", sa.String(64), nullable=False),
        sa.UniqueConstraint("machine_id", "number", name="uq_entry_machine_id"),
    )
    op.create_table(
        "night",
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("machine_id", sa.Integer, sa.ForeignKey("machine.id"), nullable=False),
        sa.Column("night", sa.String(10), nullable=False),
        sa.Column("start_utc", sa.String(32), nullable=False),
        sa.Column("end_utc", sa.String(32), nullable=False),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("status", sa.String(20), nullable=False),
        sa.Column("verdict", sa.String(20), nullable=False),
        sa.Column("headline", sa.Text, nullable=False),
        sa.Column("alarms", sa.Integer, nullable=False),
        sa.Column("p_value", sa.Float),
        sa.Column("touches", sa.Integer, nullable=False),
        sa.Column("rms_um", sa.Float),
        sa.Column("volume_um", sa.Float),
        sa.Column("duration_s", sa.Float, nullable=False),
    )
    op.create_index("ix_night_machine_start", "night", ["machine_id", "start_utc"])
    op.create_index("ix_night_start", "night", ["start_utc"])
    op.create_table(
        "night_record",
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("json", sa.Text, nullable=False),
    )
    op.create_table(
        "night_parameter",
        sa.Column("machine_id", sa.Integer, sa.ForeignKey("machine.id"), primary_key=True),
        sa.Column("name", sa.String(80), primary_key=True),
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("start_utc", sa.String(32), nullable=False),
        sa.Column("value", sa.Float, nullable=False),
        sa.Column("std", sa.Float, nullable=False),
        sa.Column("unit", sa.String(20), nullable=False),
    )
    op.create_table(
        "night_readings",
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("rows", sa.Integer, nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("csv", sa.LargeBinary, nullable=False),
    )
    op.create_table(
        "night_estimate",
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("names", sa.Text, nullable=False),
        sa.Column("numbers", sa.LargeBinary, nullable=False),
    )
    op.create_table(
        "decision",
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("machine_id", sa.Integer, sa.ForeignKey("machine.id"), nullable=False),
        sa.Column("alarm", sa.String(40), nullable=False),
        sa.Column("action", sa.String(20), nullable=False),
        sa.Column("until", sa.String(10)),
        sa.Column("owner", sa.String(200), nullable=False),
        sa.Column("note", sa.Text, nullable=False),
        sa.Column("utc", sa.String(32), nullable=False),
    )
    op.create_index("ix_decision_machine", "decision", ["machine_id", "utc"])
    if op.get_bind().dialect.name == "sqlite":
        for table in APPEND_ONLY:
            for what in ("UPDATE", "DELETE"):
                op.execute(
                    f"CREATE TRIGGER {table}_no_{what.lower()} BEFORE {what} ON {table} "
                    "BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END"
                )
        return
    op.execute(
        "CREATE OR REPLACE FUNCTION tango_append_only() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION 'a history is append-only'; END $$"
    )
    for table in APPEND_ONLY:
        op.execute(
            f"CREATE TRIGGER {table}_append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON {table} "
            "FOR EACH STATEMENT EXECUTE FUNCTION tango_append_only()"
        )
