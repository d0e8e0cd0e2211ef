"""A rotary axis that turns once round or more: the same place has several positions, and a table has to correct it at each."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.compensated import example, measured, tips, truth, write
from support.few import every

from sim_controller.compensation import read
from tango_cnc.compensate import propose
from tango_cnc.compensate.space import matrix, sample
from tango_cnc.estimate import Estimate
from tango_cnc.records import Cell, InputError, World

TURN = 2 * np.pi
TRAVELS = {"endless": None, "two turns": (-np.radians(365), np.radians(365)), "less": (-np.radians(170), np.radians(185))}
SETTINGS = {"value_sheet": ("increment=1e-6",)}
TARGETS = ("siemens", "heidenhain", "centroid", "linuxcnc", "fanuc", "value_sheet")
LESS = {"siemens": 5, "heidenhain": 5}  # of the error is left, at most, where a target holds nearly all
MOST = {"heidenhain": 256, "linuxcnc": 256, "fanuc": 128}  # rows that a table of a control may have


@cache
def turning(travel: str) -> tuple[Cell, World, Estimate]:
    """Travel of C → a trunnion with it, its true machine, an estimate of what it measures without scatter."""
    cell, world = example("trunnion")
    c = replace(cell.machine.axis("C"), travel=TRAVELS[travel])
    machine = replace(cell.machine, axes=tuple(c if a.name == "C" else a for a in cell.machine.axes))
    wave = "ECC2"  # rad: the same at -180 and 180 degrees
    cell = replace(cell, machine=machine, terms=(*cell.terms, wave))
    world = replace(world, errors={**world.errors, wave: 1e-5})
    return cell, world, measured(cell, replace(world, noise=0.0))


@pytest.mark.few(1)
@pytest.mark.parametrize("travel", every(TRAVELS, 2))
@pytest.mark.parametrize("target", every(TARGETS, 3, first=1))
def test_a_table_corrects_a_place_at_each_of_its_positions(target: str, travel: str, tmp_path: Path) -> None:
    cell, world, found = turning(travel)
    machine = cell.machine
    made = propose(found, target, SETTINGS.get(target, ()))
    control = read(write(made, tmp_path / "c"), machine)

    at = sample(machine, made.request.limits, 512)
    low, high = made.request.limits["C"]
    assert low < -2.7 and high > 3.1  # nearly a turn was touched
    column = machine.column("C")
    position, direction = at.touches.position, at.touches.direction
    turned = position.copy()
    turned[:, column] += np.where(position[:, column] < 0, TURN, -TURN)
    trims = replace(control, kinematics=None)
    away, there = trims(position, direction) - position, trims(turned, direction) - turned
    assert np.abs(away[:, column]).max() > 5e-5
    if travel != "less":
        assert there == pytest.approx(away, abs=1e-8)
        assert any("-360 to 360" in step for step in made.module.steps(made.request)) == (
            travel == "endless" and target != "siemens"
        )

    # What the control does is what was promised, inside of what was touched.
    left = truth(cell, world, made, control)
    assert left < made.fit.rms_after.high < truth(cell, world, made, None) / LESS.get(target, 1)
    taken = tips(cell, world, made, None) - tips(cell, world, made, control)
    said = matrix(made.held, sample(machine, made.request.limits)) @ made.fit.change
    assert np.abs(taken - said).max() < 1e-4  # mm; errors of second order


@pytest.mark.parametrize("travel", every(TRAVELS, 3, first=1))
def test_the_tables_of_a_sinumerik_cover_a_turn_or_the_travel(travel: str) -> None:
    files = propose(turning(travel)[2], "siemens").files["enc_comp.ini"].splitlines()
    first, last = ([line for line in files if key in line][-1] for key in ("MIN[0,AX5]", "MAX[0,AX5]"))
    spread = float(last.split("=")[1]) - float(first.split("=")[1])
    assert spread == pytest.approx({"endless": 360.0, "less": 340.0}.get(travel, 730.0), abs=50 if travel == "two turns" else 1e-6)


@pytest.mark.few(0)
@pytest.mark.parametrize("target", every(MOST, 3, first=2))
def test_tables_of_a_few_degrees_have_no_more_rows_than_the_control_takes(target: str, tmp_path: Path) -> None:
    """Of a point every degree the file of two turns would have 730 rows."""
    made = propose(turning("two turns")[2], target, (f"points={min(MOST[target], 128)}",), volume={"C": (-0.5, 0.5)})
    try:
        read(write(made, tmp_path / "c"), made.request.described)
    except InputError as error:
        pytest.fail(str(error))
    rows = {h.at for h in made.held if h.axis == "C" and h.at is not None}
    assert 2 <= len(rows) < MOST[target] / 2
