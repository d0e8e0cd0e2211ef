"""A thousand plans that nobody has thought of, each in every dialect: nothing is hit, nothing leaves its travel, nothing turns low.

Machines, tables and probes are those of the examples; indexations, facets, stand-offs and feeds are random. Each program runs on
the simulated control of its dialect, with a work offset and a tool length active. The machine stops at a collision of ball,
stylus, probe body or spindle nose with table, facet, ball or obstacle, and at a limit; it touches the facets that are meant;
besides, whatever carries the probe is looked at while a rotary axis turns, by the simulator's transforms and without anything
of the planner.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from test_dialects import DRIVEN, EVERY, EXAMPLE, OFFSETS, driven

from postprocessors._base import companions, load, names, program
from sim_controller.interpreters import Alarm
from sim_controller.motion import Motion, MotionStop
from sim_controller.probing import Rig, home, rig
from sim_controller.session import language
from sim_controller.world import TrueMachine, nominal_machine, place
from tango_cnc.files import read_cell
from tango_cnc.link._client import Ended
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Array, Cell, Indexation, InputError, Machine, Plan, World

EXAMPLES = ("hu40t", "huron", "trunnion", "fork_head", "split", "three_axis")
AIR = 1.0  # mm that must be left between the probe and every facet's plane, or ball, while something turns
HEIGHTS = tuple(range(0, 401, 25))  # mm above the tip at which what carries it is looked at
STEP = math.radians(5.0)
COMMENTS = re.compile(r"\([^)]*\)|;.*")


@cache
def example(name: str) -> Cell:
    return read_cell(EXAMPLE.parent / name)


def random_plans(seed: int, count: int) -> Iterator[Plan]:
    """seed → plans of one to four touches at one or two indexations, mostly of few: what a thousand of them cost is waited for."""
    rng = np.random.default_rng(seed)
    while count:
        cell = example(str(rng.choice(EXAMPLES)))
        facets = tuple(str(f) for f in rng.choice(list(cell.artefact.facets), 1 + int(rng.random() < 0.3), replace=False))
        poses = tuple(Indexation(random_pose(cell.machine, rng), facets) for _ in range(rng.integers(1, 3)))
        approach = replace(
            cell.strategy.approach,
            standoff=round(float(rng.uniform(3, 20)), 3),
            search=round(float(rng.uniform(2, 6)), 3),
            feed=float(rng.choice([60, 180, 999.5])),
        )
        strategy = replace(cell.strategy, indexations=poses, approach=approach)
        try:
            made = plan(replace(cell, strategy=strategy), "leave-out")
        except InputError:
            continue
        count -= 1
        yield made


def random_pose(machine: Machine, rng: np.random.Generator) -> dict[str, float]:
    """→ rad of every rotary axis and the spindle, anywhere within the travels; now and then exactly at the end of one."""
    pose = {}
    for axis in machine.axes:
        if axis.kind == "rotary":
            low, high = axis.travel or (-math.tau, math.tau)
            degrees = round(math.degrees(rng.uniform(low, high)), int(rng.integers(0, 4)))
            pose[axis.name] = (
                float(np.clip(math.radians(degrees), low, high)) if rng.random() < 0.95 else float(rng.choice([low, high]))
            )
        elif axis.kind == "spindle":
            pose[axis.name] = math.radians(float(rng.choice([0, 90, 180, -45.5])))
    return pose


@dataclass
class Watched:
    """A simulated machine on which whatever turns is looked at."""

    rig: Rig
    motion: Motion
    turns: int = 0
    lowest: float = math.inf  # mm between what carries the probe and the table while something turned
    touched: list[str] = field(default_factory=list)

    def note(self, event: str, **data: Any) -> None:
        if event in ("rapid", "feed"):
            machine = self.rig.machine
            end = np.array(
                [v if a.kind == "linear" else math.radians(v) for a, v in zip(machine.axes, data["position"].values(), strict=True)]
            )
            rotary = [machine.column(name) for name in machine.rotary]
            change = np.abs(end - self.before)[rotary]
            if (change > 1e-9).any():
                self.turns += 1
                path = np.linspace(self.before, end, 2 + int(change.max() / STEP))
                self.lowest = min(self.lowest, gap(self.rig, path))
            self.before = end
        elif event in ("contact", "skip"):
            self.before = self.motion.position
            self.touched += [data["surface"]] if event == "contact" else []

    before: Array = None  # type: ignore[assignment]


def watched(made: Plan) -> Watched:
    """plan → its machine, true to the drawing, at its reference position."""
    true = rig(made.machine, made.artefact, World())
    seen = Watched(true, Motion(true))
    seen.motion = Motion(true, seen.note)
    seen.before = home(made.machine)
    return seen


def gap(true: Rig, path: Array) -> float:
    """(n, k) mm rad → mm between the line that carries the probe, thickened to its body, and the facets' planes and balls."""
    machine, artefact = true.machine, true.artefact
    tip, far = (place(drawn, path, np.ones_like(path)).tip for drawn in drawings(machine))
    at = np.concatenate([tip + (far - tip) * h / HEIGHTS[-1] for h in HEIGHTS])
    stem = machine.probe.length - machine.probe.body_length
    radius = np.repeat([machine.probe.tip_radius if h <= stem else machine.probe.body_radius for h in HEIGHTS], len(path))
    flat = [f for f in artefact.facets.values() if f.ball is None]
    free = math.inf
    if flat:
        outside = np.max([(at - np.array(f.point)) @ np.array(f.normal) for f in flat], axis=0)
        free = float((outside - radius).min())
    for ball in artefact.balls.values():
        free = min(free, float((np.linalg.norm(at - np.array(ball.centre), axis=1) - ball.radius - radius).min()))
    return free


@cache
def drawings(machine: Machine) -> tuple[TrueMachine, TrueMachine]:
    """→ the machine without errors, and the same with a probe that ends at the uppermost of HEIGHTS."""
    shorter = replace(machine, probe=replace(machine.probe, length=machine.probe.length - HEIGHTS[-1]))
    return nominal_machine(machine), nominal_machine(shorter)


posts = cache(load)


def text_of(name: str, made: Plan) -> list[str]:
    return list(program(posts(name), made, {}, plan_hash(made))[2]())


def stored(name: str, made: Plan) -> tuple[str, ...]:
    """dialect, plan → what its control has in store: the files that come with the program, else what it always has."""
    drive = "TNC:\\" if EVERY[name].family == "klartext" else ""
    files = companions(posts(name), made, {})
    return tuple(line for file, lines in files.items() for line in (drive + file, *lines)) or EVERY[name].library


def carried_out(name: str, lines: list[str], made: Plan) -> Watched:
    """dialect, program → the machine after it, which has made every touch. Raises Alarm and MotionStop."""
    seen, spoken = watched(made), EVERY[name]
    family = language(spoken.family)
    printed: list[bytes] = []
    offsets = {axis: value for axis, value in OFFSETS.items() if axis in made.machine.names}
    profile = replace(family.default_profile(made.machine), g54=offsets, **spoken.settings)
    control = family.Control(seen.motion, profile, printed.append, lambda event, **data: None, stored(name, made))
    if name in DRIVEN:
        events = driven(made, control)
        assert events[-1] == Ended(len(made.touches)), events[-1]
        return seen
    control.run(lines[spoken.frame : len(lines) - spoken.frame], False)
    assert re.search(rf"TANGO END \w+ {len(made.touches)}\b", " ".join(b"".join(printed).decode("ascii").split()))
    return seen


def what_it_does(lines: list[str]) -> tuple[str, ...]:
    """program → its text without comments, framing and mark: what does the same need not be run twice."""
    bare = (COMMENTS.sub("", line).strip() for line in lines)
    return tuple(re.sub(r"\b[0-9A-F]{12}\b", "", line) for line in bare if line and not re.fullmatch(r"%|O\d+", line))


def in_every_dialect(seed: int, count: int) -> dict[str, int]:
    """→ how many programs were run, those that say the same once, per dialect; fails at the first that is not safe."""
    ran = dict.fromkeys((name for name in names() if name in EVERY), 0)
    for i, made in enumerate(random_plans(seed, count)):
        done: set[tuple[str, ...]] = set()
        for name in ran:
            lines = text_of(name, made)
            if (what := what_it_does(lines)) in done:
                continue
            done.add(what)
            ran[name] += 1
            where = f"plan {i} of seed {seed}, {made.machine.name}, {name}"
            try:
                seen = carried_out(name, lines, made)
            except (Alarm, MotionStop, AssertionError) as stop:
                pytest.fail(f"{where}: {stop!r}")
            assert seen.touched == [f"facet {touch.facet}" for touch in made.touches], where
            assert seen.lowest > AIR, f"{where}: something turns {seen.lowest:.2f} mm from the table"
            assert seen.turns or not made.machine.rotary, where
    return ran


def test_every_post_has_a_control_that_speaks_it() -> None:
    assert sorted(EVERY) == names(), "see SPOKEN in test_dialects.py"


def test_some_random_plans_are_safe_in_every_dialect() -> None:
    ran = in_every_dialect(1, 2)
    assert {ran[name] for name in ("heidenhain", "linuxcnc", "okuma", "siemens")} == {2}


@pytest.mark.long
@pytest.mark.parametrize("part", range(5))
def test_a_thousand_random_plans_are_safe_in_every_dialect(part: int, capsys: pytest.CaptureFixture[str]) -> None:
    ran = in_every_dialect(100 + part, 200)
    with capsys.disabled():
        print(f"\n200 plans: {', '.join(f'{name} {n}' for name, n in ran.items() if n)} programs run without a collision")


def test_what_turns_low_is_seen() -> None:
    """The judge itself: the table turned under a probe that stands on it, and far above it."""
    made = next(plan_ for plan_ in random_plans(1, 20) if "B" in plan_.machine.names)
    touch = made.touches[0]
    low, high = np.array(touch.contact), np.array(made.turns[0].before if made.turns else touch.over)
    column = made.machine.column("B")
    for start, safe in ((low, False), (high, True)):
        turned = start.copy()
        turned[column] += 0.5
        assert (gap(watched(made).rig, np.linspace(start, turned, 10)) > AIR) == safe


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
    assert ("would come through facet 28" in "".join(planned.left_out)) == (made == ["1"])


def test_a_head_that_points_nobody_knows_where_first_leaves_the_table_by_one_axis() -> None:
    """What a thousand plans have found: a way to turn that is high for a swivelled head is low for one that stands upright."""
    cell = example("fork_head")
    pose = Indexation({"A": math.radians(-49.0), "C": math.radians(-132.397), "S": math.pi}, ("205",))
    made = plan(replace(cell, strategy=replace(cell.strategy, indexations=(pose,))))
    assert carried_out("fanuc", text_of("fanuc", made), made).touched == ["facet 205"]
