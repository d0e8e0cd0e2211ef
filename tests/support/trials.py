"""Trials of the diagnosis with causes that no catalogue holds, and with noise as it is; `make blind` runs hundreds.

python -m support.trials outside 500000 trials.jsonl [every] [only]     appended to the file; then its table
python -m support.trials nulls 500000 trials.jsonl 8                    so many of each kind of noise
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np

from sim_controller import simulate as simulator
from sim_controller.effects import Disturbance, History
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.records import Readings

from . import blind
from .outside import KINDS, MOMENT, NULLS, TIME, Array

# What may be said of a noise: the seats and rough facets that it has, and that it is larger than the probe's.
LARGER = ("noise_level",)
TRUE = {
    "seating": ("indexation_seating",),
    "spread by facet": ("surface_form", *LARGER),
    "spread by direction": LARGER,
    "spread by time": LARGER,
    "spread by indexation": LARGER,
}
PEAKS = (0.003, 0.005, 0.008)  # mm
SEEDS = 5


@dataclass(frozen=True, eq=False)
class Stage:
    """A bench, what its touches know, and where each goes for a mm that it is read early."""

    bench: blind.Bench
    history: History
    early: Array  # (n, k)

    def readings(self, early: Array) -> Readings:
        """(n,) mm → readings of touches that are so much early."""
        return replace(self.bench.clean, position=self.bench.clean.position + early[:, None] * self.early)


@cache
def stage(name: str = "hu40t") -> Stage:
    """name of an example → its stage, from two runs of the simulated machine."""
    return stage_of(blind.bench(name))


def stage_of(b: blind.Bench) -> Stage:
    """bench → its stage, from another run of its simulated machine."""
    seen: list[History] = []

    def listen(effects: object, history: History, seed: int) -> Disturbance:
        seen.append(history)
        n = len(history)
        return Disturbance(np.full(n, 1e-3), np.zeros((n, 3)), np.zeros((n, 3)), {})

    with mock.patch("sim_controller.simulate.effects.disturbance", listen):
        read = simulator.simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, replace(b.world, noise=1e-12))
    return Stage(b, seen[0], (read.position - b.clean.position) / 1e-3)


@dataclass(frozen=True)
class Result:
    """What became of a trial."""

    kind: str
    peak: float  # mm, 0 for a null
    seed: int
    verdict: str
    found: list[str]
    remains: list[str]  # covariates, the largest first
    events: list[str]
    margin: float  # evidence of the names over that of the shapes
    shape: float  # part of the visible pattern that the shapes without a name explain
    seconds: float


def hidden(kind: str, peak: float, seed: int) -> tuple[Array, Array]:
    """kind, visible peak mm, seed → (n,) mm by which touches are early, without noise and with it.

    What looks like a cause of the catalogue to these touches (99 % of what is visible) is drawn again: it has that name.
    """
    s = stage()
    rng = np.random.default_rng([77, seed])
    outside = blind.eyes(s.bench).outside
    for _ in range(20):
        pattern = KINDS[kind].make(s.history, rng)
        left = outside @ pattern
        if np.linalg.norm(left) > 0.05 * np.linalg.norm(pattern) > 0 and not blind.eyes(s.bench).twins(pattern):
            break
    pattern = pattern * (peak / np.abs(left).max())
    return pattern, pattern + blind.NOISE * rng.normal(size=len(pattern))


def tried(kind: str, peak: float, seed: int) -> Result:
    """kind of cause or of noise → what the diagnosis makes of it."""
    s = stage()
    began = time.process_time()
    if kind in KINDS:
        pattern, early = hidden(kind, peak, seed)
    else:
        pattern = np.zeros(len(s.history))
        early = blind.NOISE * NULLS[kind](s.history, np.random.default_rng([78, seed]))
    d = diagnose(s.bench.cell.machine, s.bench.cell.artefact, s.readings(early), s.bench.cell.terms)
    return Result(
        *(kind, peak, seed, d.verdict, blind.names(d), [r.covariate for r in d.unexplained]),
        events(d),
        0.0 if d.outcome is None else d.outcome.by_names - d.outcome.by_shapes,
        explained(d, pattern),
        time.process_time() - began,
    )


def events(d: Diagnosis) -> list[str]:
    """diagnosis → what it set aside as the matter of one moment."""
    return [e.kind for e in d.events]


def explained(d: Diagnosis, pattern: Array) -> float:
    """diagnosis, true pattern → part of what is visible of it (squared) that the shapes without a name take."""
    left = blind.eyes(stage().bench).outside @ pattern
    whole = float(left @ left)
    if not whole:
        return 0.0
    mine = sum((r.pattern for r in d.unexplained if len(r.pattern) == len(pattern)), np.zeros(len(pattern)))
    rest = left - blind.eyes(stage().bench).outside @ mine
    return 1 - float(rest @ rest) / whole


def words(covariate: str) -> set[str]:
    """covariates as they are reported → letters of axes and the words of `support.outside`."""
    found = set()
    for part in covariate.split(" × "):
        first = part.split(" ")[0]
        if first in ("way", "path", "previous", "first", "since", "pause", "heat"):
            found.add("history")
        elif first in ("time", "order"):
            found.add("time")
        elif first == "probe":
            found.add("probe direction")
        elif first == "normal" or (len(part) == 2 and part[0] == "d"):
            found.add("direction")
        else:
            found.add(first)
    return found


def right(r: Result) -> bool:
    """result → whether the largest thing without a name follows what it was made of, and nothing else."""
    wanted = KINDS[r.kind].covariates if r.kind in KINDS else ()
    if (wanted == (MOMENT,) and "indexation" in r.events) or (wanted == (TIME,) and "window" in r.events and not r.remains):
        return True
    return bool(r.remains) and words(r.remains[0]) <= set(KINDS[r.kind].covariates)


def table(results: Sequence[Result]) -> list[str]:
    """results → lines: the rates, and a line a kind."""
    lines = []
    causes = [r for r in results if r.kind in KINDS]
    nulls = [r for r in results if r.kind in NULLS]
    if causes:
        false = [r.verdict == "explained" and (bool(r.found) or not right(r)) for r in causes]
        lines += [
            f"{'outside the catalogue: false explained':60} {blind.share(false)}",
            f"{'outside the catalogue: any false name':60} {blind.share([bool(r.found) for r in causes])}",
            f"{'outside the catalogue: right covariates':60} {blind.share([right(r) for r in causes])}",
            f"{'outside the catalogue: nothing at all said':60} {blind.share([r.verdict == 'adequate' for r in causes])}",
            f"{'part of the pattern that shapes take, median':60} {np.median([r.shape for r in causes]):.2f}",
        ]
    if nulls:
        named = [bool(set(r.found) - set(TRUE.get(r.kind, ()))) for r in nulls]
        lines.append(f"{'nulls: a false cause named':60} {blind.share(named)}")
        lines.append(f"{'nulls: anything said':60} {blind.share([r.verdict != 'adequate' for r in nulls])}")
    lines.append(f"{'seconds of a trial: median, largest':60} {_two([r.seconds for r in results])}")
    for kind in dict.fromkeys(r.kind for r in results):
        own = [r for r in results if r.kind == kind]
        told = Counter(_short(r) for r in own)
        lines.append(f"{kind:20} " + "; ".join(f"{n} {what}" for what, n in told.most_common()))
    return lines


def _short(r: Result) -> str:
    return f"{r.verdict[:5]} {'+'.join(r.found)}" + "".join(f" ?{x}" for x in r.remains) + "".join(f" !{x}" for x in r.events)


def _two(values: Sequence[float]) -> str:
    return f"{np.median(values):.1f}, {max(values):.1f}"


def run(trials: Iterable[tuple[str, float, int]], file: Path) -> None:
    """trials, file → one line each, appended."""
    for kind, peak, seed in trials:
        r = tried(kind, peak, seed)
        with file.open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(r)) + "\n")


def recorded(file: Path) -> list[Result]:
    """file of `run` → results."""
    return [Result(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]


def outside_trials(start: int, every: int = 1) -> list[tuple[str, float, int]]:
    """first seed, every how many → trials of all kinds, peaks and seeds in turn."""
    trials = [
        (kind, peak, start + 1000 * i + 10 * round(1e3 * peak) + seed)
        for i, kind in enumerate(KINDS)
        for peak in PEAKS
        for seed in range(SEEDS)
    ]
    return trials[::every]


def null_trials(start: int, each: int) -> list[tuple[str, float, int]]:
    """first seed, how many of each → trials of all kinds of noise."""
    return [(kind, 0.0, start + 1000 * i + seed) for i, kind in enumerate(NULLS) for seed in range(each)]


if __name__ == "__main__":
    what, first, target, number = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4])
    chosen = outside_trials(first, number) if what == "outside" else null_trials(first, number)
    if len(sys.argv) > 5:
        chosen = [c for c in chosen if c[0] in sys.argv[5].split(",")]
    run(chosen, target)
    print("\n".join(table(recorded(target))))
