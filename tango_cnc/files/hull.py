"""A drawing of what stands on the table → the corners of its convex hull. The only file that knows trimesh (extra `cad`)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..records import Array, InputError, Vector

KINDS = (".stl", ".obj", ".ply")
LARGEST = 20_000.0  # mm: no fixture is larger; a drawing in other units often is
FLAT = 1e-6  # of its size: a thickness below that is none


def read_hull(file: Path, shift: Vector = (0.0, 0.0, 0.0)) -> tuple[Vector, ...]:
    """STL, OBJ or PLY in mm, displacement mm → corners of its convex hull, table frame.

    Raises InputError when there is no such file, it is no drawing of a solid, or trimesh is not installed.
    """
    if file.suffix.lower() not in KINDS:
        raise InputError(
            f"{file}: found a {file.suffix or 'nameless'} file; allowed: {', '.join(KINDS)}. Export the solid as STL, in mm"
        )
    if not file.is_file():
        raise InputError(f"{file}: no such file; its path starts from the folder of artefact.yaml")
    try:
        import trimesh
    except ImportError:
        raise InputError(
            f"{file}: drawings need trimesh, which is not installed: pip install 'tango-cnc[cad]', or use boxes and cylinders"
        ) from None
    try:
        drawing: Any = trimesh.load(str(file), force="mesh", process=False)
        points = np.array(drawing.vertices, dtype=np.float64)
    except Exception as error:  # whatever a reader of foreign files comes upon
        raise InputError(f"{file}: cannot be read as {file.suffix[1:].upper()}: {error}; export it again") from None
    return corners(str(file), points + np.array(shift))


def corners(what: str, points: Array) -> tuple[Vector, ...]:
    """name for complaints, (n, 3) mm → the points that are corners of their convex hull. Raises InputError when it is no solid."""
    if len(points) < 4 or not np.isfinite(points).all():
        raise InputError(
            f"{what}: found {len(points)} points, or some that are not finite; allowed: a solid with four corners or more"
        )
    size = float(np.ptp(points, axis=0).max())
    if not math.isfinite(size) or size > LARGEST:
        raise InputError(f"{what}: found a solid of {size:g} mm; allowed: up to {LARGEST:g} mm. Is the drawing in mm?")
    try:
        hull = ConvexHull(points)
    except QhullError:
        hull = None
    if hull is None or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < FLAT * size:
        raise InputError(f"{what}: found a flat drawing; allowed: a solid, which has some thickness everywhere")
    return tuple((float(x), float(y), float(z)) for x, y, z in points[hull.vertices])
