"""A drawing of what stands on the table → the corners of its convex hull. The only file that knows trimesh (extra `cad`)."""

from __future__ import annotations

import io
import logging
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from ..records import Array, Artefact, InputError, Machine, Vector
from .checked import FURTHEST, printable, read_bytes

KINDS = (".stl", ".obj", ".ply")
LARGEST = 20_000.0  # mm: no fixture is larger; a drawing in other units often is
SMALLEST = 1.0  # mm: nothing that is kept clear of is smaller; a drawing in metres often is
FLAT = 1e-6  # of its size: a thickness below that is none
HEADER, TRIANGLE = 84, 50  # bytes in a binary STL
VERTEX = re.compile(rb"^\s*vertex\s", re.MULTILINE | re.IGNORECASE)
AGAIN = "export it again, as binary STL in mm"


def read_hull(file: Path, shift: Vector = (0.0, 0.0, 0.0), named_in: str = "artefact.yaml") -> tuple[Vector, ...]:
    """STL, OBJ or PLY in mm, displacement mm, file that names it → corners of its convex hull, in the frame of the drawing.

    Raises InputError when there is no such file, it is no whole drawing of a solid, or trimesh is not installed.
    """
    if file.suffix.lower() not in KINDS:
        raise InputError(
            f"{file}: found a {file.suffix or 'nameless'} file; allowed: {', '.join(KINDS)}. Export the solid as STL, in mm"
        )
    if not file.is_file():
        raise InputError(f"{file}: no such file; its path starts from the folder of {named_in}")
    try:
        import trimesh
    except ImportError:
        raise InputError(
            f"{file}: drawings need trimesh, which is not installed: pip install 'tango-cnc[cad]', or use boxes and cylinders"
        ) from None
    data, kind, expected = _plain(file)
    logging.getLogger("trimesh").setLevel(logging.CRITICAL + 1)  # it prints a traceback for what it then reads otherwise
    try:
        drawing: Any = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
        points = np.array(drawing.vertices, dtype=np.float64)
    except Exception as error:  # whatever a reader of foreign files comes upon
        raise InputError(f"{file}: cannot be read as {file.suffix[1:].upper()}: {printable(str(error))}; {AGAIN}") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{file}: found corners that have no X, Y and Z; allowed: a solid; {AGAIN}")
    if expected is not None and 3 * len(drawing.faces) != expected:
        raise InputError(
            f"{file}: found {expected} vertices, of which {3 * len(drawing.faces)} can be read; allowed: a whole ASCII STL, with "
            f"decimal points and no commas. It may be cut off: {AGAIN}"
        )
    return corners(str(file), points + np.array(shift))


def _plain(file: Path) -> tuple[bytes, str, int | None]:
    """drawing → its bytes with nothing beyond UTF-8 in names and remarks, trimesh's word for its kind, how many vertices it states.

    Raises InputError when it cannot be read, or for an STL that is cut off: what is missing of it would be run into.
    """
    data = read_bytes(file)
    kind = file.suffix[1:].lower()
    if kind == "ply":  # a text, then numbers that may be binary
        head, mark, body = data.partition(b"end_header")
        return _text(head) + mark + body, kind, None
    if kind == "obj":
        return _text(data), kind, None
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little") if len(data) >= HEADER else None
    if count is not None and len(data) == HEADER + TRIANGLE * count:
        return data, kind, None  # even if it begins with "solid": many do
    if data.lstrip()[:5].lower() == b"solid" and (vertices := len(VERTEX.findall(data))):
        return _text(data), "stl_ascii", vertices
    what = "" if count is None else f" where its own count of triangles makes {HEADER + TRIANGLE * count}"
    raise InputError(f"{file}: found {len(data)} bytes{what}; allowed: a whole STL. It is cut off or no STL: {AGAIN}")


def _text(data: bytes) -> bytes:
    """Names and remarks may be in any encoding; numbers are the same in all."""
    return data.decode("utf-8", errors="replace").encode("utf-8")


def corners(what: str, points: Array) -> tuple[Vector, ...]:
    """name for complaints, (n, 3) mm → the points that are corners of their convex hull. Raises InputError when it is no solid."""
    if len(points) < 4 or not np.isfinite(points).all():
        raise InputError(
            f"{what}: found {len(points)} points, or some that are not finite; allowed: a solid with four corners or more"
        )
    size = float(np.ptp(points, axis=0).max())
    if not math.isfinite(size) or not SMALLEST <= size <= LARGEST:
        raise InputError(
            f"{what}: found a solid of {size:g} mm; allowed: {SMALLEST:g} mm up to {LARGEST:g} mm. Is the drawing in mm?"
        )
    if (furthest := float(np.abs(points).max())) > FURTHEST:
        raise InputError(f"{what}: found a corner at {furthest:g} mm; allowed: up to {FURTHEST:g} mm from the origin")
    from scipy.spatial import ConvexHull, QhullError  # slow to load, and only obstacles with a mesh need it

    try:
        hull = ConvexHull(points)
    except QhullError:
        hull = None
    if hull is None or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < FLAT * size:
        raise InputError(f"{what}: found a flat drawing; allowed: a solid, which has some thickness everywhere")
    return tuple((float(x), float(y), float(z)) for x, y, z in points[hull.vertices])


def drawn_sizes(machine: Machine, artefact: Artefact) -> list[dict[str, Any]]:
    """machine, artefact → file and size in mm (X, Y, Z) of every drawing, for a person to see whether they are in mm."""
    every = (*artefact.obstacles, *machine.obstacles)
    drawn = [(obstacle.file, np.array(obstacle.points)) for obstacle in every if obstacle.file and obstacle.points]
    return [{"file": file, "size": [round(float(v), 3) for v in np.ptp(points, axis=0)]} for file, points in drawn]


def drawn_lines(sizes: list[dict[str, Any]]) -> list[str]:
    """drawings and their sizes → what a person reads of them, a line each."""
    return [f"drawing {d['file']}: {' × '.join(f'{v:g}' for v in d['size'])} mm" for d in sizes]
