"""How often a quiet night is in doubt, and how many spoilt nights are seen: nights that are judged in full, as a shop has them.

    python benchmarks/doubt.py --example trunnion --minutes 2 3 5.5 --seeds 1 2 --nights 150
    python benchmarks/doubt.py --example trunnion --minutes 2 --seeds 1 2 --spoilt

Two spoilt nights come after twelve quiet ones.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from datetime import timedelta
from pathlib import Path

from tango_cnc.commands._simulated_nights import Event, Story, nights
from tango_cnc.files import read_cell, read_world
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.records import Cell, World

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.spoilt import FIRST, SPOILT, fault, judged_in_full, said, spoilt

QUIET = 12  # nights before a spoilt one


def main() -> None:
    """Prints a line for every example, minutes, wander (and fault), and why a quiet night was not good."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--example", nargs="+", default=["trunnion"])
    parser.add_argument("--minutes", nargs="+", type=float, default=[2.0, 3.0, 5.5])
    parser.add_argument("--wander", nargs="+", type=float, default=[1.0])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--nights", type=int, default=40)
    parser.add_argument("--spoilt", action="store_true")
    parser.add_argument("--only", default="", help="faults whose name has these letters")
    parser.add_argument("--diagnose", action="store_true")
    asked = parser.parse_args()
    root = Path(__file__).parents[1] / "examples"
    for example in asked.example:
        cell, truth = read_cell(root / example), read_world(root / example / "world.yaml")
        for minutes in asked.minutes:
            settings = Nightly(diagnose=asked.diagnose, check_minutes=minutes)
            with judged_in_full(cell, settings):
                for wander in asked.wander:
                    title = f"{example} {minutes:g} min wander {wander:g}"
                    if asked.spoilt:
                        faulty(title, cell, truth, settings, wander, asked)
                    else:
                        quiet(title, cell, truth, settings, wander, asked)


def quiet(title: str, cell: Cell, truth: World, settings: Nightly, wander: float, asked: argparse.Namespace) -> None:
    """Counts the mornings of quiet nights; an alarm that nobody answers is counted once."""
    count: Counter[str] = Counter()
    for seed in asked.seeds:
        with tempfile.TemporaryDirectory() as folder, opened(Path(folder) / "history.db") as history:
            told = nights(cell, truth, history, asked.nights, seed, Story(wander=wander), settings, FIRST)
            for number, (record, _) in enumerate(told, 1):
                count["good" if said(record) in ("changed", "set apart") else said(record)] += 1
                if said(record) in ("alarm", "doubtful"):
                    why = [*record.get("plausible", {}).get("reasons", ()), *(a["text"] for a in record["alarms"])]
                    print(f"  {title} seed {seed} night {number} {record['kind']} {said(record)}: {why[:3]}", flush=True)
    print(f"{title}: {dict(count)}", flush=True)


def faulty(title: str, cell: Cell, truth: World, settings: Nightly, wander: float, asked: argparse.Namespace) -> None:
    """Counts the mornings of two spoilt nights after quiet ones."""
    names = [name for name in SPOILT if asked.only in name]
    found = {name: (Counter[str](), Counter[str]()) for name in names}
    for seed in asked.seeds:
        with tempfile.TemporaryDirectory() as folder:
            kept = Path(folder) / "history.db"
            with opened(kept) as history:
                *_, (_, now) = nights(cell, truth, history, QUIET, seed, Story(wander=wander), settings, FIRST)
            for place, name in enumerate(names):
                wrong = fault(name, list(cell.artefact.facets))
                with opened(Path(shutil.copy(kept, Path(folder) / f"{place}.db"))) as history, spoilt(wrong):
                    story = Story((Event(1, table=wrong.table),) if wrong.table else (), wander=wander)
                    later = FIRST + timedelta(days=QUIET)
                    told = nights(cell, now, history, 2, 1000 + seed, story, settings, later)
                    for count, (record, _) in zip(found[name], told, strict=True):
                        count[f"{record['kind']} {said(record)}"] += 1
                        if said(record) == "good" or asked.only:
                            print(f"  {title} seed {seed} {name}: {record['kind']} {record['headline']}", flush=True)
    for name, (first, second) in found.items():
        print(f"{title}; {name}: first {dict(first)}; second {dict(second)}", flush=True)


if __name__ == "__main__":
    main()
