"""One facet is elsewhere than artefact.yaml says, or its normal points into the material or along another axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...kinematics import chain, tip
from ...records import Array, Artefact, Facet, Id, Vector
from ...texts import say
from ._case import Case, Hypothesis

WORST = 4  # facets that are looked at
DECIMALS = 2
LEAST = 2.0  # mm in its plane from which on a facet is elsewhere
ALIKE = 0.5  # mm within which half of its touches are at the same place


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the facets that fit worst, each with the slips that a line of artefact.yaml invites; then all normals at once."""
    inward = {key: replace(f, normal=_minus(f.normal)) for key, f in case.artefact.facets.items()}
    yield Hypothesis(
        say("mistake.facet_place.readings_fit_all_normals_point"),
        "artefact",
        "facets",
        say("mistake.facet_place.turn_every_normal_round_they"),
        artefact=replace(case.artefact, facets=inward),
    )
    place = tip(chain(case.machine), case.readings.position)
    facets = np.array(case.readings.facet)
    yield from _corners(case, place, facets)
    away = np.abs(case.stated.gaps) + case.stated.beside
    loss = {f: float(np.median(np.log1p((away[facets == f] / 0.01) ** 2))) for f in dict.fromkeys(case.readings.facet)}
    for key in sorted(loss, key=lambda f: -loss[f])[:WORST]:
        yield from _facet(case, case.artefact.facets[key], place[facets == key])


def _corners(case: Case, place: Array, facets: NDArray[np.str_]) -> Iterator[Hypothesis]:
    """Most facets are touched elsewhere in their plane, each always at the same place: their points are those of their corners."""
    points, away, judged = dict(case.artefact.facets), [], 0
    for key, facet in case.artefact.facets.items():
        own = place[facets == key]
        if facet.ball is not None or facet.surface is not None or not len(own):
            continue
        judged += 1
        normal = np.array(facet.normal)
        beside = own - np.array(facet.point)
        beside = beside - (beside @ normal)[:, None] * normal
        middle = np.median(beside, axis=0)
        size = float(np.linalg.norm(middle))
        if size > LEAST and np.median(np.linalg.norm(beside - middle, axis=1)) < ALIKE:
            x, y, z = (round(float(c), DECIMALS) for c in np.array(facet.point) + middle)
            points[key] = replace(facet, point=(x, y, z))
            away.append(size)
    if judged < 3 or len(away) < judged / 2:
        return
    yield Hypothesis(
        say("mistake.facet_place.corners", count=len(away), total=judged, least=f"{min(away):.1f}", most=f"{max(away):.1f}"),
        "artefact",
        "facets",
        say("mistake.facet_place.write_centers"),
        artefact=replace(case.artefact, facets=points),
        price=8.0,  # so many numbers of its own fit much
    )


def _facet(case: Case, facet: Facet, place: Array) -> Iterator[Hypothesis]:
    def changed(text: str, key: str, change: str, price: float, **fields: object) -> Hypothesis:
        return Hypothesis(
            text, "artefact", f"facets.{facet.id}.{key}", change, artefact=_with(case.artefact, facet.id, fields), price=price
        )

    minus = _minus(facet.normal)
    yield changed(
        say("mistake.facet_place.readings_fit_normal_facet_points", id=facet.id),
        "normal",
        say("mistake.facet_place.write_normals_point_out_material", minus=_shown(minus)),
        0.0,
        normal=minus,
    )
    for base in (*np.eye(3), *-np.eye(3)):
        other = tuple(float(c) + 0.0 for c in base)
        if abs(float(base @ np.array(facet.normal))) < 0.99:
            yield changed(
                say("mistake.facet_place.readings_fit_normal_facet", id=facet.id, other=_shown(other)),
                "normal",
                say("mistake.facet_place.write", other=_shown(other)),
                1.5,
                normal=other,
            )
    for i, letter in enumerate("xyz"):
        if facet.point[i]:
            other = tuple(-c if k == i else c for k, c in enumerate(facet.point))
            text = say("mistake.facet_place.readings_fit_facet_has_other", letter=letter, id=facet.id)
            yield changed(text, "point", say("mistake.facet_place.write", other=_shown(other)), 0.5, point=other)
    found = np.median(place, axis=0) - case.machine.probe.tip_radius * np.array(facet.normal)
    for i, letter in enumerate("xyz"):
        value = round(float(found[i]), DECIMALS)
        other = tuple(value if k == i else c for k, c in enumerate(facet.point))
        text = say(
            "mistake.facet_place.readings_fit_facet_not",
            letter=letter,
            id=facet.id,
            value=f"{value:g}",
            point=f"{facet.point[i]:g}",
        )
        yield changed(text, "point", say("mistake.facet_place.write", other=_shown(other)), 3.0, point=other)
    x, y, z = (round(float(c), DECIMALS) for c in found)
    yield changed(
        say("mistake.facet_place.readings_fit_facet_at", id=facet.id, value=_shown((x, y, z))),
        "point",
        say("mistake.facet_place.write_2", value=_shown((x, y, z))),
        6.0,
        point=(x, y, z),
    )


def _with(artefact: Artefact, key: Id, fields: dict[str, object]) -> Artefact:
    facet = replace(artefact.facets[key], **fields)  # type: ignore[arg-type]
    return replace(artefact, facets={**artefact.facets, key: facet})


def _minus(v: Vector) -> Vector:
    return 0.0 - v[0], 0.0 - v[1], 0.0 - v[2]


def _shown(v: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{c:g}" for c in v) + "]"
