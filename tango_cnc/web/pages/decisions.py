"""Alarms: those that nobody has decided about, with a form for who may, and what was decided so far."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from ...history import ACTIONS, Decision
from ...records import InputError
from ...report.faults import size_of, still_open
from ..app import State, machine_of, needs, page, proven, state_of
from .fleet import answer_of, faults_of, made_up

NOTE = 500  # characters
MANY = 200  # alarms of one cause that are answered together
DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


def decisions(request: Request) -> Response:
    """request → all alarms of all machines that are not closed: unanswered ones, and those that somebody has."""
    needs(request, "view")
    return page(request, "decisions.html", said="", **_values(request))


def _values(request: Request) -> Mapping[str, Any]:
    """→ what the page shows to everybody alike; kept as long as the list of machines is."""
    state = state_of(request)
    return state.places.kept("alarms", lambda: _read(state))


def _read(state: State) -> dict[str, Any]:
    waiting: list[dict[str, Any]] = []
    past: list[dict[str, Any]] = []
    for row in state.places.fleet():
        history, name = row.machine.history, row.machine.name
        if history is None or row.standing is None:
            continue
        found = faults_of(row, state)
        if asked := still_open(found):
            shown = [a for a in found if a in asked or not a["id"]]  # and the cause behind a limit
            card = {"machine": row.machine, "answer": answer_of(row, found, state), "faults": shown, "open": asked}
            waiting.append(card | {"simulated": made_up(row), "owner": state.places.owner(row.machine)})
        past += [{"machine": row.machine, "d": d} for d in history.decisions(name)[-20:]]
    largest = {c["machine"].slug: max(map(size_of, c["faults"]), default=0.0) for c in waiting}
    waits = {c["machine"].slug: any(a["decision"] is None for a in c["open"]) for c in waiting}
    waiting.sort(
        key=lambda c: (
            not waits[c["machine"].slug],
            c["answer"] is None or c["answer"].may != "no",
            -largest[c["machine"].slug],
            c["machine"].name,
        )
    )
    past.sort(key=lambda p: p["d"].utc, reverse=True)
    listed = [a for card in waiting for a in card["open"]]
    missing = sum(a["decision"] is None for a in listed)
    return {"waiting": waiting, "open": len(listed), "alarms": missing, "past": past[:50], "actions": ACTIONS}


def decide(request: Request) -> Response:
    """request with a form → the decision is in the history. Its owner is who is signed in unless another one is named."""
    form = request.state.form
    state = state_of(request)
    if state.settings.users is None:
        return page(request, "decisions.html", 403, said=state.texts("decision.read_only"), **_values(request))
    visitor = proven(request, form)
    needs(request, "operate")
    found = machine_of(request)
    owner = " ".join(form.get("owner", "").split())[:80] or visitor.user.name
    note = form.get("note", "").strip()[:NOTE]
    until = form.get("until", "").strip() or None
    action = form.get("action", "")
    try:
        if found.history is None:
            raise InputError("this machine has no history")
        if until is not None and not DATE.fullmatch(until):
            raise InputError(f"until: found {until[:20]!r}; allowed: a date like 2026-12-01")
        signed = note if owner == visitor.user.name else f"{note} ({visitor.user.name})".strip()
        alarms = form.get("alarm", "").split()[:MANY] or [""]
        known = {a["id"] for stored in found.history.alarmed(found.name) for a in stored.record["alarms"]}
        unknown = [a for a in alarms if a not in known]
        for alarm in unknown[:1] or alarms:  # an unknown one is refused before any other is decided
            decision = Decision(alarm[:80], action, owner, signed, until if action == "ignore" else None)
            found.history.decide(found.name, decision)
    except InputError as error:
        said = state.texts("decision.wrong", why=str(error))
        return page(request, "decisions.html", 400, said=said, **_values(request))
    state.places.forget()
    return RedirectResponse("/alarms", 303)


ROUTES = [
    Route("/alarms", decisions, name="decisions"),
    Route("/machine/{slug}/decide", decide, methods=["POST"], name="decide"),
]
