"""Places for a history: SQLite files, and databases of a PostgreSQL server that the tests start."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from . import postgres


@pytest.fixture(scope="module")
def postgres_server() -> Iterator[str]:
    """→ URL of a server of its own."""
    with postgres.server() as url:
        yield url


@pytest.fixture(params=["sqlite", pytest.param("postgres", marks=[pytest.mark.long, pytest.mark.system("pg_lsclusters")])])
def history_place(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[], str | Path]:
    """→ a new, empty place for a history at every call."""
    count = iter(range(100))
    if request.param == "sqlite":
        return lambda: tmp_path / f"history{next(count)}.db"
    url = request.getfixturevalue("postgres_server")
    return lambda: postgres.database(url)
