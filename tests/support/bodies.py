"""Obstacles on any body of a machine: random ones, a run of a plan on the simulated machine, and a judge with points.

The judge shares nothing with planner or simulator: it turns points of one thing into the frame of the other with scipy's rotations,
and takes the distance of a point from a box or a cylinder, which everybody can check. Points only ever make a distance too long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from sim_controller.motion import Motion, MotionStop
from sim_controller.probing import Rig, rig
from support.randomplans import EXAMPLES, example, random_approach, random_facets, random_poses, random_probe, rounded
from tango_cnc.plan import plan
from tango_cnc.records import Array, Artefact, Cell, Indexation, InputError, Machine, Obstacle, Plan, World

PATCH = 15.0  # mm that a table surely goes on beyond its facets
NOSE = 300.0  # mm of spindle above the probe
YOKE = (
    Obstacle("box", low=(-330.0, -120.0, -160.0), high=(-245.0, 120.0, 60.0), on="A", title="left cheek"),
    Obstacle("box", low=(245.0, -120.0, -160.0), high=(330.0, 120.0, 60.0), on="A", title="right cheek"),
    Obstacle("box", low=(-330.0, -150.0, -200.0), high=(330.0, 150.0, -160.0), on="A", title="bottom of the yoke"),
)
SETTER = Obstacle(
    "cylinder", base=(395.0, 300.0, -300.0), axis=(0.0, 0.0, 1.0), radius=30.0, height=280.0, on="f", title="tool setter"
)


def bodies_of(machine: Machine) -> tuple[str, ...]:
    """machine → every body that an obstacle may be on."""
    table = machine.workpiece_branch[-1] if machine.workpiece_branch else "f"
    return tuple(name for name in ("f", *machine.workpiece_branch, *machine.tool_branch[:-1]) if name != table)


def random_solid(blind: Plan, on: str, rng: np.random.Generator) -> Obstacle:
    """plan of the machine without obstacles, body → a box or a cylinder on it, near the tip at one of its touches."""
    machine, touch = blind.machine, blind.touches[int(rng.integers(len(blind.touches)))]
    place = np.array([touch.standoff if rng.random() < 0.5 else touch.over])
    half, way = rng.uniform(5, 90, 3), rng.normal(size=3)
    tip = _moved(machine, machine.tool_branch[:-1], place, _axis_points(machine, np.array([0.0])))[0]
    near = tip + way / np.linalg.norm(way) * (rng.uniform(10, 260) + half.min())
    if on in machine.tool_branch:
        near = near + rng.uniform(0.0, 1.2 * machine.probe.length) * np.array(machine.spindle.direction)
    at = _within(_frame(machine, machine.carriers(on), place), near[None])[0][0]
    if rng.random() < 0.6:
        return Obstacle("box", low=rounded(at - half), high=rounded(at + half), on=on)
    axis = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
    axis /= np.linalg.norm(axis)
    height = round(2 * float(half.max()), 3)
    base = rounded(at - height / 2 * axis)
    return Obstacle("cylinder", base=base, axis=tuple(axis.tolist()), radius=round(float(half.min()), 3), height=height, on=on)


@dataclass(frozen=True)
class Tried:
    """A plan of a machine with obstacles (None: refused, and why), and that of the same machine without them."""

    blind: Plan
    machine: Machine
    made: Plan | None
    why: str


def random_bodies(seed: int, most: int = 3) -> Iterator[Tried]:
    """seed → plans of the examples with one obstacle or up to `most` on their bodies, without an end."""
    rng = np.random.default_rng(seed)
    while True:
        cell = example(str(rng.choice(EXAMPLES)))
        poses = tuple(Indexation(pose, random_facets(cell.artefact, rng)) for pose in random_poses(cell.machine, rng))
        probe = cell.machine.probe if rng.random() < 0.6 else random_probe(cell.machine.probe, rng)
        cell = replace(cell, machine=replace(cell.machine, probe=probe))
        cell = replace(cell, strategy=replace(cell.strategy, indexations=poses, approach=random_approach(rng)))
        try:
            blind = plan(cell, "leave-out")
        except InputError:
            continue
        where = rng.choice(bodies_of(cell.machine), int(rng.integers(1, most + 1)))
        machine = replace(cell.machine, obstacles=tuple(random_solid(blind, str(on), rng) for on in where))
        try:
            yield Tried(blind, machine, plan(replace(cell, machine=machine), "leave-out"), "")
        except InputError as error:
            yield Tried(blind, machine, None, str(error))


def begun(made: Plan, rng: np.random.Generator) -> Array:
    """plan → where the axes may stand when it begins: anywhere, but the first axis; where the plan says so, at the first place."""
    first = made.turns[0]
    place = np.array(first.before)
    if made.start:
        return np.array(first.after)
    for column, axis in enumerate(made.machine.axes):
        if axis.name != first.first and axis.kind != "spindle":
            place[column] = rng.uniform(*(axis.travel or (-math.pi, math.pi)))
    return place


def run(made: Plan, rig: Rig, start: Array) -> list[str]:
    """plan, what is true, where the axes stand → what was touched. Raises MotionStop for whatever is run into."""
    touched: list[str] = []
    motion = Motion(rig, lambda event, **data: touched.append(data["surface"]) if event == "contact" else None)
    motion._position = start.copy()
    for move in made.moves:
        if move.kind in ("find", "probe"):
            motion.skip(move.target, made.strategy.approach.feed)
        else:
            motion.rapid(move.target, straight=move.kind != "index")
    return touched


@dataclass(frozen=True)
class Judged:
    """The least distances of a plan, mm, beyond what has to be kept at that move: what is below 0 is too near."""

    probe: float
    solids: float


def judged(made: Plan, step: float = 4.0, turn: float = math.radians(2.0)) -> Judged:
    """plan, mm, rad between two looks → the least distances that any look finds."""
    machine, probe, solids = made.machine, math.inf, math.inf
    points, declared = _table(made.artefact), machine.obstacles
    for path, kept in _paths(made, step, turn):
        for i, obstacle in enumerate(declared):
            frame = _frame(machine, machine.carriers(obstacle.on or "f"), path)
            for height, radius, own in _probe(machine, obstacle):
                tip = _moved(machine, machine.tool_branch[:-1], path, _axis_points(machine, height))
                probe = min(probe, float((_distance(obstacle, _within(frame, tip)) - radius).min()) - min(kept, own))
            things = [(machine.workpiece_branch, p, r) for p, r in points]
            things += [
                (machine.carriers(o.on or "f"), _surface(o), 0.0)
                for o in declared[:i]
                if machine.carriers(o.on or "f") != machine.carriers(obstacle.on or "f")
            ]
            for carriers, own_points, size in things:
                seen = _within(frame, _moved(machine, carriers, path, own_points))
                solids = min(solids, float(_distance(obstacle, seen).min()) - size - 5.0)
    return Judged(probe, solids)


def _paths(made: Plan, step: float, turn: float) -> Iterator[tuple[Array, float]]:
    """plan → (n, k) places on each of its moves whose beginning is known, mm that the probe keeps on it."""
    names, at, before = made.machine.names, dict[str, float](), ""
    rotary = [made.machine.column(name) for name in made.machine.rotary]
    for move in made.moves:
        known = len(at) == len(names)
        start = np.array([at.get(name, 0.0) for name in names])
        at.update(move.target)
        end = np.array([at.get(name, 0.0) for name in names])
        if known:
            count = 2 + int(max(np.abs(end - start)[:3].max() / step, (np.abs(end - start)[rotary].max(initial=0.0)) / turn))
            kept = 20.0 if move.kind == "index" else 10.0 if move.kind == "clear" else 1.0
            if move.kind == "retract" and before != "back":
                kept = 10.0
            yield np.linspace(start, end, count), kept
        before = move.kind


def _frame(machine: Machine, carriers: tuple[str, ...], path: Array) -> list[tuple[Rotation, Array]]:
    """axes from the foundation outwards, (n, k) → n turns and shifts of what they move."""
    found = []
    for place in path:
        turn, shift = Rotation.identity(), np.zeros(3)
        for name in carriers:
            axis, value = machine.axis(name), place[machine.column(name)]
            if axis.kind == "linear":
                shift = shift + turn.apply(value * np.array(axis.direction))
            elif axis.kind == "rotary":
                own = Rotation.from_rotvec(value * np.array(axis.direction))
                shift = shift + turn.apply(np.array(axis.point) - own.apply(axis.point))
                turn = turn * own
        found.append((turn, shift))
    return found


def _moved(machine: Machine, carriers: tuple[str, ...], path: Array, points: Array) -> Array:
    """→ (n, v, 3) mm, machine frame."""
    return np.array([turn.apply(points) + shift for turn, shift in _frame(machine, carriers, path)])


def _within(frame: list[tuple[Rotation, Array]], points: Array) -> Array:
    return np.array([turn.inv().apply(p - shift) for (turn, shift), p in zip(frame, points, strict=True)])


def _probe(machine: Machine, obstacle: Obstacle) -> Iterator[tuple[Array, float, float]]:
    """→ heights above the tip, radius, and mm that are kept at most: a touch asks for 2 of the body, the tool's side for 5."""
    probe = machine.probe
    stem, carriers = max(probe.length - probe.body_length, 0.0), machine.carriers(obstacle.on or "f")
    beside = bool(carriers) and carriers[0] in machine.tool_branch
    if carriers == machine.tool_branch[:-1]:
        return
    most = 5.0 if beside else math.inf
    body = probe.body_radius
    yield np.array([0.0]), probe.tip_radius, most
    yield np.arange(0.0, stem, 3.0), probe.stylus_radius, most
    yield (
        np.arange(stem + body, max(probe.length - body, stem + body) + 1e-9, 5.0),
        body if probe.body_length >= 2 * body else 0.0,
        most,
    )
    if not beside:
        nose = max(body, probe.nose_radius)
        yield np.arange(probe.length + nose, probe.length + NOSE - nose, 10.0), nose, most


def _axis_points(machine: Machine, height: Array) -> Array:
    up = np.array(machine.spindle.direction)
    return np.asarray(np.array(machine.spindle.point) + (height - machine.probe.length)[:, None] * up)


def _distance(obstacle: Obstacle, points: Array) -> Array:
    """box or cylinder, (…, 3) mm in its frame → (…) mm, 0 within."""
    if obstacle.kind == "box":
        low, high = np.minimum(obstacle.low, obstacle.high), np.maximum(obstacle.low, obstacle.high)  # type: ignore[arg-type]
        return np.asarray(np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=-1))
    away = points - np.array(obstacle.base)
    along = away @ np.array(obstacle.axis)
    around = np.linalg.norm(away - along[..., None] * np.array(obstacle.axis), axis=-1) - float(obstacle.radius or 0.0)
    ahead = np.maximum(-along, along - float(obstacle.height or 0.0))
    return np.hypot(np.maximum(around, 0.0), np.maximum(ahead, 0.0))


def _surface(obstacle: Obstacle, count: int = 9) -> Array:
    """box or cylinder → points in it, most of them on its surface."""
    if obstacle.kind == "box":
        part = np.array(np.meshgrid(*[np.linspace(0, 1, count)] * 3)).reshape(3, -1).T
        return np.asarray(np.array(obstacle.low) + part * (np.array(obstacle.high) - np.array(obstacle.low)))
    axis = np.array(obstacle.axis)
    one = np.linalg.svd(axis[None])[2][1]
    angle = np.linspace(0, math.tau, 4 * count)
    ring = np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * np.cross(axis, one)
    levels = np.linspace(0, float(obstacle.height or 0.0), count)
    whole = [np.array(obstacle.base) + h * axis + r * float(obstacle.radius or 0.0) * ring for h in levels for r in (0.0, 0.5, 1.0)]
    return np.vstack(whole)


def _table(artefact: Artefact) -> list[tuple[Array, float]]:
    """→ points of the table between its facets, obstacles on it, and its balls, with the radius of each."""
    facets = [f for f in artefact.facets.values() if f.ball is None]
    found: list[tuple[Array, float]] = [(_surface(o), 0.0) for o in artefact.obstacles]
    found += [(np.array([ball.centre]), ball.radius) for ball in artefact.balls.values()]
    if len(facets) >= 4:
        point = np.array([f.point for f in facets])
        try:
            corner = point[ConvexHull(point).vertices]
        except Exception:
            corner = point
        share = np.random.default_rng(3).dirichlet(np.full(len(corner), 0.25), 400)
        found.append((np.vstack([corner, share @ corner]), 0.0))
    return found


def trunnion(*obstacles: Obstacle, indexations: int = 4) -> Cell:
    """obstacles → the first indexations of the example, on a machine that has them."""
    cell = example("trunnion")
    strategy = replace(cell.strategy, indexations=cell.strategy.indexations[:indexations])
    return replace(cell, machine=replace(cell.machine, obstacles=obstacles), strategy=strategy)


def met(made: Plan, cell: Cell, start: np.ndarray | None = None) -> str:
    """plan, cell whose machine is true → the sentence about what it ran into; empty where it ran into nothing."""
    try:
        touched = run(made, rig(cell.machine, cell.artefact, World()), np.array(made.turns[0].after) if start is None else start)
    except MotionStop as stop:
        return str(stop)
    times = 2 if made.strategy.approach.find else 1
    assert touched == [f"facet {touch.facet}" for touch in made.touches for _ in range(times)]
    return ""
