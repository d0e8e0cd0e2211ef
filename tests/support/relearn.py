"""Trials of learning: a shape is learned in one night; in another one it is hidden again, the indexations in another order.

python -m support.relearn 500000 learned.jsonl [every]     appended to the file; then its table
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from sim_controller import simulate as simulator
from support.diagnosis_parts import candidate
from tango_cnc.diagnose import as_term, diagnose
from tango_cnc.estimate import tips

from . import blind
from .outside import KINDS, Array
from .trials import PEAKS, Stage, stage, stage_of

ONCE = ("open_door", "turned_clamp", "moved_clamp")  # belong to one moment: nothing that comes back
TIMES = (0.7, 1.5)  # as large as it was, when it comes back


@cache
def reordered(seed: int) -> Stage:
    """seed → the stage of the example with its indexations in another order."""
    b = blind.bench()
    order = np.random.default_rng([79, seed]).permutation(len(b.cell.strategy.indexations))
    strategy = replace(b.cell.strategy, indexations=tuple(b.cell.strategy.indexations[i] for i in order))
    cell = replace(b.cell, strategy=strategy)
    clean = simulator.simulate(cell.machine, cell.artefact, strategy, b.world)
    return stage_of(replace(b, cell=cell, clean=clean))


def twice(kind: str, peak: float, seed: int, other: Stage) -> tuple[Array, Array]:
    """kind, visible peak mm, seed, another stage → the same cause in both nights, (n,) mm each; drawn like `trials.hidden`."""
    rng = np.random.default_rng([77, seed])
    eye = blind.eyes(stage().bench)
    for _ in range(20):
        state = rng.bit_generator.state
        pattern = KINDS[kind].make(stage().history, rng)
        left = eye.outside @ pattern
        if np.linalg.norm(left) > 0.05 * np.linalg.norm(pattern) > 0 and not eye.twins(pattern):
            break
    again = np.random.default_rng()
    again.bit_generator.state = state
    factor = peak / float(np.abs(left).max())
    return pattern * factor, KINDS[kind].make(other.history, again) * factor


@dataclass(frozen=True)
class Relearned:
    """What became of a trial."""

    kind: str
    peak: float  # mm
    seed: int
    shapes: int  # that were learned
    gain: float  # part of the visible variance of another night of the same strategy that they take, as they were learned
    best: float  # part that the true pattern takes
    found: list[str]  # causes that were named in the other night
    times: float  # how large the largest learned shape came back, of what was hidden
    seconds: float
    again: list[float] = field(default_factory=list)  # agreement of shapes without a name that were recognised
    covariates: list[str] = field(default_factory=list)  # of what was learned, and of the other night


def tried(kind: str, peak: float, seed: int) -> Relearned:
    """kind, visible peak, seed → what was learned, what it gains, whether it is recognised."""
    s, other = stage(), reordered(seed)
    began = time.process_time()
    rng = np.random.default_rng([80, seed])
    pattern, back = twice(kind, peak, seed, other)

    def noise() -> Array:
        return np.asarray(blind.NOISE * rng.normal(size=len(pattern)))

    cell = s.bench.cell
    d = diagnose(cell.machine, cell.artefact, s.readings(pattern + noise()), cell.terms)
    shapes = [{"name": f"s{i}", **as_term(r)} for i, r in enumerate(d.unexplained) if r.form is not None]
    touches = replace(d.before.model.touches, tip=tips(d.before))
    mine = sum((candidate(touches, "learned", shape).columns[:, 0] for shape in shapes), np.zeros(len(pattern)))
    outside = blind.eyes(s.bench).outside
    night = outside @ (pattern + noise())

    def taken(known: Array) -> float:
        return 1 - float(np.sum((night - outside @ known) ** 2) / np.sum(night**2))

    gain, best = taken(mine), taken(pattern)
    times = TIMES[seed % 2]
    again = diagnose(cell.machine, cell.artefact, other.readings(times * back + noise()), cell.terms, learned=shapes)
    known = [float(f.size.values[0]) / times for f in again.findings if f.cause == "learned"]
    seconds = time.process_time() - began
    known += [r.again.times / times for r in again.unexplained if r.again is not None]
    alike = [r.again.agreement for r in again.unexplained if r.again is not None]
    covariates = [r.covariate for one in (d, again) for r in one.unexplained]
    size = known[0] if known else 0.0
    return Relearned(kind, peak, seed, len(shapes), gain, best, blind.names(again), size, seconds, alike, covariates)


def table(results: Sequence[Relearned]) -> list[str]:
    """results → lines."""
    learned = [r for r in results if r.shapes]
    parts = [r.gain / r.best for r in learned if r.best > 0]
    near = [abs(r.times - 1) < 0.3 for r in learned if r.times]
    return [
        f"{'a shape was learned':60} {blind.share([bool(r.shapes) for r in results])}",
        f"{'its gain in another night, of that of the truth, median':60} {np.median(parts):.2f} of {len(parts)}",
        f"{'recognised in another night and order':60} {blind.share(['learned' in r.found or bool(r.again) for r in learned])}",
        f"{'something else named in the other night':60} {blind.share([bool(set(r.found) - {'learned'}) for r in learned])}",
        f"{'its size within 30 %':60} {blind.share(near)}",
        *(f"{r.kind:20} {1e3 * r.peak:.0f} µm: {r.gain:.2f} of {r.best:.2f}; {'+'.join(r.found)} {r.times:.2f}" for r in results),
    ]


def planned(start: int, every: int = 1) -> list[tuple[str, float, int]]:
    """first seed, every how many → trials of all kinds that can come back, at every peak."""
    kinds = [k for k in KINDS if k not in ONCE]
    return [(k, peak, start + 10 * i + j) for i, k in enumerate(kinds) for j, peak in enumerate(PEAKS)][::every]


def run(start: int, file: Path, every: int = 1) -> list[Relearned]:
    """first seed, file to append to, every how many → results."""
    results = []
    for t in planned(start, every):
        results.append(tried(*t))
        with file.open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(results[-1])) + "\n")
    return results


if __name__ == "__main__":
    print("\n".join(table(run(int(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1))))
