"""What a plan says of the way to its first place, and of places that no axis reaches."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
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
from tango_cnc.plan import places as of_plan
from tango_cnc.plan import plan, ways
from tango_cnc.plan.guard import FINE, TOUCH, TRAVEL, Guard, outside, refuse, remarks
from tango_cnc.records import Array, InputError, Machine, Move, Plan

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


class Asked:
    """Stands for a guard: notes what it is asked, and says that something is met at the places and turns that it is given."""

    def __init__(self, met: Callable[[Array], bool] = lambda place: False) -> None:
        named = SimpleNamespace(
            one=SimpleNamespace(name="tip", probe=True), other=SimpleNamespace(name="yoke"), margins=(1, 10, 20)
        )
        self.pairs, self.met = [named], met
        self.ways: Counter[tuple[int, tuple[float, ...], tuple[float, ...]]] = Counter()
        self.turned: list[tuple[tuple[float, ...], bool, bool]] = []

    def meets(self, places: Array, margin: int) -> Array:
        self.ways.update((margin, tuple(start), tuple(end)) for start, end in places.tolist())
        return np.array([0 if self.met(end) else -1 for _, end in places])

    def turns(self, place: Array, within: object, probe_alone: bool = False) -> object:
        self.turned.append((tuple(place.tolist()), within is None, probe_alone))
        return self.pairs[0] if self.met(place) else None


def ways_of(made: Plan) -> list[tuple[Move, bool, tuple[float, ...], tuple[float, ...]]]:
    """→ every move with whether all axes stand somewhere that is known, where it begins and where it ends."""
    at, found = dict[str, float](), list[tuple[Move, bool, tuple[float, ...], tuple[float, ...]]]()
    for move in made.moves:
        start, known = at, len(at) == len(made.machine.names)
        at = {**at, **move.target}
        found.append((move, known, *(tuple(p.get(n, np.nan) for n in made.machine.names) for p in (start, at))))
    return found


@pytest.mark.parametrize("chunk", [4096, 3])
def test_every_way_of_a_plan_is_asked_for_once_with_the_margin_of_its_kind(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Up and over are ways with the large margin. Near the facet the small one counts, and still on the first way up from it."""
    monkeypatch.setattr("tango_cnc.plan.guard.CHUNK", chunk)
    made, asked = plan(read_cell(Path(__file__).parent / "golden" / "cell")), Asked()
    refuse(made, cast(Guard, asked))
    moves = ways_of(made)
    expected: Counter[tuple[int, tuple[float, ...], tuple[float, ...]]] = Counter()
    for (before, *_), (move, known, start, end) in pairwise([moves[0], *moves]):
        if move.kind != "index" and known:
            wide = move.kind == "clear" or (move.kind == "retract" and before.kind != "back")
            expected[TRAVEL if wide else TOUCH, start, end] += 1
    assert asked.ways == expected and {margin for margin, _, _ in expected} == {TOUCH, TRAVEL}
    first = next(i for i, (move, *_) in enumerate(moves) if move.kind == "approach")
    turns = [(end, not known, i < first) for i, (move, known, _, end) in enumerate(moves) if move.kind == "index"]
    assert asked.turned == turns and {alone for _, _, alone in turns} == {True, False}


def test_a_way_on_which_something_is_met_is_that_to_the_touch_it_leads_to() -> None:
    """From off the facet on it leads to the next touch; after the last touch, to one more than there are."""
    made = plan(read_cell(Path(__file__).parent / "golden" / "cell"))
    numbers, left = [touch.number for touch in made.touches], set[int]()
    for move, known, _, end in ways_of(made):
        leads = [*numbers[1:], numbers[-1] + 1][numbers.index(move.touch)] if move.touch in left else move.touch
        left |= {move.touch} if move.kind == "back" else set()
        if not known:
            continue
        faults: dict[int, str] = {}
        refuse(made, cast(Guard, Asked(lambda place, end=end: tuple(place.tolist()) == end)), faults)  # type: ignore[misc]
        assert leads in faults, (move.kind, move.touch, faults)
    touch, faults = made.touches[3], {}
    refuse(made, cast(Guard, Asked(lambda place: tuple(place.tolist()) == tuple(touch.end))), faults)
    assert list(faults) == [touch.number]
    name = f"touch {touch.number} (facet {touch.facet}, indexation {touch.indexation + 1}: B -30 C -90 S 0)"
    said = f"{name} tip would come within 1 mm of yoke"
    assert said in faults[touch.number]
    with pytest.raises(InputError, match=re.escape(said)):
        refuse(made, cast(Guard, Asked(lambda place: tuple(place.tolist()) == tuple(touch.end))))


def test_a_way_with_something_in_it_goes_over_the_clear_level_from_end_to_end() -> None:
    """The others stay as low as they were."""
    cell = read_cell(Path(__file__).parent / "golden" / "cell")
    scene = of_plan.scene(cell.machine, cell.artefact, cell.strategy)
    touched = [(facet, at) for at, one in enumerate(cell.strategy.indexations) for facet in one.facets]
    facet, at = np.array([scene.facet.index(name) for name, _ in touched]), np.array([at for _, at in touched])
    low, _ = ways.lifts(replace(scene, guard=cast(Guard, Asked())), facet, at)
    before = next(i for i, (one, other) in enumerate(pairwise(at)) if one == other and low[2, i] < low[0, i])
    standoff, up = scene.standoff(facet[[before + 1]], at[[before + 1]])
    end = scene.axes(at[[before + 1]], (standoff + low[1, [before + 1], None] * up)[None])[0, 0]
    high, _ = ways.lifts(replace(scene, guard=cast(Guard, Asked(lambda place: bool(np.allclose(place, end))))), facet, at)
    expected = low.copy()
    expected[2, before], expected[1, before + 1] = low[0, before], low[0, before + 1]
    assert (high == expected).all() and (high != low).any(axis=0).tolist() == [i in (before, before + 1) for i in range(len(at))]
