"""The artefact as a whole is turned, mirrored or shifted against what artefact.yaml says, or its facets against its balls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ... import kinematics
from ...records import Array, Artefact, Obstacle, Surface, Vector
from ...texts import joined, say
from ._case import Case, Hypothesis

SMALLEST = 0.3  # of its size that a table is taken to be: what is beyond is a unit
APART = ["facets@X", "facets@Y", "facets@Z"]  # all facets that are not on a ball


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the table turned by quarters about each axis, mirrored, with axes exchanged, and shifted."""
    artefact = case.artefact
    for i, letter in enumerate("xyz"):
        for quarters in (1, 2, 3):
            yield Hypothesis(
                say("mistake.table_placement.readings_fit_table_turned_about", quarters=90 * quarters, letter=letter),
                "artefact",
                "facets",
                say("mistake.table_placement.turn_every_point_normal_about", quarters=90 * quarters, letter=letter),
                artefact=_mapped(artefact, _turn(i, quarters)),
                price=0.5,
            )
        mirror = np.diag([-1.0 if k == i else 1.0 for k in range(3)])
        yield Hypothesis(
            say("mistake.table_placement.readings_fit_every_facet_has", letter=letter),
            "artefact",
            "facets",
            say("mistake.table_placement.change_sign_every_point_normal", letter=letter),
            artefact=_mapped(artefact, mirror),
            price=0.5,
        )
        for name in case.machine.rotary:
            middle = case.machine.axis(name).point[i]
            if middle and not case.machine.axis(name).direction[i]:
                yield Hypothesis(
                    say("mistake.table_placement.mirrored_about", letter=letter, name=name),
                    "artefact",
                    "facets",
                    say("mistake.table_placement.mirror_about", letter=letter, twice=f"{2 * middle:g}"),
                    artefact=_mapped(artefact, mirror, np.eye(3)[i] * 2 * middle),
                    price=1.0,
                )
        j, k = (i + 1) % 3, (i + 2) % 3
        swap = np.eye(3)
        swap[[j, k]] = swap[[k, j]]
        yield Hypothesis(
            say("mistake.table_placement.readings_fit_every_facet_exchanged", value="xyz"[j], value2="xyz"[k]),
            "artefact",
            "facets",
            say("mistake.table_placement.exchange_every_point_normal", value="xyz"[j], value2="xyz"[k]),
            artefact=_mapped(artefact, swap),
            price=1.0,
        )
        yield Hypothesis("", "artefact", "facets", "", free=[f"E{'XYZ'[i]}w"], words=_words, price=2.8,
                         least={f"E{'XYZ'[i]}w": artefact.tolerances.placement / 2})  # fmt: skip
    yield Hypothesis("", "artefact", "facets", "", free=["EXw", "EYw", "EZw"], words=_words, price=5.2,
                     least=dict.fromkeys(["EXw", "EYw", "EZw"], artefact.tolerances.placement / 2))  # fmt: skip
    yield from _sized(case)
    if len({artefact.facets[f].ball is None for f in case.readings.facet}) == 2:
        for names, price in ((["facets@X"], 3.2), (["facets@Y"], 3.2), (["facets@Z"], 3.2), (APART, 5.6)):
            yield Hypothesis("", "artefact", "facets", "", free=names, words=_apart, price=price,
                             least=dict.fromkeys(names, artefact.tolerances.placement / 2))  # fmt: skip


def _sized(case: Case) -> Iterator[Hypothesis]:
    """case → the table as large, and with its origin, where the touches put it best: least squares along the normals."""
    used = [case.artefact.facets[f] for f in case.readings.facet]
    point, normal = np.array([f.point for f in used]), np.array([f.normal for f in used])
    ball = kinematics.tip(kinematics.chain(case.machine), case.readings.position)
    along = np.einsum("ij,ij->i", ball, normal) - case.machine.probe.tip_radius
    columns = np.column_stack([np.einsum("ij,ij->i", point, normal), normal])
    size, *shift = np.linalg.lstsq(columns, along, rcond=None)[0].tolist()
    least = case.artefact.tolerances.placement / max(float(np.abs(point).max()), 1.0)
    if SMALLEST < size < 1 / SMALLEST and abs(size - 1) > least:
        yield Hypothesis(
            say("mistake.table_placement.other_size", size=f"{size:.4g}"),
            "artefact",
            "facets",
            say("mistake.table_placement.take_its_size", size=f"{size:.4g}"),
            artefact=_mapped(case.artefact, size * np.eye(3), np.array(shift)),
            price=5.6,
        )


def _words(values: Mapping[str, float]) -> tuple[str, str]:
    said = joined(
        ", ",
        (say("mistake.table_placement.mm", lower=c.lower(), values=f"{values[f'E{c}w']:.2f}") for c in "XYZ" if f"E{c}w" in values),
    )
    return say("mistake.table_placement.readings_fit_whole_table_shifted", said=said), say(
        "mistake.table_placement.see_where_origin_artefact_yaml"
    )


def _apart(values: Mapping[str, float]) -> tuple[str, str]:
    shifts = {name[-1]: values[name] for name in APART if name in values}
    said = joined(", ", (say("mistake.table_placement.mm", lower=c.lower(), values=f"{size:.2f}") for c, size in shifts.items()))
    return say("mistake.table_placement.facets_shifted", said=said), say("mistake.table_placement.facets_and_balls")


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


def _mapped(artefact: Artefact, matrix: Array, shift: Array | None = None) -> Artefact:
    turn = matrix / np.linalg.norm(matrix[0])  # of directions, which have no size

    def point(v: Vector) -> Vector:
        x, y, z = _vector(matrix, v)
        return (x, y, z) if shift is None else (x + float(shift[0]), y + float(shift[1]), z + float(shift[2]))

    facets = {
        key: replace(f, point=point(f.point), normal=_vector(turn, f.normal), surface=_surface(turn, f.surface))
        for key, f in artefact.facets.items()
    }
    balls = {key: replace(b, centre=point(b.centre)) for key, b in artefact.balls.items()}
    none: tuple[Obstacle, ...] = ()
    return replace(artefact, facets=facets, balls=balls, obstacles=none)
