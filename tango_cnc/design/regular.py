"""A plain plan, as a careful person types it: rotary axes on a grid of equal steps, as many facets at each as time allows.

The spindle is turned to its quarters where the rotary axes are at zero. Of several grids that fit into the time the one that
tells most is taken, so that it is no straw man.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..plan import attempt, standing
from ..records import Array, Cell, Indexation, InputError, Plan, Strategy
from . import order
from .balls import information
from .criterion import value
from .problem import Chosen, Problem
from .region import turn
from .timed import judged

GRIDS = ((3, 3), (3, 4), (4, 4), (5, 4), (5, 5), (5, 6), (7, 5))  # steps of the axis with the smaller travel and of the other one
LEAST = 2  # facets at each position
TURNED = 2  # facets at each quarter of the spindle
FITS = 5  # plans until the time is met


class _Legs(order.Legs):
    """Times between some facets of an indexation."""

    def among(self, indexation: Indexation, picked: Sequence[int]) -> Array:
        """indexation, m of its facets by number → (m, m) s from stand-off to stand-off."""
        return self.between(dict(indexation.position), indexation.facets)[np.ix_(picked, picked)]


def regular(problem: Problem) -> Chosen:
    """problem → the best of the regular plans that fit into its time. Raises InputError when none fits."""
    cell = problem.choice.cell
    names = sorted(cell.machine.rotary, key=lambda name: np.ptp(turn(cell.machine, name)))
    grids = GRIDS if len(names) == 2 else tuple((n,) for n in (4, 6, 8, 12)) if names else ((),)
    legs = _Legs(cell, problem.feed)
    best: Chosen | None = None
    for counts, times in itertools.product(grids, sorted({1, problem.times})):
        found = _fitted(replace(problem, times=times), _grid(cell, names, counts), legs)
        if found is not None and (best is None or found.value < best.value):
            best = found
    if best is None:
        single = replace(problem, times=1)
        least = judged(single, *_planned(single, _grid(cell, names, grids[0]), LEAST, legs)).seconds / 60
        raise InputError(
            f"--regular: found {problem.seconds / 60:g} minutes; a plan of {' by '.join(map(str, grids[0])) or '1'} positions and "
            f"the quarters of the spindle, {LEAST} facets at each, takes {math.ceil(10 * least) / 10:g}; allowed: at least as many"
        )
    return best


def _grid(cell: Cell, names: list[str], counts: tuple[int, ...]) -> Strategy:
    """→ every facet that can be touched at the positions of a grid, to and fro, and at the quarters of the spindle."""
    lines = []
    for name, count in zip(names, counts, strict=True):
        low, high = turn(cell.machine, name)
        lines.append(np.linspace(low, high, count).tolist())
    stations = []
    for n, outer in enumerate(lines[0] if lines else [0.0]):
        inner = lines[1] if len(lines) == 2 else [0.0]
        for angle in reversed(inner) if n % 2 else inner:
            stations.append(dict(zip(names, (outer, angle), strict=False)) | {"S": 0.0})
    zero = dict.fromkeys(names, 0.0)
    stations += [zero | {"S": i * math.pi / 2} for i in range(4)]
    every = tuple(cell.artefact.facets)
    return standing(replace(cell, strategy=replace(cell.strategy, indexations=tuple(Indexation(s, every) for s in stations))))


def _fitted(problem: Problem, whole: Strategy, legs: _Legs) -> Chosen | None:
    """→ the plan of as many facets at each position as fit into the time, None when hardly any does."""
    most = max(len(i.facets) for i in whole.indexations)
    low, high, best = LEAST - 1, most, None
    count = max(LEAST, most // 3)
    for _ in range(FITS):
        found = judged(problem, *_planned(problem, whole, count, legs))
        if found.seconds <= problem.seconds:
            low, best = count, found
        else:
            high = min(high, count)
        per = found.costs[0] * len(whole.indexations)
        step = math.floor((problem.seconds - found.seconds) / per)
        count = min(max(count + step, low + 1), high - 1) if step else 0
        if count <= low or count >= high:
            break
    return best


def _planned(problem: Problem, whole: Strategy, count: int, legs: _Legs) -> tuple[Cell, Plan]:
    """→ cell and plan with `count` facets at each position, taken in turn so that each facet comes equally often."""
    cell, following = problem.choice.cell, itertools.count()
    indexations = []
    for indexation in whole.indexations:
        own = indexation.facets
        some = min(TURNED if indexation.position.get("S") else count, len(own))
        first = next(following)
        picked = sorted({(first + i * len(own) // some) % len(own) for i in range(some)})
        way = order.path(legs.among(indexation, picked))
        indexations.append(replace(indexation, facets=tuple(own[picked[i]] for i in way for _ in range(problem.times))))
    chosen = replace(cell, strategy=replace(whole, name="regular", indexations=tuple(indexations)))
    made, faults = attempt(chosen, "leave-out", problem.ways.looked)
    if faults:
        raise InputError(next(iter(faults.values())))
    return chosen, made


def at_random(found: Chosen, count: int = 100, seed: int = 1) -> Array:
    """chosen plan → (count,) φ of random plans that take as long: as many visits and facets, touched as often in a row.

    Each visits other indexations at random; its facets are drawn from all that these offer, and how often each is touched in a row
    is shuffled among them. As many touches of other facets would take longer: a further touch of the same one has no way.
    """
    problem = found.problem
    choice, rng = problem.choice, np.random.default_rng(seed)
    rows = np.array(list(Counter((touch.indexation, touch.facet) for touch in found.plan.touches).values()), float)
    visits, touches = len(found.cell.strategy.indexations), len(rows)
    values = np.empty(count)
    for number in range(count):
        offered = np.empty(0, dtype=np.int64)
        more = visits
        while len(offered) < touches and more <= len(choice.of_pose):
            poses = rng.choice(len(choice.of_pose), more, replace=False)
            offered = np.concatenate([choice.of_pose[j] for j in poses])
            more += 1
        drawn = rng.choice(offered, min(touches, len(offered)), replace=False)
        often = rng.permutation(rows)[: len(drawn)] / problem.times
        told = information(choice, [choice.facet[i] for i in drawn], choice.rows[drawn] * np.sqrt(often)[:, None])
        values[number] = value(problem.criterion, told)
    return values
