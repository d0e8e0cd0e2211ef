"""A new history of SQLite begins as a copy of an empty one that this process has made: its schema takes a tenth of a second.

Whoever tests the history itself (`test_history*.py`), or counts what writes (`*refusing*`), makes every one anew.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from sqlalchemy import Engine, create_engine

from tango_cnc.history import _database

_migrate = _database._migrate
anew = False  # whether the test that is executed wants every history made


@cache
def _empty() -> bytes:
    """→ the file of a history without nights, as this version makes it."""
    with TemporaryDirectory() as place:
        engine = create_engine(f"sqlite:///{place}/history.db")
        _migrate(engine)
        engine.dispose()
        return (Path(place) / "history.db").read_bytes()


def _copied(engine: Engine) -> None:
    """As `_database._migrate`, which finds that nothing is left to be done."""
    file = engine.url.database
    if not anew and engine.dialect.name == "sqlite" and file not in (None, "", ":memory:") and not Path(str(file)).exists():
        Path(str(file)).write_bytes(_empty())
    _migrate(engine)


_database._migrate = _copied


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before any fixture of the test, those of its module too."""
    global anew
    anew = item.path.name.startswith("test_history") or "refusing" in item.path.name
