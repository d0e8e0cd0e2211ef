"""Do the facets of a ball lie on it, and are the balls of the scale bar as far apart as it is long?

Both are given twice, once as centre and radius and once as points, normals or a length. They are nominal values, of a table
that was set up by hand: they may differ by less than the probe's usual way to look for a facet.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..records import Array, Ball, Facet, Id, InputError, ScaleBar
from .checked import Node

NEAR = 2.0  # mm that a facet may lie beside the surface of its ball …
SHARE = 0.1  # … or this share of the radius, whichever is more
TILT = 10.0  # degrees between the normal of a facet and the direction from the centre of its ball


def check_facets(facets: Mapping[Id, Facet], balls: Mapping[Id, Ball], at: Mapping[str, Node]) -> None:
    """facets, balls, nodes `facets` and `balls` of their file → nothing. Raises InputError when a facet is not on its ball."""
    for ball in balls.values():
        own = [facet for facet in facets.values() if facet.ball == ball.id]
        wrong = next((facet for facet in own if _away(facet, ball) > near(ball) or _tilt(facet, ball) > TILT), None)
        if wrong is not None:
            alike = _alike(own, ball, at["balls"]) if len(own) > 1 else None
            raise alike or _not_on(wrong, ball, balls, at["facets"])


def near(ball: Ball) -> float:
    """ball → mm that its facets may lie beside its surface."""
    return max(NEAR, SHARE * ball.radius)


def _away(facet: Facet, ball: Ball) -> float:
    return abs(math.dist(facet.point, ball.centre) - ball.radius)


def _tilt(facet: Facet, ball: Ball) -> float:
    """→ degrees from the direction out of the centre."""
    spoke = np.subtract(facet.point, ball.centre)
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(spoke, facet.normal))), float(spoke @ np.array(facet.normal))))


def _alike(own: list[Facet], ball: Ball, at: Node) -> InputError | None:
    """→ the error about the ball, when its facets agree with each other on another centre, or on another radius around this one."""
    keys = dict(dict(at.items())[ball.id].items())
    centres = np.array([np.subtract(f.point, ball.radius * np.array(f.normal)) for f in own])
    middle = centres.mean(axis=0)
    if (np.linalg.norm(centres - middle, axis=1) <= near(ball)).all():
        return keys["centre"].wrong(
            f"within {near(ball):g} mm of that. The centre may be wrong, or all of these facets: correct one or the other",
            f"{_shown(np.array(ball.centre))}, {np.linalg.norm(middle - ball.centre):.3g} mm from {_shown(middle)}, where by "
            f"point and normal all of its {len(own)} facets have it",
        )
    radii = np.array([math.dist(f.point, ball.centre) for f in own])
    if np.ptp(radii) <= NEAR and all(_tilt(f, ball) <= TILT for f in own):
        return keys["radius"].wrong(
            f"within {near(ball):g} mm of that. The radius is half of the diameter; correct it or these facets",
            f"{ball.radius:g}, but all of its {len(own)} facets lie {radii.mean():.4g} mm from the centre",
        )
    return None


def _not_on(facet: Facet, ball: Ball, balls: Mapping[Id, Ball], facets: Node) -> InputError:
    node = dict(facets.items())[facet.id]
    if (away := _away(facet, ball)) <= near(ball):
        return dict(node.items())["normal"].wrong(
            f"within {TILT:g}° of it: normals point out of the material. Correct point, normal or the ball's number",
            f"{_shown(np.array(facet.normal))}, {_tilt(facet, ball):.0f}° from the direction out of the centre of ball {ball.id}",
        )
    other = next((b.id for b in balls.values() if _away(facet, b) <= near(b) and _tilt(facet, b) <= TILT), None)
    return node.wrong(
        f"within {near(ball):g} mm of it. Correct point, centre, radius or the ball's number"
        + (f": it lies on ball {other}" if other else ""),
        f"a point {away:.3g} mm off the surface of ball {ball.id} ({math.dist(facet.point, ball.centre):.4g} mm from its centre, "
        f"radius {ball.radius:g})",
    )


def check_bar(bar: ScaleBar, balls: Mapping[Id, Ball], at: Node) -> None:
    """scale bar, balls, node of its length → nothing. Raises InputError when its balls are not that far apart."""
    one, two = (balls[ball] for ball in bar.balls)
    apart = math.dist(one.centre, two.centre)
    if abs(apart - bar.length) > 2 * NEAR:
        raise at.wrong(
            f"within {2 * NEAR:g} mm of that. Correct the length or a centre",
            f"{bar.length:g}, but the centres of balls {one.id} and {two.id} are {apart:.6g} mm apart",
        )


def _shown(vector: Array) -> str:
    return "[" + ", ".join(f"{round(v, 3) + 0.0:g}" for v in vector.tolist()) + "]"
