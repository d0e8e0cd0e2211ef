"""The schema of a history: what every row is, for SQLite and PostgreSQL alike.

Moments are ISO 8601 texts in UTC that end in Z: they sort as they follow each other, on either database. Numbers that
are only read whole (covariance, readings) are bytes; what is listed, filtered or plotted has a column of its own.
"""

from __future__ import annotations

from sqlalchemy import (
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)

metadata = MetaData(naming_convention={"uq": "uq_%(table_name)s_%(column_0_name)s", "ix": "ix_%(table_name)s_%(column_0_name)s"})

machine = Table(
    "machine",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", String(200), nullable=False, unique=True),
    Column("cell", Text, nullable=False),  # folder on the computer that made the first entry
    Column("added_utc", String(32), nullable=False),
)

# The chain of a machine: one row for everything that was ever added, each with the hash of the row before it.
entry = Table(
    "entry",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("machine_id", ForeignKey("machine.id"), nullable=False),
    Column("number", Integer, nullable=False),  # 1, 2, 3 … within a machine
    Column("kind", String(20), nullable=False),  # night, decision, compensation
    Column("utc", String(32), nullable=False),
    Column("content", String(64), nullable=False),  # SHA-256 of what the entry holds
    Column("previous", String(64), nullable=False),  # hash of the entry before it, 64 zeros for the first
    Column("hash", String(64), nullable=False),  # SHA-256 of machine, number, kind, utc, content and previous
    UniqueConstraint("machine_id", "number"),
)

night = Table(
    "night",
    metadata,
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("machine_id", ForeignKey("machine.id"), nullable=False),
    Column("night", String(10), nullable=False),  # local date of the morning after it
    Column("start_utc", String(32), nullable=False),
    Column("end_utc", String(32), nullable=False),
    Column("kind", String(20), nullable=False),
    Column("status", String(20), nullable=False),
    Column("verdict", String(20), nullable=False),
    Column("headline", Text, nullable=False),
    Column("alarms", Integer, nullable=False),
    Column("p_value", Float),
    Column("touches", Integer, nullable=False),
    Column("rms_um", Float),
    Column("volume_um", Float),
    Column("duration_s", Float, nullable=False),
    Index("ix_night_machine_start", "machine_id", "start_utc"),
    Index("ix_night_start", "start_utc"),
)

night_record = Table(
    "night_record",
    metadata,
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("json", Text, nullable=False),  # tango-night/1
)

night_parameter = Table(
    "night_parameter",
    metadata,
    Column("machine_id", ForeignKey("machine.id"), primary_key=True),
    Column("name", String(80), primary_key=True),
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("start_utc", String(32), nullable=False),
    Column("value", Float, nullable=False),
    Column("std", Float, nullable=False),
    Column("unit", String(20), nullable=False),
)

night_readings = Table(
    "night_readings",
    metadata,
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("rows", Integer, nullable=False),
    Column("sha256", String(64), nullable=False),  # of the text of readings.csv
    Column("csv", LargeBinary, nullable=False),  # that text, zlib
)

# What the night knew afterwards: all unknowns of the followed machine, or of the estimate, with their covariance.
night_estimate = Table(
    "night_estimate",
    metadata,
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("names", Text, nullable=False),  # JSON list of p names
    Column(
        "numbers", LargeBinary, nullable=False
    ),  # zlib of p values, then the lower triangle of the covariance; float64 little-endian
)

decision = Table(
    "decision",
    metadata,
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("machine_id", ForeignKey("machine.id"), nullable=False),
    Column("alarm", String(40), nullable=False),
    Column("action", String(20), nullable=False),  # accept, acknowledge, repaired, ignore
    Column("until", String(10)),  # local date, of ignore
    Column("owner", String(200), nullable=False),
    Column("note", Text, nullable=False),
    Column("utc", String(32), nullable=False),
    Index("ix_decision_machine", "machine_id", "utc"),
)

# One event of a compensation: proposed, written, kept, kept as far as seen, not as promised, undecided, no help, rolled back.
compensation = Table(
    "compensation",
    metadata,
    Column("entry_id", ForeignKey("entry.id"), primary_key=True),
    Column("machine_id", ForeignKey("machine.id"), nullable=False),
    Column("number", Integer, nullable=False),  # of the compensation within its cell
    Column("target", String(40), nullable=False),
    Column("event", String(20), nullable=False),
    Column("text", Text, nullable=False),  # the reason; empty where the event says all
    Column("before_um", Float),  # µm rms over the volume of the compensation
    Column("promised_um", Float),
    Column("measured_um", Float),
    Column("line", Text, nullable=False),  # of compensations/history.jsonl, JSON
    Column("line_sha256", String(64), nullable=False),
    Column("utc", String(32), nullable=False),
    UniqueConstraint("machine_id", "line_sha256"),
    Index("ix_compensation_machine", "machine_id", "utc"),
)

APPEND_ONLY = (
    *("entry", "night", "night_record", "night_parameter", "night_readings", "night_estimate", "decision"),
    "compensation",
)
