"""Alarms: those that nobody has decided about, with a form for who may, and what was decided so far."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from ...history import ACTIONS, Decision, UnreadableError
from ...records import InputError, LinkError, TangoError
from ...report.alarm import decided, sentence, with_its_date
from ...report.answer import is_moving, measuring
from ...report.days import at, day
from ...report.faults import earlier, still_open, untried
from ...report.orders import brief_of
from ...report.plain import plain
from ...report.reach import to_ask
from ...report.repeated import before_repair
from ...report.texts import Texts
from ..app import PagesState, machine_of, needs, page, proven, state_of
from ..served import Row, Served
from .fleet import answer_of, asked_of, brief, faults_of, made_up, moved_most, newer_of, orders_of, rows_of, unchanged
from .machine import busy_for, run_of

NOTE = 500  # characters
PAST = 20  # decisions of a machine that are shown
MANY = 200  # alarms of one cause that are answered together
DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


def decisions(request: Request) -> Response:
    """request → all alarms of all machines that are not closed: unanswered ones, and those that somebody has."""
    needs(request, "view")
    done = request.query_params.get("recorded", "")
    until, t = request.query_params.get("until", ""), state_of(request).texts
    dated = DATE.fullmatch(until) is not None
    told = t(f"decision.recorded_{done}", until=day(until, t)) if done in ACTIONS and (dated or done != "ignore") else ""
    return page(request, "decisions.html", said="", told=told, typed={}, **_values(request))


def both(state: PagesState) -> None:
    """state → what this page and the list of machines show is computed and kept."""
    rows_of(state)
    _read(state)


def _values(request: Request) -> Mapping[str, Any]:
    """→ what the page shows to everybody alike; kept as long as the list of machines is."""
    state = state_of(request)
    return state.places.kept("alarms", lambda: _read(state))


def _read(state: PagesState) -> dict[str, Any]:
    each = [_of_machine(row, state) for row in state.places.fleet()]
    waiting = [card for card, _ in each if card is not None]
    past = [one for _, decided in each for one in decided]
    waits = {c["machine"].slug: any(a["decision"] is None for a in c["open"]) for c in waiting}
    waiting.sort(
        key=lambda c: (
            not waits[c["machine"].slug],
            c["answer"] is None or c["answer"].may != "no",
            -c["moved"],
            c["machine"].name,
        )
    )
    past.sort(key=lambda p: (p["d"].utc, p["place"]), reverse=True)  # two of one second stand in their order
    listed = [a for card in waiting for a in card["open"]]
    missing = sum(a["decision"] is None for a in listed)
    made = bool(waiting) and all(c["simulated"] for c in waiting)
    alone = [one for row in state.places.fleet() if (one := _without_alarm(row, state)) is not None]
    return {
        "unread": [
            {"machine": row.machine, "call": to_ask(asked_of(row, state), (), state.texts)}
            for row in state.places.fleet()
            if row.machine.unread
        ],
        "newer": [one for one in alone if one["machine"].slug not in waits],
        "waiting": waiting,
        "simulated": made,
        "open": len(listed),
        "alarms": missing,
        "past": past[:50],
        "actions": ACTIONS,
    }


def _of_machine(row: Row, state: PagesState) -> tuple[dict[str, Any] | None, list[dict[str, Any]]]:
    """row, state → the card of its machine, None where nothing is open; what was decided about it, oldest first."""
    if row.machine.history is None or row.standing is None:
        return None, []
    asked = row.standing.alarms_open or row.standing.alarms_held
    busy = busy_for(run_of(state, row.machine), state) if asked else ""
    return unchanged(row, state, (busy, newer_of(row)), lambda: (_card(row, busy, state), _past(row, state)), "alarms")


def _without_alarm(row: Row, state: PagesState) -> dict[str, Any] | None:
    """row, state → the answer of newer readings, or that of a repair which no night has measured, with what it is about, as in the
    list; None where that is not its answer.
    """
    found = faults_of(row, state)
    tried = any(untried(a) for a in found)
    if newer_of(row) is None and not tried:
        return None
    said = answer_of(row, found, state)
    if said is None or not (said.newer or (tried and said.may in ("no", "but"))) or busy_for(run_of(state, row.machine), state):
        return None
    moving = is_moving(row.record or {}, row.machine.former)
    more = state.texts("may.repaired_todo") if tried else ""
    return {"machine": row.machine, "answer": said, "told": brief(said, found, moving, "", state.texts), "more": more}


def _card(row: Row, busy: str, state: PagesState) -> dict[str, Any] | None:
    """row, how long its machine still measures, state → what is open of it, the answer and what to do; None where nothing is."""
    history, name, found = row.machine.history, row.machine.name, faults_of(row, state)
    asked = still_open(found)
    if history is None or not asked:
        return None
    answers = Counter(d.alarm for d in history.decisions(name))
    done = [a for a in found[:1] if a["id"] and a not in asked]  # closed, and yet first: it is what stands behind a limit
    shown = [a for a in found if a in asked or not a["id"] or a in done]
    waits = [a for a in shown if a not in done]
    shown = [
        {**a, "closed": a in done, "short": brief_of(a), "seen": sum(answers[i] for i in a.get("ids") or a.get("held") or ())}
        for a in shown
    ]
    said, moving = answer_of(row, found, state), is_moving(row.record or {}, row.machine.former)
    said = measuring(said, state.texts) if busy and said is not None else said
    held = [(i, a["decision"].owner) for a in shown if a["decision"] is not None for i in a["held"]]
    return {
        "machine": row.machine,
        "taken": {i: f"repaired --owner {shlex.quote(str(owner))}" for i, owner in held},  # as `--status` says
        "where": _where(row.machine),
        "typed": _typed(row.machine, state.texts),
        "answer": said,
        "faults": shown,
        "open": asked,
        "moved": moved_most(found),
        "simulated": made_up(row),
        "first": brief(said, found, moving, "", state.texts)[0].rstrip(":."),
        "call": "" if said is None else to_ask(asked_of(row, state), waits, state.texts),
        "todo": [] if said is None else orders_of(row, said, found, state),
    }


def _where(machine: Served) -> str:
    """machine → the option with which a command finds it from the folder that its cell lies in; no page says where that is."""
    if machine.folder is None:
        return f"--history HISTORY --machine {shlex.quote(machine.name)}"
    return f"-C {shlex.quote(machine.folder.resolve().name)}"


def _typed(machine: Served, t: Texts) -> str:
    """machine, texts → where that command is typed."""
    if machine.folder is None:
        return t("decision.by_hand_shared")
    return t("decision.by_hand_where", folder=machine.folder.resolve().name)


def _past(row: Row, state: PagesState) -> list[dict[str, Any]]:
    """row, state → the last decisions about its machine, oldest first."""
    history, name = row.machine.history, row.machine.name
    newest = [] if history is None else list(enumerate(history.decisions(name)))[-PAST:]
    if history is None or not newest:
        return []
    told = [a for stored in reversed(history.alarmed(name)) for a in earlier(stored.record["alarms"])]
    texts = {a["id"]: with_its_date({**a, "night": before_repair(a) or a["id"][:10]}, a["text"], state.texts) for a in told}
    place, past = state.places.geometry(row.machine), []
    for number, d in newest:
        what = plain(texts.get(d.alarm, ""), state.units, state.texts, place)
        done, text = decided(d, state.texts), sentence(what, state.units)
        past.append({"machine": row.machine, "d": d, "done": done, "place": number, "what": text})
    return past


def decide(request: Request) -> Response:
    """request with a form → the decision is in the history. Its owner is who is signed in unless another one is named."""
    form = request.state.form
    state = state_of(request)
    if state.settings.users is None:
        return page(request, "decisions.html", 403, said=state.texts("decision.read_only"), told="", typed={}, **_values(request))
    visitor = proven(request, form)
    needs(request, "operate")
    found = machine_of(request)
    owner = " ".join(form.get("owner", "").split())[:80] or visitor.user.name
    note = form.get("note", "").strip()[:NOTE]
    until = form.get("until", "").strip() or None
    action = form.get("action", "")
    try:
        if found.history is None:
            raise LinkError(found.trouble) if found.unread else InputError("this machine has no history")
        if until is not None and not DATE.fullmatch(until):
            raise InputError(f"until: found {until[:20]!r}; allowed: a date like 2026-12-01")
        today = datetime.now().astimezone().strftime("%Y-%m-%d")
        if wrong := _incomplete(action, until, today):
            raise InputError(state.texts(wrong, last=Decision.last_ignored(today)))
        signed = note if owner == visitor.user.name else f"{note} ({visitor.user.name})".strip()
        alarms = form.get("alarm", "").split()[:MANY] or [""]
        known = {a["id"] for stored in found.history.alarmed(found.name) for a in stored.record["alarms"]}
        unknown = [a for a in alarms if a not in known]
        with state.deciding:  # of two at one moment the second sees what the first has decided
            _still_as_seen(found.history.decisions(found.name), alarms, form.get("seen"), state)
            for alarm in unknown[:1] or alarms:  # an unknown one is refused before any other is decided
                decision = Decision(alarm[:80], action, owner, signed, until if action == "ignore" else None)
                found.history.decide(found.name, decision)
    except TangoError as error:
        if isinstance(error, UnreadableError):
            state.places.is_off(error)
        state.places.forget(found.history)  # the page shows what is so now
        values, lost = _values(request), isinstance(error, LinkError)
        why = _typed_in(action, owner, until, note, error, state) if lost else str(error)
        said = _not_recorded(values, found.slug, form.get("alarm", ""), why, state)
        return page(request, "decisions.html", 503 if lost else 400, said=said, told="", typed=form, **values)
    state.places.forget(found.history)
    return RedirectResponse(f"/alarms?recorded={action}" + (f"&until={until}" if action == "ignore" else ""), 303)


def _typed_in(action: str, owner: str, until: str | None, note: str, error: TangoError, state: PagesState) -> str:
    """decision, who takes it, date or None, remark, why the history did not take it, state → what to do, with what was typed: the
    form may not come again before the history can be read.
    """
    t = state.texts
    done = t(f"decision.{action}") if action in ACTIONS else ""
    typed = [done, owner, *([t("morning.has_until", date=day(until, t))] if until else []), *([f"“{note}”"] if note else [])]
    return t("decision.unread_again", typed=", ".join(x for x in typed if x), why=str(error))


def _incomplete(action: str, until: str | None, today: str) -> str:
    """what was chosen, date or None, local date → key of the sentence that says what is wrong; '' where nothing is."""
    if action not in ACTIONS:
        return "decision.no_action"
    if action != "ignore":
        return ""
    if until is None:
        return "decision.until_needed"
    return "decision.date_over" if until < today else "decision.too_far" if until > Decision.last_ignored(today) else ""


def _not_recorded(values: Mapping[str, Any], slug: str, alarms: str, why: str, state: PagesState) -> str:
    """values of the page, machine, alarms of a form, what is wrong → the sentence that says so; it names an open alarm."""
    asked = set(alarms.split())
    cards = (c for c in values["waiting"] if c["machine"].slug == slug)
    what = next((a["text"] for c in cards for a in c["faults"] if asked & {*a["ids"], *a["held"]}), "")
    return state.texts("decision.wrong_about", what=what, why=why) if what else state.texts("decision.wrong", why=why)


def _still_as_seen(decisions: Sequence[Decision], alarms: Sequence[str], seen: str | None, state: PagesState) -> None:
    """decisions so far, alarms of a form, how many decisions its page showed of them → nothing.

    Raises InputError where somebody has decided since: who filled the form has not read that.
    """
    own = [d for d in decisions if d.alarm in alarms]
    if seen is not None and seen != str(len(own)) and own:
        t, last = state.texts, own[-1]
        raise InputError(t("decision.stale", owner=last.owner, action=t(f"decision.{last.action}"), date=at(last.utc, t)))


ROUTES = [
    Route("/alarms", decisions, name="decisions"),
    Route("/machine/{slug}/decide", decide, methods=["POST"], name="decide"),
]
