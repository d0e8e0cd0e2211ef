"""A thousand plans that nobody has thought of, each in every dialect: nothing is hit, nothing leaves its travel or turns low.

Machines and tables are those of the examples; indexations, facets, stand-offs and feeds are random. A third of the plans touch
twice, in two of five there is a box or a cylinder that the planner and the machine know, in two of five probe and spindle nose are
longer, thicker or thinner than in the example, and of every other one the profile says something: words of clamps, called macros,
another form of angles or numbers, cycle 444. Each program runs on the simulated control of its dialect, with a work offset active;
a tool length is active where `LANGUAGES` (support/dialects.py) says so (Fagor, Heidenhain, Okuma, Siemens), else none is. The
machine stops at a collision of ball, stylus, probe body or spindle nose with table, facet, ball or obstacle, and at a limit; it
touches the facets that are meant and nothing else; besides, the probe and what carries it are looked at all along every turn of a
rotary axis, by the simulator's transforms and without anything of the planner: their true distance from every body has to be 20 mm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from support.dialects import DRIVEN, EVERY, OFFSETS
from support.distances import Body, corners, distance
from support.grbl import driven
from support.randomplans import EXAMPLES, POSES, WISHES, Drawn, example, options, posts, random_plans, settings
from support.stored import NOTHING, stored

from postprocessors import names, program
from sim_controller import solids
from sim_controller.languages import Alarm
from sim_controller.motion import Motion, MotionStop
from sim_controller.probing import Rig, home, rig
from sim_controller.session import language
from sim_controller.world import TrueMachine, nominal_machine, place
from tango_cnc.link.client import Ended
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Array, Artefact, Ball, Facet, Indexation, InputError, Machine, Obstacle, Plan, World

KEPT = 19.9  # mm between the probe and everything on the table while something turns: 20, but for the decimals of a program
OVERHANG = 50.0  # mm that the table may go on beyond its facets
FAR = 400.0  # mm above the tip, of a second point of the tool
LEVEL = 1.0  # mm: a facet over which another one looks by more than that is no side of the table
STEP = math.radians(3.0)
COMMENTS = re.compile(r"\([^)]*\)|;.*")


@dataclass(frozen=True)
class Truth:
    """A machine that is true to the drawing, and what the judge knows of it."""

    rig: Rig
    tip: TrueMachine
    far: TrueMachine  # whose probe ends FAR above the tip
    bodies: tuple[Body, ...]  # table, obstacles, balls


def truth(machine: Machine, artefact: Artefact) -> Truth:
    """machine, what is on its table → what is true of them."""
    probe = machine.probe
    far = replace(machine, probe=replace(probe, length=probe.length - FAR))
    planes = (*sides(artefact), *((hull.normal, hull.offset) for hull in solids.obstacles(artefact)))
    balls = (Body(np.array([ball.centre]), np.zeros((0, 3)), ball.radius) for ball in artefact.balls.values())
    return Truth(
        rig(machine, artefact, World()),
        nominal_machine(machine),
        nominal_machine(far),
        (*(Body(corners(*one), one[0]) for one in planes), *balls),
    )


def sides(artefact: Artefact) -> tuple[tuple[Array, Array], ...]:
    """artefact → normals (f, 3), mm (f,) of the table: behind all facets that no other one looks over, and OVERHANG beyond them.

    A pallet has no facet below it: turned over, it would be as thick as the room. Nothing where there is no such facet.
    """
    flat = [facet for facet in artefact.facets.values() if facet.ball is None]
    if not flat:
        return ()
    point, normal = np.array([facet.point for facet in flat]), np.array([facet.normal for facet in flat])
    offset = np.einsum("ij,ij->i", point, normal)
    outer = (point @ normal.T - offset).max(axis=0) <= LEVEL
    room = np.concatenate([point.max(axis=0), -point.min(axis=0)]) + OVERHANG
    box = np.vstack([np.eye(3), -np.eye(3)])
    return ((np.vstack([normal[outer], box]), np.concatenate([offset[outer], room])),) if outer.any() else ()


@dataclass
class Watched:
    """A simulated machine on which whatever turns is looked at."""

    truth: Truth
    motion: Motion
    turns: int = 0
    lowest: float = math.inf  # mm between the probe with what carries it and what is on the table while something turned
    touched: list[str] = field(default_factory=list)

    def note(self, event: str, **data: Any) -> None:
        if event in ("rapid", "feed"):
            machine = self.truth.rig.machine
            end = np.array(
                [v if a.kind == "linear" else math.radians(v) for a, v in zip(machine.axes, data["position"].values(), strict=True)]
            )
            rotary = [machine.column(name) for name in machine.rotary]
            change = np.abs(end - self.before)[rotary]
            if (change > 1e-9).any():
                self.turns += 1
                path = np.linspace(self.before, end, 2 + int(change.max() / STEP))
                self.lowest = min(self.lowest, gap(self.truth, path, KEPT))
            self.before = end
        elif event in ("contact", "skip"):
            self.before = self.motion.position
            self.touched += [data["surface"]] if event == "contact" else []

    before: Array = None  # type: ignore[assignment]


def watched(true: Truth) -> Watched:
    """what is true → the machine at its reference position."""
    seen = Watched(true, Motion(true.rig))
    seen.motion = Motion(true.rig, seen.note)
    seen.before = home(true.rig.machine)
    return seen


def gap(true: Truth, path: Array, enough: float = math.inf) -> float:
    """(n, k) mm rad → mm between the probe with what carries it and what is on the table; no more than `enough` is asked."""
    tip, far = (place(drawn, path, np.ones_like(path)).tip for drawn in (true.tip, true.far))
    return distance(tip, (far - tip) / FAR, true.rig.machine.probe, true.bodies, enough)


def text_of(name: str, made: Plan, stated: Mapping[str, Any]) -> list[str]:
    """dialect, plan, what the profile says → the program."""
    return list(program(posts(name), made, stated, plan_hash(made))[2]())


def carried_out(name: str, lines: list[str], made: Plan, stated: Mapping[str, Any], true: Truth) -> Watched:
    """dialect, program, profile, machine → that machine, which has made every touch. Raises Alarm and MotionStop."""
    seen, spoken = watched(true), EVERY[name]
    family = language(spoken.family)
    printed: list[bytes] = []
    offsets = {axis: value for axis, value in OFFSETS.items() if axis in made.machine.names}
    known = {"g54": offsets, **spoken.settings, **settings(name, made, stated)}
    profile = replace(family.default_profile(made.machine), **known)
    control = family.Control(seen.motion, profile, printed.append, lambda event, **data: None, stored(name, made, stated))
    if name in DRIVEN:
        events, _ = driven(made, control, text="\n".join(lines))
        assert events[-1] == Ended(len(made.touches)), events[-1]
        return seen
    control.run(lines[spoken.frame : len(lines) - spoken.frame], False)
    assert re.search(rf"TANGO END \w+ {len(made.touches)}\b", " ".join(b"".join(printed).decode("ascii").split()))
    return seen


def what_it_does(lines: list[str]) -> tuple[str, ...]:
    """program → its text without comments, framing and mark: what does the same need not be run twice."""
    bare = (COMMENTS.sub("", line).strip() for line in lines)
    return tuple(re.sub(r"\b[0-9A-F]{12}\b", "", line) for line in bare if line and not re.fullmatch(r"%|O\d+", line))


def not_safe(name: str, drawn: Drawn, lines: list[str], true: Truth) -> str:
    """dialect, plan, its program, machine → what is wrong with it in words; empty when nothing is."""
    made = drawn.plan
    try:
        seen = carried_out(name, lines, made, options(name, drawn), true)
    except (Alarm, MotionStop, AssertionError) as stop:
        return repr(stop)
    times = 2 if made.strategy.approach.find else 1
    if seen.touched != [f"facet {touch.facet}" for touch in made.touches for _ in range(times)]:
        return f"has touched {', '.join(seen.touched)}"
    if seen.lowest < KEPT:
        return f"something turns {seen.lowest:.2f} mm from what is on the table"
    return "" if seen.turns or not made.machine.rotary else "has turned nothing"


def in_every_dialect(seed: int, count: int) -> dict[str, int]:
    """→ how many programs were run, those that say the same once, per dialect; fails at the first that is not safe."""
    ran = dict.fromkeys((name for name in names() if name in EVERY), 0)
    for i, drawn in enumerate(random_plans(seed, count)):
        done: set[tuple[str, ...]] = set()
        true = truth(drawn.plan.machine, drawn.plan.artefact)
        for name in ran:
            lines = text_of(name, drawn.plan, options(name, drawn))
            if (what := what_it_does(lines)) in done:
                continue
            done.add(what)
            ran[name] += 1
            found = not_safe(name, drawn, lines, true)
            assert not found, f"plan {i} of seed {seed}, {drawn.plan.machine.name}, {name} {options(name, drawn)}: {found}"
    return ran


def test_every_post_has_a_control_that_speaks_it() -> None:
    assert sorted(EVERY) == names(), "see OWN and DRIVEN in tests/support/dialects.py"


@pytest.mark.long
def test_some_random_plans_are_safe_in_every_dialect() -> None:
    ran = in_every_dialect(1, 2)
    assert {ran[name] for name in ("heidenhain", "linuxcnc", "okuma", "siemens")} == {2}


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(5))
def test_a_thousand_random_plans_are_safe_in_every_dialect(part: int, capsys: pytest.CaptureFixture[str]) -> None:
    ran = in_every_dialect(100 + part, 200)
    with capsys.disabled():
        print(f"\n200 plans: {', '.join(f'{name} {n}' for name, n in ran.items() if n)} programs run without a collision")


@pytest.mark.long
def test_the_plans_are_as_different_as_is_said() -> None:
    drawn = list(random_plans(5, 60))
    usual = {example(name).machine.probe for name in EXAMPLES}
    assert {one.plan.machine.name for one in drawn} == {example(name).machine.name for name in EXAMPLES}
    assert {one.wish for one in drawn} == {"", "444", *WISHES}
    for what in (
        [one.plan.strategy.approach.find is not None for one in drawn],
        [bool(one.plan.artefact.obstacles) for one in drawn],
        [one.plan.machine.probe not in usual for one in drawn],
    ):
        assert 15 < sum(what) < 35
    assert {len(one.plan.strategy.indexations) for one in drawn} == set(POSES)
    assert max(len(one.plan.touches) for one in drawn) > 5


@pytest.mark.long
def test_a_planner_that_did_not_know_the_obstacles_would_be_found() -> None:
    """Its touches are those that it would make, on the machine on which the obstacle stands."""
    for drawn in random_plans(2, 60):
        made, machine = drawn.plan, drawn.plan.machine
        cell = next(example(name) for name in EXAMPLES if example(name).machine.name == machine.name)
        blind = replace(cell, machine=machine, strategy=made.strategy)
        if made.artefact.obstacles:
            other = Drawn(plan(blind, "leave-out"))
            lines = text_of("linuxcnc", other.plan, NOTHING)
            if "obstacle 1" in not_safe("linuxcnc", other, lines, truth(machine, made.artefact)):
                return
    raise AssertionError("no obstacle stands in anybody's way")


@pytest.mark.long
def test_what_turns_low_is_seen() -> None:
    """The judge itself: the table turned under a probe that stands on it, and far above it."""
    made = next(drawn.plan for drawn in random_plans(1, 20) if "B" in drawn.plan.machine.names)
    touch = made.touches[0]
    low, high = np.array(touch.contact), np.array(made.turns[0].before if made.turns else touch.over)
    column = made.machine.column("B")
    for start, safe in ((low, False), (high, True)):
        turned = start.copy()
        turned[column] += 0.5
        assert (gap(truth(made.machine, made.artefact), np.linspace(start, turned, 10)) >= KEPT) == safe


def test_nothing_is_known_of_what_is_far_below_a_pallet() -> None:
    """What a thousand plans with other probes have found of the judge: a trunnion at A107, the probe where no table is."""
    pallet = example("trunnion")
    turned = np.array([[-50.522, 199.966, 516.821, 1.868, -0.537, 1.571]])  # mm rad: the tip is 200 mm below it, beside two sides
    assert gap(truth(pallet.machine, pallet.artefact), turned) > 150


@pytest.mark.few(3)
@pytest.mark.parametrize("body_length", [80.0, 210.0])
@pytest.mark.parametrize("nose", [0.0, 60.0, 110.0])
def test_how_low_a_probe_is_depends_on_where_it_points(nose: float, body_length: float) -> None:
    """Upright it is the ball, however short the stem and thick the rest; level it is the thickest part, over whatever is there."""
    machine = example("split").machine  # its pivot is 200 mm above a probe of 220 mm
    machine = replace(machine, probe=replace(machine.probe, nose_radius=nose, body_length=body_length))
    upright, level = np.zeros((2, 1, len(machine.names)))
    upright[:, 2] = level[:, 2] = 500.0
    level[:, machine.column("B")] = math.pi / 2
    thick = max(nose, machine.probe.body_radius)
    top = Artefact("top", {"1": Facet("1", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))})
    assert gap(truth(machine, top), upright) == pytest.approx(500 - 220 - 3)
    assert gap(truth(machine, top), level) == pytest.approx(500 + 200 - thick)
    box = replace(top, obstacles=(Obstacle("box", low=(-900.0, -900.0, 0.0), high=(900.0, 900.0, 100.0)),))
    assert gap(truth(machine, box), upright) == pytest.approx(400 - 220 - 3)
    assert gap(truth(machine, box), level) == pytest.approx(400 + 200 - thick)
    ball = replace(top, balls={"1": Ball("1", (0.0, 0.0, 100.0), 12.7)})
    assert gap(truth(machine, ball), upright) == pytest.approx(400 - 220 - 3 - 12.7)
    assert gap(truth(machine, ball), level) == pytest.approx(400 + 200 - thick - 12.7)


ALONG = [
    (178.2, -206.0, "would come through facet 26"),
    (162.7, -240.0, "would come through facet 27"),
    (-180.0, 165.0, "leans more"),
]


@pytest.mark.parametrize(("a", "c", "why"), ALONG)
def test_a_slot_is_not_come_to_along_the_table(a: float, c: float, why: str) -> None:
    """What a thousand plans have found when the machine knew that there is table between the facets: 250 mm of it on the way."""
    cell = example("huron")
    pose = Indexation({"A": math.radians(a), "C": math.radians(c), "S": 0.0}, ("10",))
    with pytest.raises(InputError, match=why):
        plan(replace(cell, strategy=replace(cell.strategy, indexations=(pose,))))


@pytest.mark.parametrize(("degrees", "made"), [(-185.0, ["1"]), (70.0, ["1", "10"])])
def test_an_inner_facet_is_not_come_to_through_the_table(degrees: float, made: list[str]) -> None:
    """What a thousand plans have found: the slot of the Huron's table, with the spindle across the table and above it."""
    cell = example("huron")
    pose = Indexation({"A": math.radians(degrees), "C": math.radians(64.0), "S": 0.0}, ("1", "10"))
    planned = plan(replace(cell, strategy=replace(cell.strategy, indexations=(pose,))), "leave-out")
    assert sorted(touch.facet for touch in planned.touches) == made
    assert ("would come through facet 28" in "".join(planned.left_out.values())) == (made == ["1"])


def test_a_head_that_points_nobody_knows_where_first_leaves_the_table_by_one_axis() -> None:
    """What a thousand plans have found: a way to turn that is high for a swivelled head is low for one that stands upright."""
    cell = example("fork_head")
    pose = Indexation({"A": math.radians(-49.0), "C": math.radians(-132.397), "S": math.pi}, ("205",))
    made = plan(replace(cell, strategy=replace(cell.strategy, indexations=(pose,))))
    true = truth(made.machine, made.artefact)
    assert carried_out("fanuc", text_of("fanuc", made, NOTHING), made, NOTHING, true).touched == ["facet 205"]
