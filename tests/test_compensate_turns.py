"""A rotary axis that turns once round or more: the same place has several positions, and a table has to correct it at each."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.compensated import example, measured, tips, truth, write

from sim_controller.compensation import read
from tango_cnc.compensate import propose
from tango_cnc.compensate.space import matrix, sample

TURN = 2 * np.pi
TRAVELS = {"endless": None, "two turns": (-np.radians(365), np.radians(365)), "less": (-np.radians(170), np.radians(185))}


@pytest.mark.few(1)
@pytest.mark.parametrize("travel", list(TRAVELS))
def test_a_table_corrects_a_place_at_each_of_its_positions(travel: str, tmp_path: Path) -> None:
    cell, world = example("trunnion")
    c = replace(cell.machine.axis("C"), travel=TRAVELS[travel])
    machine = replace(cell.machine, axes=tuple(c if a.name == "C" else a for a in cell.machine.axes))
    wave = "ECC2"  # rad: the same at -180 and 180 degrees
    cell = replace(cell, machine=machine, terms=(*cell.terms, wave))
    world = replace(world, errors={**world.errors, wave: 1e-5})
    made = propose(measured(cell, replace(world, noise=0.0)), "siemens")
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
        assert there == pytest.approx(away, abs=1e-9)

    # What the control does is what was promised, inside of what was touched.
    left = truth(cell, world, made, control)
    assert left < made.fit.rms_after.high < truth(cell, world, made, None) / 5
    taken = tips(cell, world, made, None) - tips(cell, world, made, control)
    said = matrix(made.held, sample(machine, made.request.limits)) @ made.fit.change
    assert np.abs(taken - said).max() < 1e-4  # mm; errors of second order
    first, last = (
        [line for line in made.files["enc_comp.ini"].splitlines() if key in line][-1] for key in ("MIN[0,AX5]", "MAX[0,AX5]")
    )
    spread = float(last.split("=")[1]) - float(first.split("=")[1])
    assert spread == pytest.approx({"endless": 360.0, "less": 340.0}.get(travel, 730.0), abs=50 if travel == "two turns" else 1e-6)
