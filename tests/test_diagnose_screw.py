"""A screw that warms with its way, hidden by somebody who had no such cause in mind: named, and no drift that is not there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.annex import NAMED
from support.judge import tried

from tango_cnc.terms.screw_heat import heat


def test_heat_comes_with_the_way_and_goes_with_time_and_with_the_night() -> None:
    """Two metres at once, half of it left after a time of ln 2, another metre; the next day begins cold."""
    x = np.array([0.0, 2000.0, 2000.0, 1000.0, 4000.0, 4500.0])
    day: Any = SimpleNamespace(axis=lambda name: x, warm=np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]))
    assert heat(day, "X", 1 / np.log(2)) == pytest.approx([0.0, 2.0, 1.0, 2.0, 0.0, 0.5])


@pytest.mark.long
@pytest.mark.parametrize(("machine", "peak", "seed"), [("trunnion", 0.005, 95_008_050), ("fork_head", 0.008, 95_028_080)])
def test_a_screw_that_warms_with_its_way_is_named(machine: str, peak: float, seed: int) -> None:
    assert tried(machine, "hot_screw", peak, seed, kinds=NAMED).found == ["screw_heat"]
