"""Pages of a server without a network: their HTML, and what a person reads there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("starlette")
from starlette.testclient import TestClient

from tango_cnc.web.app import create
from tango_cnc.web.settings import Settings

HOST = "http://127.0.0.1"


def site_of(*cells: Path, users: Path | None = None, late_hours: float = Settings.late_hours) -> TestClient:
    """cells, who may sign in, hours after which a night is late → their server."""
    return TestClient(create(Settings(cells, users=users, late_hours=late_hours)), base_url=HOST, client=("127.0.0.1", 5000))


def seen(place: Path, path: str) -> str:
    """cell, path → its page; no night is late."""
    with site_of(place, late_hours=1e6) as site:
        return str(site.get(path).text)


def read(place: Path, path: str) -> str:
    """cell, path → what a person reads there."""
    with site_of(place) as site:
        return words_of(site.get(path).text)


def plain_of(page: str) -> str:
    """page → its text, with titles and rules of style, on one line."""
    return " ".join(re.sub(r"<[^>]*>", " ", page).split())


def words_of(page: str) -> str:
    """page → what a person reads, without titles and pictures, on one line."""
    return " ".join(re.sub(r"<(title|svg|style).*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL).split())
