"""Every machine in one list, those that need somebody first."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, TypeVar, cast

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...report.age import measured_on
from ...report.alarm import sentence, since_date, whole_sentence
from ...report.answer import (
    NEWER,
    Answer,
    date_run_off,
    dates_cut_off,
    is_moving,
    measuring,
    of_no_night,
)
from ...report.days import ago, day, spoken_days
from ...report.faults import does_now, earlier, faults, still_open, unclosed
from ...report.morning import told_of, volumes_of, who_of
from ...report.newer import NewerAnswer, newer_answer
from ...report.orders import brief_of, orders, parts_first
from ...report.pace import Ahead, ahead
from ...report.plain import plain, plainly
from ...report.reach import to_ask
from ...report.repeated import of_shop
from ...report.signs import strip
from ...report.texts import Texts
from ...report.together import closed
from ...report.units import Units
from ..app import PagesState, needs, page, state_of
from ..places import sign_of, today
from ..places import told as verdict_of
from ..served import Row
from .machine import between, busy_for, happened_to, ran_of, ran_since, run_of, unmeasured
from .report import file_of_cell

NAMED = 3  # machines that are late, by their names
GROUPS = {"no": 1, "unread": 2, "unknown": 3, "but": 4, "wait": 5, "yes": 6, "none": 7}  # in this order; 0: one that may still move
ANSWERS = ("yes", "but", "no", "not_yet", "unknown", "measuring")  # each is counted by its own word
T = TypeVar("T")


def fleet(request: Request) -> Response:
    """request → the list."""
    needs(request, "view")
    state = state_of(request)
    rows = state.places.kept("fleet rows", lambda: rows_of(state))
    late = [r["name"] for r in rows if r["late"]]
    answers = Counter(r["answer"] for r in rows)
    counts = {key: answers.pop(state.texts(f"may.{key}"), 0) for key in ANSWERS}  # a shop may have one word for two of them
    hours = f"{state.settings.late_hours:g}"
    names = ", ".join(late[:NAMED]) + (f" … ({len(late)})" if len(late) > NAMED else "")
    made_up = bool(rows) and all(r["simulated"] for r in rows)
    return page(request, "fleet.html", rows=rows, count=len(rows), counts=counts, late=names, hours=hours, simulated=made_up)


def rows_of(state: PagesState) -> list[dict[str, Any]]:
    """state → every machine; cells of one machine name are copied folders, and each is shown with its own."""
    listed = state.places.fleet()
    named = Counter(row.machine.name for row in listed)
    folders = ("" if named[row.machine.name] == 1 else str(row.machine.folder or "") for row in listed)
    return sorted((_row(row, state) | {"folder": folder} for row, folder in zip(listed, folders, strict=True)), key=_urgent)


def unchanged(row: Row, state: PagesState, more: object, make: Callable[[], T], what: str) -> T:
    """row, state, what else counts, how to compute, name of what is computed → that of before while nothing of the machine, its
    nights, decisions, settings and files is another, and the day is the same: of 200 machines those that changed are computed anew.
    """
    m, places = row.machine, state.places
    head = None if m.history is None else places.written(m.history, m.name)
    night = (row.nights[0].entry, len(row.nights), None if row.before is None else row.before["night"]) if row.nights else ()
    key, axes = (m, row.standing, night, head, places.stated(m), today(), places.due(m), more), places.geometry(m)
    with state.lock:
        known = state.rows.get((what, m.slug))
    if known is None or known[0] != key or known[1] is not axes:
        known = key, axes, make()
        with state.lock:
            state.rows[what, m.slug] = known
    return cast("T", known[2])


def _row(row: Row, state: PagesState) -> dict[str, Any]:
    """row, state → what the list shows of a machine."""
    run = run_of(state, row.machine)
    busy = busy_for(run, state)
    ran = ran_of(state, row.machine) if row.record is None else ""
    simulated = run is not None and run.simulated and bool(busy or ran)
    reported = bool(ran) and file_of_cell(row.machine) is not None
    since = "" if busy or row.record is None else ran_since(state, row.machine, row.record)
    told = unchanged(
        row, state, (busy, ran, simulated, reported, newer_of(row)), lambda: _told(row, busy, ran, simulated, state), "row"
    )
    return told | {"ran_since": since, "age": _age(row, state.texts, newer_of(row) if told["newer"] else None)}


def _told(row: Row, busy: str, ran: str, simulated: bool, state: PagesState) -> dict[str, Any]:
    """row, how long it still measures, its complete run, whether its run is of no machine, state → the same without its age."""
    t, s, u = state.texts, row.standing, state.units
    found = faults_of(row, state)
    told = answer_of(row, found, state)
    if busy and told is not None:
        told = measuring(told, t)
    moving = told is not None and not busy and is_moving(row.record or {}, row.machine.former)
    axes = state.places.geometry(row.machine)
    own = of_shop((row.record or {}).get("headline") or "")
    said = sentence(plain(plainly(own, t), u, t, axes), Units())
    allowed = {str(x["what"]): float(x["limit"]) for x in ((row.before or row.record or {}).get("limits") or ()) if x.get("limit")}
    complete = next((n.night for n in row.nights if n.status == "complete"), t("web.never"))
    may = ("wait" if busy else "none") if told is None else told.may
    return {
        "slug": row.machine.slug,
        "name": row.machine.name,
        "trouble": row.machine.trouble,
        "former": [spoken_days(t.of(text), t) for text in row.machine.former],
        "unmeasured": unmeasured(ran, busy, row.machine, state),
        "simulated": made_up(row) or simulated,
        "night": row.nights[0].night if row.nights else "",
        "may": may,
        "newer": told is not None and told.newer,
        "group": "moving" if moving else may,
        **(_not_answered(busy, t) if told is None else _answered(told, busy, t)),
        **_asked(row, told, found, state),
        "limit_for": "" if told is None or not allowed else _limit_for(row, state),
        "headline": whole_sentence(said),
        "fault": " ".join(x for x in (str(found[0]["text"]) if found else "", told.moved if told is not None else "") if x),
        "brief": brief(
            told, found, moving, said, t, since_of(row, told, found, moving, allowed), bool(date_run_off(row.machine.former))
        ),
        "open": len(still_open(found)),
        "moved": moved_most(found),
        "complete": day(complete, t),
        "late": bool(s and s.late and s.nights),
        "strip": _strip(row, state),
        "todo": "",  # of one whose history cannot be read
        **(_unread(row, state) if row.machine.unread and not moving and not busy else {}),
    }


def _unread(row: Row, state: PagesState) -> dict[str, Any]:
    """row of one whose history cannot be read, state → what the list says of it: that nobody knows, what to do and whom to call."""
    t = state.texts
    call = to_ask(asked_of(row, state), (), t)
    return {
        "group": "unread",
        "brief": ("", ""),
        "word": t("may.unread"),
        "call": call,
        "todo": t(f"web.unread_do_{row.machine.unread}"),
    }


def _answered(told: Answer, busy: str, t: Texts) -> dict[str, str]:
    """answer, how long the machine still measures → what the list says of it."""
    words = {"level": told.level, "answer": told.word, "word": busy or told.short(t)}
    return words | {"why": told.why, "numbers": told.numbers, "soon": told.soon}


def _not_answered(busy: str, t: Texts) -> dict[str, str]:
    """How long the machine still measures → what the list says where no night has an answer."""
    return {
        "level": "none" if busy else "unknown",
        "answer": t("may.measuring" if busy else "may.unknown"),
        "word": busy,
    } | dict.fromkeys(("why", "numbers", "soon"), "")


def _asked(row: Row, told: Answer | None, found: Sequence[Mapping[str, Any]], state: PagesState) -> dict[str, Any]:
    """row, answer, what is wrong → who has it, and whom one calls."""
    t, owner, asked = state.texts, state.places.owner(row.machine), asked_of(row, state)
    nobody = not (owner or asked["deputy"]) and "owner" not in _named(row.record)
    calls = told is not None and told.may in ("no", "but", "unknown")
    return {
        "who": who_of(told, {"owner": owner, "deputy": asked["deputy"], **_named(row.record)}, found, t),
        "nobody": found[0]["nobody"] if found else nobody,
        "has": bool(found and found[0]["decision"]),
        "call": to_ask(asked, found, t) if calls else "",
    }


def _strip(row: Row, state: PagesState) -> str:
    """row, state → a sign for each of its nights."""
    if not row.nights:
        return ""
    t = state.texts
    cut = [(date, "partial", "") for date in dates_cut_off(row.machine.former)]
    unsure = state.places.unsure(row.machine.history, row.nights)
    signs = [(n.night, sign_of(n, unsure), "") for n in reversed(row.nights)] + cut[::-1]
    old = 0 if row.record is None else state.places.old(row.machine, measured_on(row.record, row.before))
    label = between(signs[::-1], t, old)
    return strip(signs, label, t, old)


def _limit_for(row: Row, state: PagesState) -> str:
    """row, state → what the limits of the machine are for and who has stated them, or that nobody has written it down."""
    stated = state.places.limits_for(row.machine) or str((row.record or {}).get("limits_for") or "")
    return state.texts("may.limit_for", text=stated.rstrip(".")) if stated else state.texts("may.limit_for_unsaid")


def since_of(row: Row, told: Answer | None, found: Sequence[Mapping[str, Any]], moving: bool, limits: Mapping[str, float]) -> str:
    """row, answer, what is wrong, whether it may still move, limits (µm) → date since when it is so; '' where nothing is to be
    done, or where no night says so.
    """
    if moving and (off := date_run_off(row.machine.former)):
        return off
    if told is None or told.may in ("yes", "wait") or not row.nights:
        return ""
    cut = dates_cut_off(row.machine.former)
    if moving or (cut and told.state == "not_measured"):
        return max(cut, default=row.nights[0].night)
    if told.old:
        return measured_on(row.record or {}, row.before)
    if told.newer and (told.state == NEWER or not found):
        return ""  # the report has the date
    if told.state == "late":
        return next((n.night for n in row.nights if n.status == "complete"), "")
    if found and told.state != "doubtful":
        return since_date(_first(found))
    own = verdict_of(row.nights[0], limits)
    same = itertools.takewhile(lambda n: verdict_of(n, limits) == own, row.nights)
    first = [n.night for n in same][-1]
    # "Nothing was measured last night" has its date
    return "" if own == "good" or (own == "not_measured" and first == row.nights[0].night) else first


def brief(
    told: Answer | None,
    found: Sequence[Mapping[str, Any]],
    moving: bool,
    said: str,
    t: Texts,
    since: str = "",
    of_run: bool = False,
) -> tuple[str, str]:
    """answer, what is wrong, whether its control may still execute a program, headline, texts, date since when or '', whether that
    program is of a run that broke off → the one thing to do first, as on its page, and its cause with that date: the first sentence
    of it; ("", "") where nothing is to be done.
    """

    def dated(text: str) -> str:
        if told is not None and told.state == "doubtful" and text.rstrip(".").endswith(f" {t('night.within.since')}"):
            return whole_sentence(f"{text.rstrip('.')} ({t('morning.found', date=day(since, t))})" if since else text)
        known = not since or day(since, t) in text  # the sentence has that date already
        return whole_sentence(text if known else t("web.since", text=text.rstrip("."), date=day(since, t)))

    if told is None or told.may in ("yes", "wait"):
        return "", ""
    if moving:
        key = "may.brief_moving_run" if of_run else "may.brief_moving_of"
        words = t(key, date=day(since, t)) if since else t("may.brief_moving")
        return t("may.brief_look"), whole_sentence(words)
    parts = parts_first(told, found, t)
    parts = t("may.brief_first") if parts == t("morning.parts_first") else parts
    if told.old and not parts:
        return t("may.brief_measure"), dated(told.old)
    if told.state == NEWER:
        why = told.why.partition(". ")[0].partition(": ")[2]
        return parts, f"{whole_sentence(f'{why[:1].upper()}{why[1:]}')} {told.moved}".rstrip()
    found = () if told.state == "doubtful" else found  # the readings are the reason, whatever was found before them
    cause = told.old or (str(_first(found)["text"]) if found else told.why if told.why and told.may != "no" else said)
    cause = cause.replace(str(t("changed.which", names="")), "")  # which of them it is says the page; the size stands behind it
    cause = cause.partition(". ")[0].partition(" (")[0].rstrip(".")
    cause = cause.partition(t("may.brief_until"))[0] if found else cause.partition(": ")[2] or cause
    first = _first(found) if found and not told.old else {}
    gone = t("web.gone_again") if first.get("gone") else t("web.unseen_again") if first.get("unseen") else ""
    still = str(first.get("still") or "")
    still = still if first and still in brief_of(first) else ""  # it is another size by now
    return parts, " ".join(x for x in (dated(cause[:1].upper() + cause[1:]), still, gone, told.moved) if x)


def _first(found: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """what is wrong, one at least → the first of it that nobody ignores, also what stands behind a limit and is no alarm: the order
    is about that; else the first.
    """
    return next((a for a in found if not a.get("let_be") and (not a["id"] or a in still_open(found))), found[0])


def moved_most(found: Sequence[Mapping[str, Any]]) -> float:
    """what is wrong → µm that the largest of it does to a part by now, of what nobody has closed and what stands behind a limit:
    the order of machines in the list and on Alarms.
    """
    return max((does_now(a) for a in found if not (a["id"] and closed(a))), default=0.0)


def _age(row: Row, t: Texts, no: NewerAnswer | None = None) -> str:
    """row of the fleet, texts, newer readings where these answer → how long ago they were made, or the last night
    that measured has ended; '' where none has.
    """
    known = row.before or row.record or {}
    if no is None and known.get("verdict") == "not_measured":  # none has
        return ""
    try:
        moment = datetime.fromisoformat(str(known.get("end_utc") if no is None else no.measured))
    except ValueError:
        return ""
    return t("web.measured_ago", ago=ago(moment if moment.tzinfo else moment.replace(tzinfo=UTC), t, datetime.now(UTC)))


def answer_of(row: Row, found: Sequence[Mapping[str, Any]], state: PagesState) -> Answer | None:
    """row, what is wrong and not closed, state → whether parts may be made; None where nothing was measured and nothing moves."""
    if row.record is None:
        return of_no_night(row.machine.former, state.texts)
    late = next((n.night for n in row.nights if n.status == "complete"), state.texts("web.never"))
    late = late if row.standing is not None and row.standing.late else ""
    stale, ahead_of = state.places.old(row.machine, measured_on(row.record, row.before)), _ahead(row, state)
    of_readings, axes = newer_of(row), state.places.geometry(row.machine)
    beside = row.machine.former, of_readings, state.units, state.texts, axes
    return told_of(row.record, found, row.before, late, ahead_of, stale, *beside)


def newer_of(row: Row) -> NewerAnswer | None:
    """row → the answer of a report of readings that are newer than its newest night; None where that is a plain Yes, or none."""
    return newer_answer(row.machine.folder, (row.record or {}).get("end_utc"))


def asked_of(row: Row, state: PagesState) -> dict[str, Any]:
    """row, state → record of its last night, with whoever is asked about the machine today."""
    record, places = row.record or {}, state.places
    return {
        **record,
        "owner": record.get("owner") or places.owner(row.machine),
        "deputy": places.deputy(row.machine) or record.get("deputy"),
    }


def orders_of(row: Row, told: Answer, found: Sequence[Mapping[str, Any]], state: PagesState) -> list[str]:
    """row, answer, what is wrong, state → what to do, in the sentences of the page of the machine."""
    record, axes = asked_of(row, state), state.places.geometry(row.machine)
    return orders(
        told, record, found, str((record.get("next") or {}).get("kind") or ""), state.units, state.texts, axes, row.machine.former
    )


def _ahead(row: Row, state: PagesState) -> Ahead | None:
    known = row.before or row.record or {}
    return unchanged(row, state, "", lambda: ahead(known, volumes_of(row.nights), today()), "ahead")


def _named(record: Mapping[str, Any] | None) -> dict[str, Any]:
    """record of a night → verdict and owner, where it names one."""
    known = record or {}
    return {"verdict": known.get("verdict")} | ({"owner": known["owner"]} if known.get("owner") else {})


def made_up(row: Row) -> bool:
    """row of the fleet → whether its last night measured no machine but a simulated one."""
    return bool((row.record or {}).get("simulated") or (row.before or {}).get("simulated"))


def _urgent(r: Mapping[str, Any]) -> tuple[int, bool, float, str]:
    """The groups of the list one after the other; in each those near a limit first, then what has moved most."""
    return GROUPS.get(r["group"], 0), not r["soon"], -r["moved"], r["name"]


def faults_of(row: Row, state: PagesState) -> Sequence[Mapping[str, Any]]:
    """row of the fleet, state → what is wrong with the machine, as its own page has it: each cause once, the largest first."""
    m, places = row.machine, state.places
    if m.history is None:
        return []
    old = places.old(m, measured_on(row.record or {}, row.before))
    return unchanged(row, state, old, lambda: _faults(row, state), "faults")


def _faults(row: Row, state: PagesState) -> Sequence[Mapping[str, Any]]:
    history, name, record = row.machine.history, row.machine.name, row.record or {}
    s, known = row.standing, row.before or record
    told = any(x.get(key) for x in (record, known) for key in ("alarms", "standing", "behind", "unheard"))
    doubt = known.get("verdict") == "doubtful"  # a repair that somebody reports waits for another night
    if history is None or s is None or not (told or doubt or s.alarms_open or s.alarms_held):
        return []
    day_ = today()
    alarms, decisions = unclosed(history, name, day_)
    asked = asked_of(row, state)
    axes, events = state.places.geometry(row.machine), happened_to(state, row.machine)
    old = state.places.old(row.machine, measured_on(record, row.before))
    return faults(asked, earlier(alarms), decisions, state.units, state.texts, axes, row.before, day_, events, old)


ROUTES = [Route("/", fleet, name="fleet")]
