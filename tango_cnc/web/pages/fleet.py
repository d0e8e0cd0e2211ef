"""Every machine in one list, those that need somebody first."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...report.morning import LEVELS, context, earlier, strip
from ..app import needs, page, state_of
from ..places import Row


def fleet(request: Request) -> Response:
    """request → the list."""
    needs(request, "view")
    state = state_of(request)
    rows = state.places.kept("fleet rows", lambda: [_row(row, request) for row in state.places.fleet()])
    bad = sum(r["level"] in ("look", "stop") or bool(r["open"]) for r in rows)
    late = sum(r["late"] for r in rows)
    good = sum(r["level"] == "good" and not r["open"] for r in rows)
    return page(request, "fleet.html", rows=rows, count=len(rows), good=good, bad=bad, late=late)


def _row(row: Row, request: Request) -> dict[str, Any]:
    state = state_of(request)
    t, s = state.texts, row.standing
    last = s.last if s is not None else None
    key = f"morning.{last.verdict}" if last else ""
    volume = None if last is None or last.volume_um is None else f"{last.volume_um * state.units.per_micron:.0f}"
    level = LEVELS.get(last.verdict, "stop") if last else "none"
    word = "" if last is None else t(key) if key in t else last.verdict
    if s is not None and s.alarms_open and level == "good":  # no green while an alarm waits
        level, word = "look", t("web.alarm_open")
    return {
        "slug": row.machine.slug,
        "name": row.machine.name,
        "trouble": row.machine.trouble,
        "last": last,
        "level": level,
        "word": word,
        "waiting": _first_waiting(row, request) if s is not None and s.alarms_open else "",
        "open": s.alarms_open if s else 0,
        "late": bool(s and s.late and s.nights),
        "volume": volume or "–",
        "strip": strip([(n.night, n.verdict, "") for n in reversed(row.nights)], t("web.nights")) if row.nights else "",
    }


def _first_waiting(row: Row, request: Request) -> str:
    """→ the newest alarm that nobody has decided about, as a sentence."""
    history = row.machine.history
    alarms = history.open_alarms(row.machine.name) if history is not None else ()
    if not alarms:
        return ""
    state = state_of(request)
    a = context({"alarms": earlier(alarms[:1])}, (), state.units, state.texts)["first"]
    return f"{state.texts('web.waiting', date=a['night'])}: {a['text']} {a['amount']}".rstrip()


ROUTES = [Route("/", fleet, name="fleet")]
