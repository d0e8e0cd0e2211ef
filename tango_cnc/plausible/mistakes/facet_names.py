"""Facets are exchanged, or their numbers are shifted: in artefact.yaml, or in the column `facet` of the readings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...kinematics import chain, tip
from ...records import Artefact, Id
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
    votes = {f: Counter(nearest[named == f].tolist()).most_common(1)[0][0] for f in set(named.tolist())}
    moved = {f: g for f, g in votes.items() if f != g}
    if len(moved) == 2 and all(moved.get(g) == f for f, g in moved.items()):
        one, other = (names[i] for i in sorted(moved))
        yield Hypothesis(
            f"the readings fit if facets {one} and {other} are exchanged",
            "artefact",
            f"facets.{one}",
            f"give facet {one} the place of facet {other} and the other way round, or exchange the names in the readings",
            artefact=_renamed(case.artefact, {one: other, other: one}),
        )
    elif len(moved) > 2:
        said = ", ".join(f"{names[f]} is {names[g]}" for f, g in list(moved.items())[:4])
        yield Hypothesis(
            f"the readings fit if the numbers of {len(moved)} facets are others: {said} …",
            "artefact",
            "facets",
            "number the facets as the readings (and the program) have them",
            artefact=_renamed(case.artefact, {names[f]: names[g] for f, g in moved.items()}),
            price=1.0,
        )
    touches = tuple(int(t) for t in case.readings.touch[wrong])
    if len(touches) < len(named) / 2:
        called = tuple(names[nearest[i]] if wrong[i] else f for i, f in enumerate(case.readings.facet))
        listed = ", ".join(map(str, touches[:8])) + (" …" if len(touches) > 8 else "")
        yield Hypothesis(
            f"the readings fit if touches {listed} were made at other facets than the readings name",
            "readings",
            "facet",
            f"the first is {called[int(np.flatnonzero(wrong)[0])]}; see whether strategy.yaml is that of the program",
            readings=replace(case.readings, facet=called),
            touches=touches,
            price=2.0 + 2.0 * len(touches),
        )


def _renamed(artefact: Artefact, names: dict[Id, Id]) -> Artefact:
    return replace(artefact, facets={key: replace(artefact.facets[names.get(key, key)], id=key) for key in artefact.facets})
