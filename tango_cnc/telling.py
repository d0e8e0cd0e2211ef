"""Which facets tell where the table stands: what touches say of its six freedoms and its size, and the few that say most."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import check
from .astray import AGREES
from .records import Array, Artefact, Facet

SAME_SIDE = 0.5  # cosine of the angle between normals of facets on one side of the table
OTHER_SIZE = 0.01  # share by which a table may be larger or smaller than its file
EDGE = 0.05  # mm from the plane of a facet: a corner of the table that is nearer lies on it; and the least of a square of a sine
BESIDE = 0.95  # cosine: facets that lie more alike than this have no edge between them


def unseen(artefact: Artefact, names: Sequence[str]) -> tuple[str, ...]:
    """artefact, touched facets → facets on sides of the table where no touch was: a table of another size has them elsewhere, and
    no touch shows it.
    """
    touched = np.array([artefact.facets[name].normal for name in names])
    flat = {key: facet for key, facet in artefact.facets.items() if facet.ball is None and facet.surface is None}
    return tuple(key for key, facet in flat.items() if float((touched @ np.array(facet.normal)).max()) < SAME_SIDE)


def unseen_by(artefact: Artefact, names: Sequence[str], hidden: Sequence[str]) -> tuple[float, str]:
    """artefact, touched facets, facets on sides where no touch was → mm along its normal by which the worst of these is elsewhere
    on a table that is 1 % larger and placed by these touches, and which; 0 for none.
    """
    if not hidden or weakest(artefact, names) <= 1e-3:
        return 0.0, ""
    (told, grows), (rows, by) = (_shown([artefact.facets[name] for name in some], np.zeros(3)) for some in (names, hidden))
    off = np.abs(OTHER_SIZE * (by - rows @ np.linalg.pinv(told) @ grows))
    worst = int(np.argmax(off))
    return float(off[worst]), hidden[worst]


@dataclass(frozen=True)
class OtherSize:
    """What a table of another size than its file's may do unseen: how far edges are beside, how far it is turned, by what share."""

    beside: float  # mm
    turned: float  # deg
    share: float  # by which it is larger or smaller

    @property
    def text(self) -> str:
        """→ what it means, half a sentence."""
        return (
            f"a table up to {100 * self.share:.2g} % larger or smaller than artefact.yaml says fits these touches as well, once it "
            f"is turned by some {self.turned:.1f} deg: its edges are then some {self.beside:.1f} mm beside"
        )


def unsized(artefact: Artefact, names: Sequence[str], agrees: float | None = None) -> OtherSize:
    """artefact, touched facets, mm to which somebody says that facets are in their places, None where nobody does → what a table
    that is larger or smaller than its file by up to 1 % is taken for, as far as no touch shows it; inf where the place is unknown.

    The six freedoms take up what they can of the growth. What is left of it shows in a touch, beyond what counts as agreement. What
    is wrong by then: the facets of the touched sides at their points, and the table at its corners, as far as these sides bound it.
    Where all touches of a round of sides are on the same hand of their sides nothing is left: such a table is one that is turned,
    and only its edges and normals are elsewhere.
    """
    if weakest(artefact, names) <= 1e-3:
        return OtherSize(math.inf, math.inf, OTHER_SIZE)
    hidden = set(unseen(artefact, names))
    flat = [f for f in artefact.facets.values() if f.ball is None and f.surface is None]
    seen = [f for f in flat if f.id not in hidden]
    middle = np.mean([f.point for f in flat], axis=0)
    told, grows = _shown([artefact.facets[name] for name in names], middle)
    place = -np.linalg.pinv(told) @ grows
    share = min(OTHER_SIZE, (agrees or AGREES) / max(float(np.abs(told @ place + grows).max()), 1e-9))
    rows, by = _shown(seen, middle)
    if agrees is not None:  # who says that says the size, too
        share = min(share, agrees / max(float(np.abs(_shown(flat, middle)[1]).max()), 1e-9))
    beside = max(float(np.abs(rows @ place + by).max()), _at_corners(artefact, seen, middle, place))
    return OtherSize(share * beside, share * math.degrees(float(np.linalg.norm(place[3:]))), share)


def _shown(facets: Sequence[Facet], middle: Array) -> tuple[Array, Array]:
    """facets, (3,) mm → (n, 6) what each shows of translation and rotation about it, (n,) mm that it shows of a doubled size."""
    normal = np.array([facet.normal for facet in facets]).reshape(-1, 3)
    arm = np.array([facet.point for facet in facets]).reshape(-1, 3) - middle
    return np.hstack([normal, np.cross(arm, normal)]), np.einsum("ni,ni->n", normal, arm)


def _at_corners(artefact: Artefact, seen: Sequence[Facet], middle: Array, place: Array) -> float:
    """artefact, facets of the touched sides, (3,) mm, the six freedoms for a doubled size → mm by which the worst corner is beside.

    Only in the directions of the touched sides that meet there: along them a corner is where an untouched side cuts them off.
    """
    table = check.solid(artefact).table
    if table is None:
        return 0.0
    corner = table.corner - middle
    normal, offset = np.array([f.normal for f in seen]), _shown(seen, middle)[1]
    meet = np.abs(corner @ normal.T - offset) < EDGE
    across = np.einsum("vk,ki,kj->vij", meet, normal, normal)
    size, axes = np.linalg.eigh(across)
    off = place[:3] + np.cross(place[3:], corner) + corner
    along = np.einsum("vij,vi->vj", axes, off) * (size > EDGE)
    return float(np.linalg.norm(along, axis=1).max(initial=0.0))


def told_by(artefact: Artefact, names: Sequence[str], sized: bool = False) -> Array:
    """→ (n, 6) what a facet's touch tells of translation and rotation, rotations by their lever of 100 mm; `sized`: (n, 7), of the
    size of the table, too.
    """
    facets = [artefact.facets[name] for name in names]
    middle = np.mean([facet.point for facet in facets], axis=0) if facets else np.zeros(3)
    rows, grows = _shown(facets, middle)
    lever = np.array([1.0] * 3 + [0.01] * 3)
    return np.hstack([rows * lever, *([grows[:, None] * 0.01] if sized else [])])


def weakest(artefact: Artefact, names: Sequence[str]) -> float:
    """→ the smallest singular value of what the facets tell; 0 for fewer than six."""
    return float(np.linalg.svd(told_by(artefact, names), compute_uv=False)[-1]) if len(names) >= 6 else 0.0


def known_to(artefact: Artefact, names: Sequence[str], agrees: float = AGREES) -> tuple[float, str]:
    """facets that are touched, mm to which facets are in their places → mm to which the worst facet of the table is known then, and
    which; inf where unknown.

    One standard deviation along its normal, where the facets are in their places on the table to `agrees` and touches are exact.
    """
    if weakest(artefact, names) <= 1e-3:
        return math.inf, ""
    every = list(artefact.facets)
    rows, _ = _shown([artefact.facets[name] for name in every], np.zeros(3))
    touched = rows[[every.index(name) for name in names]]
    spread = agrees * np.linalg.norm(rows @ np.linalg.pinv(touched), axis=1)
    worst = int(np.argmax(spread))
    return float(spread[worst]), every[worst]


def without_one(rows: Array) -> float:
    """(n, m) what touches tell → the smallest singular value that is left when the worst is missing; below 0: not enough."""
    if len(rows) <= rows.shape[1]:
        return float(np.linalg.svd(rows, compute_uv=False)[-1]) - 1.0 if len(rows) == rows.shape[1] else -1.0
    without = rows.T @ rows - np.einsum("ni,nj->nij", rows, rows)
    return math.sqrt(max(float(np.linalg.eigvalsh(without)[:, 0].min()), 0.0))


def to_edge(artefact: Artefact, names: Sequence[str]) -> Array:
    """facets → (n,) mm from each facet's point to the nearest edge at which another flat facet begins; inf without such an edge.

    Within it a displaced table still shows the same plane to the ball.
    """
    flat = [facet for facet in artefact.facets.values() if facet.surface is None and facet.ball is None]
    normal, point = np.array([facet.normal for facet in flat]), np.array([facet.point for facet in flat])
    found = []
    for facet in (artefact.facets[name] for name in names):
        cosine, beyond = normal @ np.array(facet.normal), np.einsum("ni,ni->n", normal, point - np.array(facet.point))
        beside = (np.abs(cosine) < BESIDE) & (beyond >= 0)
        found.append(float((beyond[beside] / np.sqrt(1 - cosine[beside] ** 2)).min(initial=math.inf)))
    return np.array(found)


def sure(artefact: Artefact, names: Sequence[str], off: float, sized: bool = False, room: Array | None = None) -> Array:
    """facets, mm by which they may be elsewhere, whether of size, too → (n, 6 or 7) what their touches tell; less where an edge is
    nearer than that. `room` is their (n,) mm to an edge, for who asks of the same facets again and again.
    """
    edge = to_edge(artefact, names) if room is None else room
    return told_by(artefact, names, sized) * np.clip(edge / off, 0.1, 1.0)[:, None] ** 3


def chosen(artefact: Artefact, names: Sequence[str], count: int, off: float, sized: bool = False) -> tuple[str, ...]:
    """facets, mm by which they may be elsewhere → `count` of them that tell most, also when any one of them misses.

    First each that adds most to what the ones before tell (determinant), then exchanges as long as they help.
    """
    rows, left, found = sure(artefact, names, off, sized), list(range(len(names))), list[int]()
    information = 1e-6 * np.eye(rows.shape[1])
    while left and len(found) < count:
        best = max(left, key=lambda row: float(rows[row] @ np.linalg.solve(information, rows[row])))
        information += np.outer(rows[best], rows[best])
        found.append(best)
        left.remove(best)
    better = True
    while better:
        better = False
        for place in range(len(found)):
            for other in range(len(names)):
                tried = [*found[:place], other, *found[place + 1 :]]
                if other not in found and without_one(rows[tried]) > 1.001 * without_one(rows[found]):
                    found, better = tried, True
    return tuple(names[row] for row in sorted(found))
