"""Everything that every night found, append-only, in SQLite or PostgreSQL: docs/nightly.md."""

from ._answers import UnreadableError
from ._database import refused, shown
from .compensated import add_compensations, compensations
from .records import ACTIONS, Compensation, Decision, Knowledge, Night, Standing, Stored, Trend
from .store import FORMAT, History, opened

__all__ = [
    "ACTIONS",
    "FORMAT",
    "Compensation",
    "Decision",
    "History",
    "Knowledge",
    "Night",
    "Standing",
    "Stored",
    "Trend",
    "UnreadableError",
    "add_compensations",
    "compensations",
    "opened",
    "refused",
    "shown",
]
