"""A reversal does not rest on the radius of the tip: late readings are a smaller tip to a ball, and so is backlash."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell
from tango_cnc.iso230.signed import Sheet, signed
from tango_cnc.records import Probe
from tests.support.iso_coverage import EXAMPLES, against, touched
from tests.support.truth import Truth

LATE = 0.003  # mm, every touch alike


@cache
def sheet_of(late: float) -> tuple[Sheet, Truth, list[tuple[str, float | None, tuple[float, float] | None, float]]]:
    """µm by which every touch is read late → figures, the machine, its reversals: name, value, interval, truth."""
    truth = Truth(EXAMPLES / "trunnion", 1003)
    cell = read_cell(EXAMPLES / "trunnion")
    readings = touched(truth, cell.machine.names)
    # to all touches alike, a late reading is a tip that is smaller than stated
    probe: Probe = replace(cell.machine.probe, tip_radius=cell.machine.probe.tip_radius + late)
    result = estimate(replace(cell.machine, probe=probe), cell.artefact, readings, cell.terms)
    sheet = signed(result)
    rows = against(truth, result, sheet)
    return sheet, truth, [(name, value, interval, real) for kind, name, value, interval, real in rows if kind == "reversal"]


@pytest.mark.few(0)
def test_a_probe_that_reads_late_is_no_backlash() -> None:
    found = [(interval, real) for _, _, interval, real in sheet_of(LATE)[2] if interval is not None]
    assert len(found) == 2
    for (low, high), real in found:
        assert low <= real <= high


@pytest.mark.long
def test_the_difference_of_two_reversals_does_not_feel_the_radius() -> None:
    """Their sum does: it moves by as much as the late readings, less than it would where the radius is taken as exact."""
    (_, _, without), (_, _, late) = sheet_of(0.0), sheet_of(LATE)
    before, after = (np.array([value for _, value, _, _ in rows if value is not None]) for rows in (without, late))
    moved = after - before
    assert moved[0] == pytest.approx(moved[1], abs=0.5)
    assert 0.3 < np.abs(moved).mean() < 2e3 * LATE
