"""The record of a night (tango-night/1, docs/nightly.md) → the morning page: one screen of a phone, then the engineer's part."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from datetime import datetime
from pathlib import Path, PurePath
from typing import Any

from ..records import InputError, Machine
from ..state.changes import change
from ..texts import Said, say
from ..texts.handed import page_of_cell
from .alarm import alarm, sentence, since_told, whole_sentence
from .answer import Answer, answer, by_newer, dates_cut_off, measuring, renamed
from .compensated import after, held
from .days import ago, at, day, ended, ended_at
from .decimals import decimals_of_page
from .engineer import numbers
from .faults import accepted, answered, begun, faults, for_setting_up, of_probe, settled, still_open
from .newer import NewerAnswer
from .orders import brief_of, orders
from .pace import Ahead, ahead
from .plain import amount, office, plain, reason, shop, to_type
from .reach import or_else
from .repeated import as_dated, said_of_repair
from .suspects import beyond_before, suspected
from .template import environment, rendered
from .texts import Texts, texts_of
from .units import Units
from .words import of_its_night

FORMAT = "tango-night/1"
NIGHT: Mapping[str, Any] = {  # what a page asks of every record
    "status": "complete",
    "why": "",
    "kind": "",
    "start_utc": "",
    "end_utc": "",
    "touches": 0,
    "planned": 0,
}
LISTED = 3  # faults below the first one
LIKE = 0.03  # of its size, by which the error at the tool tip may differ and still count as the same


def render(
    record: Mapping[str, Any],
    decisions: Sequence[Any] = (),
    units: Units | None = None,
    folder: Path | None = None,
    before: Mapping[str, Any] | None = None,
    within: str = "",
    never: str = "",
    volumes: Mapping[str, float] | None = None,
    events: Sequence[Any] = (),
    signs: Sequence[tuple[str, str]] = (),
    unsure: Container[str] = (),
) -> str:
    """tango-night/1, decisions, units, a shop's templates, last night that measured, date of the last one in limits,
    of the first one where none was, {date: µm at the tool tip}, what happened to compensations, (date, verdict) of
    nights, newest first, dates of nights of which nobody knows whether they are within a limit → HTML alone.

    Raises InputError.
    """
    if record.get("format") != FORMAT:
        raise InputError(f"night: found format {record.get('format')!r}; allowed: {FORMAT}")
    known: dict[str, Any] = {"before": before, "within": within, "never": never, "volumes": volumes, "events": events}
    t = texts_of(folder)
    values = context(record, decisions, units, t, **known, signs=signs, unsure=unsure)
    page = page_of_cell(rendered(environment(folder), "morning.html", values), name_of(record))
    return decimals_of_page(page, t)


def context(
    record: Mapping[str, Any],
    decisions: Sequence[Any],
    units: Units | None,
    t: Texts,
    *,
    waiting: Sequence[Mapping[str, Any]] = (),
    before: Mapping[str, Any] | None = None,
    machine: Machine | None = None,
    owner: str = "",
    deputy: str = "",
    late: str = "",
    within: str = "",
    never: str = "",
    volumes: Mapping[str, float] | None = None,
    events: Sequence[Any] = (),
    busy: str = "",
    now: datetime | None = None,
    newer: int = 0,
    by_readings: NewerAnswer | None = None,
    signs: Sequence[tuple[str, str]] = (),
    unsure: Container[str] = (),
    former: Sequence[str] | None = None,
    old: int | None = None,
) -> dict[str, Any]:
    """record, decisions about its alarms, units, texts → values for the page.

    `waiting`: alarms of earlier nights that nobody has closed; `before`: the last night that measured; `owner`: who is asked
    where the record names nobody, `deputy`: who is asked where the owner does not answer; `late`: date since when a complete
    night is missing; `within`: date of the last night within every limit, where that is over; `never`: date of the first night
    on record where none was within; `volumes`: {date: µm at the tool tip} of the nights; `events`: what happened to
    compensations; `busy`: how long the machine still measures; `now`: what the age of the night counts to; `newer`: how many
    nights came after this one; `by_readings`: the answer of a report of readings after it; `unsure`: dates of nights not sure to
    be within a limit; `former`: what its cell has under other names today (None: as the record says); `old`: nights since the
    machine was measured, where these are too many for an answer of today (None: as the record says).
    """
    u = units or Units()
    by_alarm = {d.alarm: d for d in decisions}  # the last one counts
    asked = {**record, "owner": record.get("owner") or owner, "deputy": deputy or record.get("deputy")}
    today = now.astimezone().strftime("%Y-%m-%d") if now is not None else str(record.get("night") or "")
    alarms = [alarm(a, by_alarm.get(str(a.get("id"))), u, t, machine, asked, today) for a in record.get("alarms") or ()]
    stale = int(record.get("stale_nights") or 0) if old is None else old
    found = faults(asked, waiting, by_alarm, u, t, machine, before, today, events, stale)
    coming = ahead(before or record, volumes or {}, str(record.get("night")) if newer else today)
    told = told_of(record, found, before, late, coming, stale, former, by_readings, u, t, machine)
    if (closed := settled(found)) and found[0]["id"]:
        found[0] = {**found[0], "todo": t("morning.todo_nothing" if closed == "accept" else "may.repaired_todo")}
    began, within = _begun(told, found, record), within or told.after
    coming_night = next_night(record, decisions, before)
    suspect = _suspected(record, told, found, began, (within, never), signs, unsure, t)
    told = measuring(told, t) if busy else told
    todo = orders(told, asked, found, str(coming_night.get("kind") or ""), u, t, machine, former or ())
    return {
        "t": t,
        "units": u,
        "night": {**NIGHT, **record},
        **_sayings(record, u, t, machine),
        **numbers(record, u, t),
        "office": _office(record, found, t),
        "ended": ended(record.get("end_utc"), t, now),
        "simulated": any((x or {}).get("simulated") for x in (record, before)),
        "last_measured": _last_measured(before or record, t, now) if before or dates_cut_off(former or ()) else "",
        "suspect": suspect,
        "over_since": _over_since(told, within, never, unsure, t),
        "grown": _grown(
            record if record.get("volume") else before or {},
            (began, (volumes or {}).get(began)),
            str((before or record).get("night")) if told.old or told.newer or before or dates_cut_off(former or ()) else "",
            u,
            t,
            sum(not a["gone"] for a in still_open(found)) > 1,
        ),
        "who": who_of(told, asked, found, t),
        "whom": t("morning.call", owner=named) if (named := asked["owner"] or asked["deputy"]) else "",
        "count": len(still_open(found)),
        "nobody": found[0]["nobody"] if found else not (asked["owner"] or asked["deputy"]),
        "has": bool(found and found[0]["decision"]),
        "done": bool(found and found[0]["id"]) and not still_open(found[:1]),
        "next_kind": _next_kind(told, coming_night, todo, t),
        "limit_for": _limit_for(told, record, before, t),
        "busy": busy,
        "old": stale,
        "measured": (before or record).get("night") or "",
        "newer": newer,
        "answer": told,
        "headline": sentence(as_dated(record, decisions), u, t),
        "level": told.level,
        "word": busy or told.short(t) or told.state,
        "todo": todo,
        "alarms": alarms,
        "first": found[0] | {"brief": brief_of(found[0])} if found else None,
        "repaired": [_repaired(x, u, t, machine) for x in record.get("repaired") or ()],
        "ignored": _ignored(record, {str(a.get("id")) for a in waiting}, u, t, machine),
        "also": found[1 : LISTED + 1],
        "more": max(len(found) - LISTED - 1, 0),
        "owner": asked["owner"],
        "next": {"kind": "", **coming_night, "why": u.sentence(t.of(coming_night.get("why") or "", u.more))},
        "held": held(record, t, events),
        "held_open": bool(after(record, events)) or not (record.get("in_control") or {"measured": True})["measured"],
    }


def told_of(
    record: Mapping[str, Any],
    found: Sequence[Mapping[str, Any]],
    before: Mapping[str, Any] | None,
    late: str,
    coming: Ahead | None,
    stale: int,
    former: Sequence[str] | None,
    by_readings: NewerAnswer | None,
    u: Units,
    t: Texts,
    machine: Machine | None,
) -> Answer:
    """record, what is wrong, last night that measured, date since when a night is missing, how soon a limit is reached, nights
    since the last measurement, what is said beside its nights, the answer of newer readings, units, texts, chain of axes →
    whether parts may be made: every page asks here.
    """
    waits, has = answered(found, record)
    told = answer(record, u, t, waits, before, machine, late, has, coming, settled(found), stale, of_probe(found))
    told = renamed(told, record.get("former") or () if former is None else former, t)
    return told if by_readings is None else by_newer(told, by_readings, u, t, machine, before or record)


def _suspected(
    record: Mapping[str, Any],
    told: Answer,
    found: Sequence[Mapping[str, Any]],
    began: str,
    limits: tuple[str, str],
    signs: Sequence[tuple[str, str]],
    unsure: Container[str],
    t: Texts,
) -> str:
    """record, answer, faults, date since when, (date of the last night within every limit, of the first on record where none was),
    (date, verdict) of nights newest first, dates of nights that are not certain, texts → which parts are in doubt, '' for none.
    """
    within, never = limits
    suspect = _suspect("but" if told.old and told.may == "unknown" else told.may, within, never, began, unsure, t)
    alone = suspect == t("morning.suspect", date=day(began, t))
    if suspect and alone and found and str(found[0]["begun"]) not in ("", began):
        suspect = t("morning.suspect_any", date=day(began, t))  # "it" would be what the page names first
    if not suspect and not began and (probed := begun(found)):
        suspect = t("morning.suspect_probe", date=day(probed, t))
    elif suspect and not (told.may == "no" and never) and (first := beyond_before(signs, min(began or within, within or began))):
        suspect += f" {t('morning.suspect_before', date=_night(first, unsure, t))}"
    if not suspect and (accepted_ := [str(a["begun"]) for a in found if a["begun"] and not a["gone"] and accepted(a)]):
        until = min(accepted_)
        if first := beyond_before(signs, until):  # to accept what came after it has sorted none of these
            suspect = t("morning.suspect_until", first=_night(first, unsure, t), date=day(until, t))
    believed = str(record.get("last_carried") or "")
    if not suspect and not began and record.get("verdict") == "doubtful" and believed:
        suspect = t("morning.suspect_doubt", date=day(believed, t))
    over = (
        a for a in found if a["gone"] and a["begun"] and not change(a.get("cause_key")).scatters
    )  # parts of the probe: `on_part` has them
    back, until = min(((str(a["begun"]), str(a.get("gone_by") or "")) for a in over), default=("", ""))
    known = any(str(x.get("since")) <= back for x in record.get("repaired") or ())
    if back and not known and not (suspect and began and began <= back):
        key = f"morning.suspect_gone{'_also' if suspect else ''}{'_by' if until else ''}"
        return f"{suspect} {t(key, date=day(back, t), until=day(until, t))}".strip()
    return suspect


def _sayings(record: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None) -> dict[str, Any]:
    """record, units, texts, machine → how the page says a sentence, a date, a moment; reasons of a doubt and what was edited."""
    return {
        "first_time": _says(record.get("headline"), "night.words.first_time"),
        "sentence": lambda text: sentence(text, u, t),
        "plain": lambda text: whole_sentence(shop(sentence(plain(text, u, t, machine), Units()), t)),
        "reasons": [
            whole_sentence(shop(sentence(reason(r, u, t, machine), Units()), t))
            for r in dict.fromkeys((record.get("plausible") or {}).get("reasons") or ())
        ],
        "edited": whole_sentence(sentence(plain((record.get("edited") or {}).get("text"), u, t, machine), Units())),
        "warm": whole_sentence(sentence(plain((record.get("temperature") or {}).get("text"), u, t, machine), Units())),
        "unalarmed": _unalarmed(record, u, t, machine),
        "day": lambda text, year=True: day(text, t, year),
        "moment": lambda text: at(text, t),
        "since_of": lambda a: since_told(a, t),
    }


def _says(text: Any, key: str) -> bool:
    """text of a record, beginning of a key → whether it, or a text within it, has one."""
    return isinstance(text, Said) and (text.key.startswith(key) or any(_says(x, key) for x in text.values.values()))


def next_night(record: Mapping[str, Any], decisions: Sequence[Any], before: Mapping[str, Any] | None = None) -> Mapping[str, Any]:
    """record of the newest night, decisions, last night that measured → kind of the next night and why.

    Who repairs the machine after a night asks for the full measurement; the night could not know that. {}: nobody knows.
    """
    measured = record if before is None or record.get("verdict") != "not_measured" else before
    ended_utc = str(measured.get("end_utc") or "")
    repaired = [d for d in decisions if d.action == "repaired" and d.utc and ended_utc and d.utc >= ended_utc]
    if not repaired:
        return record.get("next") or {}
    last = max(repaired, key=lambda d: str(d.utc))
    return {"kind": "full", "why": say("night.analysis.repaired_since_last_full_run", value=said_of_repair(last))}


def _next_kind(told: Answer, coming: Mapping[str, Any], todo: Sequence[str], t: Texts) -> str:
    """answer, next night, what to do, texts → what it measures, beside a full measurement that is asked for now; '' where somebody
    has to see to the machine or the computer before any night can measure.
    """
    kind = str(coming.get("kind") or "")
    if not kind or told.old or told.state in ("cut_off", "moved", "not_measured"):
        return ""
    asked = told.may in ("no", "but") and any(t("morning.kind_full") in line for line in todo)
    key = f"morning.next_{kind}" if asked and f"morning.next_{kind}" in t else f"morning.kind_{kind}"
    return t(key) if key in t else kind


def _limit_for(told: Answer, record: Mapping[str, Any], before: Mapping[str, Any] | None, t: Texts) -> str:
    """answer, record, last night that measured, texts → what the limit is for and who has stated it; '' without a number."""
    known = before or record
    if not told.numbers or not any(x.get("limit") for x in known.get("limits") or ()):
        return ""
    stated = str(record.get("limits_for") or known.get("limits_for") or "").rstrip(".")
    return t("may.limit_for", text=stated) if stated else ""


def _last_measured(known: Mapping[str, Any], t: Texts, now: datetime | None) -> str:
    """last night that measured, texts, now → its date and how long ago that is, as the list of machines has it; '' for none."""
    moment = ended_at(known.get("end_utc"))
    if moment is None or now is None or known.get("verdict") == "not_measured":
        return ""
    return t("web.last_measured", date=day(known.get("night"), t), ago=ago(moment, t, now))


def _repaired(x: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None) -> dict[str, str]:
    """what a night says of a repair that helped, units, texts, chain of axes → the same for the shop, and which parts to check."""
    since = x.get("since")  # older records do not have it
    told = whole_sentence(sentence(plain(x.get("text"), u, t, machine), Units()))
    return {"text": told, "suspect": t("morning.suspect_repaired", date=day(since, t)) if since else ""}


def _unalarmed(record: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None) -> str:
    """record, units, texts, chain of axes → what has moved without an alarm, as a sentence of the shop; '' for nothing, and where
    an alarm says it.
    """
    trend = record.get("trend") or {}
    own = (a for key in ("standing", "unheard") for a in record.get(key) or ())
    if any(a.get("parameter") == trend.get("parameter") and a.get("rate_per_day") for a in own):
        return ""  # that goes on is what its alarm says
    return whole_sentence(sentence(plain(trend.get("text"), u, t, machine), Units()))


def _ignored(record: Mapping[str, Any], shown: set[str], u: Units, t: Texts, machine: Machine | None) -> list[str]:
    """record, alarms that the page shows already, units, texts, chain of axes → what somebody ignores, as sentences of the shop."""

    def told(text: str) -> str:
        return whole_sentence(sentence(plain(text, u, t, machine), Units()))

    found = []
    for a in record.get("unheard") or ():
        if str(a["alarm"]) not in shown:
            words = {"text": told(of_its_night(a["text"], str(a["alarm"])[:10])), "owner": a["owner"], "until": day(a["until"], t)}
            now = {"now": told(a["now"])} if a["now"] else {}
            found.append(t("morning.ignored_now" if now else "morning.ignored_by", **words, **now))
    return found


def _grown(record: Mapping[str, Any], before: tuple[str, float | None], on: str, u: Units, t: Texts, several: bool) -> str:
    """last night that measured, date before any open fault and µm at the tool tip then, date of that night where it is no answer of
    today, units, texts, whether several causes are open → which of the two is larger, and that it is of all; or nothing.
    """
    began, was = before
    v = record.get("volume") or {}
    same_date = began == record.get("night")  # nights of one date: which of them was before the fault cannot be told by its date
    if same_date or was is None or v.get("worst_um") is None or record.get("verdict") == "doubtful":
        return ""
    now = float(v["worst_um"])
    slack = max(2 * float(v.get("std_um") or 0.0), LIKE * was)
    key = "larger" if now > was + slack else "smaller" if now < was - slack else "same"
    then = t("morning.grown_on", size=amount(now, "µm", u, t), date=day(on, t)) if on else ""
    sizes = {"before": amount(was, "µm", u, t), "now": then or t("morning.grown_now", size=amount(now, "µm", u, t))}
    told = t(f"morning.grown_{key}", date=day(began, t), **sizes)
    return t("morning.grown_all", told=told) if several else told


def _night(date: str, unsure: Container[str], t: Texts) -> str:
    """date of a night that is named for its limit, dates of those that are not certain, texts → the date, and whether it is."""
    return t("morning.unsure", date=day(date, t)) if date in unsure else day(date, t)


def _suspect(may: str, within: str, never: str, began: str, unsure: Container[str], t: Texts) -> str:
    """answer, date of the last night in limits, of the first where none was, of that before the first open fault, dates of nights
    that are not certain, texts → parts in question, or nothing."""
    if (found := suspected(may, within, never, began)) is None:
        return ""
    return t(found.key, **{name: _night(date, unsure if name in found.limits else (), t) for name, date in found.dates.items()})


def _office(record: Mapping[str, Any], found: Sequence[Mapping[str, Any]], t: Texts) -> list[str]:
    """record, faults, texts → what the office can do at a computer: the commands that the first screen leaves out."""
    failed = [p.get("do") for p in record.get("preflight") or () if not p.get("passed")]
    by_status = {"refused": "night.refused_do", "missed": "morning.missed_todo"}.get(str(record.get("status")))
    told = [record.get("why"), *failed, *((record.get("plausible") or {}).get("reasons") or ()), t(by_status) if by_status else ""]
    told = [office(t.of(x or ""), t) for x in told] + [str(a["office"]) for a in found]
    return to_type([x for x in told if x], name_of(record), t)


def name_of(record: Mapping[str, Any]) -> str:
    """record of a night → name of the folder of its cell, by which its commands find it; '' where it has none."""
    return PurePath(str(record.get("cell") or "")).name


def _begun(told: Answer, found: Sequence[Mapping[str, Any]], record: Mapping[str, Any]) -> str:
    """answer, faults, record → date of the last night before anything of the machine that is open; where nothing is, that of the
    night before newer readings that say Yes, but; '' where none is.
    """
    known = begun([a for a in found if not for_setting_up(a)], record.get("behind") or ())
    return known or (told.after if told.newer and told.may == "but" and not found else "")


def _over_since(told: Answer, within: str, never: str, unsure: Container[str], t: Texts) -> str:
    """answer, date of the last night in limits, of the first where none was, dates of nights that are not certain, texts → since
    when the limit is crossed, or newer readings say Yes, but; else nothing.
    """
    if told.newer and told.may == "but" and told.after:
        return t("morning.since_text", good=day(told.after, t))
    if told.may != "no" or not (never or within):
        return ""
    return t("morning.since_never" if never else "morning.since_within", date=_night(never or within, unsure, t))


def who_of(told: Answer | None, record: Mapping[str, Any], found: Sequence[Mapping[str, Any]], t: Texts) -> str:
    """answer (None: nothing is known), record, faults → who has it, as a sentence; '' where there is nothing to have."""
    if found:
        return str(found[0]["who"])
    if told is not None and told.may in ("yes", "wait") and record.get("verdict") == "good" and not told.soon:
        return ""
    if not record["owner"]:
        deputy = str(record.get("deputy") or "")
        return t("morning.nobody_but", other=deputy) if deputy else t("morning.nobody")
    return " ".join(
        x for x in (t("morning.call", owner=record["owner"]), or_else(record["owner"], 0, str(record.get("deputy") or ""), t)) if x
    )


def volumes_of(nights: Sequence[Any]) -> dict[str, float]:
    """nights of a history, newest first → {date: µm at the tool tip} of those that know it."""
    return {n.night: float(n.volume_um) for n in reversed(nights) if n.volume_um is not None}
