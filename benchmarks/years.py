"""Years of nights with faults of every kind, and the sum of all that were played on this code.

    python benchmarks/years.py [--years 1000] [--seed 0] [--jobs 2] [--minutes 10]

Each year is a machine of its own and follows one seed (tests/support/years.py). With `--seed` alone it is one year. What a year
came to is a line in build/years.jsonl; a year that is done on this code is not played again, so a sum may take several sessions.
The last line is that sum, with the hash of the code that it is of: every module that a night reaches, the cell and its world.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support import yearbook


def played(seeds: range, minutes: float) -> None:
    """seeds, minutes (0: as long as it takes) → each year that is not done is played, kept and printed."""
    code, end = yearbook.code(), time.monotonic() + 60 * minutes if minutes else float("inf")
    done = {line["seed"] for line in yearbook.years(code) if "broken" not in line}
    on = yearbook.small()
    gc.collect()
    gc.freeze()  # the libraries stay: nobody need look through them with every night
    for seed in seeds:
        if seed in done or time.monotonic() > end:
            continue
        line = yearbook.played(on, seed, code)
        yearbook.keep(line)
        print(json.dumps({key: value for key, value in line.items() if key != "code"}, ensure_ascii=False), flush=True)


def main() -> int:
    """→ exit status: 1 where a year has broken something."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--years", type=int, help="How many seeds; without it one where a seed is given, and else a thousand.")
    parser.add_argument("--seed", type=int, help="The first of them.")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=0.0)
    parser.add_argument("--part", type=int, help="Which of the jobs this is; without it all of them are begun.")
    asked = parser.parse_args()
    first, count = asked.seed or 0, asked.years or (1000 if asked.seed is None else 1)
    if asked.part is not None:
        played(range(first + asked.part, first + count, asked.jobs), asked.minutes)
        return 0
    own = [sys.executable, __file__, "--years", str(count), "--seed", str(first), "--jobs", str(asked.jobs)]
    own += ["--minutes", str(asked.minutes), "--part"]
    running = [subprocess.Popen([*own, str(part)]) for part in range(asked.jobs)]
    for one in running:
        one.wait()
    code = yearbook.code()
    lines = yearbook.years(code)
    wrong = [f"seed {line['seed']}: {line['broken']}" for line in lines if "broken" in line]
    print("\n".join([*wrong, yearbook.summary(lines, code)]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
