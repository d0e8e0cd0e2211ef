"""How often 95 % intervals contain the truth, by what disturbs the machine: `python tests/support/coverage.py MACHINES [CASE …]`.

The simulator makes the machines; it shares no mathematics with the estimate. Directions of drifts, rough facets and all random
numbers are drawn anew for every machine.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement
from tango_cnc.kinematics import chain, inverse, tip
from tango_cnc.noise import honest
from tango_cnc.plausible import judge, swamped
from tango_cnc.records import Array, Artefact, Cell, Readings, World

INSIDE = 1.96
EXAMPLES = Path(__file__).parents[2] / "examples"


def pushed(cell: Cell, readings: Readings, way: Array) -> Readings:
    """Readings as they would be with each touch `way` mm farther out along its normal."""
    c = chain(cell.machine)
    normal = np.array([cell.artefact.facets[f].normal for f in readings.facet])
    return replace(readings, position=inverse(c, readings.position, tip(c, readings.position) + way[:, None] * normal))


def judged(cell: Cell, readings: Readings) -> Judgement:
    """cell, readings → whether their estimate may be believed, without the search for a mistake."""
    return judge(cell, readings, honest(estimate(cell.machine, cell.artefact, readings, cell.terms)), search=False)


def _drift(size: float, rng: np.random.Generator) -> dict[str, Any]:
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    return {"cause": "thermal_drift", "amplitude": size, "direction": direction.tolist(), "tau": float(rng.uniform(800, 3000))}


def _effects(what: str, cell: Cell, rng: np.random.Generator) -> tuple[Mapping[str, Any], ...]:
    if what.startswith("warm-up"):
        return (_drift(float(what.split()[2]) / 1e3, rng),)
    if what == "random walk":
        return ({"cause": "random_walk", "amplitude": 0.008},)
    if what == "seating":
        return ({"cause": "indexation_seating", "amplitude": 0.002},)
    if what == "rough facets":
        rough = rng.choice([f for f, facet in cell.artefact.facets.items() if facet.ball is None], 5, replace=False)
        return ({"cause": "surface_form", "amplitude": 0.004, "facets": [str(f) for f in rough]},)
    if what.endswith("5 % outliers"):
        return ({"cause": "outliers", "amplitude": 0.05, "rate": 0.05},)
    return ()


CASES = (
    "white noise",
    "warm-up of 5 µm",
    "warm-up of 15 µm",
    "warm-up of 30 µm",
    "random walk",
    "seating",
    "rough facets",
    "heavy tails",
    "5 % outliers",
    "heavy tails, 5 % outliers",
)


@dataclass(frozen=True)
class Coverage:
    """Of all parameters of all machines: which are trusted, and which intervals contain the truth."""

    inside: Array  # (machines, parameters) bool
    trusted: Array  # (machines, parameters) bool
    names: tuple[str, ...]

    @property
    def share(self) -> float:
        """→ of the intervals of trusted parameters that contain the truth."""
        return float(self.inside[self.trusted].mean()) if self.trusted.any() else float("nan")

    @property
    def each(self) -> dict[str, float]:
        """→ the same of each parameter that is trusted in a tenth of the machines or more."""
        enough = self.trusted.mean(axis=0) >= 0.1
        rows = zip(self.names, self.inside.T, self.trusted.T, enough, strict=True)
        return {n: float(i[t].mean()) for n, i, t, e in rows if e}


def true_bar(artefact: Artefact, rng: np.random.Generator) -> Artefact:
    """artefact → the same with a bar as its certificate leaves it open: exactly of the stated length no bar is."""
    bar = artefact.scale_bar
    if bar is None:
        return artefact
    one, other = (np.array(artefact.balls[b].centre) for b in bar.balls)
    x, y, z = (other + (other - one) / np.linalg.norm(other - one) * bar.uncertainty * rng.normal()).tolist()
    far = replace(artefact.balls[bar.balls[1]], centre=(x, y, z))
    return replace(artefact, balls={**artefact.balls, bar.balls[1]: far})


def measured(cell: Cell, world: World, what: str, seed: int) -> Readings:
    """cell, its machine, what disturbs it, number of the machine → readings."""
    rng = np.random.default_rng([seed, CASES.index(what)])
    effects = _effects(what, cell, rng)
    artefact = true_bar(cell.artefact, np.random.default_rng([seed, len(CASES)]))
    readings = simulate(cell.machine, artefact, cell.strategy, replace(world, effects=effects), seed=seed)
    if what.startswith("heavy tails"):  # Student's t with three degrees of freedom, on top of the noise
        readings = pushed(cell, readings, 0.0015 * rng.standard_t(3, len(readings)))
    return readings


def coverage(what: str, machines: int, example: str = "hu40t", start: int = 50_000) -> Coverage:
    """what disturbs the machines, how many → what their intervals are worth."""
    cell, world = read_cell(EXAMPLES / example), read_world(EXAMPLES / example / "world.yaml")
    inside, trusted, names = [], [], ()
    for seed in range(start, start + machines):
        result = honest(estimate(cell.machine, cell.artefact, measured(cell, world, what, seed), cell.terms))
        bad = {result.selection.label(name) for name in swamped(result)}
        names = tuple(result.parameters)
        off = [(p.value - world.errors.get(n, 0.0)) / p.std for n, p in result.parameters.items()]
        inside.append([abs(z) < INSIDE for z in off])
        trusted.append([n not in bad for n in names])
    return Coverage(np.array(inside), np.array(trusted), names)


def row(what: str, found: Coverage) -> str:
    """case and what was found → its row of the table in docs/plausible.md."""
    low = min(found.each, key=lambda n: found.each[n])
    high = max(found.each, key=lambda n: found.each[n])
    return (
        f"| {what} | {len(found.inside)} | {found.share:.3f} | {found.each[low]:.3f} ({low}) … {found.each[high]:.3f} ({high}) "
        f"| {found.trusted.mean():.2f} | {found.inside.mean():.3f} |"
    )


if __name__ == "__main__":
    print("| disturbed by | machines | inside, trusted | worst and best parameter | trusted | inside, all |\n" + "|---" * 6 + "|")
    for case in sys.argv[2:] or CASES:
        print(row(case, coverage(case, int(sys.argv[1]))), flush=True)
