"""A facet whose normal points into the table sends the probe through the table."""

from __future__ import annotations

import numpy as np

from ..records import Artefact, Cell, Id
from .checked import load

LEVEL = 0.5  # mm: facets of one plane lie as unevenly
NEAR = 10.0  # mm: between faces nearer than that there is no room for a probe
OPPOSITE = -0.3  # cosine between normals: these faces look the other way


def refuse_inward(cell: Cell) -> None:
    """cell → nothing. Raises InputError with file and line of a facet whose normal points into the table."""
    found = inward(cell.artefact)
    if not found:
        return
    facet, beside = next(iter(found.items()))
    file = cell.folder / dict(load(cell.folder / "tango.yaml").items())["artefact"].text()
    node = dict(dict(dict(load(file).items())["facets"].items())[facet].items())["normal"]
    normal = [f"{v:g}" for v in cell.artefact.facets[facet].normal]
    out = [f"{-v + 0.0:g}" for v in cell.artefact.facets[facet].normal]
    others = ", ".join(beside[:4])
    raise node.wrong(
        f"[{', '.join(out)}], out of the material",
        f"[{', '.join(normal)}], which points into the table: the whole table is in front of facet {facet}, and facets beside it "
        f"({others}) face the other way",
    )


def inward(artefact: Artefact) -> dict[Id, tuple[Id, ...]]:
    """artefact → flat facets that have the whole table in front of them, and who beside them faces the other way.

    A wall of a slot has table behind it, the floor of a pocket has nobody beside it that faces the other way.
    """
    flat = [f for f in artefact.facets.values() if f.ball is None and f.surface is None]
    point = np.array([f.point for f in flat]).reshape(-1, 3)
    normal = np.array([f.normal for f in flat]).reshape(-1, 3)
    ahead = np.einsum("ik,ijk->ij", normal, point[None, :, :] - point[:, None, :])  # of facet i lies facet j, mm
    whole = (ahead > -LEVEL).all(axis=1) & (ahead > NEAR).any(axis=1)
    near = (ahead < NEAR) & (normal @ normal.T < OPPOSITE)
    return {f.id: tuple(flat[j].id for j in np.flatnonzero(near[i])) for i, f in enumerate(flat) if whole[i] and near[i].any()}
