"""Facets are exchanged, or their numbers are shifted: in artefact.yaml, or in the column `facet` of the readings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy import optimize

from ...kinematics import chain, tip
from ...records import Artefact, Id
from ...texts import joined, say
from ._case import Case, Hypothesis

NEAR = 5.0  # mm


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → the names that the touches themselves ask for: two exchanged, all shifted, or those of single touches."""
    facets = case.artefact.facets
    names = list(facets)
    place = tip(chain(case.machine), case.readings.position)
    radius = case.machine.probe.tip_radius
    contact = np.array([np.array(f.point) + radius * np.array(f.normal) for f in facets.values()])
    away = np.linalg.norm(place[:, None, :] - contact[None], axis=2)
    named = np.array([names.index(f) for f in case.readings.facet])
    nearest = np.argmin(away, axis=1)
    own = away[np.arange(len(named)), named]
    wrong = (nearest != named) & (own > NEAR) & (away.min(axis=1) < NEAR)
    if not wrong.any():
        return
    votes = np.zeros((len(names), len(names)))
    np.add.at(votes, (named, nearest), 1.0)
    np.fill_diagonal(votes, votes.diagonal() + 0.5)  # what was never touched keeps its number
    moved = {int(f): int(g) for f, g in zip(*optimize.linear_sum_assignment(votes, maximize=True), strict=True) if f != g}
    if len(moved) == 2 and all(moved.get(g) == f for f, g in moved.items()):
        one, other = (names[i] for i in sorted(moved))
        yield Hypothesis(
            say("mistake.facet_names.readings_fit_facets_exchanged", one=one, other=other),
            "artefact",
            f"facets.{one}",
            say("mistake.facet_names.give_facet_place_facet_other", one=one, other=other),
            artefact=_renamed(case.artefact, {one: other, other: one}),
        )
    elif len(moved) > 2:
        said = joined(", ", (say("mistake.facet_names.is", names=names[f], names2=names[g]) for f, g in list(moved.items())[:4]))
        yield Hypothesis(
            say("mistake.facet_names.readings_fit_numbers_facets_others", count=len(moved), said=said),
            "artefact",
            "facets",
            say("mistake.facet_names.number_facets_as_readings_program"),
            artefact=_renamed(case.artefact, {names[f]: names[g] for f, g in moved.items()}),
            price=1.0,
        )
    touches = tuple(int(t) for t in case.readings.touch[wrong])
    if len(touches) < len(named) / 2:
        called = tuple(names[nearest[i]] if wrong[i] else f for i, f in enumerate(case.readings.facet))
        listed = ", ".join(map(str, touches[:8])) + (" …" if len(touches) > 8 else "")
        yield Hypothesis(
            say("mistake.facet_names.readings_fit_touches_were_made", listed=listed),
            "readings",
            "facet",
            say("mistake.facet_names.first_see_whether_strategy_yaml", called=called[int(np.flatnonzero(wrong)[0])]),
            readings=replace(case.readings, facet=called),
            touches=touches,
            price=2.0 + 2.0 * len(touches),
        )


def _renamed(artefact: Artefact, names: dict[Id, Id]) -> Artefact:
    return replace(artefact, facets={key: replace(artefact.facets[names.get(key, key)], id=key) for key in artefact.facets})
