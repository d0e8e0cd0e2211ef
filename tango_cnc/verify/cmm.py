"""The table measured by a CMM against the table as estimated, and against where the model says the tip was (Tables 4-7, 4-8).

A CMM knows the shape of the table and not where it stands on the machine: every comparison removes the rigid displacement
(three translations, three rotations) that fits best, exactly as the thesis does. The table grows between CMM and machine: its
expansion is taken into account where the temperatures are stated, and a scale can be fitted as a seventh number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..files.checked import complaint, read_text, rows_of, suggestion
from ..files.readings import finite
from ..iso230.temperature import Known
from ..model import RADIUS
from ..records import Array, Artefact, Id, InputError, Readings
from ..terms import GAP
from ..touches import from_readings
from ._shared import Figures, acting, figures, tips

FEWEST = 7  # facets: six go into the fit
NOT = Known(0.0, 0.0)
FARTHEST = 5.0  # mm from the nominal facet: more is another frame or another facet


@dataclass(frozen=True)
class Comparison:
    """Residuals of one best fit, mm along the facets' normals, positive = more material or tip farther out than the CMM says."""

    facet: tuple[Id, ...]
    residual: Array  # (n,)
    shift: Array  # (3,) mm, of the CMM's frame to get there
    turn: Array  # (3,) rad
    grown: Known  # mm/mm, by which the CMM's lengths were taken longer, by temperatures; its standard uncertainty
    scale: Known  # mm/mm, beside that: which scale fits best. Taken out when `fitted`
    fitted: bool
    reach: float  # mm, of the facet that feels a scale most

    @property
    def figures(self) -> Figures:
        """→ figures of the residuals."""
        return figures(self.residual)


def read_cmm(file: Path, artefact: Artefact) -> dict[Id, Array]:
    """CSV file → facet id: (3,) mm, measured point, table frame; several rows of one facet are averaged.

    The file has `facet` and either `x,y,z` (mm, a point on the surface, table frame) or `offset` (mm along the nominal
    normal). Raises InputError for anything else.
    """
    rows = rows_of(file, read_text(file).splitlines())
    header = [name.strip() for name in rows[0]] if rows else []
    points = {"x", "y", "z"} <= set(header)
    known = ["facet", "x", "y", "z", "offset"]
    for name in header:
        if name not in known:
            raise complaint(file, 1, "header", f"the unknown column {name!r}", f"{', '.join(known)}.{suggestion(name, known)}")
    if "facet" not in header or points == ("offset" in header):
        found = f"the columns {', '.join(header) or 'none'}"
        raise complaint(file, 1, "header", found, "facet and either x, y, z (mm, table frame) or offset (mm along the normal)")
    found_points: dict[Id, list[Array]] = {}
    for line, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise complaint(file, line, "row", f"{len(row)} values", f"{len(header)}, one for each column")
        cells = dict(zip(header, (cell.strip() for cell in row), strict=True))
        facet = _planar(file, line, cells["facet"], artefact)
        values = [
            finite(file, line, name, cells[name], "a finite number of mm") for name in (("x", "y", "z") if points else ("offset",))
        ]
        nominal, normal = np.array(artefact.facets[facet].point), np.array(artefact.facets[facet].normal)
        point = np.array(values) if points else nominal + values[0] * normal
        if abs(away := float((point - nominal) @ normal)) > FARTHEST:
            raise complaint(
                file,
                line,
                f"facet {facet}",
                f"a point {away:.3f} mm from its nominal plane",
                f"at most {FARTHEST:g} mm: give the points in the table frame (aligned on the CMM to within a few mm)",
            )
        found_points.setdefault(facet, []).append(point)
    if len(found_points) < FEWEST:
        raise complaint(file, None, "facet", f"{len(found_points)} facets", f"{FEWEST} or more, six go into the best fit")
    return {facet: np.mean(measured, axis=0) for facet, measured in found_points.items()}


def _planar(file: Path, line: int, facet: str, artefact: Artefact) -> Id:
    planes = [f.id for f in artefact.facets.values() if f.ball is None]
    if facet not in planes:
        raise complaint(file, line, "facet", repr(facet), f"a facet that is no part of a ball: {', '.join(planes)}")
    return facet


def compare_artefact(result: Estimate, measured: Mapping[Id, Array], grown: Known = NOT, free: bool = False) -> Comparison:
    """estimate, CMM points, growth since (mm/mm), whether a scale is fitted → estimated offsets minus measured ones (Table 4-7).

    Raises InputError when the facets in common do not fix a rigid displacement.
    """
    offsets = result.facets
    facets = [f for f in offsets if f in measured]
    return _compare(result.model.touches.artefact, facets, np.array([offsets[f].value for f in facets]), measured, grown, free)


def compare_tips(
    result: Estimate,
    readings: Readings,
    measured: Mapping[Id, Array],
    rows: NDArray[np.bool_] | None = None,
    grown: Known = NOT,
    free: bool = False,
) -> Comparison:
    """estimate, all readings, CMM points, growth since → where the model puts the tip against the measured facets (Table 4-8).

    Machine, stylus and what acts on the touch are the estimate's, the table is the CMM's. `rows`, a mask of the readings,
    leaves only those (held-out ones, say). Raises InputError as `compare_artefact`.
    """
    own = result.model.touches
    touches = from_readings(own.machine, own.artefact, readings)
    height = np.sum((tips(result, touches) - touches.point) * touches.normal, axis=1) - touches.radius
    found = acting(result, touches)
    height = height + found.get(GAP, 0.0) - found.get(RADIUS, 0.0)
    wanted = np.ones(len(readings), dtype=np.bool_) if rows is None else rows
    keep = wanted[readings.ok] & np.array([f in measured for f in touches.facet], dtype=np.bool_)
    return _compare(own.artefact, [touches.facet[i] for i in np.flatnonzero(keep)], height[keep], measured, grown, free)


def _compare(
    artefact: Artefact, facets: Sequence[Id], height: Array, measured: Mapping[Id, Array], grown: Known, free: bool
) -> Comparison:
    """facet ids (n), heights above the nominal planes (n,) mm, CMM points → residuals of the best fit of the CMM to them."""
    point = np.array([measured[f] for f in facets]).reshape(-1, 3) * (1 + grown.value)
    nominal = np.array([artefact.facets[f].point for f in facets]).reshape(-1, 3)
    normal = np.array([artefact.facets[f].normal for f in facets]).reshape(-1, 3)
    lever = np.hstack([normal, np.cross(point, normal) / 100.0])
    if len(set(facets)) < FEWEST or np.linalg.svd(lever, compute_uv=False)[-1] < 1e-3:
        raise InputError(
            f"CMM: the {len(set(facets))} facets in common do not fix where the table stands; "
            "measure facets on the top and on at least three sides"
        )
    shift, turn, size = np.zeros(3), np.eye(3), 1.0
    for _ in range(20):
        moved = size * point @ turn.T + shift
        residual = height - np.sum((moved - nominal) * normal, axis=1)
        lever = np.hstack([normal, np.cross(moved, normal), np.sum(moved * normal, axis=1)[:, None]])
        used = lever if free else lever[:, :6]
        step = np.linalg.lstsq(used, residual, rcond=None)[0]
        small = _rotation(step[3:6])
        size *= 1 + (step[6] if free else 0.0)
        shift, turn = small @ shift + step[:3] + (step[6] * shift if free else 0.0), small @ turn
        if np.max(np.abs(used @ step)) < 1e-11:
            break
    moved = size * point @ turn.T + shift
    residual = height - np.sum((moved - nominal) * normal, axis=1)
    vector = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    best, reach = _scale(lever, residual)
    scale = replace(best, value=size - 1 + best.value)
    return Comparison(tuple(facets), residual, shift, vector, grown, scale, free, reach)


def _scale(lever: Array, residual: Array) -> tuple[Known, float]:
    """(n, 7) what shift, turn and scale do, residuals (n,) → the scale that fits best, the largest lever of a scale, mm.

    An uncertain scale where no two facets face each other: all levers are then those of a shift.
    """
    own = lever[:, 6] - lever[:, :6] @ np.linalg.lstsq(lever[:, :6], lever[:, 6], rcond=None)[0]
    square = float(own @ own)
    if square < 1.0 or len(residual) < 8:
        return Known(0.0, math.inf), float(np.abs(own).max())
    value = float(own @ residual) / square
    rest = residual - own * value
    std = float(np.sqrt(rest @ rest / (len(rest) - 7) / square))
    return Known(value, std), float(np.abs(own).max())


def _rotation(vector: Array) -> Array:
    """(3,) rad → (3, 3), exact (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-300:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)
