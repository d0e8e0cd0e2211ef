"""Plans that nobody has thought of: machine, table, probe, obstacle, poses, facets, approach and options, drawn from a seed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from postprocessors import load
from support.dialects import EXAMPLE
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.records import Approach, Artefact, Cell, Find, Indexation, InputError, Machine, Obstacle, Plan, Probe

EXAMPLES = ("hu40t", "huron", "trunnion", "fork_head", "split", "three_axis")
POSES = {1: 0.5, 2: 0.38, 3: 0.12}  # how many, how often
FACETS = {1: 0.5, 2: 0.3, 3: 0.12, 5: 0.08}  # at a pose
CLEAR = 0.5  # mm between the search zone and where the second of two touches begins
WISHES = ("clamps", "called", "angles", "decimals")  # of a profile, besides 444
CLAMPS = {"rs274": ("M64 P%d", "M65 P%d"), "mach3": ("M81%d", "M82%d"), "osp": ("M2%d", "M3%d")}


@dataclass(frozen=True)
class Drawn:
    """A plan, and what is stated of the controls that know such a thing: a word of WISHES, 444 or nothing."""

    plan: Plan
    wish: str = ""


@cache
def example(name: str) -> Cell:
    """name → the example cell."""
    return read_cell(EXAMPLE.parent / name)


posts = cache(load)


def random_plans(seed: int, count: int) -> Iterator[Drawn]:
    """seed → plans, mostly of few touches: what a thousand of them cost is waited for. What the planner refuses is drawn anew."""
    rng = np.random.default_rng(seed)
    while count:
        cell = example(str(rng.choice(EXAMPLES)))
        poses = tuple(Indexation(pose, random_facets(cell.artefact, rng)) for pose in random_poses(cell.machine, rng))
        approach = random_approach(rng)
        machine = cell.machine if rng.random() < 0.6 else replace(cell.machine, probe=random_probe(cell.machine.probe, rng))
        obstacles = (random_obstacle(cell.artefact, poses[-1].facets, rng),) if rng.random() < 0.4 else ()
        wish = random_wish(approach, machine.probe, rng)
        artefact = replace(cell.artefact, obstacles=obstacles)
        strategy = replace(cell.strategy, indexations=poses, approach=approach)
        try:
            made = plan(replace(cell, machine=machine, artefact=artefact, strategy=strategy), "leave-out")
        except InputError:
            continue
        count -= 1
        yield Drawn(made, wish)


def some(often: Mapping[int, float], rng: np.random.Generator) -> int:
    """{number: how often} → one of the numbers."""
    return int(rng.choice(list(often), p=list(often.values())))


def random_facets(artefact: Artefact, rng: np.random.Generator) -> tuple[str, ...]:
    """→ one facet or some, each once."""
    return tuple(str(facet) for facet in rng.choice(list(artefact.facets), some(FACETS, rng), replace=False))


def random_poses(machine: Machine, rng: np.random.Generator) -> list[dict[str, float]]:
    """→ some, each of them anywhere, or, every other one, a little farther by one of the axes than the one before."""
    poses = [random_pose(machine, rng) for _ in range(some(POSES, rng))]
    for before, after in pairwise(poses):
        if machine.rotary and rng.random() < 0.5:
            name = str(rng.choice(machine.rotary))
            low, high = machine.axis(name).travel or (-math.tau, math.tau)
            turned = before[name] + math.radians(round(float(rng.uniform(-30, 30)), 2))
            after.update(before | {name: float(np.clip(turned, low, high))})
    return poses


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


def random_approach(rng: np.random.Generator) -> Approach:
    """→ one touch a facet, or, a third of them, two."""
    search, standoff = round(float(rng.uniform(2, 6)), 3), round(float(rng.uniform(3, 20)), 3)
    if rng.random() > 1 / 3:
        return Approach(standoff, search, float(rng.choice([60, 180, 999.5])))
    least = search + CLEAR
    standoff = max(standoff, round(least + 1, 3))
    retreat = float(rng.choice([least, standoff, rng.uniform(least, standoff)], p=[0.1, 0.1, 0.8]))
    return Approach(standoff, search, float(rng.choice([60, 180])), Find(800.0, round(retreat, 3)))


def random_probe(usual: Probe, rng: np.random.Generator) -> Probe:
    """probe of the example → one that is longer or shorter, thicker or thinner, on a spindle as thin as it or thicker."""
    length = usual.length + float(rng.uniform(-60, 60))
    return replace(
        usual,
        length=round(length, 3),
        tip_radius=float(rng.choice([2.0, 3.0, 4.0])),
        body_radius=round(float(rng.uniform(20, 40)), 1),
        body_length=round(float(rng.uniform(40, min(160, length - 50))), 1),
        nose_radius=float(rng.choice([0.0, 60.0, 110.0])),
    )


def random_obstacle(artefact: Artefact, facets: Sequence[str], rng: np.random.Generator) -> Obstacle:
    """table, facets that are touched one after the other → a box or a cylinder: anywhere, beside one of them, or among them."""
    points = np.array([facet.point for facet in artefact.facets.values()])
    half = rng.uniform(4, 60, 3)
    at = rng.uniform(points.min(axis=0) - 40, points.max(axis=0) + 40)
    where = rng.choice(["anywhere", "beside", "among"], p=[0.3, 0.5, 0.2])
    if where == "beside":
        one = artefact.facets[str(rng.choice(facets))]
        way = np.array(one.normal) * rng.uniform(-0.2, 0.8) + rng.normal(size=3)
        at = np.array(one.point) + way / np.linalg.norm(way) * rng.uniform(5, 40) + np.sign(way) * half
    elif where == "among":
        touched = [artefact.facets[facet] for facet in facets]
        at = np.mean([facet.point for facet in touched], axis=0) + rng.uniform(0, 100) * np.array(touched[0].normal)
    if rng.random() < 0.5:
        return Obstacle("box", low=rounded(at - half), high=rounded(at + half))
    axis = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
    axis, height = axis / np.linalg.norm(axis), round(2 * float(half.max()), 3)
    base = rounded(at - height / 2 * axis)
    return Obstacle("cylinder", base=base, axis=tuple(axis.tolist()), radius=round(float(half.min()), 3), height=height)


def rounded(place: Any) -> tuple[float, float, float]:
    """(3,) mm → the same to a micrometre."""
    x, y, z = (round(float(value), 3) for value in place)
    return x, y, z


def random_wish(approach: Approach, probe: Probe, rng: np.random.Generator) -> str:
    """→ what is stated of the controls: nothing in every other plan, cycle 444 in every other one that it can measure."""
    wish = str(rng.choice(["", *WISHES], p=[0.5, *[0.5 / len(WISHES)] * len(WISHES)]))
    room = approach.find is not None and approach.find.retreat >= approach.search + probe.tip_radius + CLEAR
    return "444" if room and rng.random() < 0.5 else wish


def options(name: str, drawn: Drawn) -> dict[str, Any]:
    """dialect, plan → what the profile of its control says beside the defaults; nothing where it does not know the wish."""
    known = {option.name: option for option in posts(name).options}
    if drawn.wish == "444" and "cycle" in known:
        return {"cycle": 444}
    if drawn.wish == "clamps" and "unclamp" in known:
        loose, held = CLAMPS.get(load(name).language, ("M1%d", "M3%d"))
        number = {axis: i for i, axis in enumerate(drawn.plan.machine.rotary, 1)}
        return {"unclamp": {a: loose % i for a, i in number.items()}, "clamp": {a: held % i for a, i in number.items()}}
    if drawn.wish == "called" and "macros" in known:
        return {"macros": "called"}
    if drawn.wish == "decimals" and "decimals" in known:
        return {"decimals": next(n for n in known["decimals"].choices if n != known["decimals"].default)}
    if drawn.wish == "angles":
        every = {"rollover": "always", "rotary": "AC", "shortest": False}
        return {key: value for key, value in every.items() if key in known}
    return {}


def settings(name: str, made: Plan, stated: Mapping[str, Any]) -> dict[str, Any]:
    """dialect, plan, what the profile says → what is set at its control that the program needs."""
    approach = made.strategy.approach
    if stated.get("cycle") == 444 and approach.find is not None:
        retreat, radius = approach.find.retreat, made.machine.probe.tip_radius
        return {"probe_table": {"F": approach.feed, "DIST": retreat + approach.search, "SET_UP": retreat, "R": radius}}
    if load(name).language == "grbl":
        return {key: {axis: int(word[1:]) for axis, word in words.items()} for key, words in stated.items()}
    if load(name).language == "centroid" and "clamp" in stated:
        return {"macros": ("M19", *stated["unclamp"].values(), *stated["clamp"].values())}
    return {}
