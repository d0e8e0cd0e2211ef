"""Two convex bodies apart: by boxes whose distance is worked out by hand, by random solids, exactly at the limit, and how soon."""

from __future__ import annotations

import numpy as np
import pytest

from tango_cnc.check.apart import Placed, Round, apart
from tango_cnc.records import Array

ASIDE = np.array([7.0, -5.0, 11.0])  # both boxes are from where they were drawn
UNIT = np.array([[i, j, k] for i in (-1.0, 1) for j in (-1.0, 1) for k in (-1.0, 1)])


def over_each_other(gap: Array, aside: Array) -> tuple[Round, Placed, Round, Placed, float]:
    """(n,) mm between two boxes above each other, (n, 2) mm that the upper one is aside → the boxes, poses, mm of their radii."""
    upper, lower = Round(UNIT * 20.0 + np.array([1.0, 2.0, 20.0]), 0.5), Round(UNIT * 10.0 + np.array([3.0, -4.0, -10.0]), 0.25)
    place = np.hstack([aside, gap[:, None]])[:, None]
    at, there = place + ASIDE, np.zeros_like(place) + ASIDE
    turn = np.tile(np.eye(3), (len(gap), 1, 1))
    return upper, Placed(turn, at), lower, Placed(turn, there), 0.75


@pytest.mark.parametrize("steps", [24, 0])  # of the walk; without any everything is worked out by the nearest point
def test_exactly_as_far_as_asked_is_not_proven_and_a_little_more_is(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever is asked for more than what is there says no, whatever the last digit does; a nanometre is enough for a yes."""
    monkeypatch.setattr("tango_cnc.check.apart.STEPS", steps)
    rng = np.random.default_rng(9)
    gap, aside = rng.uniform(2.0, 40.0, 40), rng.uniform(-9, 9, (40, 2))
    aside[:9] = [2.0, -6.0]  # one straight above the other: the first direction of the walk is the right one
    upper, at, lower, there, radii = over_each_other(gap, aside)
    for more, proven in ((0.0, False), (1e-6, False), (-1e-6, True)):
        assert (apart(upper, at, lower, there, gap - radii + more) == proven).all()


@pytest.mark.parametrize("steps", [24, 0])
def test_two_points_at_one_place_are_not_apart(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between them is no way in which anybody could look for a distance."""
    monkeypatch.setattr("tango_cnc.check.apart.STEPS", steps)
    point, here = Round(np.zeros((1, 3))), Placed(np.eye(3)[None], ASIDE[None, None])
    assert not apart(point, here, point, here, np.zeros(1)).any()


def test_the_walk_alone_decides_what_is_clear(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest point is worked out for few poses only: a hundred times as slow, it is left to what is nearly as far as asked."""
    monkeypatch.setattr("tango_cnc.check.apart._nearest", lambda *args: pytest.fail("the walk has not decided"))
    rng = np.random.default_rng(11)
    gap, aside = rng.uniform(10.0, 60.0, 200), rng.uniform(-15, 15, (200, 2))
    upper, at, lower, there, radii = over_each_other(gap, aside)
    assert apart(upper, at, lower, there, 0.7 * gap - radii).all()
    assert not apart(upper, at, lower, there, 1.3 * gap - radii).any()


def test_two_boxes_straight_above_each_other_are_decided_at_the_first_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """The walk begins at the way from the one centre to the other, between all shifts."""
    monkeypatch.setattr("tango_cnc.check.apart.STEPS", 1)
    monkeypatch.setattr("tango_cnc.check.apart._nearest", lambda *args: pytest.fail("one look has not decided"))
    gap = np.linspace(2.0, 40.0, 20)
    upper, at, lower, there, radii = over_each_other(gap, np.tile([2.0, -6.0], (20, 1)))
    sideways = np.array([[9.0, 0.0, 0.0], [-9.0, 0.0, 0.0]])
    swept = Placed(at.turn, at.shift + sideways)
    still = Placed(there.turn, np.repeat(there.shift, 2, axis=1))
    assert apart(upper, swept, lower, still, 0.9 * gap - radii).all()


@pytest.mark.parametrize("seed", range(2))
def test_proven_apart_is_apart(seed: int) -> None:
    """Random solids shifted past each other: what is proven is so for all points of both that are drawn."""
    rng = np.random.default_rng(seed)
    one, other = (Round(rng.normal(size=(9, 3)) * rng.uniform(5, 60, 3), r) for r in (0.0, 3.0))
    turn = np.linalg.qr(rng.normal(size=(60, 3, 3)))[0]
    shift = rng.normal(size=(60, 2, 3)) * 120
    need = rng.uniform(0, 20, 60)
    still = Placed(np.tile(np.eye(3), (60, 1, 1)), np.zeros((60, 2, 3)))
    proven = apart(one, Placed(turn, shift), other, still, need)
    share, along = rng.dirichlet(np.full(9, 0.3), (2, 200)), rng.dirichlet(np.full(2, 0.5), 200)
    a = np.einsum("nij,vj->nvi", turn, share[0] @ one.corner) + np.einsum("vs,nsi->nvi", along, shift)
    b = share[1] @ other.corner
    nearest = np.linalg.norm(a[:, :, None] - b[None, None, ::4], axis=-1).min(axis=(1, 2)) - other.radius
    assert (nearest[proven] > need[proven]).all()
    assert 6 < proven.sum() < 58


@pytest.mark.parametrize("steps", [24, 0])  # of the walk; without any everything is worked out by the nearest point
def test_boxes_are_as_far_apart_as_can_be_worked_out_by_hand(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tango_cnc.check.apart.STEPS", steps)
    rng = np.random.default_rng(4)
    half, way = rng.uniform(1, 40, (2, 3)), rng.uniform(-150, 150, (300, 2, 3))
    way[:, 1, 1:] = way[:, 0, 1:]  # shifted along X
    beside = np.array([25.0, -17.0, 11.0])  # of the one box from its own origin: neither is its mirror image
    low, high = way.min(axis=1) + beside - half.sum(axis=0), way.max(axis=1) + beside + half.sum(axis=0)
    exact = np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0), axis=1)
    need = rng.uniform(0, 60, 300)
    poses = [Placed(np.tile(np.eye(3), (300, 1, 1)), shift) for shift in (way, np.zeros((300, 2, 3)))]
    proven = apart(Round(beside + UNIT * half[0]), poses[0], Round(UNIT * half[1]), poses[1], need)
    assert (proven == (exact > need))[np.abs(exact - need) > 1e-3].all() and 50 < proven.sum() < 250
