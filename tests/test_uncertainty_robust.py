"""`tango uncertainty` rests on the touches that `tango estimate` rests on, and no interval is shorter than the scatter seen."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.cli import guarded, tango
from tango_cnc.files import read_cell, read_readings, read_world, readings_text


@pytest.fixture(scope="module")
def measured(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = Path(shutil.copytree(root / "examples" / "trunnion", tmp_path_factory.mktemp("robust") / "cell"))
    cell = read_cell(folder)
    readings = simulate(cell.machine, cell.artefact, cell.strategy, read_world(folder / "world.yaml"), seed=5)
    (folder / "readings.csv").write_text(readings_text(readings), encoding="utf-8")
    return folder


@pytest.fixture
def cell(measured: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(measured, tmp_path / "cell"))


def intervals(capsys: pytest.CaptureFixture[str], cell: Path, *more: str) -> tuple[int, dict[str, Any], str]:
    code = guarded(tango.main, ["uncertainty", "-C", str(cell), "--trials", "1000", "--json", "-", *more], standalone_mode=False)
    out, err = capsys.readouterr()
    return code, json.loads(out) if out else {}, err


def far(cell: Path, data: dict[str, Any]) -> float:
    """Largest distance from the truth, in half widths of the intervals."""
    truth = read_world(cell / "world.yaml").errors
    half = {n: (p["value"] - truth.get(n, 0.0), (p["interval"][1] - p["interval"][0]) / 2) for n, p in data["parameters"].items()}
    return max(abs(off) / width for off, width in half.values())


def spoil(cell: Path, size: Any) -> None:
    """Moves the touches (n,) mm by the linear axis that carries most of the approach."""
    known = read_cell(cell)
    readings = read_readings(cell / "readings.csv", known.machine, known.artefact)
    position = np.array(readings.position)
    position[:, readings.axes.index("Z")] += size
    moved = replace(readings, position=position)
    (cell / "readings.csv").write_text(readings_text(moved), encoding="utf-8")


@pytest.mark.long
def test_a_few_wrong_touches_are_in_no_interval(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = np.zeros(226)
    wrong[[20, 61, 99, 150, 201]] = 0.4
    spoil(cell, wrong)
    code, data, _ = intervals(capsys, cell)
    assert code == 0 and far(cell, data) < 3


@pytest.mark.long
def test_scatter_that_the_budget_leaves_out_is_added_and_said(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoil(cell, np.random.default_rng(3).normal(0, 0.01, 226))
    (cell / "uncertainty.yaml").write_text("contributions:\n- {source: repeatability, std: 0.0000007}\n", encoding="utf-8")
    code, data, _ = intervals(capsys, cell)
    assert (code, data["verdict"], data["nothing_trusted"]) == (1, "doubtful", True) and far(cell, data) < 4
    assert any("the residuals show more than the budget allows for" in reason for reason in data["reasons"])
    assert data["parameters"]["EX0S"]["contributions"]["scatter seen in the residuals"] > 1e-4


@pytest.mark.long
def test_a_result_in_doubt_decides_on_no_limit_unless_told_to(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoil(cell, np.random.default_rng(3).normal(0, 0.01, 226))
    (cell / "uncertainty.yaml").write_text("contributions:\n- {source: repeatability, std: 0.0000007}\n", encoding="utf-8")
    (cell / "limits.yaml").write_text("limits: {EX0S: 0.4}\n", encoding="utf-8")
    wide = "--limits", str(cell / "limits.yaml")
    code, data, _ = intervals(capsys, cell, *wide)
    decided = data["conformity"]["EX0S"]
    assert (code, decided["verdict"], decided["probability_inside"]) == (1, "cannot tell", None)
    code, data, _ = intervals(capsys, cell, *wide, "--despite")
    assert (code, data["conformity"]["EX0S"]["verdict"]) == (0, "conforms")


@pytest.mark.parametrize(
    "line, found",
    [
        ("{source: repeatability, std: -0.0006}", "found -0.0006"),
        ("{source: repeatability, std: 0.6}", "found 0.6"),
        ("{source: drift, amplitude: 2}", "found 2"),
        ("{source: rotary_positioning, axis: C, std: 5}", "found 5"),
    ],
)
def test_a_size_in_another_unit_is_refused(cell: Path, line: str, found: str, capsys: pytest.CaptureFixture[str]) -> None:
    (cell / "uncertainty.yaml").write_text(f"contributions:\n- {line}\n", encoding="utf-8")
    code, _, err = intervals(capsys, cell)
    assert code == 2 and found in err and "uncertainty.yaml:2" in err and "0 to 0.5 (mm; degrees for angles)" in err


def test_a_limit_that_every_machine_keeps_is_refused(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits = cell / "limits.yaml"
    limits.write_text("limits: {EX0S: 10}\n", encoding="utf-8")
    code, _, err = intervals(capsys, cell, "--limits", str(limits))
    assert code == 2 and "limits.EX0S: found 10; allowed: less than 5 (mm; 10 µm is 0.01)" in err


@pytest.mark.long
def test_there_are_no_intervals_around_an_implausible_estimate(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (cell / "machine.yaml").read_text(encoding="utf-8")
    assert "tip_radius: 3" in text
    (cell / "machine.yaml").write_text(text.replace("tip_radius: 3", "tip_radius: 6"), encoding="utf-8")
    code, data, _ = intervals(capsys, cell)
    assert (code, data["verdict"], data["parameters"]) == (1, "implausible", {})
