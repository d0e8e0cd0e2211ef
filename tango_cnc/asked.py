"""The touches that a strategy asks for, and which of them the plan of these readings makes: counted here, for every command."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .files.shape import misfit
from .kinematics import chain, spindle_axis
from .records import Array, Cell, Id, Indexation

AWAY = -0.02  # least cosine between normal and spindle: other facets face away, and plans leave them out
MEANT = [{"position": {"*": float}, "facets": [str]}]  # of readings.json: until.strategy
BEFORE = re.compile(r"touch (\d{1,9}) ")  # records of versions before 0.2 have the sentences alone, not the numbers


@dataclass(frozen=True)
class Asked:
    """The touches of a strategy, in its order: touch 1 is the first."""

    facet: tuple[Id, ...]  # (n)
    position: Array  # (n, k) rad, of the rotary axes; 0 in the columns of linear axes
    made: frozenset[int]  # numbers of those that the plan makes

    def __len__(self) -> int:
        return len(self.facet)


def asked(cell: Cell, run: Mapping[str, Any] | None = None) -> Asked:
    """cell, readings.json (None: the file is missing) → touches asked for. Without it, a plan makes no touch that faces away."""
    strategy, machine = as_run(cell, run).strategy, cell.machine
    facet = tuple(f for i in strategy.indexations for f in i.facets)
    at = [[i.position.get(name, 0.0) for name in machine.names] for i in strategy.indexations for _ in i.facets]
    position = np.array(at).reshape(-1, len(machine.names))
    every = set(range(1, len(facet) + 1))
    return Asked(facet, position, frozenset(every - _left_out(run or {}) - _away(cell, facet, position, run)))


def as_run(cell: Cell, run: Mapping[str, Any] | None) -> Cell:
    """cell, readings.json → the cell with the touches that a run to a goal meant to make, where `run --until` made the readings."""
    try:
        meant = (run or {})["until"]["strategy"]
        if misfit(meant, MEANT):
            return cell
        indexations = tuple(Indexation({n: float(v) for n, v in i["position"].items()}, tuple(i["facets"])) for i in meant)
    except (KeyError, TypeError, OverflowError):
        return cell
    if not all(facet in cell.artefact.facets for i in indexations for facet in i.facets):
        return cell
    return replace(cell, strategy=replace(cell.strategy, indexations=indexations))


def resume_of(run: Mapping[str, Any] | None) -> str:
    """readings.json → what 'tango run' has to state to go on with that run."""
    how = (run or {}).get("resume")
    return how if isinstance(how, str) else "--resume"


def _left_out(run: Mapping[str, Any]) -> set[int]:
    numbers = run.get("left_out_touches")
    if isinstance(numbers, list):
        return {n for n in numbers if isinstance(n, int)}
    sentences = run.get("left_out")
    texts = sentences if isinstance(sentences, list) else []
    return {int(found[1]) for text in texts if (found := BEFORE.match(str(text)))}


def _away(cell: Cell, facet: tuple[Id, ...], position: Array, run: Mapping[str, Any] | None) -> set[int]:
    if isinstance((run or {}).get("left_out_touches"), list):  # the plan itself says what it leaves out
        return set()
    normal = np.array([cell.artefact.facets[f].normal for f in facet]).reshape(-1, 3)
    up = spindle_axis(chain(cell.machine), position)
    return {int(i) + 1 for i in np.flatnonzero(np.einsum("ij,ij->i", normal, up) < AWAY)}
