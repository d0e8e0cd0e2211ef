"""Whether a straight probe can stand where a touch wants it: the stem and the body go from the tip towards the spindle.

Everything is judged in the table frame, where the table stands still. The approach comes down along the tool, so the probe
sweeps only its own extension upwards, then moves along the facet's normal: poses along that way, closer together than the
margin allows for, are judged one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Approach, Array, Artefact, Id, Probe
from .solid import Body, Solid

SHANK = -0.02  # least cosine between normal and spindle direction: 1.1° of undercut is within what a table is out of square
GAP = 0.2  # mm between stem and surface while the tip touches
MARGIN = 1.0  # mm around stem and tip elsewhere
BODY_MARGIN = 2.0  # mm around the body
BEHIND = 1000.0  # mm: what carries the probe is at least as thick as its body
STEP = 1.0  # mm between the poses that are judged


@dataclass(frozen=True)
class Pose:
    """Touches in the table frame: tip centre at contact, outward normal, direction from the tip to the spindle."""

    facet: tuple[Id, ...]
    tip: Array  # (n, 3) mm
    normal: Array  # (n, 3)
    spindle: Array  # (n, 3)

    def rows(self, index: NDArray[np.int64]) -> Pose:
        """(m,) indices → those touches."""
        return Pose(tuple(self.facet[i] for i in index), self.tip[index], self.normal[index], self.spindle[index])


def obstruction(pose: Pose, probe: Probe, approach: Approach, artefact: Artefact, solid: Solid) -> dict[int, str]:
    """touches → {row: why the probe cannot make it}, empty when it can make all.

    Chunks keep the memory flat for any number of touches.
    """
    found: dict[int, str] = {}
    for start in range(0, len(pose.facet), 4096):
        index = np.arange(start, min(start + 4096, len(pose.facet)))
        found |= {start + row: why for row, why in _chunk(pose.rows(index), probe, approach, artefact, solid).items()}
    return found


def _chunk(pose: Pose, probe: Probe, approach: Approach, artefact: Artefact, solid: Solid) -> dict[int, str]:
    n = len(pose.facet)
    reasons: dict[int, str] = {}

    def blame(hit: NDArray[np.bool_], why: str) -> None:
        for row in np.flatnonzero(hit):
            reasons.setdefault(int(row), why)

    cosine = np.einsum("ij,ij->i", pose.normal, pose.spindle)
    for row in np.flatnonzero(cosine < SHANK):
        angle = np.degrees(np.arccos(np.clip(cosine[row], -1, 1)))
        reasons[int(row)] = f"the facet faces {angle:.0f}° away from the spindle, the straight stylus reaches up to 91°"

    stem = max(probe.length - probe.body_length, 0.0)
    if probe.stylus_radius + GAP > probe.tip_radius:
        grazing = cosine < (probe.stylus_radius + GAP - probe.tip_radius) / max(stem, 1.0)
        blame(grazing, f"the stem (stylus_radius {probe.stylus_radius:g} mm) is not thinner than the tip ({probe.tip_radius:g} mm)")

    facets = [artefact.facets[f] for f in pose.facet]
    bounded = np.array([f.ball is not None or f.id in solid.outer for f in facets], dtype=bool)
    way = np.arange(-approach.search, approach.standoff + STEP, STEP).clip(max=approach.standoff)
    parts = (
        ("the stem", 0.0, stem, max(probe.stylus_radius, 0.0), MARGIN),
        ("the probe body", stem, probe.length + BEHIND, probe.body_radius, BODY_MARGIN),
    )
    for part, low, high, radius, margin in parts:
        begin, run = pose.tip + low * pose.spindle, (high - low) * pose.spindle
        if solid.table is not None:
            thin = radius + (GAP if part == "the stem" else margin)
            blame(bounded & _crosses(solid.table, begin, run, thin), f"{part} would hit the table while the tip touches")
            lifted = begin + approach.standoff * pose.normal
            thick = max(radius, probe.tip_radius if part == "the stem" else 0.0) + min(margin, approach.standoff / 2)
            blame(bounded & _crosses(solid.table, lifted, run, thick), f"{part} would hit the table on the way to the stand-off")
        for distance in way:
            moved = begin + distance * pose.normal
            for number, body in enumerate(solid.obstacles, 1):
                blame(_crosses(body, moved, run, radius + margin + STEP / 2), f"{part} would hit obstacle {number}")
        names = list(artefact.balls)
        for ball, centre, size in zip(names, solid.centre, solid.radius, strict=True):
            own = np.array([f.ball == ball for f in facets], dtype=bool)
            near = np.full(n, np.inf)
            for distance in way:
                near = np.minimum(near, _distance(centre, begin + distance * pose.normal, run))
            touching = _distance(centre, begin, run)
            clear = size + radius
            own_margin = GAP if part == "the stem" else margin
            blame(np.where(own, touching < clear + own_margin, near < clear + margin + STEP / 2), f"{part} would hit ball {ball}")
            if part == "the stem":
                tip = np.full(n, np.inf)
                for distance in way:
                    tip = np.minimum(tip, np.linalg.norm(pose.tip + distance * pose.normal - centre, axis=1))
                blame(~own & (tip < size + probe.tip_radius + margin + STEP / 2), f"the tip would hit ball {ball}")
    if solid.table is not None:
        over = np.array([f.ball is not None for f in facets], dtype=bool)
        for distance in way:
            blame(
                over & _crosses(solid.table, pose.tip + distance * pose.normal, np.zeros((n, 3)), probe.tip_radius + MARGIN),
                "the tip would hit the table",
            )
    for distance in way:
        for number, body in enumerate(solid.obstacles, 1):
            moved = pose.tip + distance * pose.normal
            blame(
                _crosses(body, moved, np.zeros((n, 3)), probe.tip_radius + MARGIN + STEP / 2),
                f"the tip would hit obstacle {number}",
            )
    return reasons


def _crosses(body: Body, begin: Array, run: Array, radius: float) -> NDArray[np.bool_]:
    """segments begin + t run, 0 ≤ t ≤ 1, (n, 3) each → (n,) whether they come nearer than `radius` to the body.

    The body's faces are moved out by the radius: exact at faces, a little too careful at corners (Cyrus–Beck clipping).
    """
    height = begin @ body.normal.T - (body.offset + radius)  # (n, f), negative is inside
    slope = run @ body.normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -height / slope
    enter = np.where(slope < 0, at, -np.inf).max(axis=1)
    leave = np.where(slope > 0, at, np.inf).min(axis=1)
    apart = ((slope == 0) & (height >= 0)).any(axis=1)
    return np.asarray(~apart & (np.maximum(enter, 0.0) < np.minimum(leave, 1.0)))


def _distance(point: Array, begin: Array, run: Array) -> Array:
    """(3,), segments (n, 3) → (n,) mm, distance of the point from each segment."""
    length = np.maximum(np.einsum("ij,ij->i", run, run), 1e-12)
    t = np.clip(np.einsum("ij,ij->i", point - begin, run) / length, 0.0, 1.0)
    distance: Array = np.linalg.norm(begin + t[:, None] * run - point, axis=1)
    return distance
