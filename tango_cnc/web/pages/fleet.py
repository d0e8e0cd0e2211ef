"""Every machine in one list, those that need somebody first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...report.answer import Answer, answer, measuring
from ...report.days import day
from ...report.faults import answered, earlier, faults, sentence, unclosed
from ...report.morning import strip
from ...report.plain import plain
from ...report.units import Units
from ..app import State, needs, page, state_of
from ..places import Row
from ..places import told as verdict_of
from .machine import busy_of, run_of, written_of


def fleet(request: Request) -> Response:
    """request → the list."""
    needs(request, "view")
    state = state_of(request)
    rows = state.places.kept("fleet rows", lambda: sorted((_row(row, request) for row in state.places.fleet()), key=_urgent))
    late = sum(r["late"] for r in rows)
    counts = {key: sum(r["may"] == key for r in rows) for key in ("yes", "but", "no", "unknown", "wait", "none")}
    hours = f"{state.settings.late_hours:g}"
    return page(request, "fleet.html", rows=rows, count=len(rows), counts=counts, late=late, hours=hours)


def _row(row: Row, request: Request) -> dict[str, Any]:
    state = state_of(request)
    t, s, u = state.texts, row.standing, state.units
    axes = state.places.geometry(row.machine)
    complete = next((n.night for n in row.nights if n.status == "complete"), t("web.never"))
    found = open_faults(row, state)
    waiting = next((a for a in found if a["decision"] is None), None)
    told = answer_of(row, found, state)
    run, busy = run_of(request, row.machine), busy_of(request, row.machine)
    if busy and told is not None:
        told = measuring(told, t)
    verdict = "" if told is None else f"morning.{told.state}"
    headline = "" if row.record is None else sentence(plain(t.of(row.record.get("headline") or ""), u, t, axes), Units())
    allowed = {str(x["what"]): float(x["limit"]) for x in ((row.before or row.record or {}).get("limits") or ()) if x.get("limit")}
    signs = [(n.night, verdict_of(n, allowed), "") for n in reversed(row.nights)]
    return {
        "slug": row.machine.slug,
        "name": row.machine.name,
        "trouble": row.machine.trouble,
        "unmeasured": t("may.first_run" if busy else "may.never"),
        "simulated": made_up(row) or (bool(busy) and run is not None and run.simulated),
        "night": row.nights[0].night if row.nights else "",
        "may": ("wait" if busy else "none") if told is None else told.may,
        "level": "none" if told is None else told.level,
        "answer": t("may.measuring" if busy else "may.unknown") if told is None else told.word,
        "word": busy or (t(verdict) if verdict in t else ""),
        "why": "" if told is None else told.why,
        "numbers": "" if told is None else told.numbers,
        "headline": headline,
        "waiting": "" if waiting is None else waiting["who"],
        "nobody": waiting is not None and waiting["nobody"],
        "fault": "" if waiting is None else waiting["text"],
        "open": s.alarms_open if s else 0,
        "complete": day(complete, t),
        "late": bool(s and s.late and s.nights),
        "strip": strip(signs, t("web.nights", count=len(signs)), t) if signs else "",
    }


def answer_of(row: Row, found: Sequence[Mapping[str, Any]], state: State) -> Answer | None:
    """row, what is wrong and not closed, state → whether parts may be made; None where nothing was measured."""
    if row.record is None:
        return None
    late = next((n.night for n in row.nights if n.status == "complete"), state.texts("web.never"))
    waits, has = answered(found, row.record)
    axes = state.places.geometry(row.machine)
    return answer(
        row.record,
        state.units,
        state.texts,
        waits,
        row.before,
        axes,
        late if row.standing is not None and row.standing.late else "",
        has,
    )


def made_up(row: Row) -> bool:
    """row of the fleet → whether its last night measured no machine but a simulated one."""
    return bool((row.record or {}).get("simulated") or (row.before or {}).get("simulated"))


def _urgent(r: Mapping[str, Any]) -> tuple[int, str]:
    """Those on which no parts may be made first; those without a history last."""
    order = {"no": 0, "but": 1, "unknown": 1, "wait": 2, "yes": 3, "none": 4}
    return min(order[r["may"]], 2 if r["late"] else 4), r["name"]


def open_faults(row: Row, state: State) -> list[dict[str, Any]]:
    """row of the fleet, state → what is wrong with the machine and not closed, each cause once, whole; unanswered first."""
    history, name, s = row.machine.history, row.machine.name, row.standing
    if history is None or s is None or not (s.alarms_open or s.alarms_held):
        return []
    today = datetime.now().astimezone().strftime("%Y-%m-%d")
    alarms, decisions = unclosed(history, name, today)
    whose, axes = state.places.owner(row.machine), state.places.geometry(row.machine)
    record = dict(row.record or {})
    record |= {"owner": record.get("owner") or whose, "alarms": (), "standing": (), "behind": ()}
    known = row.before if record.get("verdict") == "not_measured" else row.record
    shown = record | {"verdict": "not_measured"}
    return faults(shown, earlier(alarms), decisions, state.units, state.texts, axes, known, today, written_of(row.machine))


ROUTES = [Route("/", fleet, name="fleet")]
