"""Trends of a machine: every parameter by night with its interval, the nights with alarms and decisions marked."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Any

import numpy as np
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...history import Trend
from ...report.charts import trend as drawn
from ...report.compensated import begins, placed
from ...report.course import Jump, by_compensations, by_repairs, course, drift_told, jumps_of
from ...report.days import between
from ...report.page import titled
from ...report.units import shown
from ..app import machine_of, needs, page, state_of
from ..served import Served
from .machine import (
    LAST,
    alarms_by_entry,
    course_of_tip,
    curves,
    day_of,
    events_of,
    happened_to,
    limits_of,
    of_believed,
    simulated,
    unclosed_of,
)

FIRST = 12  # parameters that are drawn when none is chosen
INTERVAL = 1.96


def trends(request: Request) -> Response:
    """request → charts of the chosen parameter, or of those that moved most for their uncertainty."""
    needs(request, "view")
    state, found = state_of(request), machine_of(request)
    wanted = request.query_params.get("parameter", "")
    every = state.places.kept(f"trends {found.slug}", lambda: _all(found), 30)
    if wanted not in every:
        wanted = ""
    names = [wanted] if wanted else list(every)[:FIRST]
    marks = alarms_by_entry(request, found)
    axes = state.places.geometry(found)
    allowed = limits_of(request, found)
    charts, events = [], events_of(state, found)
    for name in names:
        series = every[name]
        factor, unit = state.units.coefficient(series.unit)
        if unit == "µin":  # as the tool tip above: a micro-inch is no size in a shop
            factor, unit = factor * state.units.plain[0] / state.units.per_micron, state.units.plain[1]
        days = _days(series.nights)
        alarm = [entry in marks for entry in series.entries]
        points = {
            "title": titled(name, axes, state.texts),
            "first": date.fromisoformat(series.nights[0]),
            "days": days,
            "limit": allowed[name] * factor / shown(series.unit)[0] if name in allowed else None,
            "value": series.value * factor,
            "half": INTERVAL * series.std * abs(factor),
            "alarm": alarm,
            "x_label": between(series.nights, state.texts),
            "events": placed(events, date.fromisoformat(series.nights[0]), date.fromisoformat(series.nights[-1])),
        }
        sizes = ((880, 340), (360, 300)) if wanted else ((425, 240),)
        said = course(
            points["first"],
            days,
            points["value"],
            series.std * abs(factor),
            jumps_of(marks, series.entries, name, factor, _put_back(request, found, series)),
            points["limit"],
            unit,
            state.texts,
            drift_told(marks, series.entries, series.nights, name),
        )
        said = of_believed(request, found, series.nights[-1], said)
        charts.append((name, [Markup(drawn(points, unit, state.texts, *size)) for size in sizes], said))
    return page(
        request,
        "trend.html",
        machine=found,
        charts=charts,
        names=list(every),
        wanted=wanted,
        course="" if wanted else course_of_tip(request, found),
        curves=None if wanted else curves(request, found),
        **{"simulated": simulated(request, found)} | day_of(request, found),
    )


def _put_back(request: Request, machine: Served, series: Trend) -> list[Jump]:
    """request, machine, a parameter by night → how far repairs of its alarms, and compensations, have moved it."""
    done = unclosed_of(request, machine)[1]
    marks = alarms_by_entry(request, machine)
    known = series.value, series.std
    back = by_repairs(marks, done, series.start_utc, series.name, known)
    return by_compensations(begins(happened_to(state_of(request), machine), series.start_utc), known, back)


def _all(machine: Served) -> Mapping[str, Trend]:
    """→ {parameter: trend}, those that moved most for their uncertainty first."""
    if machine.history is None or machine.name not in machine.history.machines():
        return {}
    history = machine.history
    found = {name: history.trend(machine.name, name) for name in history.parameters(machine.name)}
    found = {name: _last(s) for name, s in found.items() if len(s.value) > 1}
    return dict(sorted(found.items(), key=lambda item: -_moved(item[1])))


def _last(s: Trend) -> Trend:
    n = LAST
    return Trend(s.machine, s.name, s.unit, s.entries[-n:], s.start_utc[-n:], s.nights[-n:], s.value[-n:], s.std[-n:])


def _moved(s: Trend) -> float:
    return float(np.ptp(s.value) / (np.median(s.std) or 1.0))


def _days(nights: tuple[str, ...]) -> Any:
    days = [date.fromisoformat(night) for night in nights]
    return np.array([(day - days[0]).days for day in days], dtype=float)


ROUTES = [Route("/machine/{slug}/trend", trends, name="trend")]
