"""Do 95 % intervals contain the truth in 95 of 100 machines? The simulator makes the machines, it shares no mathematics."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.commands.init import examples
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell
from tango_cnc.records import Cell, World
from tango_cnc.uncertainty.analysis import Options, analyse
from tango_cnc.uncertainty.inputs import BudgetLine

NOISE, WALK, LOBES = 0.0006, 0.002, 0.0015
BUDGET = (
    BudgetLine("repeatability", {"std": NOISE}),
    BudgetLine("drift", {"shape": "random_walk", "amplitude": WALK}),
    BudgetLine("lobing", {"amplitude": LOBES, "order": 2}),
)
BAR = 0.0005
SIZE = {"X": 0.02, "Y": 0.02, "Z": 0.02, "A": 3e-5, "B": 3e-5, "C": 3e-5}  # one standard deviation of a true axis location error


def truth(names: tuple[str, ...], rng: np.random.Generator) -> dict[str, float]:
    """names of S3 → a machine: offsets, squarenesses, gains and backlashes of the size that machines have."""
    result = {}
    for name in names:
        if name.endswith("b"):
            result[name] = rng.normal(scale=3e-3 if name[1] in "XYZ" else 1e-5)
        elif name.endswith("1"):
            result[name] = rng.normal(scale=2e-5)
        else:
            result[name] = rng.normal(scale=SIZE[name[1]])
    return result


def one_machine(cell: Cell, names: tuple[str, ...], number: int) -> dict[str, np.ndarray]:
    """cell, names of S3, number of a machine → errors of its S3 and S4 estimates, in the order of their names."""
    rng = np.random.default_rng([2026, number])
    errors = truth(names, rng)
    lobing = {"cause": "probe_lobing", "amplitude": LOBES, "order": 2, "phase": float(rng.uniform(0, 360))}
    world = World(
        errors,
        {"EXt": 0.01, "EYt": -0.003, "EZt": -0.07},
        {f: float(rng.normal(scale=0.02)) for f, facet in cell.artefact.facets.items() if facet.ball is None},
        NOISE,
        ({"cause": "random_walk", "amplitude": WALK}, lobing),
        number,
    )
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world)
    bar = cell.artefact.scale_bar
    assert bar is not None
    certified = replace(cell.artefact, scale_bar=replace(bar, length=bar.length + rng.normal(scale=BAR), uncertainty=BAR))
    found = {}
    for terms in ("S3", "S4"):
        result = estimate(cell.machine, certified, readings, (terms,))
        found[terms] = np.array([p.value - errors.get(name, 0.0) for name, p in result.parameters.items()])
    return found


@pytest.mark.campaign
def test_intervals_cover_the_truth_in_95_of_100_of_a_thousand_simulated_machines() -> None:
    cell = read_cell(examples()["hu40t"])
    bar = cell.artefact.scale_bar
    assert bar is not None
    artefact = replace(cell.artefact, scale_bar=replace(bar, uncertainty=BAR))
    readings = simulate(cell.machine, artefact, cell.strategy, World({}, {}, {}, NOISE, (), 1))
    intervals, names = {}, {}
    for terms in ("S3", "S4"):
        a = analyse(cell.machine, artefact, readings, (terms,), 3, BUDGET, Options(trials=50_000))
        own = a.study.machine
        intervals[terms] = (a.low - a.values)[own], (a.high - a.values)[own]
        names[terms] = tuple(a.study.names[i] for i in own)
    with ProcessPoolExecutor(2) as pool:
        machines = list(pool.map(partial(one_machine, cell, names["S3"]), range(1000), chunksize=20))
    covered = {}
    for terms, (low, high) in intervals.items():
        # The true value lies in [y + low, y + high] when the error of the estimate lies in [−high, −low].
        errors = np.array([m[terms] for m in machines])
        covered[terms] = ((errors >= -high) & (errors <= -low)).mean(axis=0)
    print(
        {n: round(float(c), 3) for n, c in zip(names["S3"], covered["S3"], strict=True)}, covered["S4"].mean(), covered["S4"].min()
    )
    assert np.all((covered["S3"] >= 0.93) & (covered["S3"] <= 0.97))
    assert 0.93 <= covered["S4"].mean() <= 0.97
