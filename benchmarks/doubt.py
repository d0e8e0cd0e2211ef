"""How often a quiet night is in doubt, and how many spoilt nights are seen: nights as a shop has them, each judged in full.

    python benchmarks/doubt.py --example trunnion --minutes 2 3 5.5 --seeds 1 2 --nights 40
    python benchmarks/doubt.py --example trunnion --minutes 2 --seeds 1 2 --spoilt

A spoilt night comes after twelve quiet ones; the night after it is spoilt as well.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from tango_cnc.commands import _simulated_nights as simulated
from tango_cnc.commands._cell_nights import nights_of
from tango_cnc.commands._simulated_nights import Event, Story, nights
from tango_cnc.files import read_cell, read_world, readings_text
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.plan import plan
from tango_cnc.records import Readings, World

QUIET = 12  # nights before a spoilt one
FIRST = datetime(2026, 10, 1, 2, 0, tzinfo=UTC)
WARMING = {"cause": "thermal_drift", "amplitude": 0.020, "tau": 900, "direction": [0, 0.7, 0.7]}

# name → what is added to the true machine's effects, or what becomes of the readings, or where the table goes
EFFECTS: Mapping[str, Callable[[list[int]], Mapping[str, Any]]] = {
    "late probe, 15 µm": lambda facets: {"cause": "trigger_latency", "delay": 0.015 / (180 / 60)},
    "probe that scatters by 5 µm": lambda facets: {"cause": "noise_level", "amplitude": 0.005},
    "5 % outliers of 50 to 100 µm": lambda facets: {"cause": "outliers", "amplitude": 0.1, "rate": 0.05},
    "warm-up of 20 µm": lambda facets: WARMING,
    "swapped facets": lambda facets: {"cause": "swapped_facets", "facets": facets[:2]},
}


def half(read: Readings) -> Readings:
    """readings → the first half of them."""
    return read.rows(np.arange(len(read) // 2))


class Spoilt:
    """While it is in force, every night that is measured is spoilt in one way."""

    def __init__(self, effect: Mapping[str, Any] | None, then: Callable[[Readings], Readings] | None) -> None:
        self.effect, self.then, self.measure = effect, then, simulated._Machine.measure

    def __enter__(self) -> None:
        outer = self

        def measure(machine: Any, kind: str, touches: Any) -> Any:
            truth = machine.truth
            if outer.effect is not None:
                machine.truth = replace(truth, effects=(*truth.effects, outer.effect))
            try:
                found = outer.measure(machine, kind, touches)
            finally:
                machine.truth = truth
            if outer.then is None:
                return found
            read = outer.then(found.readings)
            return replace(found, readings=read, text=readings_text(read))

        simulated._Machine.measure = measure  # type: ignore[method-assign]

    def __exit__(self, *error: object) -> None:
        simulated._Machine.measure = self.measure  # type: ignore[method-assign]


def said(record: Mapping[str, Any]) -> str:
    """record → what a morning with it is: good, alarm, doubtful …"""
    return "alarm" if record["alarms"] and record["verdict"] != "doubtful" else str(record["verdict"])


def main() -> None:
    """Prints one line for every example, minutes and wander."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--example", nargs="+", default=["trunnion"])
    asked.add_argument("--minutes", nargs="+", type=float, default=[2.0, 3.0, 5.5])
    asked.add_argument("--wander", nargs="+", type=float, default=[1.0, 0.0])
    asked.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    asked.add_argument("--nights", type=int, default=40)
    asked.add_argument("--spoilt", action="store_true")
    asked.add_argument("--only", default="")
    asked.add_argument("--diagnose", action="store_true")
    given = asked.parse_args()
    root = Path(__file__).parents[1] / "examples"
    for example in given.example:
        cell, truth = read_cell(root / example), read_world(root / example / "world.yaml")
        made = plan(cell)
        simulated.plan = lambda cell, made=made: made  # type: ignore[assignment]
        for minutes in given.minutes:
            settings = Nightly(diagnose=given.diagnose, check_minutes=minutes)
            analysis = nights_of(cell, settings, made, deep=True)
            simulated.nights_of = lambda cell, settings, made, deep=True, deeply=analysis: deeply  # type: ignore[assignment]
            for wander in given.wander:
                (spoilt if given.spoilt else quiet)(
                    f"{example} {minutes:g} min wander {wander:g}", cell, truth, settings, wander, given
                )


def quiet(title: str, cell: Any, truth: World, settings: Nightly, wander: float, given: Any) -> None:
    """Counts the mornings of quiet nights; the first one is not counted."""
    count: Counter[str] = Counter()
    for seed in given.seeds:
        with tempfile.TemporaryDirectory() as folder, opened(Path(folder) / "history.db") as history:
            for number, (record, _) in enumerate(
                nights(cell, truth, history, given.nights, seed, Story(wander=wander), settings, FIRST), 1
            ):
                count[said(record)] += 1
                if record["verdict"] != "good":
                    why = [*record.get("plausible", {}).get("reasons", ()), *(a["text"] for a in record["alarms"])]
                    print(f"  {title} seed {seed} night {number} {record['kind']} {record['verdict']}: {why[:3]}", flush=True)
    print(f"{title}: {dict(count)}", flush=True)


def spoilt(title: str, cell: Any, truth: World, settings: Nightly, wander: float, given: Any) -> None:
    """Counts the mornings of two spoilt nights after quiet ones."""
    facets = [int(i) for i in cell.artefact.facets]
    cases = [(name, (effect(facets), None, None)) for name, effect in EFFECTS.items()]
    cases += [("half of the touches missing", (None, half, None)), ("table knocked by 20 µm", (None, None, (0.018, 0.009, 0.0)))]
    found: dict[str, list[Counter[str]]] = {name: [Counter(), Counter()] for name, _ in cases if given.only in name}
    for seed in given.seeds:
        with tempfile.TemporaryDirectory() as folder:
            kept = Path(folder) / "history.db"
            with opened(kept) as history:
                *_, (_, now) = nights(cell, truth, history, QUIET, seed, Story(wander=wander), settings, FIRST)
            for place, (name, (effect, then, table)) in enumerate(cases):
                if name not in found:
                    continue
                with opened(Path(shutil.copy(kept, Path(folder) / f"{place}.db"))) as history, Spoilt(effect, then):
                    story = Story((Event(1, table=table),) if table else (), wander=wander)
                    later = FIRST + timedelta(days=QUIET)
                    for which, (record, _) in enumerate(nights(cell, now, history, 2, 1000 + seed, story, settings, later)):
                        found[name][which][f"{record['kind']} {said(record)}"] += 1
                        if said(record) == "good" or given.only:
                            print(f"  {title} seed {seed} {name}: {record['kind']} {record['headline'][:150]}", flush=True)
    for name, (first, second) in found.items():
        print(f"{title}; {name}: first {dict(first)}; second {dict(second)}", flush=True)


if __name__ == "__main__":
    main()
