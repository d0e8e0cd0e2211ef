"""Every dialect on the control that speaks it: program → its interpreter → records → readings → the same S3 as `tango simulate`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.dialects import EVERY, PRINTED, QUICK, cell, measured, s3, world  # noqa: F401  fixtures

from sim_controller.simulate import simulate
from tango_cnc.plan import plan
from tango_cnc.records import Cell, Readings, World


@pytest.fixture(scope="module")
def true(cell: Cell, world: World) -> Readings:
    return simulate(cell.machine, cell.artefact, cell.strategy, world)


@pytest.fixture(scope="module")
def limits(cell: Cell, true: Readings) -> tuple[dict[str, float], dict[str, float]]:
    """→ parameters of the true readings, and by how much they move when every coordinate is rounded somehow."""
    exact = s3(cell, true)
    rng = np.random.default_rng(1)
    moved: dict[str, float] = dict.fromkeys(exact, 0.0)
    linear = np.array([name in "XYZ" for name in true.axes])
    for _ in range(12):
        off = rng.uniform(-0.5, 0.5, true.position.shape) * np.where(linear, PRINTED, np.radians(PRINTED))
        rounded = s3(cell, replace(true, position=true.position + off))
        moved = {name: max(size, abs(rounded[name] - exact[name])) for name, size in moved.items()}
    return exact, moved


@pytest.mark.long
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.long) for n in sorted(EVERY)])
def test_the_dialect_gives_the_parameters_of_the_true_machine(
    name: str, cell: Cell, world: World, true: Readings, limits: tuple[dict[str, float], dict[str, float]]
) -> None:
    readings = measured(plan(cell), name, world)
    assert readings.facet == true.facet
    assert set(readings.status) == {"ok"}, f"postprocessors/{name}.py: a record is no contact: {sorted(set(readings.status))}"
    exact, moved = limits
    found = s3(cell, readings)
    assert found.keys() == exact.keys()
    for parameter, value in exact.items():
        assert abs(found[parameter] - value) <= 2 * moved[parameter] * EVERY[name].resolution / PRINTED, (
            f"postprocessors/{name}.py: {parameter} differs by more than digits of {EVERY[name].resolution} mm do: does its "
            "control print fewer (printed in tests/support/dialects.py), or read positions otherwise (CONTROLS of its language)?"
        )
