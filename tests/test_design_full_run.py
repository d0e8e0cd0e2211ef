"""The full run that a check rests on: which terms judge it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_controller.simulate import simulate
from tango_cnc.commands.design import earlier_run
from tango_cnc.files import read_cell, read_world, readings_text
from tango_cnc.plan import last_moves, plan
from tango_cnc.records import TangoError

TRUNNION = Path(__file__).parents[1] / "examples" / "trunnion"
BENT = {"EZC2": 0.004, "EAC2": 4e-5, "EYX2": 4e-7, "EZA2": 0.03, "EXC3": 0.002}  # error motions that no squareness stands for


def full(folder: Path, more: dict[str, float]) -> Path:
    cell, world = read_cell(TRUNNION), read_world(TRUNNION / "world.yaml")
    made = plan(cell, "leave-out")
    world = replace(world, errors=dict(world.errors) | more)
    readings = simulate(cell.machine, cell.artefact, made.strategy, world, seed=1, moved=last_moves(made))
    file = folder / "full.csv"
    file.write_text(readings_text(readings), encoding="utf-8")
    return file


@pytest.mark.long
def test_a_full_run_of_bent_axes_serves_a_check_though_the_cell_has_locations_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell, file = read_cell(TRUNNION), full(tmp_path, BENT)
    with pytest.raises(TangoError, match="is not used"):
        earlier_run(cell, file, False, False)
    assert len(earlier_run(cell, file, False, True)) > 200
    assert "judged with the terms S4" in capsys.readouterr().err


@pytest.mark.long
def test_a_full_run_that_the_terms_of_the_cell_explain_is_judged_with_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    earlier_run(read_cell(TRUNNION), full(tmp_path, {}), False, True)
    assert "terms S4" not in capsys.readouterr().err
