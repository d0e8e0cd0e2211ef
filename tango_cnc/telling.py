"""Which facets tell where the table stands: what touches say of its six freedoms and its size, and the few that say most."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .astray import AGREES
from .records import Array, Artefact, Facet

SAME_SIDE = 0.5  # cosine of the angle between normals of facets on one side of the table
OTHER_SIZE = 10.0  # mm by which a table of 1 m may be larger or smaller than its file
BESIDE = 0.95  # cosine: facets that lie more alike than this have no edge between them


def unseen(artefact: Artefact, names: Sequence[str]) -> tuple[str, ...]:
    """artefact, touched facets → facets on sides of the table where no touch was: a table of another size has them elsewhere, and
    no touch shows it.
    """
    touched = np.array([artefact.facets[name].normal for name in names])
    flat = {key: facet for key, facet in artefact.facets.items() if facet.ball is None and facet.surface is None}
    return tuple(key for key, facet in flat.items() if float((touched @ np.array(facet.normal)).max()) < SAME_SIDE)


def unsized(artefact: Artefact, names: Sequence[str], agrees: float = AGREES) -> float:
    """artefact, touched facets, mm to which they agree → mm by which the worst facet may be beside its place, on the sides that are
    touched, where the table is larger or smaller than its file by up to 1 % and no touch shows it; inf where the place is unknown.
    """
    if weakest(artefact, names) <= 1e-3:
        return math.inf
    hidden = set(unseen(artefact, names))
    flat = [f for f in artefact.facets.values() if f.ball is None and f.surface is None and f.id not in hidden]
    left, beside = larger([artefact.facets[name] for name in names], flat)
    return beside * min(OTHER_SIZE, agrees / max(left, 1e-12))


def told_by(artefact: Artefact, names: Sequence[str], sized: bool = False) -> Array:
    """→ (n, 6) what a facet's touch tells of translation and rotation, rotations by their lever of 100 mm; `sized`: (n, 7), of the
    size of the table, too.
    """
    facets = [artefact.facets[name] for name in names]
    normal = np.array([facet.normal for facet in facets]).reshape(-1, 3)
    point = np.array([facet.point for facet in facets]).reshape(-1, 3)
    point = point - point.mean(axis=0) if len(point) else point
    grows = [np.einsum("ni,ni->n", normal, point)[:, None] / 100.0] if sized else []
    return np.hstack([normal, np.cross(point, normal) / 100.0, *grows])


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
    normal = np.array([artefact.facets[name].normal for name in every])
    point = np.array([artefact.facets[name].point for name in every])
    rows = np.hstack([normal, np.cross(point, normal)])
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
    """facets → (n,) mm from each facet's point to the nearest edge at which another flat facet begins; inf where there is none.

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


def sure(artefact: Artefact, names: Sequence[str], off: float, sized: bool = False) -> Array:
    """facets, mm by which they may be elsewhere, whether of size, too → (n, 6 or 7) what their touches tell; less where an edge is
    nearer than that.
    """
    return told_by(artefact, names, sized) * np.clip(to_edge(artefact, names) / off, 0.1, 1.0)[:, None] ** 3


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


def larger(touched: Sequence[Facet], others: Sequence[Facet]) -> tuple[float, float]:
    """facets that are touched, facets → mm for each mm by which a table of 1 m is larger than its file, when it is taken for one
    that is displaced: what is left of the worst touch, by how much the worst of the facets is beside.

    Nothing is left where all touches of a round of sides are on the same hand of their sides: such a table is one that is turned.
    """

    def rows(facets: Sequence[Facet]) -> tuple[Array, Array]:
        normal, point = np.array([facet.normal for facet in facets]), np.array([facet.point for facet in facets])
        return np.hstack([normal, np.cross(point, normal)]), 1e-3 * np.einsum("ni,ni->n", normal, point)

    told, grows = rows(touched)
    place = -np.linalg.pinv(told) @ grows
    left, beside = (each @ place + by for each, by in ((told, grows), rows(others)))
    return float(np.abs(left).max()), float(np.abs(beside).max())
