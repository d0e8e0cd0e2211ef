"""The body that stands for an obstacle holds all of it, is little larger, and its corners are those of its planes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from tango_cnc.check.solid import THIN, Body, solid
from tango_cnc.records import Array, Artefact, Facet, Obstacle

MUCH = 1.06  # times as large as the true solid: this far out nothing of the body is left
ROUND = 1.05  # the same for a round drawing; faces that are spread less evenly leave 1.08


def body_of(obstacle: Obstacle) -> Body:
    (body,) = solid(Artefact("one obstacle", {}, obstacles=(obstacle,))).obstacles
    return body


def outside(body: Body, points: Array) -> Array:
    """(n, 3) mm → (n,) mm beyond the plane that is farthest below the point, negative within the body."""
    return np.asarray((points @ body.normal.T - body.offset).max(axis=1))


def holds(body: Body, points: Array, farther: Array) -> None:
    """The planes and the corners hold the points, neither holds what is farther away."""
    np.testing.assert_allclose(np.linalg.norm(body.normal, axis=1), 1.0)
    hull = ConvexHull(body.corner).equations
    for inside, beyond in ((outside(body, points), outside(body, farther)), (*(_beyond(hull, p) for p in (points, farther)),)):
        assert inside.max() < 1e-6 and beyond.min() > 0
    assert np.abs(outside(body, body.corner)).max() < 1e-6


def _beyond(planes: Array, points: Array) -> Array:
    return np.asarray((points @ planes[:, :3].T + planes[:, 3]).max(axis=1))


@pytest.mark.parametrize("seed", range(3))
def test_the_body_of_a_cylinder_holds_it_and_little_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis, base = rng.normal(size=3), rng.uniform(-200, 200, 3)
    axis /= np.linalg.norm(axis)
    across = np.linalg.svd(axis[None])[2][1:]  # two directions at right angles to the axis
    turn = np.linspace(0, 2 * np.pi, 200)
    rim = np.column_stack([np.cos(turn), np.sin(turn)]) @ across
    radius, height = 15.0, 40.0
    body = body_of(Obstacle("cylinder", base=tuple(base), axis=tuple(axis), radius=radius, height=height))
    ends = np.vstack([base + radius * rim, base + radius * rim + height * axis])
    wide = base + MUCH * radius * rim + height / 2 * axis
    holds(body, ends, np.vstack([wide, [base - 0.01 * axis, base + (height + 0.01) * axis]]))


def test_the_body_of_a_round_drawing_holds_it_and_little_more() -> None:
    rng = np.random.default_rng(4)
    way = rng.normal(size=(1500, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    centre = np.array([40.0, -30.0, 80.0])
    holds(body_of(Obstacle("hull", points=tuple(map(tuple, centre + 20 * way)))), centre + 20 * way, centre + 20 * ROUND * way)


def test_the_table_holds_every_outer_facet_and_is_no_larger_than_facets_of_one_plane_are_uneven() -> None:
    """Facets of one side are entered up to half a millimeter unevenly: its plane is through the one that stands out most."""
    rng = np.random.default_rng(3)
    sides = [np.array(n) for n in ((1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), (0, -1.0, 0), (0, 0, 1.0), (0.6, 0.0, 0.8))]
    points = [tuple(rng.uniform(-20, 20, 3) * (n == 0) + (60.0 + step) * n) for n in sides for step in (0.0, 0.4, 0.2)]
    normals = [tuple(n) for n in sides for _ in range(3)]
    facets = {str(i): Facet(str(i), point, normal) for i, (point, normal) in enumerate(zip(points, normals, strict=True))}
    made = solid(Artefact("uneven", facets))
    assert made.table is not None and made.outer == set(facets)
    assert outside(made.table, np.array(points)).max() == pytest.approx(0.0, abs=1e-9)
    for normal in sides:
        reach = max(float(np.array(p) @ normal) for p in points)
        (own,) = {round(float(o), 6) for n, o in zip(made.table.normal, made.table.offset, strict=True) if np.allclose(n, normal)}
        assert own == pytest.approx(reach, abs=1e-6)


def test_a_box_without_thickness_is_a_thin_body() -> None:
    """Its normals point to both sides: a plane has no inside, and nothing could be found to meet it."""
    body = body_of(Obstacle("box", low=(0.0, 0.0, 5.0), high=(10.0, 10.0, 5.0), title="sheet"))
    low, high = body.corner.min(axis=0), body.corner.max(axis=0)
    assert (high - low).tolist() == pytest.approx([10.0, 10.0, THIN])
