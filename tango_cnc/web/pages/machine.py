"""One machine: its last night as the morning page, its trend, its nights, and the way to everything else."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from typing import Any

import numpy as np
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...history import Compensation, Night, compensations
from ...link.progress import LOOKED, journals
from ...report.age import measured_on
from ...report.alarm import sentence
from ...report.answer import Answer, dates_cut_off, of_no_night
from ...report.charts import tip
from ...report.compensated import begins, marked
from ...report.course import course, drift_of_tip, jumps_of_tip
from ...report.days import day
from ...report.faults import earlier, unclosed
from ...report.morning import context, volumes_of, who_of
from ...report.newer import has_no_report, newer_answer
from ...report.orders import orders_of_cut_off
from ...report.plain import plain, plainly
from ...report.repeated import as_dated, in_a_row, of_shop, shortened
from ...report.signs import SHORT, level_of, strip
from ...report.suspects import last_within, never_within
from ...report.texts import Texts
from ...report.tonight import sized
from ...report.units import Units
from ..app import PagesState, machine_of, needs, page, state_of
from ..live import LiveRun, minutes_left, quiet, title, touched_by
from ..places import STRIP, measured_before, sign_of, told
from ..served import Served
from .report import file_of_cell

PAGE = 50  # nights of one page of the list
ANOTHER = 10_000
LAST = 365  # nights whose alarms are looked for in a curve
QUARTER = 90  # nights of the curve; on a phone it has those of the strip


def machine(request: Request) -> Response:
    """request → the page of the machine."""
    needs(request, "view")
    state, found = state_of(request), machine_of(request)
    nights = state.places.nights(found, STRIP)
    run = run_of(state, found)
    values: dict[str, Any] = {"machine": found, "nights": nights[:10], "run": run, "known": False}
    values["silent"] = None if run is None else quiet(run, time.time())
    values["busy"] = busy_of(request, found)
    owner = state.places.owner(found)
    values["cut"] = dates_cut_off(found.former)
    deputy = state.places.deputy(found)
    values |= {"who": who_of(None, {"owner": owner, "deputy": deputy}, (), state.texts), "nobody": not (owner or deputy)}
    values["simulated"] = run is not None and run.simulated and not nights
    values["ran"] = "" if nights else ran_of(state, found)
    values["moving"] = None if values["busy"] else of_no_night(found.former, state.texts)
    values["unmeasured"] = unmeasured(values["ran"], values["busy"], found, state)
    values["reported"] = file_of_cell(found) is not None
    if nights and found.history is not None:
        entry, allowed = nights[0].entry, limits_of(request, found)
        cut = [(date, "partial") for date in dates_cut_off(found.former)]
        unsure = state.places.unsure(found.history, nights)
        signs = (cut + [(n.night, sign_of(n, unsure)) for n in nights])[:STRIP]
        values |= morning_of(request, found, values["busy"])
        values["known"], values["judged"] = True, bool(allowed)
        values["entry"] = entry
        values["strip"] = strip(
            [(d, v, "") for d, v in reversed(signs)], between(signs, state.texts, values["old"]), state.texts, values["old"]
        )
        values["between"] = between(signs, state.texts, values["old"])
        values["headlines"] = headlines(request, found, nights[:10])
        values["curves"] = curves(request, found)
        values["course"] = course_of_tip(request, found)
    return page(request, "machine.html", **values)


def between(signs: Sequence[tuple[str, ...]], t: Texts, old: int = 0) -> str:
    """(date, …) of nights, newest first, texts, whether they are too old → which nights a row of signs has."""
    every, signs = len(signs), signs[:SHORT] if old else signs
    first, last = (day(signs[end][0], t, year) for end, year in ((-1, False), (0, True)))
    key = "web.nights_of" if every > len(signs) else "web.nights" if every > 1 else "web.nights_one"
    return t(key, count=len(signs), all=every, first=first, last=last)


def answer_today(request: Request, machine: Served) -> Answer:
    """request, machine → the answer of its page, for pages that show something older or narrower."""
    busy, t = busy_of(request, machine), state_of(request).texts
    found = morning_of(request, machine, busy).get("answer")
    if isinstance(found, Answer):
        return found
    if not busy and (moving := of_no_night(machine.former, t)) is not None:
        return moving
    why = unmeasured(ran_of(state_of(request), machine), busy, machine, state_of(request))
    return Answer("wait" if busy else "unknown", t("may.measuring" if busy else "may.unknown"), "", "", why)


def day_of(request: Request, machine: Served) -> dict[str, Any]:
    """request, machine → values of the first screen of its newest night; without a night `today`, the answer in a line."""
    return morning_of(request, machine, busy_of(request, machine)) or {"today": answer_today(request, machine)}


def todo_today(request: Request, machine: Served) -> list[str]:
    """request, machine → what to do, in the sentences of its page."""
    if found := morning_of(request, machine, busy_of(request, machine)):
        return list(found["todo"])
    return orders_of_cut_off(machine.former, state_of(request).texts)


def who_today(request: Request, machine: Served) -> dict[str, Any]:
    """request, machine → `who` has it (`has`) or is asked, as on its page, and whether that is `nobody`."""
    state = state_of(request)
    if found := morning_of(request, machine, busy_of(request, machine)):
        return {key: found[key] for key in ("who", "nobody", "has")}
    owner, deputy = state.places.owner(machine), state.places.deputy(machine)
    return {"who": who_of(None, {"owner": owner, "deputy": deputy}, (), state.texts), "nobody": not (owner or deputy), "has": False}


def morning_of(request: Request, machine: Served, busy: str) -> dict[str, Any]:
    """request, machine, how long it still measures → values of the first screen of its newest night; empty without a night."""
    state = state_of(request)
    nights = state.places.nights(machine, STRIP)
    if not nights or machine.history is None:
        return {}
    allowed = limits_of(request, machine)
    alarms, decisions = unclosed_of(request, machine)
    known = state.places.nights(machine, ANOTHER)
    record, before = stored(request, machine, nights[0].entry), record_before(request, machine, nights)
    record = {**record, "limits_for": state.places.limits_for(machine) or record.get("limits_for")}
    every = [(n.night, told(n, allowed)) for n in known]
    since = {"ran_since": "" if busy else ran_since(state, machine, record)}
    return since | context(
        record,
        decisions,
        state.units,
        state.texts,
        waiting=earlier(alarms),
        before=before,
        machine=state.places.geometry(machine),
        owner=state.places.owner(machine),
        deputy=state.places.deputy(machine),
        late=state.places.late(machine),
        within=last_within(every),
        never=never_within(every),
        volumes=volumes_of(known),
        events=happened_to(state, machine),
        busy=busy,
        now=datetime.now(UTC),
        by_readings=newer_answer(machine.folder, record.get("end_utc")),
        signs=every,
        unsure=dates_unsure(state, machine, known),
        former=machine.former,
        old=state.places.old(machine, measured_on(record, before)),
    )


def dates_unsure(state: PagesState, machine: Served, nights: Sequence[Night]) -> frozenset[str]:
    """what pages share, machine, nights → dates of those of which nobody knows whether they are within a limit."""
    unsure = state.places.unsure(machine.history, nights)
    return frozenset(n.night for n in nights if n.entry in unsure)


def stored(request: Request, machine: Served, entry: int) -> Any:
    """request, machine, number of an entry → its record; kept for ten minutes, since no entry changes."""
    history = machine.history
    assert history is not None
    return state_of(request).places.kept(f"night {machine.slug} {entry}", lambda: history.night(entry).record, 600)


def record_before(request: Request, machine: Served, nights: Sequence[Night]) -> Any:
    """request, machine, its nights newest first → record of the last one that measured before a night that did not; else None."""
    last = measured_before(nights)
    return None if last is None else stored(request, machine, last.entry)


def simulated(request: Request, machine: Served) -> bool:
    """request, machine → whether its newest night, or the last that measured, measured no machine but a simulated one."""
    nights = state_of(request).places.nights(machine, STRIP)
    known = [stored(request, machine, nights[0].entry), record_before(request, machine, nights)] if nights else []
    return any((record or {}).get("simulated") for record in known)


def unclosed_of(request: Request, machine: Served) -> tuple[Any, Any]:
    """request, machine → its alarms that nobody has closed, newest first, and the last decision about each."""
    history, today = machine.history, datetime.now().astimezone().strftime("%Y-%m-%d")
    assert history is not None

    def read() -> tuple[Any, Any]:
        alarms, decisions = unclosed(history, machine.name, today)
        return alarms, tuple(decisions.values())

    return state_of(request).places.kept(f"unclosed {machine.slug}", read)


def events_of(state: PagesState, machine: Served) -> Mapping[str, str]:
    """what pages share, machine → {date: what happened to its compensations}, in the words of the page."""
    return marked(happened_to(state, machine), state.texts)


def happened_to(state: PagesState, machine: Served) -> Sequence[Compensation]:
    """what pages share, machine → what happened to its compensations, newest first."""
    history, name = machine.history, machine.name

    def read() -> Sequence[Compensation]:
        return compensations(history, name) if history is not None and history.knows(name) else ()

    return state.places.of_machine(machine, "compensations", read)


def run_of(state: PagesState, machine: Served) -> LiveRun | None:
    """what pages share, machine → its present or last run on this computer."""
    if machine.folder is None:
        return None
    files = journals(machine.folder)
    cell = state.places.cell(machine.folder)
    return state.journals.run(files[0], touched_by(files[0], cell)) if files else None


def ran_of(state: PagesState, machine: Served) -> str:
    """what pages share, machine → when its newest complete run on this computer began, as a text; '' without one."""
    if machine.folder is None:
        return ""
    cell = state.places.cell(machine.folder)
    for file in journals(machine.folder)[:LOOKED]:
        run = state.journals.run(file, touched_by(file, cell))
        if run is not None and run.state == "complete":
            return title(run, state.texts)
    return ""


def ran_since(state: PagesState, machine: Served, record: Mapping[str, Any]) -> str:
    """what pages share, machine, record of its newest night → when its newest complete run outside the nights began, where that was
    later and no report was written since, as a text; else ''. A run of no machine says nothing of a machine.
    """
    if machine.folder is None:
        return ""
    cell = state.places.cell(machine.folder)
    for file in journals(machine.folder)[:LOOKED]:
        run = state.journals.run(file, touched_by(file, cell)) if file.parent == machine.folder else None
        if run is not None and run.state == "complete":
            unknown = has_no_report(machine.folder, run.started, run.touched, run.simulated, record)
            return title(run, state.texts) if unknown else ""
    return ""


def unmeasured(ran: str, busy: str, machine: Served, state: PagesState) -> str:
    """complete run or '', minutes left or '', machine, state → what is known of a machine that no night has measured."""
    t = state.texts
    if machine.unread:
        return t("may.unread")
    if busy:
        return t("may.another_run", date=ran) if ran else t("may.first_run")
    if not ran:
        return t("may.never")
    return t("may.ran" if file_of_cell(machine) is not None else "may.ran_bare", date=ran)


def busy_of(request: Request, machine: Served) -> str:
    """request, machine → how long it still measures, in words; '' where it does not."""
    return busy_for(run_of(state_of(request), machine), state_of(request))


def busy_for(run: LiveRun | None, state: PagesState) -> str:
    """run, state → how long it still measures, in words; '' where it does not."""
    left = minutes_left(run, time.time())
    return "" if left is None else state.texts("web.left_short" if left else "web.begun_short", minutes=left)


def limits_of(request: Request, machine: Served) -> Mapping[str, float]:
    """request, machine → {what: limit} of its last night that measured, in µm, µrad or µm/m."""
    nights = state_of(request).places.nights(machine, STRIP)
    last = next((n for n in nights if n.verdict != "not_measured"), None)
    if last is None:
        return {}
    return {str(x["what"]): float(x["limit"]) for x in stored(request, machine, last.entry).get("limits") or () if x.get("limit")}


def curves(request: Request, machine: Served) -> tuple[Markup, Markup] | None:
    """The largest error of the tool tip night by night: of a quarter of a year, and of the last nights for a phone."""
    state = state_of(request)
    (k, unit), allowed = state.units.plain, limits_of(request, machine)
    known = state.places.nights(machine, QUARTER)
    unsure = state.places.unsure(machine.history, known)
    found = [
        (date.fromisoformat(n.night), float(n.volume_um) * k, level_of(sign_of(n, unsure)))
        for n in reversed(known)
        if n.volume_um is not None
    ]
    if len(found) < 2:
        return None
    limit = allowed["volume"] * k if "volume" in allowed else None
    wide, narrow = (
        tip(part, limit, unit, state.texts, *size, events_of(state, machine))
        for part, size in ((found, (860, 240)), (found[-STRIP:], (360, 270)))
    )
    return Markup(wide), Markup(narrow)


def alarms_by_entry(request: Request, machine: Served) -> Mapping[int, Any]:
    """request, machine → {entry: alarms of that night} of its nights with alarms; kept for half a minute."""
    history = machine.history
    if history is None or machine.name not in history.machines():
        return {}
    return state_of(request).places.kept(
        f"alarmed {machine.slug}", lambda: {s.night.entry: s.record["alarms"] for s in history.alarmed(machine.name, LAST)}, 30
    )


def course_of_tip(request: Request, machine: Served) -> str:
    """request, machine → what the largest error of the tool tip does, in one sentence; nothing before two nights."""
    state, allowed = state_of(request), limits_of(request, machine)
    known = [n for n in reversed(state.places.nights(machine, QUARTER)) if n.volume_um is not None]
    if len(known) < 2:
        return ""
    k, unit = state.units.plain
    volume = stored(request, machine, known[-1].entry).get("volume") or {}
    std = float(volume.get("std_um") or 1.0) * k
    value = np.array([float(n.volume_um or 0.0) * k for n in known])
    first = date.fromisoformat(known[0].night)
    days = np.array([(date.fromisoformat(n.night) - first).days for n in known], dtype=float)
    anew = {*begins(happened_to(state, machine), [n.start_utc for n in known]), *_after_repairs(request, machine, known)}
    alarms, entries = alarms_by_entry(request, machine), [n.entry for n in known]
    jumps = jumps_of_tip(alarms, entries, value, std, anew)
    drift = drift_of_tip(alarms, entries, [n.night for n in known], value, std)
    limit = allowed["volume"] * k if "volume" in allowed else None
    told = course(first, days, value, np.full(len(value), std), jumps, limit, unit, state.texts, drift)
    return of_believed(request, machine, known[-1].night, told)


def of_believed(request: Request, machine: Served, last: str, told: str) -> str:
    """request, machine, date of the last night of a curve, what is said of that → the same, up to that night where readings since
    then are in doubt: nothing of them is in the curve.
    """
    t, nights = state_of(request).texts, state_of(request).places.nights(machine, STRIP)
    newest = next((n for n in nights if n.verdict != "not_measured"), None)
    doubted = newest is not None and newest.verdict == "doubtful" and newest.night > last
    return t("course.until_doubt", date=day(last, t), text=told) if told and doubted else told


def _after_repairs(request: Request, machine: Served, nights: Sequence[Night]) -> list[int]:
    """request, machine, nights oldest first → places of the first night after each repair."""
    done = [d.utc for d in unclosed_of(request, machine)[1] if d.action == "repaired"]
    return [place for utc in done if (place := next((i for i, n in enumerate(nights) if n.start_utc >= utc), None)) is not None]


def headlines(request: Request, machine: Served, nights: Sequence[Night]) -> Mapping[int, str]:
    """request, machine, nights → {entry: what the night said, in the words of the shop}; what the one above said is left out."""
    state, history = state_of(request), machine.history
    if history is None or not nights:
        return {}
    decisions = unclosed_of(request, machine)[1]
    stamp = max((d.utc for d in decisions), default="")
    key = f"headlines {machine.slug} {nights[0].entry} {nights[-1].entry} {len(decisions)} {stamp}"
    t, u, axes = state.texts, state.units, state.places.geometry(machine)

    def made() -> dict[int, str]:
        records = history.records_of([n.entry for n in nights])
        said = shortened([as_dated(records.get(n.entry, {}), decisions) or n.headline for n in nights])
        rows = [in_a_row(of_shop(sized(text, records.get(n.entry, {})))) for n, text in zip(nights, said, strict=True)]
        return {n.entry: sentence(plain(plainly(row, t), u, t, axes), Units()) for n, row in zip(nights, rows, strict=True)}

    return state.places.kept(key, made, 600)


def nights(request: Request) -> Response:
    """request → the list of all nights, a page at a time."""
    needs(request, "view")
    state, found = state_of(request), machine_of(request)
    text = request.query_params.get("page", "0")
    number = int(text) if text.isascii() and text.isdigit() and len(text) < 6 else 0
    every = state.places.nights(found, ANOTHER)
    shown = every[number * PAGE : (number + 1) * PAGE]
    more = (number + 1) * PAGE < len(every)
    said = headlines(request, found, shown)
    return page(
        request,
        "nights.html",
        machine=found,
        nights=shown,
        headlines=said,
        listed=len(every),
        cut=[] if number else dates_cut_off(found.former),
        number=number,
        older=more,
        judged=bool(limits_of(request, found)),
        **{"simulated": simulated(request, found)} | day_of(request, found),
    )


ROUTES = [Route("/machine/{slug}", machine, name="machine"), Route("/machine/{slug}/nights", nights, name="nights")]
