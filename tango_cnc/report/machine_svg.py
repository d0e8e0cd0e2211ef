"""Cell → a drawing of the machine as SVG: axes with the sense of their own bodies, pivots, stylus, facets with numbers and normals.

Nothing but text is needed to draw it. Whoever looks at it before a measurement sees what a file hides: an axis that goes the other
way, a pivot on the wrong side, a normal that points into the table. The machine stands at its zero pose.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .. import check
from ..records import Array, Artefact, Axis, Machine
from .texts import texts

SIZE, MARGIN, TOP = 520.0, 46.0, 72.0  # px, of a view
INK, SOFT, LINEAR, TURNING, FACET, PALE = "#1f2933", "#5b6770", "#1b6ca8", "#c0392b", "#2e8b57", "#d9dee3"
BESIDE = "#8d6e63"  # what is declared on bodies other than the table
ISO = np.array([[math.cos(math.radians(30)), -math.cos(math.radians(30)), 0.0], [0.5, 0.5, 1.0]])
Place = Callable[[Array], tuple[float, float]]  # mm, machine frame → px
VIEWS: tuple[tuple[str, Array], ...] = (
    ("front", np.array([[1.0, 0, 0], [0, 0, 1.0]])),
    ("right", np.array([[0, 1.0, 0], [0, 0, 1.0]])),
    ("above", np.array([[1.0, 0, 0], [0, 1.0, 0]])),
    ("left", ISO),
)


def drawing(machine: Machine, artefact: Artefact) -> str:
    """machine, artefact → SVG of four views at the zero pose, machine frame, mm."""
    points = _extent(machine, artefact)
    width, height = 2 * SIZE, 2 * SIZE + TOP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}" '
        'font-family="system-ui,Segoe UI,Helvetica,Arial,sans-serif" font-size="11">',
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#fff"/>',
        f'<text x="16" y="26" font-size="18" fill="{INK}">{escape(machine.name)}: {escape(machine.topology)}</text>',
        *(_text(16, 46 + 15 * i, line, SOFT) for i, line in enumerate((texts()("view.axes"), texts()("view.colors")))),
    ]
    for i, (side, view) in enumerate(VIEWS):
        title = texts()(f"view.{side}")
        parts.append(_view(machine, artefact, points, title, view, (i % 2) * SIZE, TOP + (i // 2) * SIZE))
    return "\n".join([*parts, "</svg>"]) + "\n"


def _extent(machine: Machine, artefact: Artefact) -> Array:
    solid = check.solid(artefact)
    own = [np.array(a.point) for a in machine.axes if a.kind != "linear"]
    beside = [check.body_of(obstacle).corner for obstacle in machine.obstacles]
    some = np.array([*own, _tip(machine), np.zeros(3)])
    return np.vstack([*solid.corners, *beside, some, [f.point for f in artefact.facets.values()]])


def _tip(machine: Machine) -> Array:
    return np.array(machine.spindle.point) - machine.probe.length * np.array(machine.spindle.direction)


def _view(machine: Machine, artefact: Artefact, points: Array, title: str, view: Array, left: float, top: float) -> str:
    flat = points @ view.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    span = max(float((high - low).max()), 1.0)
    scale = (SIZE - 2 * MARGIN) / (1.25 * span)
    middle = (low + high) / 2

    def at(p: Array) -> tuple[float, float]:
        x, y = (view @ np.asarray(p) - middle).tolist()
        return left + SIZE / 2 + scale * x, top + SIZE / 2 - scale * y

    out = [
        f'<rect x="{left + 4:.0f}" y="{top + 4:.0f}" width="{SIZE - 8:.0f}" height="{SIZE - 8:.0f}" fill="none" stroke="{PALE}"/>',
        f'<text x="{left + 14:.0f}" y="{top + 22:.0f}" fill="{SOFT}">{title}</text>',
    ]
    for corners in check.solid(artefact).corners:
        out.append(_outline(np.array([at(c) for c in corners])))
    for obstacle in machine.obstacles:  # where it stands with all axes at zero, and the body it moves with
        places = np.array([at(c) for c in check.body_of(obstacle).corner])
        out.append(_outline(places, BESIDE))
    for number, obstacle in enumerate(machine.obstacles, 1):
        places = np.array([at(c) for c in check.body_of(obstacle).corner])
        x, y = places.mean(axis=0).tolist()
        out.append(_text(x, y, f"{obstacle.title or obstacle.file or number} ({obstacle.on})", BESIDE))
    size = 0.16 * span
    for facet in artefact.facets.values():
        begin, end = np.array(facet.point), np.array(facet.point) + 0.35 * size * np.array(facet.normal)
        out.append(_arrow(at(begin), at(end), FACET, 1.2))
        x, y = at(begin + 0.5 * size * np.array(facet.normal))
        out.append(_text(x, y, facet.id, FACET))
    tip, nose = at(_tip(machine)), at(np.array(machine.spindle.point))
    out.append(f'<line x1="{nose[0]:.1f}" y1="{nose[1]:.1f}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}" stroke="{INK}" stroke-width="2"/>')
    out.append(f'<circle cx="{tip[0]:.1f}" cy="{tip[1]:.1f}" r="{max(scale * machine.probe.tip_radius, 2.5):.1f}" fill="{INK}"/>')
    out.append(_text(tip[0] + 8, tip[1], "tip", INK))
    origin = np.array([left + 64, top + SIZE - 40])  # linear axes stand beside the picture, where nothing hides them
    out += [_linear(machine.axis(name), _side(machine, name), origin, view) for name in machine.linear]
    for axis in machine.axes:
        if axis.kind != "linear":
            out.append(_rotary(axis, at, size))
    return "\n".join(part for part in out if part)


def _side(machine: Machine, name: str) -> str:
    return "table" if name in machine.workpiece_branch else "spindle"


def _linear(axis: Axis, side: str, origin: Array, view: Array) -> str:
    flat = view @ np.array(axis.direction)
    if np.linalg.norm(flat) < 0.2:
        return ""
    end = origin + 34 * np.array([flat[0], -flat[1]])
    where = end + np.array([5.0, -4.0 if flat[1] >= 0 else 12.0])
    return _arrow(origin.tolist(), end.tolist(), LINEAR, 2.0) + _text(where[0], where[1], f"+{axis.name} {side}", LINEAR)


def _rotary(axis: Axis, at: Place, size: float) -> str:
    d, point = np.array(axis.direction), np.array(axis.point)
    across = np.cross(d, np.eye(3)[int(np.argmin(np.abs(d)))])
    across /= np.linalg.norm(across)
    other = np.cross(d, across)
    colour = TURNING if axis.kind == "rotary" else SOFT
    radius = size * (0.9 if axis.kind == "rotary" else 0.5)
    angles = np.radians(np.arange(0, 271, 10))
    ring = [at(point + radius * (math.cos(a) * across + math.sin(a) * other)) for a in angles]
    one, two = at(point - 1.6 * radius * d), at(point + 1.6 * radius * d)
    x, y = at(point)
    coordinates = ", ".join(f"{c:g}" for c in axis.point)
    return (
        f'<line x1="{one[0]:.1f}" y1="{one[1]:.1f}" x2="{two[0]:.1f}" y2="{two[1]:.1f}" stroke="{colour}" stroke-dasharray="6 3"/>'
        f'<polyline points="{_points(ring[:-1])}" fill="none" stroke="{colour}" stroke-width="1.6"/>'
        + _arrow(ring[-2], ring[-1], colour, 1.6)
        + f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>'
        + _text(two[0] + 6, two[1] + (14 if axis.kind == "spindle" else -4), f"+{axis.name} [{coordinates}]", colour)
    )


def _outline(corners: Array, colour: str = SOFT) -> str:
    try:
        around = corners[ConvexHull(corners).vertices]
    except QhullError:  # seen edge on
        return ""
    return f'<polygon points="{_points(around.tolist())}" fill="#eef1f4" stroke="{colour}" stroke-width="0.8" fill-opacity="0.7"/>'


def _points(places: Sequence[Sequence[float]]) -> str:
    return " ".join(f"{p[0]:.1f},{p[1]:.1f}" for p in places)


def _arrow(begin: Sequence[float], end: Sequence[float], colour: str, width: float) -> str:
    a, b = np.array(begin, dtype=float), np.array(end, dtype=float)
    length = float(np.linalg.norm(b - a))
    if length < 1.0:  # towards the eye or away from it
        return f'<circle cx="{a[0]:.1f}" cy="{a[1]:.1f}" r="2.2" fill="none" stroke="{colour}"/>'
    along = (b - a) / length
    side = np.array([-along[1], along[0]])
    head = min(7.0, 0.8 * length)
    wings = [b, b - head * along + 0.4 * head * side, b - head * along - 0.4 * head * side]
    return (
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="{colour}" stroke-width="{width}"/>'
        f'<polygon points="{_points([w.tolist() for w in wings])}" fill="{colour}"/>'
    )


def _text(x: float, y: float, text: str, colour: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}">{escape(text)}</text>'
