"""A report whose readings are newer than the newest night of its cell, and say what that night does not."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from support.nights import M, night
from support.server import cell
from tango_cnc.report.answer import Answer
from tango_cnc.report.newer import NewerAnswer, answer_text

PATHS = (f"/machine/{M}", f"/machine/{M}/trend", f"/machine/{M}/nights", f"/machine/{M}/night/2", "/", "/alarms")
OWNER = "Ann Meier, 4711"
YES = Answer("yes", "Yes", "good", "", "")


def measured(folder: Path, may: str = "but", tip: float = 101.0, grown: bool = True, **own: Any) -> tuple[Path, str]:
    """Nights at 50 µm of 120 until three hours ago, newer readings at 101 µm whose EY0C is 59 µm → cell, date of the newest."""
    now = datetime.now(UTC)
    limits = [{"what": "volume", "unit": "µm", "value": 50.0, "low": 49.0, "high": 51.0, "limit": 120.0, "passed": True}]
    known = {"EY0C": {"value": 0.002, "std": 0.0002, "unit": "mm", "low": 0.0016, "high": 0.0024}}
    began, end = ((now - timedelta(hours=h)).strftime("%Y-%m-%dT%H:%M:%SZ") for h in (3, 2))
    more: dict[str, Any] = {"limits": limits, "parameters": known, "owner": OWNER, **own}
    first = night(M, 7, **{**more, "verdict": "good", "alarms": []})
    newest = night(M, 8, **more, start_utc=began, end_utc=end) | {"night": f"{now.astimezone():%Y-%m-%d}"}
    place = cell(folder, records=[first, newest])
    told = NewerAnswer(f"{now:%Y-%m-%dT%H:%M:%SZ}", tip, 120.0, "", 0.0, "", ("EY0C", 0.059, "mm"), may, grown)  # type: ignore[arg-type]
    (place / "report.html").write_text("<!DOCTYPE html><html><body>The page of a shop</body></html>", encoding="utf-8")
    (place / "report.json").write_text(answer_text(may, end if may == "no" else None, told, end), encoding="utf-8")
    return place, newest["night"]
