"""A run: live while it goes on, from its journal; progress, deviations, drift, and what is still to come."""

from __future__ import annotations

import hashlib
import math
import time
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup, escape
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ...link.entries import Reading
from ...link.progress import journals
from ...records import Cell
from ...report.days import at
from ...report.plain import office, shop, to_type
from ...report.svg import BLUE, GOOD, GREEN, INK, LINE, RED, SOFT, Canvas, Plotted, chart, label
from ...report.texts import Texts
from ...texts.handed import page_of_cell
from ..app import cell_of, machine_of, made, needs, page, state_of
from ..live import LiveRun, broken, called, quiet, title, touched_by
from ..served import Served
from .machine import answer_today, todo_today, who_today

STEP = 2.0  # s that a finished step is kept for all who follow it
LATEST = 8
APART = (30.0, 36.0)  # px between facets of the map, across and down: a square with a name above it
MANY = 100  # facets, more than which the map has no room for
MAP = (420.0, 400.0)  # px, how wide and high it is
SQUARE = 22.0  # px
WIDE, NARROW = 860.0, 360.0  # px of a chart on a desk and on a phone


def run(request: Request) -> Response:
    """request → the page of a run: the present one, or the one whose number is asked for."""
    needs(request, "view")
    found, chosen, cell = _chosen(request)
    state = state_of(request)
    listed = []
    for i, file in enumerate(journals(found.folder) if found.folder else ()):
        listed.append((i, called(file)))
    step = _step(request, found, chosen, cell) if chosen else ""
    return page(
        request,
        "run.html",
        machine=found,
        run=chosen,
        simulated=chosen is not None and chosen.simulated,
        today=answer_today(request, found),
        step=Markup(step),
        mark=_mark(chosen),
        follow=_follow(request, found, chosen),
        listed=listed,
        heading=title(chosen, state.texts) if chosen else "",
        **who_today(request, found),
        texts=state.texts,
    )


async def step(request: Request) -> Response:
    """request → what changes on that page, for those who follow it; 304 where nothing has."""
    needs(request, "view")
    asked = (request.path_params["slug"], request.query_params.get("run", "0"))
    tag, state, mark, text = await state_of(request).looks.at(asked, lambda: _seen(request))
    clock = quote(state_of(request).texts("web.made", time=made(state_of(request).texts)))
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers={"etag": tag, "cache-control": "no-cache", "x-made": clock})
    kept = "no-store" if state == "none" else "no-cache"
    headers = {"etag": tag, "cache-control": kept, "x-run-state": state, "x-run": mark, "x-made": clock}
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)


def _seen(request: Request) -> tuple[str, str, str, str]:
    """request → tag, state, mark and drawing of its run as it is now; the state none where there is no run yet."""
    found, chosen, cell = _chosen(request)
    if chosen is None:
        return '"none"', "none", "", str(escape(state_of(request).texts("web.no_run")))
    tag = f'"{_mark(chosen)}-{chosen.version}-{chosen.state}-{quiet(chosen, time.time()) or 0}-{int(broken(chosen))}"'
    return tag, chosen.state, _mark(chosen), _step(request, found, chosen, cell)


def _mark(run: LiveRun | None) -> str:
    """run or None → what tells it from another run: a page that follows one loads itself again when another begins."""
    return "" if run is None else hashlib.sha256(run.started.encode()).hexdigest()[:12]


def _follow(request: Request, machine: Served, run: LiveRun | None) -> str:
    """request, machine, its run → the address that its page follows; '' for a run of before that is complete."""
    present = request.query_params.get("run", "0") == "0" and machine.folder is not None
    going = run is not None and run.state != "complete"
    return f"/machine/{machine.slug}/run/step" if present or going else ""


def _chosen(request: Request) -> tuple[Served, LiveRun | None, Cell | None]:
    found, state = machine_of(request), state_of(request)
    if found.folder is None:
        return found, None, None
    files = journals(found.folder)
    text = request.query_params.get("run", "0")
    if not (text.isascii() and text.isdigit() and len(text) < 6):
        raise HTTPException(404)
    if not files:
        return found, None, None
    if int(text) >= len(files):
        raise HTTPException(404)
    cell = state.places.cell(found.folder)
    usable = touched_by(files[int(text)], cell)
    return found, state.journals.run(files[int(text)], usable), usable


def _step(request: Request, machine: Served, run: LiveRun, cell: Cell | None) -> str:
    state, silent = state_of(request), quiet(run, time.time())
    off = broken(run)
    key = f"step {machine.slug} {run.file.name} {run.version} {run.state} {silent} {off}"
    present = request.query_params.get("run", "0") == "0"
    todo = todo_today(request, machine) if present and (off or run.state == "stopped") else []
    return state.places.kept(f"{key} {todo}", lambda: _drawn(request, cell_of(machine), run, cell, silent, todo), 60)


def _drawn(request: Request, folder: str, run: LiveRun, cell: Cell | None, silent: int | None, todo: Sequence[str]) -> str:
    """request, name of the folder of the machine, run, its cell, minutes since its last entry, what to do by the page of its
    machine → its drawing.
    """
    state, off = state_of(request), broken(run)
    t, k, unit = state.texts, state.units.per_micron, state.units.small
    values: dict[str, Any] = {
        "t": t,
        "run": run,
        "silent": silent,
        "off": off,
        "state": ("broken" if run.state == "running" else "given_up") if off else "silent" if silent else run.state,
        "since": at(datetime.fromtimestamp(run.touched, UTC).isoformat(), t),
        "done": len(run.readings),
        "left": "" if not run.remaining or silent else t("web.left", minutes=max(1, math.ceil(run.remaining / 60))),
        "deviations": [Markup(_deviations(run, t, unit, k, wide)) for wide in (WIDE, NARROW)] if run.readings else [],
        "drift": [Markup(_drift(run, t("web.drift"), unit, k, wide)) for wide in (WIDE, NARROW)],
        "map": Markup(_map(run, cell, t("web.map"))) if cell is not None else "",
        "latest": [_row(e, k) for e in run.readings[-LATEST:][::-1]],
        "unit": unit,
        "shop": lambda text: shop(str(text), t),
        "office": to_type(_office(run, t, off), folder, t),
        "resume": _resume(run, t) if off or run.state == "stopped" else "",
        "todo": todo,
    }
    return page_of_cell(state.templates.get_template("_step.html").render(**values), folder)


def _resume(run: LiveRun, t: Texts) -> str:
    return t("web.resume", more="" if run.head is None else run.head.how.removeprefix("--resume"))


def _office(run: LiveRun, t: Texts, off: bool) -> list[str]:
    """run, texts, whether it broke off → what the office can do at a computer once it has ended."""
    if off:
        return [office(_resume(run, t), t)]
    told = {"stopped": [str(run.why), _resume(run, t)], "complete": [t("web.to_report")]}.get(run.state, [])
    return list(dict.fromkeys(line for text in told if (line := office(text, t))))


def _row(e: Reading, k: float) -> dict[str, Any]:
    return {
        "touch": e.touch,
        "facet": e.facet,
        "status": e.status,
        "deviation": "–" if e.deviation_um is None else f"{e.deviation_um * k:+.1f}".replace("-", "−"),
        "drift": "" if e.drift_um is None else f"{e.drift_um * k:+.1f}".replace("-", "−"),
    }


def _deviations(run: LiveRun, t: Texts, unit: str, k: float, wide: float) -> str:
    good = [(e.touch, e.deviation_um * k) for e in run.readings if e.status == "ok" and e.deviation_um is not None]
    bad = [e.touch for e in run.readings if e.status != "ok"]
    x, y = (np.array(v, dtype=float) for v in (zip(*good, strict=True) if good else ((), ())))
    most = max(run.head.touches if run.head is not None else (), default=1)
    level = float(np.median(y)) if len(y) else 0.0
    crosses = Plotted(np.array(bad, dtype=float), np.full(len(bad), level), "crosses", RED, t("web.no_contact"), size=4)
    dots = Plotted(x, y, "dots", BLUE, t("web.contact") if bad else "", size=2.2)
    series = [s for s in (dots, crosses) if len(s.x)]
    return chart(series, Canvas(wide, 230, t("web.deviation"), t("table.touch"), unit, x_range=(0.0, float(most) + 1)))


def _drift(run: LiveRun, heading: str, unit: str, k: float, wide: float) -> str:
    rows = [(e.time_s / 60, e.drift_um * k) for e in run.readings if e.drift_um is not None]
    if not rows:
        return ""
    x, y = (np.array(v, dtype=float) for v in zip(*rows, strict=True))
    return chart([Plotted(x, y, "squares", GREEN, size=2.6)], Canvas(wide, 190, heading, "min", unit))


def _map(run: LiveRun, cell: Cell, heading: str) -> str:
    """Facets from above, each below its name; those on top of each other are moved apart, and a line leads to where each is."""
    made = Counter(e.facet for e in run.readings)
    facets = [f for f in cell.artefact.facets.values() if f.id in made or f.id in run.left]
    if not facets:
        return ""
    points = np.array([f.point for f in facets])
    low, high = points.min(axis=0), points.max(axis=0)
    span = max(float((high - low)[:2].max()), 1.0)
    wide, high_px = MAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:g} {high_px:g}" width="{wide:g}" height="{high_px:g}" '
        f'role="img" aria-label="{escape(heading)}" font-family="sans-serif" font-size="12">'
    ]
    scaled = (points - (low + high) / 2)[:, :2] / span * (np.array(MAP) - 60) * (1, -1)
    own = tuple((float(x), float(y)) for x, y in np.array(MAP) / 2 + scaled)
    squares = apart(own)
    for (a, b), (x, y) in zip(own, squares, strict=True):
        if math.hypot(x - a, y - b) > SQUARE / 2:
            parts.append(f'<path d="M{a:.1f} {b:.1f}L{x:.1f} {y:.1f}" stroke="{SOFT}"/><circle cx="{a:.1f}" cy="{b:.1f}" r="2"/>')
    for f, (x, y) in zip(facets, squares, strict=True):
        left = run.left.get(f.id, 0)
        share = made[str(f.id)] / (made[str(f.id)] + left) if made[str(f.id)] + left else 0.0
        ink = "#fff" if not left else INK
        stroke = f'stroke="{SOFT}" stroke-dasharray="3 2"' if left else f'stroke="{LINE}"'
        tip = f"<title>{escape(str(f.id))}: {left}</title>"
        corner = f'x="{x - SQUARE / 2:.1f}" width="{SQUARE:g}"'
        parts.append(f'<g>{tip}<rect {corner} y="{y - SQUARE / 2:.1f}" height="{SQUARE:g}" fill="#fff" {stroke}/>')
        full = GOOD if not left else "#9fd0bf"
        top, high = y + SQUARE * (0.5 - share), SQUARE * share
        parts.append(f'<rect {corner} y="{top:.1f}" height="{high:.1f}" fill="{full}"/>')
        name = f'<text x="{x:.1f}" y="{y - SQUARE / 2 - 3:.1f}" text-anchor="middle" font-size="11" fill="{SOFT}">'
        name += f"{escape(str(f.id)[:6])}</text>"
        parts.append(f'{name}<text x="{x:.1f}" y="{y + 4.4:.1f}" text-anchor="middle" fill="{ink}">{left or "✓"}</text></g>')
    axes = ((wide - 4, high_px - 4, "end", "X →"), (4, 12, "start", "Y ↑"))
    parts += [label(x, y, name, anchor) for x, y, anchor, name in axes]
    return "".join([*parts, "</svg>"])


@lru_cache(64)
def apart(places: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """(x, y) of facets on the map, px → (x, y) of their squares: as near to them as there is room without covering another one.

    Of too many they are the same.
    """
    if len(places) > MANY:
        return places
    far, turn = np.meshgrid(np.arange(0.0, 420.0, 10.0), np.arange(16) * math.pi / 8, indexing="ij")
    ways = np.stack([far * np.cos(turn), far * np.sin(turn)], axis=-1).reshape(-1, 2)
    taken = np.empty((0, 2))
    for own in places:
        at = own + ways
        free = np.all((at >= (14, 26)) & (at <= np.array(MAP) - (14, 16)), axis=1)
        beside = np.abs(at[:, None] - taken) >= np.array(APART)
        free &= np.all(np.any(beside, axis=2), axis=1)
        nearest = at[np.argmax(free)] if free.any() else np.array(own)  # more facets than there is room for
        taken = np.vstack([taken, nearest])
    return tuple((float(x), float(y)) for x, y in taken)


ROUTES = [Route("/machine/{slug}/run", run, name="run"), Route("/machine/{slug}/run/step", step, name="step")]
