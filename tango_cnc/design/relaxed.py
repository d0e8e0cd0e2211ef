"""The relaxed design: touches by the fraction, and with it a bound on what any plan of the same time can reach.

Theory of operation. A visit to an indexation costs b seconds and each touch there c; at one visit a facet is touched at most
once. A plan is then a sum of visits, each a set of touches S at a cost b + Σ c. Let the weights of visits be any numbers: the
criterion is convex in them, and its gradient by a touch is g = x G x (`criterion.State`). Whatever else is done with T seconds,
the sum of gradients is at most T·ρ, ρ the best ratio Σ_S g / (b + Σ_S c) of any visit: the best visit to an indexation has its
touches of largest g / c. From convexity, for every plan of T seconds,

    trace         1 / φ ≤ 1 / φ₀ + (T ρ − Σ w g) / φ₀²          (1 / tr(Q A⁻¹) is concave in A)
    determinant   φ ≥ φ₀ − (T ρ − Σ w g)

with equality where φ₀ is the optimum: the equivalence theorem (Kiefer and Wolfowitz 1960; Whittle 1973; with costs: Elfving 1952).
Weights follow by the multiplicative algorithm (Silvey, Titterington and Torsney 1978) on visits that are added as they become the
best ones. The bound holds at every step, however far from the optimum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from .criterion import Criterion, State, parts, value

ROUNDS = 40
THOROUGH = 120  # rounds for a bound that is printed
STEPS = 6  # of the multiplicative algorithm between two looks at all visits
NEW = 24  # visits added in a round
SETTLED = 0.004  # of φ, between weights and bound
POWER = 0.9  # of the multiplicative step; up to 1 for the determinant, 1/2 surely monotone for a trace
Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Costs:
    """Seconds of the machine: of each touch with its share of the way between touches, and of coming to each indexation."""

    touch: Array  # (n,)
    visit: Array  # (m,)


@dataclass(frozen=True)
class Relaxed:
    """Weights of touches and of visits to indexations, the bound on φ that follows, and the criterion that it is a bound of."""

    weights: Array  # (n,)
    visits: Array  # (m,)
    bound: float
    criterion: Criterion  # with the weights of the worst of many
    made_of: tuple[tuple[int, Rows, float], ...] = ()  # visits: indexation, touches, weight
    many: Array | None = None  # weights of the directions of the worst of many
    ratio: Array | None = None  # (m,) what a second at each indexation tells at best, beside what is chosen already


def table_of(of_pose: Sequence[Rows], count: int) -> Rows:
    """rows of each of m indexations, n → (m, k) the same in a table, filled up with n."""
    table = np.full((len(of_pose), max(map(len, of_pose), default=0)), count)
    for j, own in enumerate(of_pose):
        table[j, : len(own)] = own
    return table


def best_visits(gradient: Array, table: Rows, costs: Costs) -> tuple[Array, Callable[[int], Rows]]:
    """(n,) g, (m, k) rows of each indexation, costs → (m,) best Σ g / (b + Σ c) of one visit, and by its number its touches."""
    dearest = np.append(-gradient / costs.touch, np.inf)[table]
    order = np.take_along_axis(table, np.argsort(dearest, axis=1, kind="stable"), axis=1)
    time = costs.visit[:, None] + np.cumsum(np.append(costs.touch, np.inf)[order], axis=1)
    reached = np.cumsum(np.append(gradient, 0.0)[order], axis=1) / time
    reached[order == len(gradient)] = -np.inf
    best = np.argmax(reached, axis=1)
    return reached[np.arange(len(table)), best], lambda j: np.sort(order[j, : best[j] + 1])


def relax(
    rows: Array,
    of_pose: Sequence[Rows],
    held: Array,
    costs: Costs,
    seconds: float,
    criterion: Criterion,
    begin: Relaxed | None = None,
    rounds: int = ROUNDS,
) -> Relaxed:
    """(n, p) touches, rows of each indexation, (p, p) known without them, costs, s, criterion → relaxed design and its bound.

    `begin`: of nearly the same problem, from which it goes on.
    """
    made_of = [(j, own, 1.0) for j, own in enumerate(of_pose) if len(own)] if begin is None else list(begin.made_of)
    visits = {(j, own.tobytes()): own for j, own, _ in made_of}
    keys = list(visits)
    price = np.array([costs.visit[j] + costs.touch[visits[j, b]].sum() for j, b in keys])
    weight = np.array([share for _, _, share in made_of])
    weight *= seconds / (weight @ price)
    many = None if criterion.worst is None else np.full(len(criterion.worst), 1 / len(criterion.worst))
    if begin is not None and begin.many is not None:
        many = begin.many
    here, lowest, found = criterion, -np.inf, criterion
    ratio, table = np.zeros(len(of_pose)), table_of(of_pose, len(rows))
    total: Array = np.zeros(len(rows))
    for _ in range(rounds):
        touched = np.concatenate([visits[key] for key in keys])
        owner = np.repeat(np.arange(len(keys)), [len(visits[key]) for key in keys])
        for step in range(STEPS):
            total = np.asarray(np.bincount(touched, weights=weight[owner], minlength=len(rows)), dtype=float)
            active = np.flatnonzero(total > 0)
            some = rows[active]
            information = held + (some.T * total[active]) @ some
            if many is not None:
                many = many * parts(criterion, information) ** POWER
                many /= many.sum()
                here = criterion.with_weights(many)
            state = State.of(here, information)
            if step == STEPS - 1:
                break
            whole = np.zeros(len(rows))
            whole[active] = state.slope(some)
            rate = np.bincount(owner, weights=whole[touched], minlength=len(keys)) / price
            weight = weight * (np.maximum(rate, 0.0) / rate.max()) ** POWER  # rounding may leave it below zero
            weight *= seconds / (weight @ price)
        gradient = state.slope(rows)
        ratio, chosen = best_visits(gradient, table, costs)
        excess = seconds * float(ratio.max()) - float(total @ gradient)
        now = value(Criterion(here.name, here.spread), information)
        low = below(here, now, excess)
        if low > lowest:
            lowest, found = low, here
        worst = now if many is None else value(criterion, information)
        if (worst - lowest) < (SETTLED * abs(worst) if not here.determinant else SETTLED * len(held)):
            break
        keep = weight > 3e-4 * weight.max()
        keys, weight = [key for key, k in zip(keys, keep, strict=True) if k], weight[keep]
        best = {(j, (own := chosen(j)).tobytes()): own for j in np.argsort(-ratio)[:NEW].tolist()}
        fresh = [key for key in best if key not in set(keys)]
        visits |= {key: best[key] for key in fresh}
        keys = [*keys, *fresh]
        price = np.array([costs.visit[key[0]] + costs.touch[visits[key]].sum() for key in keys])
        weight = np.concatenate([weight, np.full(len(fresh), 0.05 * weight.mean())])
        weight *= seconds / (weight @ price)
    come = np.zeros(len(of_pose))
    np.add.at(come, [key[0] for key in keys], weight[: len(keys)])
    kept = tuple((key[0], visits[key], float(share)) for key, share in zip(keys, weight, strict=True))
    return Relaxed(total, come, lowest, found, kept, many, ratio)


def below(criterion: Criterion, now: float, excess: float) -> float:
    """criterion, φ₀ of weights, how much larger Σ g of any plan is than Σ w g at most → bound on φ of any plan."""
    return now - excess if criterion.determinant else 1 / (1 / now + excess / now**2)


def efficiency(criterion: Criterion, reached: float, bound: float, unknowns: int) -> float:
    """criterion, φ, its bound, p → standard uncertainty of the bound over that of the plan, 1 at best.

    Of the determinant: the p-th root of the ratio of volumes of the confidence ellipsoids.
    """
    if criterion.determinant:
        return float(np.exp((bound - reached) / (2 * unknowns)))
    return float(np.sqrt(bound / reached))
