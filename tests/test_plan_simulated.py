"""`tango simulate` and `tango plan` are of one mind about the way each axis came to a touch: backlash goes by it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.runs import Result, readings

from tango_cnc.files import read_cell
from tango_cnc.plan import last_motion, last_moves, plan

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture
def folder(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    shutil.copytree(EXAMPLES / request.param, tmp_path / "cell")
    return tmp_path / "cell"


@pytest.mark.few(1)
@pytest.mark.parametrize("folder", ["hu40t", "fork_head", "three_axis"], indirect=True)
def test_every_last_motion_is_that_of_the_plan(folder: Path) -> None:
    result = Result("simulate", "-C", folder, "--cycles", 2, "--json", "-")
    assert result.code == 0 and json.loads(result.out)["planned"]
    sense = last_motion(plan(read_cell(folder)))
    known = np.tile(sense != 0, (2, 1))
    assert known.mean() > 0.8
    np.testing.assert_array_equal(readings(folder, "simulated.csv").direction[known], np.tile(sense, (2, 1))[known])


@pytest.mark.parametrize("folder", ["hu40t"], indirect=True)
def test_a_strategy_that_cannot_be_planned_is_simulated_and_that_is_said(folder: Path) -> None:
    file = folder / "machine.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("travel: [-100, 800]", "travel: [-100, 640]"), encoding="utf-8")
    assert Result("plan", "-C", folder).code == 2
    result = Result("simulate", "-C", folder, "--json", "-")
    assert result.code == 0 and not json.loads(result.out)["planned"]
    assert f"the strategy cannot be planned ('tango plan -C {folder}' says why)" in result.err


def test_a_last_motion_has_the_size_of_the_move() -> None:
    made = plan(read_cell(Path(__file__).parent / "golden" / "cell"))
    moved, names = last_moves(made), made.machine.names
    standoff, contact = (np.array([getattr(t, what) for t in made.touches]) for what in ("standoff", "contact"))
    measuring = np.abs(contact - standoff) > 1e-6
    np.testing.assert_allclose(moved[measuring], (contact - standoff)[measuring], atol=1e-9)
    first = dict(zip(names, np.degrees(moved[0]), strict=True))
    assert [round(first[name]) for name in "BCS"] == [5, 5, 5]  # the stop before the first touch
