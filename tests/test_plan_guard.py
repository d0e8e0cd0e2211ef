"""What a plan says of the way to its first place, and of places that no axis reaches."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blockcell import machine as topology

from tango_cnc.check.apart import Round
from tango_cnc.check.bodies import Pair, Thing
from tango_cnc.files import read_cell
from tango_cnc.plan.guard import FINE, Guard, outside, remarks
from tango_cnc.records import Array, Machine

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_a_place_beyond_the_travel_of_an_axis_is_outside_and_an_axis_without_travel_never_is() -> None:
    machine = read_cell(EXAMPLES / "trunnion").machine
    low, high = machine.axis("X").travel or (0.0, 0.0)
    place = np.zeros(len(machine.names))
    for x, beyond in ((low, False), (high, False), (low - 0.01, True), (high + 0.01, True)):
        place[machine.column("X")] = x
        assert outside(machine, place) == beyond, x
    place[machine.column("X")], place[machine.column("S")] = 0.0, 100.0
    assert machine.axis("S").travel is None and not outside(machine, place)


def test_the_first_place_is_named_in_millimeters_and_degrees_where_something_may_be_met_on_the_way() -> None:
    machine = read_cell(EXAMPLES / "trunnion").machine
    met = SimpleNamespace(one=SimpleNamespace(name="spindle"), other=SimpleNamespace(name="door"))
    guard = cast(Guard, SimpleNamespace(anywhere=lambda where, first: [met]))
    place = {"X": 12.0, "Y": -3.0, "Z": 400.0, "A": np.pi / 6, "C": -np.pi / 2, "S": 0.0}
    (text,) = remarks(machine, guard, [place[name] for name in machine.names], "Z")
    assert "(X 12.0 Y -3.0 A 30.0 C -90.0)" in text and "door may be met by spindle" in text


NEED = 4.0  # mm that the two things are to keep
WALK = 41  # places along each axis
SEEN = 9  # points of a thing that is a line


def rod(rng: np.random.Generator, name: str, axes: tuple[str, ...]) -> Thing:
    """→ a line with a radius, or a ball, and the axes that carry it."""
    ends = rng.uniform(-90.0, 90.0, (int(rng.integers(1, 3)), 3))
    return Thing(name, Round(ends, float(rng.uniform(5.0, 30.0))), axes)


def walked(machine: Machine, axes: tuple[str, ...], points: Array, way: dict[str, Array], place: Array) -> Array:
    """machine, axes from the foundation outwards, (v, 3) mm, places of those that move → (v, …, 3) mm, where the points get."""
    found = points
    for name in reversed(axes):
        axis = machine.axis(name)
        steps = way.get(name, place[machine.column(name)][None])
        flat, direction = found.reshape(-1, 3), np.array(axis.direction)
        if axis.kind == "linear":
            moved = flat[:, None] + steps[:, None] * direction
        else:
            turns = Rotation.from_rotvec(steps[:, None] * direction).as_matrix()
            moved = np.einsum("sij,nj->nsi", turns, flat - np.array(axis.point)) + np.array(axis.point)
        found = moved.reshape(*found.shape[:-1], len(steps), 3)
    return found


def between(machine: Machine, pair: Pair, way: dict[str, Array], place: Array) -> float:
    """→ mm, the least distance of the two anywhere on a grid of the places, as a walk by points finds it."""
    clouds = []
    for thing, axes in ((pair.one, pair.own), (pair.other, pair.others)):
        ends = thing.shape.corner
        points = ends[:1] + np.linspace(0.0, 1.0, SEEN)[:, None] * (ends[-1:] - ends[:1]) if len(ends) > 1 else ends
        clouds.append(walked(machine, axes, points, way, place).reshape(-1, 3))
    one, other = clouds
    far = min(
        float(np.linalg.norm(some[:, None] - other[None], axis=-1).min()) for some in np.array_split(one, len(one) // 200 + 1)
    )
    return far - pair.one.shape.radius - pair.other.shape.radius


@pytest.mark.parametrize(("own", "others"), [(("B", "C"), ()), (("X", "C"), ("Z", "A")), ((), ("Y", "C", "Z", "A"))])
def test_two_things_that_turn_are_proven_apart_where_they_are_and_refused_where_they_meet(
    own: tuple[str, ...], others: tuple[str, ...]
) -> None:
    """One or two axes that turn, on one side or on both: what is proven keeps the distance, what is refused comes near to it."""
    rng, proven, refused = np.random.default_rng(len(own)), 0, 0
    letters = [name for name in (*own, *others) if name in "ABC"]
    for _ in range(24):
        base = topology("wCBXfZYA(S)t", {name: tuple(rng.uniform(-40.0, 40.0, 3)) for name in "ABC"})
        machine = replace(base, axes=tuple(replace(a, travel=(-4.0, 4.0)) if a.name in "ABC" else a for a in base.axes))
        one, other = rod(rng, "one", own), rod(rng, "other", others)
        aside = rng.normal(size=3)
        aside *= rng.uniform(20.0, 200.0) / np.linalg.norm(aside)
        other = replace(other, shape=replace(other.shape, corner=other.shape.corner + aside))
        pair = Pair(one, other, own, others, (NEED, NEED, NEED))
        place = np.zeros(len(machine.names))
        place[:3] = rng.uniform(-15.0, 15.0, 3)
        spans = {name: (0.0, 0.0) for name in machine.rotary} | {
            name: (float(rng.uniform(-1.2, 0.0)), float(rng.uniform(0.0, 1.2))) for name in letters
        }
        met = Guard(machine, [pair]).turns(place, spans)
        gap = between(machine, pair, {name: np.linspace(*spans[name], WALK) for name in letters}, place)
        assert gap >= NEED - 1e-6 if met is None else gap <= NEED + FINE + 6.0
        proven, refused = proven + (met is None), refused + (met is not None)
    assert proven > 2 and refused > 2


def balls(*places: tuple[float, float, float]) -> list[Thing]:
    """→ balls of 10 mm radius; each is a thing of its own."""
    return [Thing(f"ball {i}", Round(np.array([place]), 10.0), ()) for i, place in enumerate(places)]


def of_travel(**travels: tuple[float, float] | None) -> Machine:
    """→ a table C on an axis B that X carries, a tool on Y and Z, with these travels."""
    base = topology("wCBXfZY(S)t")
    return replace(base, axes=tuple(replace(a, travel=travels[a.name]) if a.name in travels else a for a in base.axes))


def test_of_several_pairs_that_come_too_near_the_first_one_is_named() -> None:
    machine, (still, one, other) = of_travel(), balls((0, 0, 0), (200, 0, 0), (200, 30, 0))
    pairs = [Pair(still, thing, (), ("X",), (2.0, NEED, NEED)) for thing in (one, other)]
    places = np.zeros((4, 2, len(machine.names)))
    places[:, 1, machine.column("X")] = [-100.0, -176.5, -177.0, -300.0]  # on the way from 0
    assert Guard(machine, pairs).meets(places, 0).tolist() == [-1, -1, -1, 0]
    assert Guard(machine, pairs).meets(places, 1).tolist() == [-1, 0, 0, 0]
    assert Guard(machine, pairs[::-1]).meets(places, 0).tolist() == [-1, -1, -1, 1]
    assert Guard(machine, [*pairs[1:], *pairs]).meets(places, 0).tolist() == [-1, -1, -1, 1]
    assert Guard(machine, [pairs[0], pairs[0]]).meets(places, 1).tolist() == [-1, 0, 0, 0]


@pytest.mark.parametrize(
    ("travel", "first", "met"),
    [
        ((-5.0, 70.0), "Z", False),
        ((-5.0, 79.0), "Z", True),
        ((-79.0, 5.0), "Z", False),
        ((-5.0, 79.0), "X", False),  # it stands where it is
        (None, "Z", False),
    ],
)
def test_what_may_meet_anywhere_is_looked_for_over_the_travel_of_every_axis_but_the_first(
    travel: tuple[float, float] | None, first: str, met: bool
) -> None:
    machine, (still, one) = of_travel(X=travel, Y=(0.0, 0.0), Z=(0.0, 0.0)), balls((100, 0, 0), (0, 0, 0))
    found = Guard(machine, [Pair(still, one, (), ("X",), (2.0, NEED, NEED))]).anywhere(np.zeros(len(machine.names)), first)
    assert bool(found) == met


def test_what_was_found_of_a_turn_counts_for_the_same_places_and_angles_alone() -> None:
    """Answers are kept: another place, other angles, another need or another thing is another question."""
    machine, (still, one, far) = of_travel(), balls((150, 0, 0), (80, 0, 0), (0, 0, 0))
    near, at_ease = (Pair(still, thing, (), ("X", "C"), (NEED, NEED, NEED)) for thing in (one, far))
    wide = replace(near, margins=(NEED, NEED, 60.0))
    place, nearer = np.zeros(len(machine.names)), np.zeros(len(machine.names))
    nearer[machine.column("X")] = 60.0
    turn, away = {"B": (0.0, 0.0), "C": (-0.2, 0.2)}, {"B": (0.0, 0.0), "C": (2.0, 2.4)}
    known: dict[tuple[object, ...], bool] = {}
    for _ in range(2):  # the second time everything is known
        for pair, where, spans, met in (
            (near, place, turn, False),
            (near, nearer, turn, True),
            (near, nearer, away, False),
            (wide, place, turn, True),
            (at_ease, place, turn, False),
        ):
            assert (Guard(machine, [pair], known).turns(where, spans) is not None) == met, (pair.margins, spans)
    assert len(known) == 5


@pytest.mark.parametrize("own", [("B", "C"), ("C", "X"), ("B", "Z", "C"), ("C",)])
def test_what_turns_is_proven_right_up_to_how_near_it_gets(own: tuple[str, ...]) -> None:
    """A ball that turns, also with a linear axis between, and one that stands: a hair less is proven, more is not.

    How near they get is looked for on a grid of the angles, and four times on a finer one around the nearest.
    """
    rng = np.random.default_rng(len(own))
    for _ in range(8):
        machine = topology("wCBXfZY(S)t", {name: tuple(rng.uniform(-60.0, 60.0, 3)) for name in "BC"})
        (one, other), place = balls(tuple(rng.uniform(-90, 90, 3)), (0, 0, 0)), rng.uniform(-150.0, 150.0, len(machine.names))
        letters = [name for name in own if name in "BC"]
        spans = {"B": (0.0, 0.0), "C": (0.0, 0.0)} | {name: tuple(np.sort(rng.uniform(-1.5, 1.5, 2)).tolist()) for name in letters}
        near = {name: np.linspace(*spans[name], WALK) for name in letters}
        reached = walked(machine, own, one.shape.corner, near, place).reshape(-1, 3)
        aside = reached[int(rng.integers(len(reached)))] + rng.normal(size=3) * 25.0
        for _ in range(5):
            far = np.linalg.norm(walked(machine, own, one.shape.corner, near, place) - aside, axis=-1)
            at = dict(zip(reversed(own), np.unravel_index(far.argmin(), far.shape[1:]), strict=True))
            gap = float(far.min()) - 20.0
            step = {name: near[name][1] - near[name][0] for name in letters}
            near = {
                name: np.linspace(*np.clip(near[name][at[name]] + np.array([-1.0, 1.0]) * step[name], *spans[name]), 21)
                for name in letters
            }
        still = replace(other, shape=replace(other.shape, corner=aside[None]))
        for need, meets in ((gap - 0.6, False), (gap + 0.1, True)):
            pair = Pair(one, still, own, (), (need, need, need))
            assert (Guard(machine, [pair]).turns(place, spans) is not None) == meets, (gap, spans)
