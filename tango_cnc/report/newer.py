"""A report that was made of readings after the newest night, and what it says by them: who answers for the machine asks here."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

NAME = "report.html"
SAID = "report.json"  # beside it: what pages ask of it; a shop's own template of the page need not know of that
FORMAT = "tango-report-answer/1"
MOST = 100_000  # characters of a file that can be one
LONG = 80  # characters of a name
UNIT = re.compile(r"(mm|rad)(/(mm|rad)[²³]?)?")


@dataclass(frozen=True)
class NewerAnswer:
    """What a report says by readings after the newest night: when they were made (UTC), largest error at the tool tip and its limit
    (µm), which error the largest part of it comes from ('': not said), its value and unit (mm, rad, mm/mm); the error that has
    moved most since that night, with value and unit; whether parts may be made by them (a No counts where it is worse than the
    answer of the night), and whether the error at the tool tip is larger than in that night.
    """

    measured: str
    tip_um: float | None = None
    limit_um: float | None = None
    parameter: str = ""
    value: float = 0.0
    unit: str = ""
    moved: tuple[str, float, str] | None = None
    may: Literal["no", "but", "yes"] = "no"
    grown: bool = False


def report_of(folder: Path | None) -> Path | None:
    """folder of a cell, None for none → its report; None when it has none, or when the file links to a place outside the cell."""
    if folder is None:
        return None
    root = folder.resolve()
    file = (root / NAME).resolve()
    return file if file.is_relative_to(root) and file.is_file() else None


def has_no_report(folder: Path, began: str, ended: float, made_up: bool, record: Mapping[str, Any]) -> bool:
    """cell, when a complete run of it outside the nights began (UTC) and ended (s since 1970), whether no machine was measured by
    it, record of the newest night → whether it is newer than that night and no report was written since, so that no page knows
    what it found. A run of no machine says nothing of a machine.
    """
    night, report = str(record.get("end_utc") or ""), report_of(folder)
    newer = bool(night) and began[:19] > night[:19] and (bool(record.get("simulated")) or not made_up)
    return newer and (report is None or report.stat().st_mtime < ended)


def newer_answer(folder: Path | None, ended_utc: object) -> NewerAnswer | None:
    """folder of a cell, moment at which its newest night ended → what its report says, where that was made of readings that are
    newer than that night; else None. A report of an earlier version says no plain Yes, or a No alone, or nothing; a file that
    cannot be read says nothing.
    """
    if not ended_utc or (file := report_of(folder)) is None:
        return None
    said = file.with_name(SAID)
    try:
        if said.resolve() != said or not said.is_file():
            return None
        with said.open(encoding="utf-8", errors="replace") as text:
            found = json.loads(text.read(MOST))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        return None
    night = str(ended_utc)
    if night not in (found.get("no_after"), found.get("after"), found.get("yes_after")):
        return None
    may: Literal["no", "but", "yes"] = "no" if found.get("no_after") == night else "but" if found.get("after") == night else "yes"
    measured, tip, limit = str(found.get("measured") or "")[:LONG], _number(found.get("tip_um")), _number(found.get("limit_um"))
    name, value, unit = _error(found.get("most")) or ("", 0.0, "")
    return NewerAnswer(measured, tip, limit, name, value, unit, _error(found.get("moved")), may, found.get("grown") is True)


def _error(known: Any) -> tuple[str, float, str] | None:
    """what a file has of an error → its name, value and unit; None for anything else."""
    name, unit, value = (known.get(key) if isinstance(known, dict) else None for key in ("parameter", "unit", "value"))
    size = _number(value)
    if not (isinstance(name, str) and len(name) <= LONG and isinstance(unit, str) and UNIT.fullmatch(unit)) or size is None:
        return None
    return name, size, unit


def _number(x: Any) -> float | None:
    """what a file has → the same where it is a finite number, else None."""
    return float(x) if isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) else None


def answer_text(may: str, no_after: str | None, told: NewerAnswer, after: str | None = None) -> str:
    """whether parts may be made by a report, when the newest night ended that its No is newer than (None: none), what that rests
    on, when the newest night ended that its readings are newer than → text of its report.json.
    """
    kept: Mapping[str, Any] = asdict(told)
    names = ("parameter", "value", "unit")
    most = {key: kept[key] for key in names} if told.parameter else None
    moved = None if told.moved is None else dict(zip(names, told.moved, strict=True))
    own = {key: kept[key] for key in ("measured", "tip_um", "limit_um", "grown")} | {"most": most, "moved": moved}
    yes = told.may == "yes"
    when = {"no_after": no_after or None, "after": None if yes else after or no_after or None, "yes_after": after if yes else None}
    return json.dumps({"format": FORMAT, "may_make_parts": may} | when | own, indent=1) + "\n"
