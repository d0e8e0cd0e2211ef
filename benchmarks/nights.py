"""A short check and the state every night against the full strategy every night: what is known, machine time, coverage.

python benchmarks/nights.py [--nights 25] [--seeds 0 1 2 3] [--minutes 5.5]      the same simulated machine, which wanders, in both

Both are compared twice: with a full night by itself (a state that begins anew every night), and with a state that is fed a full
night every night, which no short check can reach.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from tango_cnc.commands._simulated_nights import Story, nights
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened

EXAMPLE = Path(__file__).parents[1] / "examples" / "hu40t"
STORY = Story()


def played(count: int, seed: int, full: bool, minutes: float) -> list[tuple[dict[str, Any], Any]]:
    """nights, seed, whether every night is a full one, minutes of a check → record and truth of each night."""
    cell, truth = read_cell(EXAMPLE), read_world(EXAMPLE / "world.yaml")
    settings = Nightly(diagnose=False, check_minutes=minutes, full_every_days=1e-9 if full else 1e6)
    with opened("sqlite://") as history:
        return list(nights(cell, truth, history, count, seed, STORY, settings))


def covered(record: Mapping[str, Any], truth: Any) -> list[bool]:
    """record, true machine → of every parameter that the machine has by that name, whether its 95 % interval holds it."""
    told = record.get("parameters") or {}
    return [bool(p["low"] <= truth.errors[n] <= p["high"]) for n, p in told.items() if n in truth.errors]


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--nights", type=int, default=25)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3])
    parser.add_argument("--minutes", type=float, default=Nightly().check_minutes)
    asked = parser.parse_args()
    check: list[tuple[float, float, list[bool]]] = []
    full: list[tuple[float, float, list[bool]]] = []
    alone = []
    for seed in asked.seeds:
        for target, every in ((check, False), (full, True)):
            for i, (record, truth) in enumerate(played(asked.nights, seed, every, asked.minutes)):
                if i == 0:
                    alone.append(record["volume"]["std_um"])  # nothing was known before: a full night by itself
                elif record.get("volume"):
                    target.append((record["volume"]["std_um"], record["machine_time_s"], covered(record, truth)))
    print(f"{len(check)} nights after a first full one, seeds {asked.seeds}, checks of {asked.minutes:g} min")
    own, base = float(np.mean(alone)), float(np.mean([s for s, _, _ in full]))
    for name, found in (("check + state", check), ("full + state", full)):
        std, seconds = float(np.mean([s for s, _, _ in found])), float(np.mean([t for _, t, _ in found]))
        hits = [c for _, _, some in found for c in some]
        by_night = [float(np.mean(some)) for _, _, some in found if some]
        spread = float(stats.sem(by_night)) * 1.96
        print(
            f"{name:14} volume known to {std:.2f} µm: {std / own:.2f} of a full night by itself ({own:.2f} µm), "
            f"{std / base:.2f} of full + state; {seconds / 60:.1f} min; "
            f"95 % intervals cover {100 * np.mean(hits):.1f} ± {100 * spread:.1f} % (n = {len(hits)})"
        )
    print(f"machine time: {np.sum([t for _, t, _ in check]) / np.sum([t for _, t, _ in full]):.3f} of a full run every night")


if __name__ == "__main__":
    main()
