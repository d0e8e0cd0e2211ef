"""What a plan cannot have because of obstacles on the machine: found before anything is chosen, and while plans were made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import groupby

from ..plan import standing
from ..records import Cell, Indexation, Machine, Strategy
from .candidates import grid
from .problem import Problem

NAMED = 3  # indexations that are named for each reason


@dataclass(frozen=True)
class LeftOut:
    """Indexations and touches without a safe way; indexations as 'A -90 C 36'."""

    touches: int  # that no obstacle keeps the probe from
    of: int  # touches that there would be without obstacles
    never: tuple[str, ...]  # indexations at which nothing can be touched
    indexations: int  # that there would be without obstacles
    turns: Mapping[str, tuple[str, ...]]  # why axes cannot turn → to or from which indexations


def left_out(problem: Problem) -> LeftOut | None:
    """problem of which a plan was made → what obstacles of the machine take from it; None for a machine without obstacles."""
    choice, known = problem.choice, problem.ways
    own, machine = choice.cell.strategy, choice.cell.machine
    turns = _grouped(known.visits, own, machine)
    if not machine.obstacles:
        return LeftOut(len(choice.facet), len(choice.facet), (), len(own.indexations), turns) if turns else None
    free = standing(_without_obstacles(choice.cell))
    left = {pose(machine, i.position) for i in own.indexations}
    there = [pose(machine, i.position) for i in free.indexations]
    never = tuple(name for name in there if name not in left)
    return LeftOut(len(choice.facet), sum(len(i.facets) for i in free.indexations), never, len(there), turns)


def _without_obstacles(cell: Cell) -> Cell:
    stations = tuple(Indexation(position, tuple(cell.artefact.facets)) for position in grid(cell))
    strategy = replace(cell.strategy, indexations=stations)
    return replace(cell, machine=replace(cell.machine, obstacles=()), strategy=strategy)


def _grouped(visits: Mapping[int, str], strategy: Strategy, machine: Machine) -> dict[str, tuple[str, ...]]:
    pairs = sorted((why, j) for j, why in visits.items())
    return {
        why: tuple(pose(machine, strategy.indexations[j].position) for _, j in some)
        for why, some in groupby(pairs, key=lambda pair: pair[0])
    }


def pose(machine: Machine, position: Mapping[str, float]) -> str:
    """machine, indexation (rad) → 'A -90 C 36', with S where the spindle is turned."""
    names = (*machine.rotary, *(["S"] if position.get("S") else []))
    return " ".join(f"{name} {math.degrees(position.get(name, 0.0)):g}" for name in names)


def sentences(found: LeftOut) -> list[str]:
    """what is left out → one line for each reason, short."""
    lines = []
    if found.touches < found.of:
        some = f", and none at {len(found.never)} of {found.indexations} indexations ({_some(found.never)})" if found.never else ""
        lines.append(f"obstacles of machine.yaml leave {found.touches} of {found.of} possible touches{some}")
    return lines + [f"left out, as axes cannot turn to or from {_some(poses)}: {why}" for why, poses in found.turns.items()]


def _some(names: tuple[str, ...]) -> str:
    more = len(names) - NAMED
    return "; ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
