"""Obstacles on any body of the machine: how they are declared, what the planner makes of them, and that the machine agrees.

The random machines of the campaign are run on the simulated machine, which finds collisions by mathematics of its own, from
anywhere that the axes may stand at; besides, a judge that knows points and boxes alone looks at every move (support/bodies.py).
"""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.bodies import SETTER, YOKE, begun, bodies_of, judged, met, random_bodies, trunnion
from support.randomplans import EXAMPLES, example

from tango_cnc.check import bodies, solid
from tango_cnc.check.bodies import pairs
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell
from tango_cnc.files.write import machine_text
from tango_cnc.plan import guard, plan
from tango_cnc.records import InputError, Obstacle


def invoke(arguments: list[str]) -> int | None:
    """arguments of `tango` → exit status."""
    return guarded(tango.main, arguments, standalone_mode=False)


@pytest.mark.long
def test_a_yoke_and_a_tool_setter_leave_all_touches_and_are_not_met() -> None:
    cell = trunnion(*YOKE, SETTER, indexations=2)
    made = plan(cell)
    assert len(made.touches) == len(plan(trunnion(indexations=2)).touches) and not made.start
    assert not met(made, cell)
    found = judged(replace(made, touches=made.touches[-2:], turns=made.turns[1:]), 20.0, 0.2)
    assert found.probe >= 0 and found.solids >= 0


class Met:
    """Stands for a guard that finds every move of one margin to meet something, and no other move."""

    def __init__(self, margin: int | None) -> None:
        cheek = SimpleNamespace(
            one=SimpleNamespace(name="nose", probe=True), other=SimpleNamespace(name="cheek"), margins=(5, 6, 7)
        )
        self.margin, self.pairs = margin, (cheek,)

    def meets(self, places: np.ndarray, margin: int) -> np.ndarray:
        return np.full(len(places), 0 if margin == self.margin else -1)

    def turns(self, *asked: object, **more: object) -> None:
        return None


@pytest.mark.parametrize(("margin", "keeps"), [(guard.TOUCH, "5 mm"), (guard.TRAVEL, "6 mm")])
def test_a_move_that_meets_something_is_refused_near_a_facet_and_on_the_way(margin: int, keeps: str) -> None:
    made = plan(read_cell(Path(__file__).parent / "golden" / "cell"))
    guard.refuse(made, Met(None))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=f"nose would come within {keeps} of cheek"):
        guard.refuse(made, Met(margin))  # type: ignore[arg-type]


class Asked:
    """Stands for a guard that finds nothing and keeps where each way that it was asked about ends, by its margin."""

    def __init__(self) -> None:
        self.pairs, self.ends = (None,), dict[int, set[tuple[float, ...]]]()

    def meets(self, places: np.ndarray, margin: int) -> np.ndarray:
        self.ends.setdefault(margin, set()).update(map(tuple, places[:, -1].tolist()))
        return np.full(len(places), -1)

    def turns(self, *asked: object, **more: object) -> None:
        return None


def test_near_a_facet_the_small_margin_counts_and_on_the_way_the_large_one() -> None:
    made, asked = plan(read_cell(Path(__file__).parent / "golden" / "cell")), Asked()
    guard.refuse(made, asked)  # type: ignore[arg-type]
    columns = [made.machine.column(name) for name in made.machine.linear]
    touched = {tuple(np.round([touch.end[i] for i in columns], 6)) for touch in made.touches}
    ends = {margin: {tuple(np.round([end[i] for i in columns], 6)) for end in found} for margin, found in asked.ends.items()}
    assert set(ends) == {guard.TOUCH, guard.TRAVEL}
    assert touched <= ends[guard.TOUCH]
    assert not touched & ends[guard.TRAVEL]


def test_what_goes_with_the_table_is_seen_where_it_was_and_what_does_not_the_other_way() -> None:
    machine = example("trunnion").machine
    at, on = np.zeros((1, len(machine.names))), [name for name in machine.workpiece_branch if name in machine.linear]
    still, cheek = (bodies.seen(machine, obstacle, at) for obstacle in (SETTER, YOKE[0]))
    for axis in on:
        moved = at.copy()
        moved[0, machine.column(axis)] = 50.0
        np.testing.assert_allclose(bodies.seen(machine, YOKE[0], moved), cheek, atol=1e-9)
        way = -50.0 * np.array(machine.axis(axis).direction)
        np.testing.assert_allclose(bodies.seen(machine, SETTER, moved), still + way, atol=1e-9)
    turned = at.copy()
    turned[0, machine.column("C")] = np.radians(90.0)
    about = np.array(machine.axis("C").point)
    rotation = Rotation.from_rotvec(np.radians(-90.0) * np.array(machine.axis("C").direction))
    np.testing.assert_allclose(bodies.seen(machine, YOKE[0], turned), rotation.apply(cheek - about) + about, atol=1e-9)


@pytest.mark.parametrize(
    ("travel", "between"),
    [
        ((-120.0, 30.0), (-120.0, 30.0)),
        ((-110.0, 240.0), (-110.0, 240.0)),
        ((300.0, 400.0), (300.0, 400.0)),
        ((-360.0, 360.0), (-180.0, 180.0)),
        (None, (-180.0, 180.0)),
    ],
)
def test_an_axis_that_may_be_anywhere_is_within_its_travel(
    travel: tuple[float, float] | None, between: tuple[float, float]
) -> None:
    machine = example("trunnion").machine
    limits = None if travel is None else (np.radians(travel[0]), np.radians(travel[1]))
    axes = tuple(replace(axis, travel=limits) if axis.name == "C" else axis for axis in machine.axes)
    assert np.degrees(guard.everywhere(replace(machine, axes=axes))["C"]) == pytest.approx(between)


@pytest.mark.few(0)
def test_what_is_far_away_changes_nothing() -> None:
    far = Obstacle("box", low=(5000.0, 5000.0, 0.0), high=(5100.0, 5100.0, 100.0), on="A")
    blind = plan(trunnion())
    for on in ("f", "Y", "A", "X", "Z"):
        made = plan(trunnion(replace(far, on=on)))
        assert made.touches == blind.touches and made.turns == blind.turns and not made.start and not made.left_out


def test_the_table_meets_a_tool_setter_that_stands_where_it_goes() -> None:
    near = replace(SETTER, base=(340.0, 100.0, -300.0))
    with pytest.raises(InputError, match=r"within 5 mm of obstacle 4 of machine.yaml \(tool setter, on f\)"):
        plan(trunnion(*YOKE, near))
    assert "obstacle 4 of the machine" in met(plan(trunnion()), trunnion(*YOKE, near))


@pytest.mark.few(0)
def test_a_clamp_on_the_table_meets_the_yoke_when_c_turns_and_not_when_a_does() -> None:
    cell = trunnion(*YOKE)
    clamp = Obstacle("box", low=(-20.0, 170.0, -70.0), high=(20.0, 262.0, -50.0))
    turning = replace(cell, artefact=replace(cell.artefact, obstacles=(clamp,)))
    with pytest.raises(InputError, match=r"obstacle 1 would come within 5 mm of obstacle \d of machine.yaml \((left|right) cheek"):
        plan(turning, "leave-out")
    one = cell.strategy.indexations[0]
    tilted = tuple(replace(one, position={**one.position, "A": angle}, facets=("13",)) for angle in (0.0, 0.5, -0.7))
    made = plan(replace(turning, strategy=replace(cell.strategy, indexations=tilted)))
    assert not met(made, turning) and any("obstacle 1" in text or "A " in text for text in made.start)


@pytest.mark.long
@pytest.mark.parametrize(("height", "raised"), [(30.0, 0.0), (110.0, 100.0)])
def test_a_post_on_the_yoke_is_passed_over(height: float, raised: float) -> None:
    """It stands between two facets: the way between them goes over it, though no facet and nothing on the table is as high."""
    post = Obstacle("cylinder", base=(-45.0, 32.5, -30.0), axis=(0.0, 0.0, 1.0), radius=6.0, height=height, on="A")
    cell = trunnion(post)
    one = cell.strategy.indexations[0]
    strategy = replace(cell.strategy, indexations=(replace(one, facets=("9", "13", "10", "14")),))
    low, made = (plan(replace(c, strategy=strategy)) for c in (trunnion(), cell))
    z = cell.machine.column("Z")
    assert max(t.leave[z] for t in made.touches[:-1] if t.leave) > max(t.leave[z] for t in low.touches[:-1] if t.leave) + 50
    assert made.touches[0].over[z] == pytest.approx(low.touches[0].over[z] + raised)
    over = [i for i, (one, other) in enumerate(zip(low.touches, made.touches, strict=True)) if other.leave[z] > one.leave[z] + 1]
    assert over and all(made.touches[i + 1].enter[z] == pytest.approx(made.touches[i].leave[z]) for i in over)
    assert "obstacle 1 of the machine" in met(low, cell) and not met(made, cell)


def test_a_door_on_the_ram_meets_the_table() -> None:
    """A housing that the ram carries down beside the spindle: no probe reaches the pallet's middle without it."""
    door = Obstacle("box", low=(60.0, -100.0, -150.0), high=(100.0, 100.0, 200.0), on="Z", title="housing")
    low = replace(door, low=(60.0, -100.0, -238.0))
    assert plan(trunnion(door, indexations=1)).touches
    with pytest.raises(InputError, match=r"table would come within 5 mm of obstacle 1 of machine.yaml \(housing, on Z\)"):
        plan(trunnion(low, indexations=1))


def test_a_longer_search_takes_the_housing_nearer_to_the_table() -> None:
    """A search that meets nothing ends behind the facet: what the ram carries must have room there, too."""
    door = Obstacle("box", low=(60.0, -100.0, -190.0), high=(100.0, 100.0, 200.0), on="Z", title="housing")
    cell = trunnion(door, indexations=1)

    def left(search: float) -> int:
        approach = replace(cell.strategy.approach, search=search)
        return len(plan(replace(cell, strategy=replace(cell.strategy, approach=approach)), "leave-out").touches)

    assert left(5.0) == left(2.0) - 1


@pytest.mark.long
def test_where_the_table_may_stand_before_is_said() -> None:
    """Beside the path, but where the table might stand: nobody knows how it gets away from there."""
    side = replace(SETTER, base=(200.0, 560.0, -300.0))
    made = plan(trunnion(side))
    assert (
        made.start
        and "Before the first touch nobody knows where the axes stand" in made.start[0]
        and "tool setter" in made.start[0]
    )
    assert not met(made, trunnion(side))


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(2))
def test_what_is_proven_to_keep_off_while_an_axis_turns_keeps_off_at_every_angle(seed: int) -> None:
    """An axis far from where the frame begins: what it turns swings wide. The judge walks along the turn and knows points alone."""
    rng, base = np.random.default_rng(seed), example("trunnion").machine
    grid = np.array(list(product(np.linspace(0.0, 1.0, 5), repeat=3)))
    table, names = solid(example("trunnion").artefact), tuple(example("trunnion").artefact.balls)
    proven = refused = 0
    for _ in range(40):
        pivot = rng.uniform(-250.0, 250.0, 3)
        low = rng.uniform(-300.0, 250.0, 3)
        aside = Rotation.from_rotvec([rng.uniform(-2.5, 2.5), 0.0, 0.0]).apply(low - pivot) + pivot
        bed = aside + rng.normal(-60.0, 60.0, 3)
        size, block = rng.uniform(10.0, 120.0, (2, 3))
        axes = tuple(replace(axis, point=tuple(pivot)) if axis.name == "A" else axis for axis in base.axes)
        there = (
            Obstacle("box", low=tuple(low), high=tuple(low + size), on="A"),
            Obstacle("box", low=tuple(bed), high=tuple(bed + block), on="f"),
        )
        machine = replace(base, axes=axes, obstacles=there)
        pair = next(pair for pair in pairs(machine, table, (), names) if {*pair.axes} == {"Y", "A"})
        span = (-rng.uniform(0.5, 2.5), rng.uniform(0.5, 2.5))
        met = guard.Guard(machine, [pair]).turns(np.zeros(len(machine.names)), {"A": span, "C": (0.0, 0.0)})
        turns = Rotation.from_rotvec(np.linspace(*span, 200)[:, None] * machine.axis("A").direction)
        points = np.einsum("aij,pj->api", turns.as_matrix(), low + grid * size - pivot) + pivot
        beyond = np.maximum(np.maximum(bed - points, points - bed - block), 0.0)
        nearest = np.linalg.norm(beyond, axis=-1).min()
        assert met is not None or nearest > pair.margins[guard.TURN]
        assert met is None or nearest < pair.margins[guard.TURN] + 40.0
        proven, refused = proven + (met is None), refused + (met is not None)
    assert proven > 8 and refused > 8


GOOD = "  - {kind: box, low: [300, -90, -90], high: [330, 90, 60], on: A, name: cheek}\n"


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (
            "{kind: box, low: [0, 0, 0], high: [1, 1, 1]}",
            r"obstacles\[0\]: found no key 'on'; allowed: 'on' is required here: one of f, ",
        ),
        ("{kind: box, low: [0, 0, 0], high: [1, 1, 1], on: B}", r"obstacles\[0\].on: found 'B'; allowed: f, Y, A, X, Z"),
        (
            "{kind: box, low: [0, 0, 0], high: [1, 1, 1], on: C}",
            "'C', which is the table; allowed: f, Y, A, X, Z; what stands on the",
        ),
        ("{kind: box, low: [0, 0, 0], high: [1, 1, 1], on: table}", "described in artefact.yaml"),
        ("{kind: box, low: [0, 0, 0], high: [1, 1, 1], on: S}", "the probe is described under probe: body_radius"),
        ("{kind: bax, low: [0, 0, 0], high: [1, 1, 1], on: A}", "found 'bax'; allowed: box, cylinder, hull. Did you mean"),
        ("{kind: box, low: [0, 0, 0], hihg: [1, 1, 1], on: A}", "the unknown key 'hihg'"),
        ("{kind: hull, file: yoke.stl, on: A}", "its path starts from the folder of machine.yaml"),
    ],
)
def test_a_wrong_entry_is_refused_with_its_line(tmp_path: Path, entry: str, words: str) -> None:
    folder = cell_of(tmp_path, f"  - {entry}\n")
    with pytest.raises(InputError, match=words) as found:
        read_cell(folder)
    assert re.search(r"machine.yaml:\d+: ", str(found.value)) or "folder of machine.yaml" in str(found.value)


def test_what_is_read_is_written_again(tmp_path: Path) -> None:
    machine = read_cell(cell_of(tmp_path, GOOD)).machine
    assert machine.obstacles == (Obstacle("box", low=(300, -90, -90), high=(330, 90, 60), title="cheek", on="A"),)
    (tmp_path / "cell" / "machine.yaml").write_text(machine_text(machine), encoding="utf-8")
    assert read_cell(tmp_path / "cell").machine == machine


def test_every_body_but_table_and_spindle_may_carry_one() -> None:
    for name in EXAMPLES:
        machine = example(name).machine
        assert set(bodies_of(machine)) == {"f", *machine.names} - {"S", (machine.workpiece_branch or ("f",))[-1]}


@pytest.mark.long
def test_plan_and_check_show_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = cell_of(tmp_path, GOOD)
    picture = tmp_path / "machine.svg"
    capsys.readouterr()
    assert invoke(["check", "-C", str(folder), "--picture", str(picture), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["start"] == []
    assert "cheek (A)" in picture.read_text(encoding="utf-8")


def cell_of(tmp_path: Path, entries: str) -> Path:
    """folder, entries → a cell of the trunnion whose machine.yaml ends with them, with few indexations."""
    folder = tmp_path / "cell"
    assert invoke(["init", str(folder), "--example", "trunnion"]) == 0
    with (folder / "machine.yaml").open("a", encoding="utf-8") as file:
        file.write(f"obstacles:\n{entries}")
    return folder


def campaign(seed: int, count: int) -> Counter[str]:
    """seed, plans → how many were refused, left as they were, and met something without the obstacles being known."""
    rng, seen = np.random.default_rng([seed, 1]), Counter[str]()
    for one in random_bodies(seed):
        if seen["planned"] == count:
            return seen
        true = replace(example("trunnion"), machine=one.machine, artefact=one.blind.artefact)
        seen["drawn"] += 1
        seen["blind would hit"] += bool(met(one.blind, true))
        if one.made is None:
            seen["refused"] += 1
            continue
        seen["planned"] += 1
        seen["as without"] += one.made.touches == one.blind.touches and one.made.turns == one.blind.turns
        assert not (hit := met(one.made, true, begun(one.made, rng))), f"plan {seen['drawn']} of seed {seed}: {hit}"
        found = judged(one.made)
        assert found.probe >= -1e-6 and found.solids >= -1e-6, f"plan {seen['drawn']} of seed {seed}: {found}"
    raise AssertionError("it never ends")


@pytest.mark.long
def test_random_obstacles_on_random_bodies_are_not_met() -> None:
    seen = campaign(1, 8)
    assert seen["blind would hit"] > 4


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(4))
def test_many_random_obstacles_on_random_bodies_are_not_met(part: int, capsys: pytest.CaptureFixture[str]) -> None:
    seen = campaign(100 + part, 60)
    with capsys.disabled():
        print(f"\n{dict(seen)}")


def test_each_part_of_the_probe_keeps_the_distance_that_the_formats_state() -> None:
    """At a touch, on the way between touches, while axes turn: mm from what is not on the side of the tool, and from what is."""
    cell = trunnion(YOKE[0], Obstacle("box", low=(60.0, -100.0, -150.0), high=(100.0, 100.0, 200.0), on="Z"))
    found = {
        (pair.one.name, pair.other.name[:10]): pair.margins
        for pair in pairs(cell.machine, solid(cell.artefact), (), tuple(cell.artefact.balls))
        if pair.one.probe and pair.across
    }
    cheek = "obstacle 1"
    assert found["the tip", cheek] == found["the stem", cheek] == (1.0, 10.0, 20.0)
    assert found["the probe body", cheek] == found["the spindle nose", cheek] == (2.0, 10.0, 20.0)


def test_body_and_nose_are_as_thick_as_they_are_all_around() -> None:
    """Corners stand for what is round: in no direction across the spindle may they leave out any of it."""
    cell = trunnion(*YOKE)
    probe, at = cell.machine.probe, np.array(cell.machine.spindle.point)[:2]
    shapes = {pair.one.name: pair.one.shape for pair in pairs(cell.machine, solid(cell.artefact), (), tuple(cell.artefact.balls))}
    angle = np.linspace(0.0, 2 * np.pi, 97)
    across = np.stack([np.cos(angle), np.sin(angle)])
    for name, radius in (("the probe body", probe.body_radius), ("the spindle nose", max(probe.nose_radius, probe.body_radius))):
        reach = ((shapes[name].corner[:, :2] - at) @ across).max(axis=0) + shapes[name].radius
        assert (reach >= radius - 1e-9).all() and (reach <= 1.05 * radius).all(), name
    gauge = cell.machine.spindle.point[2]  # what carries the probe begins there; the spindle points up along Z
    heights = {name: (shape.corner[:, 2].min() - gauge, shape.corner[:, 2].max() - gauge) for name, shape in shapes.items()}
    assert heights["the tip"][0] == pytest.approx(-probe.length)
    assert heights["the stem"] == pytest.approx((-probe.length, -probe.body_length))
    assert heights["the probe body"] == pytest.approx((-probe.body_length, 0.0))
    assert heights["the spindle nose"][0] == pytest.approx(0.0)
