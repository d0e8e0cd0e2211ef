"""The artefact as a whole is turned, mirrored or shifted against what artefact.yaml says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ...records import Array, Artefact, Obstacle, Surface, Vector
from ._case import Case, Hypothesis


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the table turned by quarters about each axis, mirrored, with axes exchanged, and shifted."""
    artefact = case.artefact
    for i, letter in enumerate("xyz"):
        for quarters in (1, 2, 3):
            yield Hypothesis(
                f"the readings fit if the table is turned by {90 * quarters}° about {letter}",
                "artefact",
                "facets",
                f"turn every point and normal by {90 * quarters}° about {letter}, or the table on the machine",
                artefact=_mapped(artefact, _turn(i, quarters)),
                price=0.5,
            )
        mirror = np.diag([-1.0 if k == i else 1.0 for k in range(3)])
        yield Hypothesis(
            f"the readings fit if {letter} of every facet has the other sign",
            "artefact",
            "facets",
            f"change the sign of {letter} in every point and normal",
            artefact=_mapped(artefact, mirror),
            price=0.5,
        )
        j, k = (i + 1) % 3, (i + 2) % 3
        swap = np.eye(3)
        swap[[j, k]] = swap[[k, j]]
        yield Hypothesis(
            f"the readings fit if {'xyz'[j]} and {'xyz'[k]} of every facet are exchanged",
            "artefact",
            "facets",
            f"exchange {'xyz'[j]} and {'xyz'[k]} in every point and normal",
            artefact=_mapped(artefact, swap),
            price=1.0,
        )
        yield Hypothesis("", "artefact", "facets", "", free=[f"E{'XYZ'[i]}w"], words=_words, price=2.8,
                         least={f"E{'XYZ'[i]}w": artefact.tolerances.placement / 2})  # fmt: skip
    yield Hypothesis("", "artefact", "facets", "", free=["EXw", "EYw", "EZw"], words=_words, price=5.2,
                     least=dict.fromkeys(["EXw", "EYw", "EZw"], artefact.tolerances.placement / 2))  # fmt: skip


def _words(values: Mapping[str, float]) -> tuple[str, str]:
    said = ", ".join(f"{c.lower()} by {values[f'E{c}w']:.2f} mm" for c in "XYZ" if f"E{c}w" in values)
    return f"the readings fit if the whole table is shifted: {said}", "see where the origin of artefact.yaml is meant to be"


def _turn(axis: int, quarters: int) -> Array:
    j, k = (axis + 1) % 3, (axis + 2) % 3
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters]
    turn = np.eye(3)
    turn[j, j] = turn[k, k] = cosine
    turn[k, j], turn[j, k] = sine, -sine
    return turn


def _vector(matrix: Array, v: Vector) -> Vector:
    x, y, z = (float(c) + 0.0 for c in matrix @ np.array(v))
    return x, y, z


def _surface(matrix: Array, surface: Surface | None) -> Surface | None:
    if surface is None or surface.axis is None:
        return surface
    return replace(surface, axis=_vector(matrix, surface.axis))


def _mapped(artefact: Artefact, matrix: Array) -> Artefact:
    facets = {
        key: replace(f, point=_vector(matrix, f.point), normal=_vector(matrix, f.normal), surface=_surface(matrix, f.surface))
        for key, f in artefact.facets.items()
    }
    balls = {key: replace(b, centre=_vector(matrix, b.centre)) for key, b in artefact.balls.items()}
    none: tuple[Obstacle, ...] = ()
    return replace(artefact, facets=facets, balls=balls, obstacles=none)
