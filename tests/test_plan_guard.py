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
