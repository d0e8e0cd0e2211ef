"""A stylus tip that creeps in its holder is no drift of the machine; where both read alike, both are listed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import blind

from sim_controller.simulate import simulate
from tango_cnc import terms
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.diagnose.words import as_text


def told(**effect: Any) -> Diagnosis:
    b = blind.bench()
    world = replace(b.world, effects=({"tau": 900.0, "amplitude": 0.007, **effect},), noise=blind.NOISE)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=3)
    return diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms)


def honest(d: Diagnosis, cause: str, other: str) -> bool:
    """Whether the cause is named; by another name only where the cause is listed and nothing is explained."""
    named = [f.cause for f in d.findings]
    if named == [cause]:
        return True
    listed = {name for f in d.findings for name, _, _ in f.alternatives}
    return named == [other] and cause in listed and d.verdict == "unexplained"


def test_its_two_numbers_are_one_direction_across_the_spindle() -> None:
    setting = {"shape": "linear", "tau": 3600.0}
    (effect,) = terms.effects("stylus_creep", blind.bench().cell.machine, setting, np.array([3e-3, -4e-3]))
    assert (effect["cause"], effect["amplitude"]) == ("stylus_creep", pytest.approx(5e-3))
    assert effect["direction"] == pytest.approx([0.6, -0.8, 0.0])


@pytest.mark.long
@pytest.mark.parametrize(
    "setting", [{"direction": [1.0, 0.0, 0.0]}, {"direction": [0.6, -0.8, 0.0]}, {"direction": [1.0, 0.0, 0.0], "shape": "linear"}]
)
def test_a_stylus_that_creeps_is_named_or_listed_and_never_an_explained_drift(setting: dict[str, Any]) -> None:
    d = told(cause="stylus_creep", **setting)
    assert honest(d, "stylus_creep", "thermal_drift"), [(f.cause, f.alternatives) for f in d.findings]
    assert "stylus_creep" in as_text(d)


@pytest.mark.long
@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [0.3, 0.5, 0.8]])
def test_a_machine_that_drifts_is_no_stylus_that_creeps(direction: list[float]) -> None:
    d = told(cause="thermal_drift", direction=direction)
    assert honest(d, "thermal_drift", "stylus_creep"), [(f.cause, f.alternatives) for f in d.findings]
    assert d.findings[0].cause == "thermal_drift"


@pytest.mark.long
@pytest.mark.parametrize("seed", [5200076, 5201076])
def test_a_stylus_that_creeps_along_no_axis_is_named_first(seed: int) -> None:
    """It has two numbers, and a drift that does the same three; one in this plane has two as well, so it is listed."""
    o = blind.tried(blind.Trial(blind.SMALL, "hu40t", ("stylus_creep",), (0.0015, 0.0015), seed))
    assert o is not None
    assert o.found == ["stylus_creep"] and "thermal_drift" in o.calls[0] and o.verdict == "unexplained"
