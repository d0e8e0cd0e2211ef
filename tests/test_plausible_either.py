"""What a drift may be taken for: a table knocked by 3 µm, a screw that errs once a turn, a center of rotation that drifts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.coverage import CASES, judged, measured, pushed
from support.trust_parts import status

from sim_controller.simulate import simulate
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Array, Cell, Readings, World

Run = tuple[Cell, World, Readings]


@pytest.fixture(scope="module")
def run(root: Path) -> Run:
    cell, world = read_cell(root / "examples" / "trunnion"), read_world(root / "examples/trunnion/world.yaml")
    return cell, world, simulate(cell.machine, cell.artefact, cell.strategy, world, seed=21)


def normals(cell: Cell, readings: Readings) -> Array:
    return np.array([cell.artefact.facets[f].normal for f in readings.facet])


@pytest.mark.long
def test_a_table_knocked_by_3_micrometers_is_not_taken_for_a_drift(run: Run) -> None:
    cell, world, readings = run
    late = np.arange(len(readings)) >= 0.88 * len(readings)
    knocked = np.array([1.0, -1.0, 0.3]) / np.linalg.norm([1.0, -1.0, 0.3]) * 0.0035
    found = judged(cell, pushed(cell, readings, late * (normals(cell, readings) @ knocked)))
    assert found.verdict == "doubtful"
    assert "may as well be something else: the residuals fit if the table, or what is on it, had moved" in " ".join(found.reasons)
    assert set(world.errors) <= set(found.untrusted), "which of the two it was, nobody can tell"
    assert found.nothing and status(found, despite=False) == 1, "no parameter is trusted: nobody goes on with them unasked"


@pytest.mark.long
def test_a_screw_that_errs_once_a_turn_is_said(run: Run) -> None:
    cell, _, readings = run
    z = readings.position[:, cell.machine.column("Z")]
    column = np.arange(len(cell.machine.names)) == cell.machine.column("Z")
    wavy = replace(readings, position=readings.position + 0.003 * np.sin(2 * np.pi * z / 5 + 1)[:, None] * column)
    found = judged(cell, wavy)
    assert found.verdict == "doubtful" and "the screw or scale of Z erred once a turn" in " ".join(found.reasons)


@pytest.mark.long
def test_a_center_of_rotation_that_drifts_is_said(run: Run) -> None:
    cell, world, readings = run
    elsewhere = replace(world, errors={**world.errors, "EY0C": world.errors["EY0C"] + 0.008})
    after = simulate(cell.machine, cell.artefact, cell.strategy, elsewhere, seed=21)
    over = np.linspace(0, 1, len(readings))[:, None]
    found = judged(cell, replace(readings, position=readings.position + over * (after.position - readings.position)))
    assert found.verdict == "doubtful" and "the center of rotation of C drifted" in " ".join(found.reasons)
    assert {"EY0C", "EY0S"} <= set(found.untrusted)


@pytest.mark.long
@pytest.mark.parametrize("runout", ["EXt", "EYt"])
def test_a_tip_that_creeps_in_its_holder_does_not_pass_for_a_place_of_the_spindle(run: Run, runout: str) -> None:
    cell, world, readings = run
    elsewhere = replace(world, stylus={**world.stylus, runout: world.stylus.get(runout, 0.0) + 0.005})
    after = simulate(cell.machine, cell.artefact, cell.strategy, elsewhere, seed=21)
    over = np.linspace(0, 1, len(readings))[:, None]
    found = judged(cell, replace(readings, position=readings.position + over * (after.position - readings.position)))
    assert "the stylus tip crept sideways in its holder" in " ".join((*found.reasons, *found.remarks))
    assert {"EXt": "EX0S", "EYt": "EY0S"}[runout] in found.untrusted


@pytest.mark.long
@pytest.mark.parametrize("what", ["warm-up of 5 µm", "seating"])
def test_a_drift_that_is_one_is_left_in_peace(what: str, root: Path) -> None:
    assert what in CASES
    cell, world = read_cell(root / "examples" / "hu40t"), read_world(root / "examples/hu40t/world.yaml")
    found = [judged(cell, measured(cell, world, what, seed)) for seed in range(801, 809)]
    assert sum("something else" in reason for judgement in found for reason in judgement.reasons) <= 1


@pytest.mark.long
def test_a_result_of_which_most_is_untrusted_is_no_trustworthy_one(run: Run) -> None:
    cell, world, readings = run
    elsewhere = replace(world, stylus={**world.stylus, "EYt": world.stylus.get("EYt", 0.0) + 0.003})
    after = simulate(cell.machine, cell.artefact, cell.strategy, elsewhere, seed=21)
    over = np.linspace(0, 1, len(readings))[:, None]
    found = judged(cell, replace(readings, position=readings.position + over * (after.position - readings.position)))
    assert found.verdict == "doubtful" and not found.nothing
    assert found.reasons == ("9 of 17 parameters are not to be trusted",)
    assert not found.suspicions and status(found, despite=False) == 0, (
        "no mistake is accused of it, and what is trusted may be used"
    )
    assert judged(cell, readings).verdict == "trustworthy"
