"""Bodies that stand on a table → facets that are worth touching: spread over every face that a probe can come to.

A box by two corners, an upright cylinder, or the convex hull of a drawing. What the probe reaches at which indexation is for the
candidates to say; here only faces that look down along the spindle are left out, and strips along edges.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..files.checked import FURTHEST, read_bytes, suggestion
from ..records import Array, Artefact, Facet, InputError, Surface

EDGE = 15.0  # mm from every edge
SIDES = 3  # facets along a face, and two rows of them where it is tall enough
AROUND = 8  # facets around a cylinder
DOWN = -0.1  # cosine with the direction up below which a face looks down
FLAT = 1e-6
KINDS = ("box", "cylinder", "table", "mesh")


def of_text(text: str, up: Sequence[float] = (0.0, 0.0, 1.0)) -> Artefact:
    """'box:-200:200,-200:200,-80:0', 'cylinder:250,-80:0', 'table:400,400' → artefact; mm, table frame.

    `table:WIDTH,DEPTH` is a box whose top is at zero and of which the sides are 80 mm deep. `mesh:FILE.stl` is the convex hull of
    a drawing. Raises InputError for anything else.
    """
    kind, _, rest = text.partition(":")
    if kind == "mesh":
        return of_hull(mesh(Path(rest)), up, "proposed facets of the hull of a mesh")
    try:
        numbers = [float(part) for piece in rest.split(",") for part in piece.split(":")]
    except ValueError:
        numbers = []
    count = {"box": 6, "cylinder": 3, "table": 2}.get(kind)
    if count is None or len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(
            f"--facets: found {text!r}; allowed: box:X0:X1,Y0:Y1,Z0:Z1, cylinder:RADIUS,Z0:Z1 or table:WIDTH,DEPTH in mm, "
            f"or mesh:FILE.stl{suggestion(kind, KINDS) if count is None else ''}"
        )
    if kind == "table":
        numbers = [-numbers[0] / 2, numbers[0] / 2, -numbers[1] / 2, numbers[1] / 2, -80.0, 0.0]
    if kind == "cylinder":
        return cylinder(*numbers)
    low, high = np.array(numbers[::2]), np.array(numbers[1::2])
    if not (low < high).all():
        raise InputError(f"--facets: found {text!r}; allowed: spans from the smaller end to the larger one")
    corners = np.array([[(low, high)[i][0], (low, high)[k][1], (low, high)[m][2]] for i in (0, 1) for k in (0, 1) for m in (0, 1)])
    return of_hull(corners, up, "proposed facets of a box")


def mesh(file: Path) -> Array:
    """STL file, text or binary → (v, 3) mm corners of its convex hull that count. Raises InputError for what is no such file."""
    try:
        data = read_bytes(file)
    except InputError as error:
        raise InputError(f"--facets: mesh:{error}") from None
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        kind = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")])
        points = np.frombuffer(data[84:], kind)["corner"].reshape(-1, 3).astype(float)
    else:
        lines = [line.split() for line in data.decode("latin-1").splitlines()]
        try:
            points = np.array([[float(v) for v in words[1:4]] for words in lines if words[:1] == ["vertex"]]).reshape(-1, 3)
        except ValueError:
            points = np.empty((0, 3))
    points = np.unique(points[np.isfinite(points).all(axis=1)], axis=0)
    if len(points) >= 4 and float(np.abs(points).max()) <= FURTHEST:
        with contextlib.suppress(QhullError):  # of points in a plane
            return points[ConvexHull(points).vertices]
    raise InputError(f"--facets: found mesh:{file}, which has no body; allowed: an STL file in mm, text or binary, of a body")


def of_hull(points: Array, up: Sequence[float], name: str = "proposed facets") -> Artefact:
    """(v, 3) mm corners, direction to the spindle → facets spread over every face of their hull that does not look down."""
    hull = ConvexHull(points)
    planes = np.unique(np.round(hull.equations, 6), axis=0)
    facets: dict[str, Facet] = {}
    for plane in planes[np.lexsort(planes.T)]:
        normal = plane[:3]
        if normal @ np.array(up) < DOWN:
            continue
        corners = points[np.abs(points @ normal + plane[3]) < 1e-4 * max(1.0, float(np.abs(points).max()))]
        for place in _spread(corners, normal, np.array(up)):
            number = str(len(facets) + 1)
            facets[number] = Facet(number, _tuple(place), _tuple(normal / np.linalg.norm(normal)))
    if not facets:
        raise InputError(f"{name}: no face is large enough for a facet {EDGE:g} mm from its edges")
    return Artefact(name, facets)


def _spread(corners: Array, normal: Array, up: Array) -> list[Array]:
    """corners of a face → points on it: along it in steps, and in two rows where there is room, none near an edge."""
    along = np.cross(up, normal)
    if np.linalg.norm(along) < FLAT:
        along = np.eye(3)[np.argmin(np.abs(normal))]
    along = along / np.linalg.norm(along)
    across = np.cross(normal, along)
    flat = np.column_stack([corners @ along, corners @ across])
    edges = ConvexHull(flat).equations
    base = float(np.mean(corners @ normal)) * normal
    low, high = flat.min(axis=0) + EDGE, flat.max(axis=0) - EDGE
    rows = [0.5] if high[1] - low[1] < EDGE else [0.15, 0.85] if np.abs(normal @ up) < 0.5 else [0.0, 0.5, 1.0]
    found = []
    for number, part in enumerate(rows):
        for step in np.linspace(0, 1, SIDES):
            place = low + np.array([min(max(step + 0.1 * (number - 0.5), 0.0), 1.0), part]) * (high - low)
            if (edges[:, :2] @ place + edges[:, 2]).max() <= -0.99 * EDGE:
                found.append(base + place[0] * along + place[1] * across)
    return found


def cylinder(radius: float, low: float, high: float) -> Artefact:
    """mm, mm, mm → facets around an upright cylinder about the z axis and on its top."""
    if radius < 2 * EDGE or high - low < 2:
        raise InputError(f"--facets: found radius {radius:g}, {low:g} to {high:g}; allowed: at least {2 * EDGE:g} mm, 2 mm tall")
    facets: dict[str, Facet] = {}
    heights = [high - (high - low) * part for part in (0.3, 0.7)]
    for i in range(AROUND):
        angle = 2 * math.pi * i / AROUND
        normal = (math.cos(angle), math.sin(angle), 0.0)
        number = str(len(facets) + 1)
        point = (radius * normal[0], radius * normal[1], heights[i % 2])
        facets[number] = Facet(number, point, normal, surface=Surface("cylinder", radius, (0.0, 0.0, 1.0)))
    for i in range(AROUND):
        angle, out = 2 * math.pi * (i + 0.5) / AROUND, (radius - EDGE) * (0.5 if i % 2 else 0.95)
        number = str(len(facets) + 1)
        facets[number] = Facet(number, (out * math.cos(angle), out * math.sin(angle), high), (0.0, 0.0, 1.0))
    return Artefact("proposed facets of a cylinder", facets)


def _tuple(place: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 6) + 0.0 for v in place)
    return x, y, z
