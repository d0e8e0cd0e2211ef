"""Readings of an example, and what `tango estimate` says of readings."""

from __future__ import annotations

from pathlib import Path

from sim_controller.simulate import simulate
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.judgement import Judgement
from tango_cnc.noise import honest
from tango_cnc.plausible import judge
from tango_cnc.records import Cell, Readings, TangoError


def measured(root: Path, example: str, seed: int) -> tuple[Cell, Readings]:
    """root of the project, example, seed → its cell, its readings."""
    folder = root / "examples" / example
    cell = read_cell(folder)
    return cell, simulate(cell.machine, cell.artefact, cell.strategy, read_world(folder / "world.yaml"), seed=seed)


def judged(cell: Cell, readings: Readings) -> Judgement:
    """cell, readings → whether their estimate may be believed, as the commands judge it."""
    try:
        return judge(cell, readings, honest(estimate(cell.machine, cell.artefact, readings, cell.terms)))
    except TangoError:
        return judge(cell, readings, None)
