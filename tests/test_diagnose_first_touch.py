"""First touches that read early only after a rotary axis has turned are no habit of that axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.coverage import pushed

from sim_controller.simulate import simulate
from tango_cnc.diagnose import diagnose
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Array, Cell, Readings
from tango_cnc.terms.first_touch import make
from tango_cnc.touches import from_readings


@pytest.fixture(scope="module")
def run(root: Path) -> tuple[Cell, Readings]:
    folder = root / "examples" / "hu40t"
    cell = read_cell(folder)
    return cell, simulate(cell.machine, cell.artefact, cell.strategy, read_world(folder / "world.yaml"), seed=31)


def after_a_turn(cell: Cell, readings: Readings) -> Array:
    """→ (n,) 1 where B or C has turned since the touch before, or none was before."""
    at = readings.position[:, [cell.machine.column(axis) for axis in "BC"]]
    return np.concatenate([[1.0], np.any(np.diff(at, axis=0) != 0, axis=1)])


def test_after_a_turn_is_not_after_an_indexation_in_which_the_spindle_turns_alone(run: tuple[Cell, Readings]) -> None:
    cell, readings = run
    touches = from_readings(cell.machine, cell.artefact, readings)
    turned, indexed = (make(cell.machine, after)[0].regressor(touches) for after in ("turn", "indexation"))
    assert (-turned == after_a_turn(cell, readings)).all() and -turned.sum() < -indexed.sum()


@pytest.mark.long
def test_first_touches_after_a_turn_are_not_said_to_be_where_c_stops(run: tuple[Cell, Readings]) -> None:
    """3 µm, on facets close to the line of C most of all: 'where C stops depends on how far it came', explained."""
    cell, readings = run
    found = diagnose(cell.machine, cell.artefact, pushed(cell, readings, 0.003 * after_a_turn(cell, readings)), cell.terms)
    assert found.verdict == "explained"
    assert [(f.cause, f.setting.get("after")) for f in found.findings] == [("first_touch", "turn")]
