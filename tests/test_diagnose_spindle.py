"""A swing of the stylus that the orientations of the spindle cannot size is not named with a size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import blind

from sim_controller.simulate import simulate
from tango_cnc.diagnose import diagnose
from tango_cnc.diagnose._size import _std
from tango_cnc.terms import spindle_orientation
from tango_cnc.touches import Touches, from_readings


def turned(*places: float) -> Touches:
    """Touches of the thesis' plan, the spindle at these angles in turn, deg."""
    b = blind.bench()
    position = b.clean.position.copy()
    position[:, b.cell.machine.column("S")] = np.radians(np.resize(places, len(position)))
    return from_readings(b.cell.machine, b.cell.artefact, replace(b.clean, position=position))


@pytest.mark.parametrize(
    ("places", "orders"),
    [((0, 180), []), ((0, 90, 180, 270), [1]), ((0, 60, 120, 180, 240, 300), [1, 2]), ((0, 0.5, 1, 1.5, 2, 2.5), [])],
)
def test_waves_are_tried_where_each_of_them_has_a_size(places: tuple[float, ...], orders: list[int]) -> None:
    assert [v["order"] for v in spindle_orientation.variants(turned(*places)) if "order" in v] == orders


def test_a_coefficient_that_touches_know_nothing_of_leaves_no_size() -> None:
    def length(v: np.ndarray, effect: np.ndarray) -> float:
        return float(np.linalg.norm(v))

    columns, none = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.empty((2, 0))
    known = _std(length, np.array([3.0, 0.0]), columns, none, np.diag([0.01, 0.04]))
    assert known == pytest.approx(0.1, rel=1e-9)
    assert _std(length, np.array([3.0, 0.0]), columns, none, np.diag([0.01, 1e6])) > 900


@pytest.mark.long
@pytest.mark.parametrize(("order", "seed"), [(1, 1), (2, 2)])
def test_a_swing_with_the_spindle_is_no_other_swing_with_a_part_of_its_size(order: int, seed: int) -> None:
    b = blind.bench()
    effect = {"cause": "spindle_orientation", "amplitude": 0.02, "order": order, "phase": 40.0}
    world = replace(b.world, effects=(effect,), noise=blind.NOISE, stylus={**b.world.stylus, "EXt": 0.4, "EYt": -0.3})
    found = diagnose(
        b.cell.machine, b.cell.artefact, simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=seed), b.cell.terms
    )
    swing = 0.02 * 0.5
    waves = [f.size for f in found.findings if f.cause == "spindle_orientation" and "order" in f.setting]
    assert all(abs(size.amplitude - swing) < 2 * size.amplitude_std for size in waves)
    assert found.verdict == "unexplained" or any(f.cause == "spindle_orientation" for f in found.findings)
