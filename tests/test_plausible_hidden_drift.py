"""A drift that a plan cannot show: what it may have moved is not to be trusted, whether or not there was one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.trust_parts import judged

from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world

ROOT = Path(__file__).parents[1]


def trusted(example: str, seed: int, drift: float) -> tuple[dict[str, float], tuple[str, ...], str]:
    """Example, seed, mm of a drift of Z → standard deviations by which every trusted parameter is off, untrusted ones, remarks."""
    cell = read_cell(ROOT / "examples" / example)
    known = replace(cell.machine.tolerances, step=1e-6)  # a laser has shown no step: what is left is the drift
    cell = replace(cell, machine=replace(cell.machine, tolerances=known))
    truth = read_world(cell.folder / "world.yaml")
    effect = {"cause": "thermal_drift", "amplitude": drift, "direction": [0.0, 0.0, -1.0], "tau": 600.0}
    world = replace(truth, seed=seed, effects=(effect,) if drift else ())
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world)
    result, judgement = judged(cell, readings, cell.terms, 3)
    off = {}
    for name, value, std in zip(result.parameters, result.values, result.std, strict=False):
        one, _, other = name.partition("-")
        off[name] = (value - truth.errors.get(one, 0.0) + truth.errors.get(other, 0.0)) / std
    return (
        {n: v for n, v in off.items() if n not in judgement.untrusted},
        judgement.untrusted,
        " ".join(map(str, judgement.remarks)),
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("drift", [0.0, 0.005])
def test_what_an_unseen_drift_moves_is_not_trusted(drift: float) -> None:
    off, untrusted, said = trusted("split", 3, drift)
    assert "EZZ1-EXX1" in untrusted and "cannot show a slow drift along Z" in said
    assert max(abs(v) for v in off.values()) < 4


@pytest.mark.few(0)
@pytest.mark.parametrize("example", ["hu40t", "trunnion"])
def test_a_plan_that_comes_back_shows_every_drift(example: str) -> None:
    _, untrusted, said = trusted(example, 3, 0.0)
    assert untrusted == () and "slow drift" not in said
