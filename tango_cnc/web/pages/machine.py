"""One machine: its last night as the morning page, its trend, its nights, and the way to everything else."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...report.morning import LEVELS, context, earlier, strip
from ...report.svg import BLUE, RED, Frame, Series, chart
from ..app import machine_of, needs, page, state_of
from ..live import Run, journals
from ..places import STRIP, Machine

PAGE = 50  # nights of one page of the list
ANOTHER = 10_000


def machine(request: Request) -> Response:
    """request → the page of the machine."""
    needs(request, "view")
    state, found = state_of(request), machine_of(request)
    nights = state.places.nights(found, STRIP)
    values: dict[str, Any] = {"machine": found, "nights": nights[:10], "run": run_of(request, found), "level": "none"}
    values["waiting"] = []
    if nights and found.history is not None:
        history, entry = found.history, nights[0].entry
        stored = state.places.kept(f"night {found.slug} {entry}", lambda: history.night(entry).record, 600)
        decisions = state.places.kept(f"decisions {found.slug}", lambda: history.decisions(found.name))
        values |= context(stored, decisions, state.units, state.texts)
        values["entry"] = entry
        values["waiting"] = waiting = context({"alarms": earlier(_waiting(request, found))}, (), state.units, state.texts)["alarms"]
        shown = {a.get("id") for a in (*values["alarms"], *([values["first"]] if values["first"] else []))}
        waiting[:] = [a for a in waiting if a["id"] not in shown]
        if (waiting or values["first"]) and values["level"] == "good":  # no green while an alarm waits
            headline = values["headline"]
            told = {"headline": state.texts("web.last_said", headline=headline[:1].lower() + headline[1:])}
            values |= told | {"level": "look", "word": state.texts("web.alarm_open"), "quiet": True}
        if waiting and values["first"] is None:  # what it is, what it does and what to do stand here, not a page away
            values["first"] = {**waiting.pop(0), "older": True}
        values["strip"] = strip([(n.night, n.verdict, "") for n in reversed(nights)], state.texts("web.nights"))
        values["picture"] = _volume(request, found)
    return page(request, "machine.html", **values)


def _waiting(request: Request, machine: Machine) -> Any:
    """request, machine → its alarms that nobody has decided about, newest first."""
    history = machine.history
    assert history is not None
    return state_of(request).places.kept(f"waiting {machine.slug}", lambda: history.open_alarms(machine.name))


def run_of(request: Request, machine: Machine) -> Run | None:
    """request, machine → its present or last run on this computer."""
    if machine.folder is None:
        return None
    files = journals(machine.folder)
    state = state_of(request)
    cell = state.places.cell(machine.folder)
    return state.journals.run(files[0], None if isinstance(cell, str) else cell) if files else None


def _volume(request: Request, machine: Machine) -> Any:
    """The largest error of the tool tip, night by night; nights with an alarm as squares."""
    from markupsafe import Markup

    state = state_of(request)
    nights = [n for n in reversed(state.places.nights(machine, 90)) if n.volume_um is not None]
    if len(nights) < 2:
        return ""
    import numpy as np

    k = state.units.per_micron
    x = np.arange(len(nights), dtype=float)
    y = np.array([float(n.volume_um or 0.0) * k for n in nights])
    bad = np.array([LEVELS.get(n.verdict, "stop") != "good" for n in nights])
    series = [
        Series(x, y, "line", BLUE),
        Series(x[~bad], y[~bad], "dots", BLUE),
        Series(x[bad], y[bad], "squares", RED, size=4, tips=tuple(n.night for n in nights if LEVELS.get(n.verdict) != "good")),
    ]
    names = tuple(n.night[5:] for n in nights)
    title = state.texts("web.volume", unit=state.units.small)
    return Markup(chart(series, Frame(860, 200, title, "", state.units.small, names=names, from_zero=True)))


def nights(request: Request) -> Response:
    """request → the list of all nights, a page at a time."""
    needs(request, "view")
    state, found = state_of(request), machine_of(request)
    text = request.query_params.get("page", "0")
    number = int(text) if text.isascii() and text.isdigit() and len(text) < 6 else 0
    every = state.places.nights(found, ANOTHER)
    shown = every[number * PAGE : (number + 1) * PAGE]
    more = (number + 1) * PAGE < len(every)
    return page(request, "nights.html", machine=found, nights=shown, count=len(every), number=number, more=more)


ROUTES = [Route("/machine/{slug}", machine, name="machine"), Route("/machine/{slug}/nights", nights, name="nights")]
