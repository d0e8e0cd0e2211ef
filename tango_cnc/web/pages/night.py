"""One night: the morning page, the engineer's part, and what is decided about its alarms."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...history.answers import every_decision
from ...records import InputError
from ...report.age import measured_on
from ...report.compensated import known_then
from ...report.days import days_between
from ...report.morning import context, volumes_of
from ...report.suspects import last_within, never_within
from ..app import machine_of, needs, page, state_of
from ..places import told
from ..served import Served
from .machine import ANOTHER, busy_of, dates_unsure, happened_to, limits_of, morning_of, record_before
from .report import NAMES, file_of_night


def night(request: Request) -> Response:
    """request → the page of the night."""
    needs(request, "view")
    found = machine_of(request)
    entry = int(request.path_params["entry"])
    record = record_of(found, entry)
    assert found.history is not None
    every = state_of(request).places.nights(found, ANOTHER)
    place = next((i for i, n in enumerate(every) if n.entry == entry), 0)
    if every and entry == every[0].entry:  # the newest one is the page of its machine
        values = morning_of(request, found, busy_of(request, found))
    else:
        values = _of_old(request, found, record, place)
    written = [name for name in NAMES if file_of_night(found, record, name) is not None]
    age = days_between(record.get("night"), datetime.now(UTC).astimezone().date())
    newest = every[0].night if place else ""
    return page(request, "night.html", machine=found, entry=entry, written=written, newest=newest, age=age, **values)


def _of_old(request: Request, found: Served, record: Mapping[str, Any], place: int) -> dict[str, Any]:
    """request, machine, record of a night that is not the newest, its place from the newest on → values of its page: as known
    that morning, with what was decided since.
    """
    assert found.history is not None
    state = state_of(request)
    nights = state.places.nights(found, ANOTHER)[place:]
    events, before = happened_to(state, found), record_before(request, found, nights)
    signs = [(n.night, told(n, limits_of(request, found))) for n in nights]
    return context(
        record,
        every_decision(found.history, found.name),
        state.units,
        state.texts,
        before=before,
        volumes=volumes_of(nights),
        machine=state.places.geometry(found),
        owner=state.places.owner(found),
        deputy=state.places.deputy(found),
        events=known_then(record, events) if place else events,
        now=datetime.now(UTC),
        newer=place,
        former=None if place else found.former,
        old=None if place else state.places.old(found, measured_on(record, before)),
        within=last_within(signs),
        never=never_within(signs),
        signs=signs,
        unsure=dates_unsure(state, found, nights),
    )


def record_of(machine: Served, entry: int) -> dict[str, object]:
    """machine, number of an entry → its record. Raises HTTPException 404 for one that is not of this machine."""
    if machine.history is None or entry > 2**53:
        raise HTTPException(404)
    try:
        stored = machine.history.night(entry)
    except InputError:
        raise HTTPException(404) from None
    if stored.night.machine != machine.name:
        raise HTTPException(404)
    return dict(stored.record)


ROUTES = [Route("/machine/{slug}/night/{entry:int}", night, name="night")]
