"""What happened to compensations is part of the chain: one more table, append-only as the others."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Creates the table and the triggers that refuse any change of a row."""
    op.create_table(
        "compensation",
        sa.Column("entry_id", sa.Integer, sa.ForeignKey("entry.id"), primary_key=True),
        sa.Column("machine_id", sa.Integer, sa.ForeignKey("machine.id"), nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("target", sa.String(40), nullable=False),
        sa.Column("event", sa.String(20), nullable=False),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("before_um", sa.Float),
        sa.Column("promised_um", sa.Float),
        sa.Column("measured_um", sa.Float),
        sa.Column("line", sa.Text, nullable=False),
        sa.Column("line_sha256", sa.String(64), nullable=False),
        sa.Column("utc", sa.String(32), nullable=False),
        sa.UniqueConstraint("machine_id", "line_sha256", name="uq_compensation_machine_id"),
    )
    op.create_index("ix_compensation_machine", "compensation", ["machine_id", "utc"])
    if op.get_bind().dialect.name == "sqlite":
        for what in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER compensation_no_{what.lower()} BEFORE {what} ON compensation "
                "BEGIN SELECT RAISE(ABORT, 'a history is append-only'); END"
            )
        return
    op.execute(
        "CREATE TRIGGER compensation_append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON compensation "
        "FOR EACH STATEMENT EXECUTE FUNCTION tango_append_only()"
    )
