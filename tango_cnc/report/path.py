"""Plan → picture of the way of the stylus tip, seen from the table: what stands there, and every move coloured by its kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from .. import check, kinematics
from ..check.bodies import seen
from ..plan.sweep import swept
from ..records import Array, Facet, InputError, Machine, Move, Plan, Touch
from .pictures import BAD, GOOD, INK, MARK, PALE, figure, styled
from .texts import texts

KINDS = {  # what is drawn, its colour and width; later ones lie on top
    "turn": (PALE, 0.7),
    "travel": (GOOD, 0.9),
    "clear": (MARK, 0.9),
    "down": ("#2e8b57", 1.0),
    "probe": (BAD, 2.2),
}
STEP = math.radians(4)  # between the poses of a turn that are drawn
NAMES = 60  # facets that are named; more are a heap of numbers
FACET = 6.0  # mm, half the side of the square that stands for a facet


def picture(plan: Plan, indexation: int | None = None) -> Any:
    """plan, one of its indexations (from 1) or all → figure. Raises InputError for one that is not there, or no matplotlib."""
    count = len(plan.strategy.indexations)
    if indexation is not None and not 1 <= indexation <= count:
        raise InputError(f"--indexation: found {indexation}; allowed: 1 … {count} of this strategy")
    drawn = figure(11, 8.5)
    with styled():
        axes = drawn.add_subplot(projection="3d", computed_zorder=False)
        touched = [t for t in plan.touches if indexation is None or t.indexation == indexation - 1]
        if not touched:
            raise InputError(f"--indexation: no touch of indexation {indexation} is in the plan")
        solid = check.solid(plan.artefact)
        _bodies(axes, solid, plan)
        beside = _beside(axes, plan, touched[0])
        names = {t.facet for t in touched}
        _facets(axes, [plan.artefact.facets[f] for f in plan.artefact.facets if f in names])
        places = _path(axes, plan, {t.number for t in touched})
        if indexation is not None:
            places = np.vstack([places, _tool(axes, plan, touched[0])])
        else:
            places = np.vstack([places, _sphere(axes, plan, solid)])
        _frame(axes, np.vstack([places, *solid.corners, *beside]))
        axes.set_title(_title(plan, indexation, len(touched)), loc="left", color=INK)
        axes.legend(loc="upper left", fontsize=8)
    return drawn


def _title(plan: Plan, indexation: int | None, count: int) -> str:
    where = texts()("way.every", count=len(plan.turns) - 1)
    if indexation is not None:
        position = plan.strategy.indexations[indexation - 1].position
        angles = " ".join(f"{n}{math.degrees(position.get(n, 0.0)):g}" for n in (*plan.machine.rotary, "S"))
        where = texts()("way.one", number=indexation, angles=angles)
    return texts()("way.title", machine=plan.machine.name, artefact=plan.artefact.name, count=count, where=where)


def _bodies(axes: Any, solid: check.Solid, plan: Plan) -> None:
    bodies = [(solid.table.normal, solid.table.offset, PALE, texts()("way.table"))] if solid.table is not None else []
    bodies += [(o.normal, o.offset, "#8d6e63", texts()("way.obstacle") if i == 0 else "") for i, o in enumerate(solid.obstacles)]
    from scipy.spatial import HalfspaceIntersection

    for normal, offset, colour, label in bodies:
        inside = _inside(normal, offset)
        if inside is None:
            continue
        corner = HalfspaceIntersection(np.column_stack([normal, -offset]), inside).intersections
        _solid(axes, corner, colour, label)
    across = np.linspace(0, 2 * np.pi, 24)
    for name, centre, radius in zip(plan.artefact.balls, solid.centre, solid.radius, strict=True):
        axes.text(*(centre - [0, 0, radius + 12]), f"ball {name}", fontsize=7, color=INK, ha="center", va="center", zorder=9)
        for ring in ((np.cos(across), np.sin(across), 0 * across), (np.cos(across), 0 * across, np.sin(across))):
            axes.plot(*(centre[:, None] + radius * np.array(ring)), color=INK, linewidth=0.6, zorder=2)


def _solid(axes: Any, corner: Array, colour: str, label: str) -> None:
    """(v, 3) mm corners of a convex body, its colour, what the legend calls it → it is drawn."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    hull = ConvexHull(corner)
    faces = []
    for plane in np.unique(np.round(hull.equations, 6), axis=0):
        on = corner[hull.vertices][np.abs(corner[hull.vertices] @ plane[:3] + plane[3]) < 1e-3]
        faces.append(_around(on, plane[:3]))
    axes.add_collection3d(Poly3DCollection(faces, facecolors=f"{colour}30", edgecolors=colour, linewidths=0.8, zorder=1))
    if label:
        axes.plot([], [], color=colour, linewidth=5, alpha=0.5, label=label)


def _beside(axes: Any, plan: Plan, touch: Touch) -> list[Array]:
    """What is declared on other bodies of the machine, where the table sees it at a touch: → their corners, (v, 3) mm each."""
    found = []
    for number, obstacle in enumerate(plan.machine.obstacles):
        corner = seen(plan.machine, obstacle, np.array([touch.standoff]))
        _solid(axes, corner, "#7b5ea7", texts()("way.beside") if number == 0 else "")
        axes.text(
            *corner.mean(axis=0), obstacle.title or f"{number + 1} ({obstacle.on})", fontsize=7, color=INK, ha="center", zorder=9
        )
        found.append(corner)
    return found


def _inside(normal: Array, offset: Array) -> Array | None:
    """→ (3,) the point farthest within; None for a body without an inside."""
    from scipy.optimize import linprog

    found = linprog([0, 0, 0, -1], np.column_stack([normal, np.ones(len(normal))]), offset, bounds=(None, None))
    return found.x[:3] if found.status == 0 and found.x[3] > 1e-6 else None


def _around(points: Array, normal: Array) -> Array:
    """corners of a face → the same in their order around it."""
    one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    away = points - points.mean(axis=0)
    return np.asarray(points[np.argsort(np.arctan2(away @ np.cross(normal, one), away @ one))])


def _facets(axes: Any, facets: Sequence[Facet]) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    squares = []
    for facet in facets:
        point, normal = np.array(facet.point), np.array(facet.normal)
        one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        one *= FACET / np.linalg.norm(one)
        two = np.cross(normal, one)
        if facet.ball is None:
            squares.append([point + i * one + j * two for i, j in ((1, 1), (1, -1), (-1, -1), (-1, 1))])
        if len(facets) <= NAMES and facet.ball is None:
            axes.text(*(point - 14 * normal), facet.id, fontsize=7, color=INK, ha="center", va="center", zorder=9)
    if squares:
        axes.add_collection3d(Poly3DCollection(squares, facecolors=INK, edgecolors=INK, linewidths=0.5, alpha=0.75, zorder=3))


def _path(axes: Any, plan: Plan, wanted: set[int]) -> Array:
    """→ (n, 3) mm, all places of the tip that are drawn."""
    chain, machine = kinematics.chain(plan.machine), plan.machine
    touches = {t.number: t for t in plan.touches}
    at: dict[str, float] = {}
    lines: dict[str, list[Array]] = {kind: [] for kind in KINDS}
    for move in plan.moves:
        before = dict(at)
        at.update(move.target)
        if len(before) < len(machine.names):
            continue
        start, end = (np.array([place[n] for n in machine.names]) for place in (before, at))
        if move.kind in ("find", "probe"):
            end = np.array(touches[move.touch].contact)
        if move.touch in wanted:
            steps = 1 + int(np.abs(end - start)[[a.kind != "linear" for a in machine.axes]].max() / STEP)
            way = start + np.linspace(0, 1, steps + 1)[:, None] * (end - start)
            lines[_kind(move, touches[move.touch], machine)].append(kinematics.tip(chain, way))
    for order, (kind, (colour, width)) in enumerate(KINDS.items()):
        if lines[kind]:
            joined = np.vstack([np.vstack([line, np.full((1, 3), np.nan)]) for line in lines[kind]])
            axes.plot(*joined.T, color=colour, linewidth=width, label=texts()(f"way.{kind}"), zorder=4 + order)
    return np.vstack([line for found in lines.values() for line in found])


def _kind(move: Move, touch: Touch, machine: Machine) -> str:
    if move.kind in ("index", "find", "probe"):
        return "turn" if move.kind == "index" else "probe"
    columns = {n: machine.column(n) for n in move.target}

    def leads_to(place: tuple[float, ...] | None) -> bool:
        return place is not None and place != touch.over and all(place[columns[n]] == v for n, v in move.target.items())

    if move.kind == "clear":
        return "travel" if leads_to(touch.enter) else "clear"
    return "down" if move.kind in ("approach", "off", "near", "back") or leads_to(touch.leave) else "clear"


def _sphere(axes: Any, plan: Plan, solid: check.Solid) -> Array:
    """→ (n, 3) mm of its outline; none when nothing under the table turns."""
    found = swept(plan.machine, solid)
    if found is None:
        return np.zeros((0, 3))
    centre, radius = found
    angle = np.linspace(0, 2 * np.pi, 73)
    rings = [np.zeros((3, 73)) for _ in range(3)]
    for i, ring in enumerate(rings):
        ring[i], ring[(i + 1) % 3] = np.cos(angle), np.sin(angle)
        label = texts()("way.swept", radius=f"{radius:.0f}") if i == 0 else None
        axes.plot(*(centre[:, None] + radius * ring), color=INK, linewidth=0.6, linestyle=":", label=label, zorder=2)
    return np.asarray(np.hstack([centre[:, None] + radius * ring for ring in rings]).T)


def _tool(axes: Any, plan: Plan, touch: Touch) -> Array:
    """An arrow above the first touch towards the spindle: → (2, 3) mm, its ends."""
    chain, place = kinematics.chain(plan.machine), np.array([touch.over])
    start, spindle = kinematics.tip(chain, place)[0], kinematics.spindle_axis(chain, place)[0]
    end = start + 80 * spindle
    axes.quiver(*start, *(80 * spindle), color=INK, linewidth=1.2, arrow_length_ratio=0.2, zorder=9)
    axes.text(*(end + 12 * spindle), texts()("way.spindle"), fontsize=8, color=INK, ha="center", zorder=9)
    return np.vstack([start, end])


def _frame(axes: Any, places: Array) -> None:
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="X mm", ylabel="Y mm", zlabel="Z mm")
    axes.set_box_aspect(np.maximum(high - low, 1.0))
    axes.view_init(elev=24, azim=-58)
