"""Long plans against shorter ones, and one strategy in every dialect: CPU time, and memory at its peak.

    python benchmarks/plan.py [--touches N] [--post NAME] [--split N]

The strategy is indexations of examples/hu40t drawn at random until there are N/10, 3N/10 and N touches; each length runs in a
process of its own, so that its peak of memory is its own, and so does `tango plan` as a whole. `check` is the program read back.
Times are CPU seconds, so that a busy machine changes them little. Promises, and exit status 1 when one is not kept:

- ten times the touches take at most TIMES the CPU time, in each stage;
- each stage, and `tango plan` as a whole, is flat in memory: the longest plan takes at most MEMORY more than a tenth of it;
- the program of examples/hu40t is written in less than a second in every dialect.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

CELL = Path(__file__).parent.parent / "examples" / "hu40t"
TIMES = 13.0  # of ten times the touches: linear, with room for a busy machine
MEMORY = 20.0  # MB: the list of touches that the strategy is, its indexations and turns, and no more
SECOND = 1.0  # s of CPU for one program of examples/hu40t
STAGES = ("plan", "program", "check", "whole")


def measured(touches: int, post: str) -> dict[str, float]:
    """→ CPU seconds and MB at the peak, of planning, writing and reading back."""
    import postprocessors as posts
    from tango_cnc import readback
    from tango_cnc.plan import plan, plan_hash

    cell, base = drawn(touches), peak()
    made, plan_s = timed(lambda: plan(cell))
    planned = peak()
    dialect = posts.load(post)

    def written() -> tuple[Any, int]:
        _, _, lines = posts.program(dialect, made, {}, plan_hash(made))
        return lines, sum(len(line) + 1 for line in lines())

    (lines, size), program_s = timed(written)
    wrote = peak()
    _, check_s = timed(lambda: readback.check(lines, made, posts.settings(dialect, {}), posts.companions(dialect, made, {})))
    return {
        "touches": len(made.touches),
        "plan_s": plan_s,
        "program_s": program_s,
        "check_s": check_s,
        "plan_mb": planned - base,
        "base_mb": base,
        "program_mb": wrote - planned,
        "check_mb": peak() - wrote,
        "size_mb": size / 1e6,
    }


def drawn(touches: int) -> Any:
    """→ the cell with so many touches, or a few more."""
    from tango_cnc.files import read_cell

    cell, chance = read_cell(CELL), random.Random(1)
    found, count = [], 0
    while count < touches:
        found.append(chance.choice(cell.strategy.indexations))
        count += len(found[-1].facets)
    return replace(cell, strategy=replace(cell.strategy, indexations=tuple(found)))


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """→ what it gives, CPU seconds."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def whole(touches: int, post: str, split: int | None = None) -> dict[str, float]:
    """→ CPU seconds and MB at the peak of `tango plan`, files read and written."""
    from tango_cnc.files import strategy_text

    with tempfile.TemporaryDirectory() as folder:
        cell = Path(folder) / "cell"
        shutil.copytree(CELL, cell)
        (cell / "strategy.yaml").write_text(strategy_text(drawn(touches).strategy), encoding="utf-8")
        code = (
            "import json, runpy, sys, time\nfrom tango_cnc.cli import main\n"
            "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
            f"used = time.process_time(), runpy.run_path({__file__!r})['peak']()\n"
            "print(json.dumps(used), file=sys.stderr)"
        )
        call = [sys.executable, "-c", code, "plan", "-C", str(cell), "--post", post]
        call += ["--split", str(split)] if split else []
        said = subprocess.run(call, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True).stderr
    seconds, size = json.loads(said.splitlines()[-1])
    return {"whole_s": seconds, "whole_mb": size}


def dialects() -> dict[str, tuple[int, float]]:
    """→ touches of examples/hu40t and CPU seconds of writing its program, of every dialect."""
    import postprocessors as posts
    from tango_cnc.files import read_cell
    from tango_cnc.plan import plan, plan_hash

    made, found = plan(read_cell(CELL)), {}
    for name in posts.names():

        def written(name: str = name) -> None:
            for _ in posts.program(posts.load(name), made, {}, plan_hash(made))[2]():
                pass

        found[name] = len(made.touches), timed(written)[1]
    return found


def peak() -> float:
    """→ MB, the most that this process has ever had.

    Linux counts into `ru_maxrss` what the process that started this one had at that moment; VmHWM begins anew with the program.
    """
    status = Path("/proc/self/status")
    if status.exists():
        return int(re.findall(r"^VmHWM:\s+(\d+) kB$", status.read_text(), re.MULTILINE)[0]) / 1e3
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size / (1e6 if sys.platform == "darwin" else 1e3)


def lengths(most: int, post: str, split: int | None) -> list[str]:
    """touches of the longest plan, dialect, touches a program → promises that are not kept, the table printed."""
    print(f"{post}; CPU ms a touch, MB at the peak (plan: beyond what is loaded; program, check: beyond the plan)\n")
    print(f"{'touches':>9}{'plan':>8}{'program':>9}{'check':>8}{'whole':>8}", end="")
    print(f"{'plan MB':>10}{'program MB':>12}{'check MB':>10}{'whole MB':>10}{'text MB':>9}")
    found: list[dict[str, float]] = []
    for count in (most // 10, 3 * most // 10, most):
        call = [sys.executable, __file__, "--one", "--touches", str(count), "--post", post]
        row = json.loads(subprocess.run(call, check=True, stdout=subprocess.PIPE, text=True).stdout) | whole(count, post, split)
        found.append(row)
        times = [1e3 * row[f"{stage}_s"] / row["touches"] for stage in STAGES]
        print(f"{row['touches']:9d}{times[0]:8.3f}{times[1]:9.3f}{times[2]:8.3f}{times[3]:8.3f}", end="")
        print(
            f"{row['plan_mb']:10.1f}{row['program_mb']:12.1f}{row['check_mb']:10.1f}{row['whole_mb']:10.1f}{row['size_mb']:9.1f}",
            flush=True,
        )
    print()
    short, long = found[0], found[-1]
    more, failures = long["touches"] / short["touches"], []
    for stage in STAGES:
        times_ = long[f"{stage}_s"] / short[f"{stage}_s"]
        failures += promise(f"{stage}: times as long for {more:.1f} times the touches", times_, round(TIMES * more / 10, 1))
    for stage in STAGES:
        failures += promise(f"{stage}: MB more for these", long[f"{stage}_mb"] - short[f"{stage}_mb"], MEMORY)
    return failures


def promise(what: str, value: float, most: float) -> list[str]:
    """prints it → what is not kept."""
    kept = value <= most
    print(f"{'kept' if kept else 'NOT KEPT':10}{what}: {value:.2f}, promised {most:g}")
    return [] if kept else [what]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--touches", type=int, default=100_000, help="of the longest plan (100 000)")
    parser.add_argument("--post", default="linuxcnc", help="dialect (linuxcnc)")
    parser.add_argument("--split", type=int, metavar="N", help="the whole command writes programs of at most N touches")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.touches, options.post)))
        return 0
    failures = []
    for name, (count, seconds) in dialects().items():
        failures += promise(f"{name}: CPU s of writing {count} touches", seconds, SECOND)
    print()
    failures += lengths(options.touches, options.post, options.split)
    return int(bool(failures))


if __name__ == "__main__":
    raise SystemExit(main())
