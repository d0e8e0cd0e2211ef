"""Drift beside the error motions: what it is found to be, and that figures of a machine that warms up are those of the machine."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell
from tango_cnc.iso230.drift import drifting, path
from tango_cnc.iso230.signed import Sheet, signed
from tests.support.iso_coverage import EXAMPLES, against, measured, touched
from tests.support.truth import Truth

SEED = 1003
WARM_UP = np.array([0.003, -0.009, 0.005])  # mm, in the machine frame


@cache
def still() -> tuple[Truth, Estimate]:
    return measured("trunnion", SEED)


def warm() -> Estimate:
    """→ what is estimated of the same machine while its table goes along `WARM_UP`, with a time constant of a third of the run."""
    truth, touches = Truth(EXAMPLES / "trunnion", SEED), still()[1].model.touches
    readings = touched(truth, touches.machine.names)
    part = (readings.time - readings.time[0]) / np.ptp(readings.time)
    gone = (1 - np.exp(-3 * part))[:, None] * WARM_UP
    out = np.sum(touches.machine_normal * gone, axis=1)
    position = readings.position.copy()
    for i, letter in enumerate(
        "XYZ"
    ):  # X and Z carry the tool, and Y the table against its direction: each takes the tip along itself
        position[:, touches.machine.column(letter)] += out * touches.machine_normal[:, i]
    cell = read_cell(EXAMPLES / "trunnion")
    return estimate(cell.machine, cell.artefact, replace(readings, position=position), cell.terms)


@cache
def sheet_of(drifts: bool) -> Sheet:
    return signed(warm() if drifts else still()[1])


def inside(sheet: Sheet) -> tuple[int, int]:
    truth, result = still()
    rows = [row for row in against(truth, result, sheet) if row[3] is not None]
    return sum(low - 1e-9 <= real <= high + 1e-9 for *_, (low, high), real in rows), len(rows)


def test_a_table_that_goes_out_along_a_normal_is_touched_earlier() -> None:
    touches = still()[1].model.touches
    found = {c.name: c.regressor(touches) for c in drifting(touches)}
    assert len(found) == 24
    last = int(np.argmax(touches.time))
    name = max((n for n in found if ".1." in n), key=lambda n: abs(found[n][last]))
    out = touches.machine_normal[last, "xyz".index(name[-1])]
    assert abs(out) > 0.3
    gone = path(touches, {name: 1.0})
    assert gone[0] == pytest.approx([0, 0, 0], abs=1e-9)
    assert found[name][last] == pytest.approx(-out * gone[last].max())
    assert gone[last].max() == pytest.approx(np.sqrt(2) / (np.pi / 2))


def test_a_walk_has_grown_to_its_coefficient_at_the_end_of_a_run() -> None:
    touches = still()[1].model.touches
    late = int(np.argmax(touches.time))
    ends = [path(touches, {c.name: 1.0})[late].max() for c in drifting(touches) if c.name.endswith("x")]
    ends += [path(touches, {c.name: -1.0})[late].max() for c in drifting(touches) if c.name.endswith("x")]
    assert np.sqrt(np.sum(np.square([e for e in ends if e > 0]))) == pytest.approx(1.0, abs=0.03)


def test_another_stylus_begins_another_run_that_may_sit_elsewhere() -> None:
    touches = still()[1].model.touches
    half = np.where(np.arange(len(touches)) < 100, 1, 2)
    two = replace(touches, stylus=half)
    names = [c.name for c in drifting(two)]
    assert [n for n in names if ".0." in n] == ["drift1.0.x", "drift1.0.y", "drift1.0.z"]
    gone = path(two, {"drift1.0.y": 0.01})
    assert gone[99].tolist() == [0, 0, 0]
    assert gone[100].tolist() == [0, 0.01, 0]


@pytest.mark.long
def test_a_warm_up_is_found_and_leaves_the_scatter_of_the_probe() -> None:
    found = sheet_of(True).learned
    assert found is not None
    assert found.scatter == pytest.approx(0.0007, rel=0.2)
    end = np.abs(WARM_UP) * (1 - np.exp(-3))
    assert found.drifted[:2] == pytest.approx(end[:2], abs=0.0015)
    assert found.drifted[2] < end[2] + 0.001  # the cradle tilts more and more meanwhile: what is along Z may be its own motion


@pytest.mark.long
def test_a_machine_that_stands_still_has_no_drift() -> None:
    found = sheet_of(False).learned
    assert found is not None
    assert max(found.drifted) < 0.001


@pytest.mark.long
def test_figures_of_a_machine_that_warms_up_are_those_of_the_machine() -> None:
    within, of = inside(sheet_of(True))
    assert of > 40
    assert within >= 0.9 * of
    volumes = [f for f in sheet_of(True).figures if f.kind == "volumetric" and f.unit == "µm"]
    assert sum(f.value is not None for f in volumes) >= 3  # before, the warm-up was scatter, and withheld them
