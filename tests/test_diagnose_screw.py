"""A screw that warms with its way, hidden by somebody who had no such cause in mind: named, and no drift that is not there."""

from __future__ import annotations

import pytest
from support.annex import NAMED
from support.judge import tried


@pytest.mark.long
@pytest.mark.parametrize(("machine", "peak", "seed"), [("trunnion", 0.005, 95_008_050), ("fork_head", 0.008, 95_028_080)])
def test_a_screw_that_warms_with_its_way_is_named(machine: str, peak: float, seed: int) -> None:
    assert tried(machine, "hot_screw", peak, seed, kinds=NAMED).found == ["screw_heat"]
