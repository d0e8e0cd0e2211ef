"""Choosing touches, timed against a plain recomputation and judged by published designs, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/design.py [--candidates N]

* 5000 candidates of an imaginary machine with 120 unknowns: relaxed design, bound, elimination and exchanges; s of one core.
* One sweep over all swaps by rank-two updates against computing the criterion anew for a sample of them.
* Exact D- and I-optimal designs against the values that the vignette of R's AlgDesign (R. E. Wheeler) prints.
* As many trials as unknowns, of factors at two levels: the largest determinants of matrices of ±1 (sequence A003433 of the OEIS;
  Orrick, "The maximal determinant and saturated D-optimal designs of orders 19 and 37", 2005, lists who proved them).

Exit status 1 when a published value is not reached, swaps are not what recomputation gives, or updates are not 1000 times faster.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time

import numpy as np

from tango_cnc.design.criterion import Criterion, State, swaps, value
from tango_cnc.design.relaxed import Costs, efficiency, relax
from tango_cnc.design.whole import whole

TIMES = 1000.0
# Model, trials, criterion, printed value; D is |XᵀX / N| to the power 1 / p, I the mean of x (XᵀX / N)⁻¹ x over the candidates.
PRINTED = [
    ("cube, quadratic", 15, "D", 3.675919),
    ("cube, quadratic", 15, "I", 8.096772),
    ("mixture, 2 at a time", 8, "D", 0.03623366),
]
LARGEST = {7: 576, 8: 4096, 9: 14336, 10: 73728, 11: 327680}  # determinant of a matrix of ±1, by its order


def cube() -> np.ndarray:
    """→ the quadratic model on a grid of five levels of three factors."""
    x = np.array(list(itertools.product([-2.0, -1, 0, 1, 2], repeat=3)))
    pairs = [x[:, i] * x[:, k] for i, k in itertools.combinations(range(3), 2)]
    return np.column_stack([np.ones(len(x)), x, x**2, *pairs])


def mixture() -> np.ndarray:
    """→ the quadratic model of Scheffé on thirds of three parts."""
    x = np.array([m for m in itertools.product(range(4), repeat=3) if sum(m) == 3]) / 3
    return np.column_stack([x, *(x[:, i] * x[:, k] for i, k in itertools.combinations(range(3), 2))])


def signs(order: int) -> np.ndarray:
    """number of unknowns → every trial of one factor less at two levels, and a constant."""
    return np.array([(1.0, *row) for row in itertools.product([-1.0, 1], repeat=order - 1)])


def saturated() -> bool:
    """Prints the determinants that are reached beside the largest there are → whether they are the same."""
    good = True
    for order, largest in LARGEST.items():
        rows = signs(order)
        of_pose = [np.array([i]) for i in range(len(rows))]
        costs, held = Costs(np.ones(len(rows)), np.zeros(len(rows))), 1e-9 * np.eye(order)
        relaxed = relax(rows, of_pose, held, costs, float(order), Criterion("D"))
        chosen = whole(rows, np.arange(len(rows)), of_pose, held, costs, float(order), relaxed)
        reached = abs(np.linalg.det(rows[chosen]))
        good &= reached > largest * (1 - 1e-6)
        print(f"D-optimal, {order - 1} factors at two levels, {order} trials: determinant {reached:.0f}, largest {largest}")
    return good


def published() -> bool:
    """Prints what is reached beside what is printed → whether nothing is worse."""
    good = True
    for name, trials, kind, printed in PRINTED:
        rows = cube() if name.startswith("cube") else mixture()
        n, p = rows.shape
        of_pose = [np.array([i]) for i in range(n)]
        costs, held = Costs(np.ones(n), np.zeros(n)), 1e-9 * np.eye(p)
        mean = rows.T @ rows / n
        criterion = Criterion("D") if kind == "D" else Criterion("I", mean)
        relaxed = relax(rows, of_pose, held, costs, float(trials), criterion)
        chosen = whole(rows, np.arange(n), of_pose, held, costs, float(trials), relaxed)
        moment = rows[chosen].T @ rows[chosen] / trials
        if kind == "D":
            reached, bound = np.linalg.det(moment) ** (1 / p), np.exp(-relaxed.bound / p) / trials
            good &= reached >= printed * (1 - 1e-6)
        else:
            reached, bound = float(np.trace(np.linalg.solve(moment, mean))), relaxed.bound * trials
            good &= reached <= printed * (1 + 1e-6)
        print(f"{kind}-optimal, {name}, {trials} trials: {reached:.7g}, AlgDesign {printed:.7g}, bound {bound:.5g}")
    return bool(good)


def main() -> int:
    """→ exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--candidates", type=int, default=5000)
    count = parser.parse_args().candidates
    good = published() & saturated()
    rng, p, poses = np.random.default_rng(3), 120, count // 25
    pose = np.repeat(np.arange(poses), 25)
    # Touches of one indexation resemble each other, as those of a machine do.
    rows = rng.normal(size=(len(pose), p)) + 1.5 * rng.normal(size=(poses, p))[pose]
    held, costs = 1e-4 * np.eye(p), Costs(np.full(len(pose), 2.5), np.full(poses, 12.0))
    criterion = Criterion("trace", np.diag(rng.uniform(0.5, 2.0, p)))
    of_pose = [np.flatnonzero(pose == j) for j in range(poses)]
    begin = time.process_time()
    relaxed = relax(rows, of_pose, held, costs, 600.0, criterion)
    between = time.process_time()
    chosen = whole(rows, pose, of_pose, held, costs, 600.0, relaxed)
    end = time.process_time()
    reached = value(criterion, held + rows[chosen].T @ rows[chosen])
    share = 100 * efficiency(criterion, reached, relaxed.bound, p)
    print(f"{len(rows)} candidates: relaxed {between - begin:.1f} s, whole touches {end - between:.1f} s, efficiency {share:.0f} %")
    inside, outside = rows[chosen], rows[~chosen][:800]
    state = State.of(criterion, held + inside.T @ inside)
    swaps(state, inside, outside)
    begin = time.process_time()
    gained = swaps(state, inside, outside)
    sweep = time.process_time() - begin
    begin, sample = time.process_time(), [(i, k) for i in range(0, len(inside), 40) for k in range(0, 800, 200)]
    plain = []
    for i, k in sample:
        other = np.vstack([np.delete(inside, i, axis=0), outside[k]])
        plain.append(reached - value(criterion, held + other.T @ other))
    naive = (time.process_time() - begin) / len(sample) * gained.size
    alike = np.allclose([gained[i, k] for i, k in sample], plain, rtol=1e-6, atol=1e-9 * reached)
    print(
        f"a sweep over {gained.size} swaps: {1e3 * sweep:.1f} ms; computed anew: {naive:.0f} s, {naive / sweep:.0f} times as long"
    )
    if not alike:
        print("swaps differ from what recomputation gives")
    return 0 if good and alike and naive / sweep >= TIMES else 1


if __name__ == "__main__":
    sys.exit(main())
