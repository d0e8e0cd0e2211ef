"""Programs that measure what a touch is worth: a strategy and, where needed, an artefact with more facets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from .. import kinematics
from ..records import Array, Artefact, Ball, Facet, Indexation, InputError, Machine, Strategy, Vector
from .probing import OVER, RING

Kind = Literal["repeatability", "wetness", "grid", "drift", "lobing", "probe", "etve"]
KINDS: tuple[Kind, ...] = ("repeatability", "wetness", "grid", "drift", "lobing", "probe", "etve")


@dataclass(frozen=True)
class CapabilitySettings:
    """How often and where; the defaults are those of the thesis."""

    facets: tuple[str, ...] = ()  # none: one facet of the strategy for every direction that it offers
    repetitions: int | None = None  # touches (300, 600), cycles over the grid (25) or over the facets (60)
    side: int = 5  # points along each side of the grid
    pitch: float = 0.5  # mm between them
    longitude: float = 30.0  # deg between the meridians on the ball
    latitude: float = 10.0  # deg between the parallels
    spindle: tuple[float, ...] = (0.0, 90.0)  # deg: what turns with the spindle is the probe's


REPETITIONS = {"repeatability": 300, "wetness": 600, "grid": 25, "drift": 60, "lobing": 1, "probe": 1, "etve": 240}


def program(
    kind: Kind, machine: Machine, artefact: Artefact, strategy: Strategy, settings: CapabilitySettings | None = None
) -> tuple[Artefact, Strategy]:
    """kind, cell → artefact (with grid points or ball points added) and strategy that measure it; for `plan` as for any other.

    Raises InputError for a facet that the strategy does not touch, and for lobing without a ball.
    """
    s = settings or CapabilitySettings()
    count = s.repetitions or REPETITIONS[kind]
    name = f"capability: {kind}"
    if kind == "lobing":
        return _lobing_program(machine, artefact, strategy, s, name)
    if kind == "probe":
        return _probe_program(machine, artefact, strategy, s, name)
    chosen = _chosen(machine, artefact, strategy, s.facets)
    if kind == "etve":  # the machine does nothing else meanwhile: one facet, that of the first direction unless named
        return artefact, Strategy(name, strategy.approach, (Indexation(chosen[0][1], (chosen[0][0],) * count),))
    if kind in ("repeatability", "wetness"):
        blocks = [Indexation(position, (facet,) * count) for facet, position in chosen]
        return artefact, Strategy(name, strategy.approach, tuple(blocks))
    if kind == "drift":
        once = [Indexation(position, (facet,)) for facet, position in chosen]
        return artefact, Strategy(name, strategy.approach, tuple(once) * count)
    points = {facet: _grid(artefact.facets[facet], s.side, s.pitch) for facet, _ in chosen}
    facets = dict(artefact.facets) | {f.id: f for grid in points.values() for f in grid}
    once = [Indexation(position, tuple(f.id for f in points[facet])) for facet, position in chosen]
    return replace(artefact, facets=facets), Strategy(name, strategy.approach, tuple(once) * count)


def _chosen(
    machine: Machine, artefact: Artefact, strategy: Strategy, wanted: tuple[str, ...]
) -> list[tuple[str, dict[str, float]]]:
    """→ facets with a rotary position at which the strategy touches them, one for each probing direction unless named."""
    chain = kinematics.chain(machine)
    found: dict[str, tuple[str, dict[str, float]]] = {}
    for index in strategy.indexations:
        for facet in index.facets:
            if artefact.facets[facet].ball is not None or (wanted and facet not in wanted):
                continue
            position = np.array([[index.position.get(n, 0.0) for n in machine.names]])
            normal = machine_normal(chain, position, np.array([artefact.facets[facet].normal]))[0]
            key = facet if wanted else direction(normal)
            found.setdefault(key, (facet, dict(index.position)))
    missing = [f for f in wanted if f not in found]
    if missing:
        raise InputError(f"--facets: found {missing[0]!r}; allowed: plane facets that the strategy of the cell touches")
    order = list(wanted) if wanted else sorted(found, key=["X", "Y", "Z", "2D", "3D"].index)
    return [found[key] for key in order]


def machine_normal(chain: kinematics.Chain, position: Array, normal: Array) -> Array:
    """chain, (n, k) mm rad, (n, 3) normals in the table frame → (n, 3) in the machine frame, nominal machine."""
    run = kinematics.trace(chain, position)
    return kinematics.sensitivity(chain, run, normal).machine_normal


def direction(normal: Array) -> str:
    """(3,) normal in the machine frame → X, Y, Z, 2D or 3D: how many linear axes move towards the surface."""
    moving = [letter for letter, c in zip("XYZ", normal, strict=True) if abs(c) > 0.02]
    return moving[0] if len(moving) == 1 else f"{len(moving)}D"


def _grid(facet: Facet, side: int, pitch: float) -> list[Facet]:
    """facet → side × side facets around its point, in its plane, row by row."""
    n = np.array(facet.normal)
    u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    steps = (np.arange(side) - (side - 1) / 2) * pitch
    at = [np.array(facet.point) + a * u + b * v for a in steps for b in steps]
    return [replace(facet, id=f"{facet.id}g{i}", point=_vector(p)) for i, p in enumerate(at, start=1)]


def _vector(p: Array) -> Vector:
    return float(p[0]), float(p[1]), float(p[2])


def _lobing_program(
    machine: Machine, artefact: Artefact, strategy: Strategy, s: CapabilitySettings, name: str
) -> tuple[Artefact, Strategy]:
    """Every `longitude` along and `latitude` up to the equator of the upper half of a ball (thesis procedure IV)."""
    ball, base = _ball(artefact, strategy, "lobing")
    facets = dict(artefact.facets)
    indexations = []
    for angle in s.spindle:
        position = base | {"S": math.radians(angle)}
        points: list[tuple[float, float]] = []
        for lift in np.arange(90.0, -1e-9, -s.latitude):
            turns = [0.0] if lift > 90 - 1e-9 else np.arange(0.0, 360.0, s.longitude)
            points += [(float(lift), float(turn)) for turn in turns]
        found = _on_ball(machine, ball, position, points, f"{ball.id}b{angle:g}p")
        facets |= {f.id: f for f in found}
        indexations.append(Indexation(position, tuple(f.id for f in found)))
    return replace(artefact, facets=facets), Strategy(name, strategy.approach, tuple(indexations))


def _probe_program(
    machine: Machine, artefact: Artefact, strategy: Strategy, s: CapabilitySettings, name: str
) -> tuple[Artefact, Strategy]:
    """A ring and a sphere of points on a ball, each point once, with the spindle as it measures."""
    ball, base = _ball(artefact, strategy, "probe")
    found = [
        *_on_ball(machine, ball, base, RING, f"{ball.id}nr"),
        *_on_ball(machine, ball, base, OVER, f"{ball.id}ns"),
    ]
    indexation = Indexation(base, tuple(f.id for f in found))
    facets = dict(artefact.facets) | {f.id: f for f in found}
    return replace(artefact, facets=facets), Strategy(name, strategy.approach, (indexation,))


def _ball(artefact: Artefact, strategy: Strategy, kind: str) -> tuple[Ball, dict[str, float]]:
    """→ the first ball that the strategy touches, and the rotary position at which it does."""
    for i in strategy.indexations:
        for f in i.facets:
            if (ball := artefact.facets[f].ball) is not None:
                return artefact.balls[str(ball)], dict(i.position)
    raise InputError(
        f"capability {kind}: found no touch on a ball in the strategy; allowed: an artefact with a ball that is touched"
    )


def _on_ball(
    machine: Machine, ball: Ball, position: Mapping[str, float], points: Sequence[tuple[float, float]], name: str
) -> list[Facet]:
    """ball, rotary position, (degrees above the equator, around) seen along the spindle, begin of the names → facets."""
    row = np.array([[position.get(n, 0.0) for n in machine.names]])
    up = kinematics.spindle_axis(kinematics.chain(machine), row)[0]
    across = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    across /= np.linalg.norm(across)
    third = np.cross(up, across)
    found = []
    for number, (lift, turn) in enumerate(points, start=1):
        a, b = math.radians(lift), math.radians(turn)
        n = math.sin(a) * up + math.cos(a) * (math.cos(b) * across + math.sin(b) * third)
        point = _vector(np.array(ball.centre) + ball.radius * n)
        found.append(Facet(f"{name}{number}", point, _vector(n), ball=ball.id))
    return found
