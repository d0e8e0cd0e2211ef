"""A run that is broken off at 25, 50, 75 % of its time, beside a plan designed for exactly that time.

    OPENBLAS_NUM_THREADS=1 python benchmarks/broken_off.py [ROW …] [--plans FOLDER]

A ROW is named hu40t, volume, or hu40t/volume/10; without one, all are made. Cells are those of `design_table.py`. Both plans are
judged by the same criterion, the standard deviations that `tango estimate` states: *none* where touches do not determine them. A
time for which `tango design` refuses a plan has no plan to compare with.

`--plans FOLDER` keeps the strategies, and does not look again for those that FOLDER has.
"""

from __future__ import annotations

import argparse
import pickle
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from design_table import Row, cell_of, wish_of

from tango_cnc.design import propose, sequence, timed
from tango_cnc.design.enough import promised
from tango_cnc.design.problem import Chosen
from tango_cnc.plan import plan
from tango_cnc.records import Cell, InputError

ROWS = (
    Row("hu40t", "locations", 6),
    Row("trunnion", "locations", 5),
    Row("fork_head", "locations", 5),
    Row("trunnion", "volume", 10),
    Row("hu40t", "volume", 10),
    Row("fork_head", "volume", 20),
)


def made(row: Row, cell: Cell, minutes: float, keep: Path | None) -> tuple[propose.Setting, Chosen | None, float]:
    """row, its cell, minutes, folder → setting, plan of these minutes, s of processor; no plan where it is refused."""
    ready, began = propose.setting(cell, replace(wish_of(row, cell), minutes=minutes)), time.process_time()
    file = None if keep is None else keep / f"{row.cell}-{row.goal}-{minutes:.3f}.pickle"
    if file is not None and file.exists():
        strategy = pickle.loads(file.read_bytes())
        if strategy is None:
            return ready, None, 0.0
        other = replace(ready.problem.choice.cell, strategy=strategy)
        return ready, timed.judged(ready.problem, other, plan(other, "leave-out")), 0.0
    try:
        found = propose.propose(ready)
    except InputError:
        found = None
    if file is not None:
        file.write_bytes(pickle.dumps(None if found is None else found.cell.strategy))
    return ready, found, time.process_time() - began


def told(ready: propose.Setting, phi: float) -> str:
    """setting, φ → as it is printed."""
    return f"{propose.reached(ready, phi)[0]:.3g}" if phi < np.inf else "none"


def main() -> int:
    """→ exit status: 0."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--plans", type=Path)
    given = parser.parse_args()
    if given.plans is not None:
        given.plans.mkdir(parents=True, exist_ok=True)
    print("| cell/goal/minutes | reached | broken off | designed | times | CPU s |", "|" + " --- |" * 6, sep="\n", flush=True)
    for row in ROWS:
        if given.rows and not any(wanted == row.name or wanted in row.name.split("/") for wanted in given.rows):
            continue
        assert row.minutes is not None
        cell = cell_of(row.cell)
        ready, whole, spent = made(row, cell, row.minutes, given.plans)
        if whole is None:
            print(f"| {row.name} | refused |", flush=True)
            continue
        prefix, designed = timed.broken_off(whole), []
        for part in sequence.FRACTIONS:
            _, found, more = made(row, cell, part * row.minutes, given.plans)
            designed.append(np.inf if found is None else promised(found))
            spent += more
        ratio = ["no plan" if d == np.inf else f"{(p / d) ** 0.5:.2f}" for p, d in zip(prefix, designed, strict=True)]
        values = (", ".join(told(ready, float(phi)) for phi in each) for each in ([promised(whole)], prefix, designed))
        cells = (*values, ", ".join(ratio), f"{spent:.0f}")
        print(f"| {row.name} | {' | '.join(cells)} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
