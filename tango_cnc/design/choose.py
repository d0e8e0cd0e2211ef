"""Machine, artefact and goal → the plan that tells most in the time there is, and how near it is to the best that any plan could.

Costs of a touch and of a turn come from the motion model: a first choice is planned and timed, and what its touches and turns
take is what the next choice is made with, until the time is met.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..duration import duration, of_moves
from ..model import Model, linearise
from ..plan import last_motion, plan
from ..records import Array, Cell, Indexation, InputError, Plan, Strategy
from ..touches import of_facets
from . import order
from .candidates import Candidates
from .criterion import Criterion, State, value
from .exchange import SHAKES, Draft, whole
from .relaxed import Costs, Relaxed, efficiency, relax

ROUNDS = 2  # choices until costs and plan agree
AGREE = 0.08
AGAIN = 4  # touches of the first indexation that are made once more at the end
CLOSE = 0.015  # of the time
TRIMS = 12
EARLY = 0.15  # of the time that an order may cost in which a part of the run is worth e times as much
DRIFT = 0.3  # correlation of time with the position of an axis that is taken without asking for another order
FRACTIONS = (0.25, 0.5, 0.75)
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Problem:
    """Everything that decides the choice."""

    choice: Candidates
    criterion: Criterion
    seconds: float
    feed: float | None  # mm/min of protected moves
    begin: Array  # (p, p) what is known of a machine whose errors are as usual: it decides the order
    repeats: int = AGAIN

    @property
    def held(self) -> Array:
        """→ (p, p) what is known without a touch, per squared scatter of a touch."""
        return self.choice.held


@dataclass(frozen=True)
class Chosen:
    """The plan, and what is known of it before anything moves."""

    problem: Problem
    cell: Cell  # with the strategy that was chosen
    plan: Plan
    seconds: float
    information: Array  # (p, p) with the last motions of the plan
    value: float  # φ
    bound: float  # on φ of any plan whose touches and turns cost what they cost in this one
    efficiency: float
    costs: tuple[float, float]  # s of a touch with its way, s of coming to an indexation
    time: Array  # (n,) s at which each touch is done
    rows: Array  # (n, p) of the touches in their order


def chosen(problem: Problem) -> Chosen:
    """problem → plan. Raises InputError when the time is too short for any plan that tells something."""
    choice = problem.choice
    touch, visit, spare = _first_costs(problem), 12.0, 0.0
    best: Chosen | None = None
    for number in range(ROUNDS):
        costs = Costs(np.full(len(choice.rows), touch), np.full(len(choice.of_pose), visit))
        seconds = problem.seconds - spare
        if seconds < visit + 3 * touch:
            raise InputError(
                f"--minutes: found {problem.seconds / 60:g}; an indexation takes {visit:.0f} s and each touch {touch:.1f} s; "
                "allow more time"
            )
        relaxed = relax(choice.rows, choice.of_pose, problem.held, costs, seconds, problem.criterion)
        shakes = SHAKES if number else 0  # the first choice says what touches and turns cost
        mask = whole(choice.rows, choice.pose, choice.of_pose, problem.held, costs, seconds, relaxed, shakes)
        found = _fitted(problem, mask, costs, relaxed)
        if best is None or found.value < best.value:
            best = found
        change = max(abs(found.costs[0] / touch - 1), abs(found.costs[1] / visit - 1))
        touch, visit = found.costs
        visits = len({tuple(sorted(i.position.items())) for i in found.cell.strategy.indexations})
        spare = found.seconds - touch * (len(found.time) - problem.repeats) - visit * visits
        if number and change < AGREE:
            break
    assert best is not None
    return best


def _first_costs(problem: Problem) -> float:
    approach = problem.choice.cell.strategy.approach
    return approach.standoff / (approach.feed / 60) + 2.0


def _fitted(problem: Problem, mask: Mask, costs: Costs, relaxed: Relaxed) -> Chosen:
    """mask of chosen touches → the plan of these, with fewer or more touches until it fits into the time."""
    mask = mask.copy()
    choice = problem.choice
    legs = order.Legs(choice.cell, problem.feed)
    best: Chosen | None = None
    sequence: list[int] | None = None
    for _ in range(TRIMS):
        visits = np.unique(choice.pose[mask]).tolist()
        if sequence is None or set(sequence) != set(visits):
            sequence = _sequence(problem, mask, visits)
        found = _planned(problem, mask, sequence, legs, relaxed)
        over = found.seconds - problem.seconds
        if over <= 0 and (best is None or found.value < best.value):
            best = found
        count = int(np.ceil(abs(over) / found.costs[0]))
        draft = Draft(choice.rows, choice.pose, choice.of_pose, problem.held, costs, relaxed, mask)
        if over > 0:
            for _ in range(count):
                inside = np.flatnonzero(draft.chosen)
                draft.change(int(inside[np.argmin(draft.state.loss(draft.leverage[inside], draft.gain[inside]))]), -1)
        elif over < -CLOSE * problem.seconds and best is found:
            for _ in range(max(1, int(0.7 * count))):
                free = np.flatnonzero(np.isin(choice.pose, visits) & ~draft.chosen)
                if len(free):
                    draft.change(int(free[np.argmax(draft.state.benefit(draft.leverage[free], draft.gain[free]))]), 1)
        else:
            break
        if not draft.chosen.any() or (draft.chosen == mask).all():
            break
        mask = draft.chosen
    if best is None:
        raise InputError(f"--minutes: found {problem.seconds / 60:g}; allow more time: even the shortest plan takes longer")
    return best


def _sequence(problem: Problem, mask: Mask, visits: list[int]) -> list[int]:
    """chosen touches → indexations in the order in which they are visited."""
    choice = problem.choice
    indexations = [choice.cell.strategy.indexations[j] for j in visits]
    facets = [choice.facet[int(np.flatnonzero(mask & (choice.pose == j))[0])] for j in visits]
    single = [replace(i, facets=(f,)) for i, f in zip(indexations, facets, strict=True)]
    times = order.turns(choice.cell, single, problem.feed)
    own = [choice.rows[mask & (choice.pose == j)] for j in visits]
    ways = [_greedy(problem, own, times), order.path(times)]

    best_worth, least = _worth(problem, ways[0], own), np.inf

    def cost(way: list[int]) -> float:
        nonlocal least
        long = order.length(way, times) * (1 + _late(problem, way, own, indexations))
        if long < least:  # what a part of it is worth takes longer to find out than how long it takes
            lost = float(np.maximum(np.log(_worth(problem, way, own) / best_worth) / 2, 0.0).mean())
            least = min(least, long := long * (1 + EARLY * lost))
        return long

    way = order.improved(min(ways, key=cost), cost, rounds=3)
    return [visits[i] for i in way]


def _worth(problem: Problem, way: Sequence[int], own: Sequence[Array]) -> Array:
    """visits in their order → (3,) φ of what is known after `FRACTIONS` of them."""
    criterion, found = _trace(problem.criterion), []
    for part in FRACTIONS:
        rows = np.vstack([own[i] for i in way[: max(1, round(part * len(way)))]])
        phi = value(criterion, problem.begin + rows.T @ rows)
        found.append(np.exp(2 * phi / len(problem.begin)) if criterion.determinant else phi)
    return np.array(found)


def _late(problem: Problem, sequence: Sequence[int], own: Sequence[Array], indexations: Sequence[Indexation]) -> float:
    """→ how much time runs together with the pose beyond `DRIFT`, as a share of the time that another order may cost."""
    names = problem.choice.cell.machine.rotary
    position = np.array([[indexations[i].position[name] for name in names] for i in sequence])
    count = np.array([len(own[i]) for i in sequence])
    at = np.repeat(position, count, axis=0)
    return max(0.0, order.runs_with_time(at, np.arange(len(at), dtype=float)) - DRIFT)


def _greedy(problem: Problem, own: Sequence[Array], times: Array) -> list[int]:
    """→ visits in the order in which each adds most for its time to what is known of a usual machine."""
    information = problem.begin
    state = State.of(_trace(problem.criterion), information)
    left, sequence = set(range(len(own))), list[int]()
    while left:
        price = {i: len(own[i]) * 2.0 + (times[sequence[-1], i] if sequence else 0.0) for i in left}
        best = max(left, key=lambda i: state.block_benefit(own[i]) / price[i])
        sequence.append(best)
        left.remove(best)
        information = information + own[best].T @ own[best]
        state = State.of(_trace(problem.criterion), information)
    return sequence


def _trace(criterion: Criterion) -> Criterion:
    """criterion → the same; of the worst of many the mean."""
    if criterion.worst is None:
        return criterion
    return Criterion(criterion.name, criterion.worst.T @ criterion.worst / len(criterion.worst))


def _planned(problem: Problem, mask: Mask, sequence: Sequence[int], legs: order.Legs, relaxed: Relaxed) -> Chosen:
    """chosen touches, order of visits → the plan, timed."""
    choice = problem.choice
    indexations = []
    for j in sequence:
        position = dict(choice.cell.strategy.indexations[j].position)
        facets = [choice.facet[i] for i in np.flatnonzero(mask & (choice.pose == j))]
        way = order.path(legs.between(position, facets))
        indexations.append(Indexation(position, tuple(facets[i] for i in way)))
    if problem.repeats and len(indexations) > 1:
        indexations.append(_again(problem, mask, sequence[0], indexations[0]))
    strategy = Strategy("design", choice.cell.strategy.approach, tuple(indexations))
    cell = replace(choice.cell, strategy=strategy)
    made = plan(cell, "leave-out")
    return judged(problem, cell, made, relaxed)


def _again(problem: Problem, mask: Mask, first: int, indexation: Indexation) -> Indexation:
    """→ the first indexation once more: of its touches those that tell most of where the table is now."""
    choice = problem.choice
    own = np.flatnonzero(mask & (choice.pose == first))
    artefact = choice.cell.artefact.facets
    normal = np.array([artefact[choice.facet[i]].normal for i in own])
    point = np.array([artefact[choice.facet[i]].point for i in own])
    where = np.hstack([normal, np.cross(point, normal) / 100])
    taken: list[int] = []
    information = 1e-3 * np.eye(6)
    for _ in range(min(problem.repeats, len(own))):
        worth = np.einsum("ij,jk,ik->i", where, np.linalg.inv(information), where)
        worth[taken] = -1
        taken.append(int(np.argmax(worth)))
        information = information + np.outer(where[taken[-1]], where[taken[-1]])
    keep = {choice.facet[own[i]] for i in taken}
    return replace(indexation, facets=tuple(f for f in indexation.facets if f in keep))


def rows_of(choice: Candidates, made: Plan) -> Array:
    """candidates, plan → (n, p) rows of its touches with the last motions that the axes have in it."""
    position = np.array([touch.contact for touch in made.touches])
    facets = [t.facet for t in made.touches]
    cell = choice.cell
    touches = replace(of_facets(cell.machine, cell.artefact, facets, position, last_motion(made)), artefact=cell.artefact)
    model = Model(touches, choice.selection.model.coefficients)
    _, jacobian = linearise(model, np.zeros(len(model.names)))
    place = {name: j for j, name in enumerate(choice.selection.model.names)}
    found = np.zeros((len(facets), len(place)))
    found[:, [place[name] for name in model.names]] = jacobian
    found = found * choice.scale[: len(place)]
    return np.hstack([found, found[:, list(choice.twice)]])


def judged(problem: Problem, cell: Cell, made: Plan, relaxed: Relaxed | None) -> Chosen:
    """problem, cell with a strategy, its plan, relaxed design or None → what the plan is worth and takes."""
    rows = rows_of(problem.choice, made)
    spent, number, ways = np.zeros(len(rows) + 1), 0, 0.0
    indexation = [touch.indexation for touch in made.touches]
    turned = {0} | {n for n in range(1, len(rows)) if indexation[n] != indexation[n - 1]}
    for move, seconds in zip(made.moves, of_moves(made, problem.feed), strict=True):
        spent[min(number, len(rows) - 1)] += seconds
        if move.kind in order.TOUCHING or number not in turned:
            ways += seconds
        if move.kind == "back":
            number += 1
    total = float(spent.sum())
    costs = ways / len(rows), (total - ways) / len(turned)
    information = problem.held + rows.T @ rows
    reached = value(problem.criterion, information)
    bound = -np.inf if relaxed is None else relaxed.bound
    share = 0.0 if relaxed is None else efficiency(problem.criterion, reached, bound, len(problem.held))
    return Chosen(problem, cell, made, total, information, reached, bound, share, costs, np.cumsum(spent[:-1]), rows)


def broken_off(found: Chosen, fractions: Sequence[float] = FRACTIONS) -> Array:
    """chosen plan, parts of its time → φ of what is known then, on a machine with errors as usual."""
    known = found.problem.begin
    values = []
    for part in fractions:
        rows = found.rows[found.time <= part * found.seconds]
        values.append(value(found.problem.criterion, known + rows.T @ rows))
    return np.array(values)


def parts_of(found: Chosen) -> dict[str, float]:
    """chosen plan → s by part of the cycle."""
    return duration(found.plan, found.problem.feed)
