"""Which features of the table a set of touches gives: facets with an offset each, balls with a centre, the scale bar between two.

One home for the rule. `tango estimate`, `check` and `design` ask here, so that none takes a ball for known that
another drops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from .records import Artefact, Id, Readings, Surface
from .texts import joined, say

SIDES = 0.05  # least against largest spread of the normals on a ball whose centre is known


def loose(artefact: Artefact, touched: Sequence[Id]) -> tuple[Id, ...]:
    """artefact, facet of every touch → balls that these touch from too few sides to know their centre.

    The one rule of which features a set of touches gives: estimate, check and design all follow it.
    """
    own: dict[Id, list[Id]] = {}
    for name in touched:
        if (ball := artefact.facets[name].ball) is not None:
            own.setdefault(ball, []).append(name)
    return tuple(ball for ball in artefact.balls if ball in own and not _known(artefact, own[ball]))


def _known(artefact: Artefact, touched: Sequence[Id]) -> bool:
    """artefact, facet of every touch on one ball → whether they meet it from enough sides to know its centre."""
    spread = np.linalg.svd(np.array([artefact.facets[name].normal for name in touched]), compute_uv=False)
    return len(spread) == 3 and bool(spread[2] >= SIDES * spread[0])


def completing(artefact: Artefact, ball: Id, touched: Sequence[Id]) -> tuple[Id, ...]:
    """artefact, ball, facet of every touch → facets of the ball of which one more touch makes its centre known.

    Where one does not: facets that do together. None where no facets of it do.
    """
    own = [name for name in touched if artefact.facets[name].ball == ball]
    others = [f.id for f in artefact.facets.values() if f.ball == ball and f.id not in set(own)]
    if one := tuple(name for name in others if _known(artefact, [*own, name])):
        return one
    for count in (2, 3):
        for more in combinations(others, count):
            if _known(artefact, [*own, *more]):
                return more
    return ()


def located(artefact: Artefact, touched: Sequence[Id]) -> Artefact:
    """artefact, facet of every touch → the artefact without balls that these touch from too few sides to know their centre.

    Such a ball's facets stand for themselves: patches of a sphere, each with an offset of its own. Its touches still count,
    and the iteration is spared a centre that could wander around the ball.
    """
    lost = loose(artefact, touched)
    if not lost:
        return artefact
    facets = {
        key: replace(f, ball=None, surface=Surface("sphere", artefact.balls[f.ball].radius)) if f.ball in lost else f
        for key, f in artefact.facets.items()
    }
    return replace(artefact, facets=facets)


def good(readings: Readings) -> list[Id]:
    """readings → facet of every touch with status ok."""
    return [readings.facet[i] for i in np.flatnonzero(readings.ok)]


def bar_left_out(artefact: Artefact, touched: Sequence[Id]) -> str | None:
    """artefact, facet of every touch → why they do not use the scale bar, what to touch; None: they do, or there is none."""
    bar = artefact.scale_bar
    if bar is None:
        return None
    said = []
    for ball in bar.balls:
        own = [name for name in touched if artefact.facets[name].ball == ball]
        if own and _known(artefact, own):
            continue
        more, facets = completing(artefact, ball, own), ", ".join(dict.fromkeys(own))
        if not more:
            said.append(say("features.ball_has_too_few_facets", ball=ball))
        elif own:
            key = "ball_needs_one_more" if _known(artefact, [*own, more[0]]) else "ball_needs_more"
            said.append(say(f"features.{key}", ball=ball, facets=facets, more=", ".join(more)))
        else:
            said.append(say("features.ball_not_touched", ball=ball, more=", ".join(more)))
    return say("features.bar_not_used", why=joined("; ", said)) if said else None
