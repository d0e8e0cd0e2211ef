"""Everything that every night found, append-only, in SQLite or PostgreSQL: docs/nightly.md."""

from .records import ACTIONS, Decision, Knowledge, Night, Standing, Stored, Trend
from .store import FORMAT, History, opened

__all__ = ["ACTIONS", "FORMAT", "Decision", "History", "Knowledge", "Night", "Standing", "Stored", "Trend", "opened"]
