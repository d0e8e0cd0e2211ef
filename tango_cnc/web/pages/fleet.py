"""Every machine in one list, those that need somebody first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...report.answer import answer
from ...report.morning import context, earlier, sentence, strip
from ...report.plain import plain
from ...report.units import Units
from ..app import needs, page, state_of
from ..places import Row
from ..places import told as verdict_of


def fleet(request: Request) -> Response:
    """request → the list."""
    needs(request, "view")
    state = state_of(request)
    rows = state.places.kept("fleet rows", lambda: sorted((_row(row, request) for row in state.places.fleet()), key=_urgent))
    late = sum(r["late"] for r in rows)
    counts = {key: sum(r["may"] == key for r in rows) for key in ("yes", "but", "no", "unknown")}
    hours = f"{state.settings.late_hours:g}"
    return page(request, "fleet.html", rows=rows, count=len(rows), counts=counts, late=late, hours=hours)


def _row(row: Row, request: Request) -> dict[str, Any]:
    state = state_of(request)
    t, s, u = state.texts, row.standing, state.units
    axes = state.places.geometry(row.machine)
    complete = next((n.night for n in row.nights if n.status == "complete"), t("web.never"))
    waiting = _first_waiting(row, request) if s is not None and s.alarms_open else None
    told = (
        None
        if row.record is None
        else answer(
            row.record, u, t, waiting["night"] if waiting else "", row.before, axes, complete if s is not None and s.late else ""
        )
    )
    verdict = "" if told is None else f"morning.{told.state}"
    headline = "" if row.record is None else sentence(plain(str(row.record.get("headline") or ""), u, t, axes), Units())
    allowed = {str(x["what"]): float(x["limit"]) for x in ((row.before or row.record or {}).get("limits") or ()) if x.get("limit")}
    return {
        "slug": row.machine.slug,
        "name": row.machine.name,
        "trouble": row.machine.trouble,
        "night": row.nights[0].night if row.nights else "",
        "may": "none" if told is None else told.may,
        "level": "none" if told is None else told.level,
        "answer": t("web.no_history") if told is None else told.word,
        "word": t(verdict) if verdict in t else "",
        "numbers": "" if told is None else told.numbers,
        "headline": headline,
        "waiting": "" if waiting is None else t("web.waiting", date=waiting["night"], who=waiting["who"]),
        "fault": "" if waiting is None else waiting["text"],
        "open": s.alarms_open if s else 0,
        "complete": complete,
        "late": bool(s and s.late and s.nights),
        "strip": strip([(n.night, verdict_of(n, allowed), "") for n in reversed(row.nights)], t("web.nights"))
        if row.nights
        else "",
    }


def _urgent(r: Mapping[str, Any]) -> tuple[int, str]:
    """Those on which no parts may be made first; those without a history last."""
    order = {"no": 0, "but": 1, "unknown": 1, "yes": 3, "none": 4}
    return min(order[r["may"]], 2 if r["late"] else 4), r["name"]


def _first_waiting(row: Row, request: Request) -> Mapping[str, Any] | None:
    """→ the largest of the alarms that nobody has decided about."""
    history = row.machine.history
    alarms = history.open_alarms(row.machine.name) if history is not None else ()
    state = state_of(request)
    whose, axes = state.places.owner(row.machine), state.places.geometry(row.machine)
    first = context({"alarms": earlier(alarms)}, (), state.units, state.texts, machine=axes, owner=whose)["first"]
    assert first is None or isinstance(first, dict)
    return first


ROUTES = [Route("/", fleet, name="fleet")]
