"""A long plan against one a tenth as long: CPU time of planning and writing, and the memory that writing takes.

    python benchmarks/plan.py [--touches N] [--post NAME]

The strategy is indexations of examples/hu40t drawn at random until there are N touches; each length runs in a process of its own,
so that its peak of memory is its own. Exit status 1 when ten times the touches take more than TIMES the CPU time, or when
writing the program adds more than MEMORY to what the plan itself takes.
"""

from __future__ import annotations

import argparse
import json
import random
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

CELL = Path(__file__).parent.parent / "examples" / "hu40t"
TIMES = 13.0  # of ten times the touches: linear, with room for a busy machine
MEMORY = 20.0  # MB


def measured(touches: int, post: str) -> dict[str, float]:
    """→ CPU seconds and MB at the peak, of planning and of writing."""
    from postprocessors import _base as posts
    from tango_cnc.files import read_cell
    from tango_cnc.plan import plan, plan_hash

    cell, chance = read_cell(CELL), random.Random(1)
    drawn, count = [], 0
    while count < touches:
        drawn.append(chance.choice(cell.strategy.indexations))
        count += len(drawn[-1].facets)
    cell = replace(cell, strategy=replace(cell.strategy, indexations=tuple(drawn)))
    start = time.process_time()
    made = plan(cell)
    planned, before = time.process_time() - start, _peak()
    start = time.process_time()
    _, _, lines = posts.program(posts.load(post), made, {}, plan_hash(made))
    written = sum(len(line) + 1 for line in lines())
    return {
        "touches": len(made.touches),
        "plan_s": planned,
        "program_s": time.process_time() - start,
        "plan_mb": before,
        "program_mb": _peak() - before,
        "size_mb": written / 1e6,
    }


def _peak() -> float:
    """→ MB, the most that this process has ever had."""
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size / (1e6 if sys.platform == "darwin" else 1e3)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--touches", type=int, default=100_000, help="of the long plan (100 000)")
    parser.add_argument("--post", default="linuxcnc", help="dialect (linuxcnc)")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.touches, options.post)))
        return 0
    print(f"{options.post}; CPU seconds, MB at the peak\n")
    print(f"{'touches':>9}{'plan s':>9}{'program s':>11}{'plan MB':>9}{'program MB more':>17}{'size MB':>9}")
    found = []
    for count in (options.touches // 10, options.touches):
        call = [sys.executable, __file__, "--one", "--touches", str(count), "--post", options.post]
        found.append(json.loads(subprocess.run(call, check=True, stdout=subprocess.PIPE, text=True).stdout))
        row = found[-1]
        print(
            f"{row['touches']:9d}{row['plan_s']:9.2f}{row['program_s']:11.2f}{row['plan_mb']:9.0f}{row['program_mb']:17.1f}"
            f"{row['size_mb']:9.1f}",
            flush=True,
        )
    short, long = found
    more = long["touches"] / short["touches"]
    failures = []
    for what in ("plan_s", "program_s"):
        times = long[what] / short[what]
        print(f"{what}: {times:.1f} times as long for {more:.1f} times the touches")
        if times > TIMES * more / 10:
            failures.append(f"{what}: {times:.1f} times, allowed {TIMES * more / 10:.1f}")
    if long["program_mb"] > MEMORY:
        failures.append(f"writing adds {long['program_mb']:.1f} MB, allowed {MEMORY:g}")
    for failure in failures:
        print(f"FAILED {failure}", file=sys.stderr)
    return int(bool(failures))


if __name__ == "__main__":
    raise SystemExit(main())
