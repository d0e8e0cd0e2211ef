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
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ..files.checked import FURTHEST, read_bytes, suggestion
from ..records import Array, Artefact, Facet, InputError, Surface

EDGE = 15.0  # mm from every edge
SIDES = 3  # facets along a face, and two rows of them where it is tall enough
FINE = 41  # places along and across a face of any shape, of which those far apart are taken
TABLE = 2 * EDGE + 2  # mm, the smallest table
AROUND = 8  # facets around a cylinder
DOWN = -0.1  # cosine with the direction up below which a face looks down
FLAT = 1e-6
ROUNDED = 1e-4  # of the largest coordinate, at least 1 mm: as far corners of one face may be out of its plane
LAST = 400  # bytes of a text STL within which it ends
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
    if max(map(abs, numbers)) > FURTHEST:
        raise InputError(f"--facets: found {text!r}; allowed: no more than {FURTHEST:g} mm")
    if kind == "table":
        if min(numbers) < TABLE:
            raise InputError(f"--facets: found {text!r}; allowed: a WIDTH and a DEPTH of at least {TABLE:g} mm each")
        numbers = [-numbers[0] / 2, numbers[0] / 2, -numbers[1] / 2, numbers[1] / 2, -80.0, 0.0]
    if kind == "cylinder":
        return cylinder(*numbers)
    low, high = np.array(numbers[::2]), np.array(numbers[1::2])
    if not (low < high).all():
        raise InputError(f"--facets: found {text!r}; allowed: spans from the smaller end to the larger one, in each of X, Y, Z")
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
        if data.lstrip()[:5] == b"solid" and b"endsolid" not in data[-LAST:]:
            raise InputError(
                f"--facets: found mesh:{file}, which is cut off: its last line is no endsolid; allowed: a whole STL file"
            )
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
    facets: dict[str, Facet] = {}
    for normal, corners in faces(points):
        if normal @ np.array(up) < DOWN:
            continue
        for place in _spread(corners, normal, np.array(up)):
            number = str(len(facets) + 1)
            facets[number] = Facet(number, _tuple(place), _tuple(normal / np.linalg.norm(normal)))
    if not facets:
        raise InputError(
            f"--facets: found {name} with no face that has room for a facet {EDGE:g} mm from its edges; allowed: a larger body"
        )
    return Artefact(name, facets)


def faces(points: Array) -> list[tuple[Array, Array]]:
    """(v, 3) mm corners of a body → the faces of its hull: outward normal, (k, 3) mm corners.

    A hull is of triangles. Those of one face are put together although a drawing rounds its corners, the largest one says which
    way the face looks.
    """
    hull = ConvexHull(points)
    near = ROUNDED * max(1.0, float(np.abs(points).max()))
    sides = np.diff(points[hull.simplices], axis=1)
    left = list(np.argsort(-np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1), kind="stable"))
    found = []
    while left:
        plane = hull.equations[left[0]]
        off = np.abs(points @ plane[:3] + plane[3])
        found.append((np.round(plane, 6), points[off < near]))
        left = [i for i in left[1:] if off[hull.simplices[i]].max() >= near or hull.equations[i, :3] @ plane[:3] < 0]
    found.sort(key=lambda face: tuple(face[0][::-1]))
    return [(plane[:3], corners) for plane, corners in found]


def _spread(corners: Array, normal: Array, up: Array) -> list[Array]:
    """corners of a face → points on it: along it in steps, and in two rows where there is room, none near an edge.

    Where a face has no room at the corners of such a grid, as many points stand as far from each other as it allows.
    """
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
    steps = [(min(max(step + 0.1 * (n - 0.5), 0.0), 1.0), part) for n, part in enumerate(rows) for step in np.linspace(0, 1, SIDES)]
    places = low + np.array(steps) * (high - low)
    if not _inside(places, edges).all():
        places = _far_apart(edges, low, high, len(steps))
    return [base + x * along + y * across for x, y in places]


def _inside(places: Array, edges: Array) -> NDArray[np.bool_]:
    """(n, 2) mm places, edges of a face → (n,) whether each is `EDGE` from all of them."""
    return np.asarray((places @ edges[:, :2].T + edges[:, 2]).max(axis=1) <= -0.99 * EDGE)


def _far_apart(edges: Array, low: Array, high: Array, most: int) -> Array:
    """edges of a face, (2,) mm its ends, number → (n, 2) mm places as far apart as it has room, none nearer than `EDGE`."""
    if not (low <= high).all():
        return np.empty((0, 2))
    x, y = (np.linspace(a, b, FINE) for a, b in zip(low, high, strict=True))
    free = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    free = free[_inside(free, edges)]
    chosen: list[Array] = []
    distance = np.linalg.norm(free - free.mean(axis=0), axis=1) if len(free) else np.empty(0)
    while len(chosen) < most and len(free) and (not chosen or float(distance.max()) >= EDGE):
        chosen.append(free[int(np.argmax(distance))])
        from_it = np.linalg.norm(free - chosen[-1], axis=1)
        distance = from_it if len(chosen) == 1 else np.minimum(distance, from_it)
    return np.array(chosen).reshape(-1, 2)


def cylinder(radius: float, low: float, high: float) -> Artefact:
    """mm, mm, mm → facets around an upright cylinder about the z axis and on its top."""
    if not low < high:
        raise InputError(f"--facets: found Z from {low:g} to {high:g}; allowed: from the smaller end to the larger one")
    if radius < 2 * EDGE or high - low < 2:
        raise InputError(
            f"--facets: found radius {radius:g} mm, {high - low:g} mm tall; allowed: a radius of at least {2 * EDGE:g} mm, "
            "and at least 2 mm tall"
        )
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
