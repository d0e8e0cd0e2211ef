"""Which side of a printed efficiency is loose, the bound or the search? Every set of a few indexations is looked at.

    OPENBLAS_NUM_THREADS=1 python benchmarks/certificate.py CELL SECONDS TOUCH VISIT [--indexations N]

A plan turns to some set of indexations, and pays for each turn. For each set there is a bound (`tango_cnc/design/here.py`), so the
least of these is a bound on every plan of these indexations; it has no parts of turns in it. The goal is `locations`, every facet
once at each visit. N indexations: those that the search visits, and those that the relaxed design likes best.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np

from tango_cnc.design import goals, propose
from tango_cnc.design.criterion import Criterion, value
from tango_cnc.design.here import bound_here
from tango_cnc.design.problem import lighter
from tango_cnc.design.relaxed import THOROUGH, Costs, Relaxed, relax
from tango_cnc.design.whole import SHAKES, whole
from tango_cnc.files import read_cell
from tango_cnc.records import Approach, Array

Rows = np.ndarray[tuple[int], np.dtype[np.int64]]


class Small:
    """Touches at some indexations, with the price of a touch and of a visit."""

    def __init__(self, rows: Array, pose: Rows, held: Array, criterion: Criterion, price: tuple[float, float, float]) -> None:
        """(n, p), (n,) indexation, (p, p), criterion, s in all, of a touch and of a visit."""
        self.rows, self.pose, self.held, self.criterion = rows, pose, held, criterion
        self.seconds, self.touch, self.visit = price
        self.of_pose = [np.flatnonzero(pose == j) for j in range(int(pose.max()) + 1)]
        self.costs = Costs(np.full(len(rows), self.touch), np.full(len(self.of_pose), self.visit))

    def relaxed(self) -> Relaxed:
        """→ the relaxed design."""
        return relax(self.rows, self.of_pose, self.held, self.costs, self.seconds, self.criterion, None, THOROUGH)

    def searched(self, relaxed: Relaxed) -> tuple[float, Rows]:
        """relaxed design → φ of the plan that is found, and its indexations."""
        mask = whole(self.rows, self.pose, self.of_pose, self.held, self.costs, self.seconds, relaxed, SHAKES)
        return value(self.criterion, self.held + self.rows[mask].T @ self.rows[mask]), np.unique(self.pose[mask])

    def only(self, some: Rows) -> Small:
        """indexations → the same with these alone."""
        own = np.isin(self.pose, some)
        price = self.seconds, self.touch, self.visit
        return Small(self.rows[own], np.searchsorted(some, self.pose[own]), self.held, self.criterion, price)

    def least(self) -> tuple[float, int]:
        """→ least bound of any set of indexations, and how many sets there are."""
        found, count = np.inf, 0
        for size in range(1, len(self.of_pose) + 1):
            left = self.seconds - size * self.visit
            for some in itertools.combinations(range(len(self.of_pose)), size) if left > self.touch else ():
                rows = self.rows[np.concatenate([self.of_pose[j] for j in some])]
                count += 1
                found = min(found, bound_here(rows, self.held, np.full(len(rows), self.touch), left, self.criterion))
        return found, count


def main() -> None:
    """Prints φ as a share of the limit: bound, search, and the least bound of all sets of indexations."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("cell", type=Path)
    for name in ("seconds", "touch", "visit"):
        asked.add_argument(name, type=float)
    asked.add_argument("--indexations", type=int, default=12)
    given = asked.parse_args()
    cell, goal = read_cell(given.cell), goals.read("locations")
    wish = propose.Wish(goal, 5.0, propose.usual_terms(goal, cell.terms), Approach(2.0, 0.5, 180.0), feed=6000.0, gate="facet")
    problem = lighter(propose.setting(cell, wish).problem)
    choice = problem.choice
    every = Small(choice.rows, choice.pose, problem.held, problem.criterion, (given.seconds, given.touch, given.visit))
    relaxed = every.relaxed()
    reached, visited = every.searched(relaxed)
    print(f"all indexations: relaxed bound {relaxed.bound**0.5:.3f}, found {reached**0.5:.3f} at {len(visited)}")
    liked = [j for j in np.argsort(-relaxed.visits) if j not in visited][: max(given.indexations - len(visited), 0)]
    few = every.only(np.sort(np.concatenate([visited, np.array(liked, dtype=np.int64)])))
    relaxed = few.relaxed()
    reached, visited = few.searched(relaxed)
    least, count = few.least()
    print(f"{len(few.of_pose)} of them: relaxed bound {relaxed.bound**0.5:.3f}, found {reached**0.5:.3f} at {len(visited)}")
    print(f"least bound of {count} sets {least**0.5:.3f}: found is {100 * (least / reached) ** 0.5:.1f} % of it or better,")
    print(f"and the relaxed bound {100 * (relaxed.bound / least) ** 0.5:.1f} %")


if __name__ == "__main__":
    main()
