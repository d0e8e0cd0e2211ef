"""Cells whose true solids are known exactly: a block with facets on its five free faces, a ball above it, any machine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tango_cnc.records import (
    Approach,
    Array,
    Artefact,
    Axis,
    Ball,
    Cell,
    Facet,
    Id,
    Indexation,
    Machine,
    Obstacle,
    Plan,
    Probe,
    Strategy,
)

HALF = np.array([100.0, 80.0, 30.0])  # of the block, mm
BALL = Ball("1", (60.0, 40.0, 60.0), 10.0)  # centre in the block's frame
NORMALS = {"1": (1, 0, 0), "2": (-1, 0, 0), "3": (0, 1, 0), "4": (0, -1, 0), "5": (0, 0, 1), "6": (0, 0, 1)}
BASE = {"X": (1.0, 0, 0), "Y": (0, 1.0, 0), "Z": (0, 0, 1.0), "A": (1.0, 0, 0), "B": (0, 1.0, 0), "C": (0, 0, 1.0)}


def machine(topology: str, points: dict[str, tuple[float, float, float]] | None = None, length: float = 300.0) -> Machine:
    """topology, points on the rotary axes, probe length mm → machine with wide travels; a head swivels half a length above it."""
    work, tool = topology.split("(")[0][1:].split("f")
    rotary = sorted(set("ABC") & set(work + tool))
    head = {name: (0.0, 0.0, length / 2) for name in tool if name in "ABC"}
    place = {**head, **(points or {})}
    linear = [Axis(name, "linear", BASE[name], travel=(-4000.0, 4000.0), rapid=24000, acceleration=2.0) for name in "XYZ"]
    turning = [
        Axis(name, "rotary", BASE[name], place.get(name, (0.0, 0.0, 0.0)), (-4 * math.pi, 4 * math.pi), math.radians(3600))
        for name in rotary
    ]
    spindle = Axis("S", "spindle", (0, 0, 1.0))
    return Machine(
        topology,
        topology,
        (*linear, *turning, spindle),
        tuple(reversed(work)),
        (*tool, "S"),
        Probe(length, 3.0, 0.0005, body_length=length / 3),
    )


def block(centre: Sequence[float] = (0.0, 0.0, -40.0), facets: dict[Id, Array] | None = None, obstacle: bool = False) -> Artefact:
    """centre of the block, places on its faces in −1 … 1 → artefact, table frame."""
    at = np.array(centre)
    places = facets or {name: np.array([0.3, -0.4, 0.5]) * (-1 if name == "6" else 1) for name in NORMALS}
    found = {}
    for name, normal in NORMALS.items():
        inside = places[name] * HALF * 0.9
        across = np.abs(np.array(normal)) == 1
        point = at + np.where(across, np.array(normal) * HALF, inside)
        found[name] = Facet(name, tuple(point), normal)
    ball = at + np.array(BALL.centre)
    for name, normal in {"7": (0, 0, 1), "8": (0.6, 0, 0.8)}.items():
        found[name] = Facet(name, tuple(ball + BALL.radius * np.array(normal)), normal, BALL.id)
    solid = (Obstacle("box", low=tuple(at - HALF), high=tuple(at + HALF)),) if obstacle else ()
    return Artefact("block", found, {BALL.id: Ball(BALL.id, tuple(ball), BALL.radius)}, obstacles=solid)


def cell(
    m: Machine, artefact: Artefact, poses: Sequence[dict[str, float]], facets: Sequence[Id] | None = None, standoff: float = 10.0
) -> Cell:
    """machine, artefact, {axis: deg} of each indexation → cell that touches every facet at every indexation."""
    names = tuple(facets or artefact.facets)
    zero = dict.fromkeys((*m.rotary, "S"), 0.0)
    indexations = tuple(Indexation(zero | {k: math.radians(v) for k, v in pose.items()}, names) for pose in poses)
    return Cell(Path(), m, artefact, Strategy("all facets", Approach(standoff, 5.0, 180.0), indexations), ("S3",))


def block_distance(points: Array, artefact: Artefact) -> Array:
    """(n, 3) table frame → (n,) mm to the block, negative inside (to the nearest face)."""
    centre = np.array(artefact.facets["5"].point) * [0, 0, 1] + _middle(artefact) * [1, 1, 0] - [0, 0, HALF[2]]
    beyond = np.abs(points - centre) - HALF
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    result: Array = np.where((beyond < 0).all(axis=1), beyond.max(axis=1), outside)
    return result


def _middle(artefact: Artefact) -> Array:
    high, low = (np.array(artefact.facets[a].point) for a in ("1", "2"))
    front, back = (np.array(artefact.facets[a].point) for a in ("3", "4"))
    return np.array([(high[0] + low[0]) / 2, (front[1] + back[1]) / 2, 0.0])


def ball_distance(points: Array, artefact: Artefact) -> Array:
    """(n, 3) table frame → (n,) mm to the surface of the ball."""
    ball = artefact.balls[BALL.id]
    result: Array = np.linalg.norm(points - np.array(ball.centre), axis=1) - ball.radius
    return result


def positions(plan: Plan) -> list[tuple[str, int, Array, Array]]:
    """plan → (kind, touch, from, to) of every move whose start is known; axes in the order of the machine."""
    names = plan.machine.names
    at: dict[str, float] = {}
    found = []
    for move in plan.moves:
        before = dict(at)
        at.update(move.target)
        if len(before) == len(names):
            found.append((move.kind, move.touch, np.array([before[n] for n in names]), np.array([at[n] for n in names])))
    return found
