"""The main job against others: readings of an independent program, and the thesis' machine behind a controller."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from sim_controller.simulate import simulate
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_readings, read_strategy, read_world, strategy_text, world_text
from tango_cnc.records import World


def test_readings_of_an_independent_program_give_its_truth(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shared / "contract" / "hu40t"
    assert guarded(tango.main, ["estimate", "-C", str(folder), "--json", "-"], standalone_mode=False) == 0
    found = json.loads(capsys.readouterr().out)
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    values = {name: (p["value"], p["std"]) for name, p in found["parameters"].items()}
    values |= {name: (found["stylus"][name], found["stylus_std"][name]) for name in found["stylus"]}
    assert set(values) == set(truth) and len(truth) == 20
    for name, (value, std) in values.items():
        assert abs(value - truth[name]) < 4 * std, name
    assert 0.6 < found["residual"]["rms_um"] < 0.8
    assert found["touches"] == 393 and not found["not_identifiable"]


def test_without_the_ball_rows_only_scale_mismatches_are_told(shared: Path) -> None:
    cell = read_cell(shared / "contract" / "hu40t")
    readings = read_readings(cell.folder / "readings.csv", cell.machine, cell.artefact)
    flat = np.array([cell.artefact.facets[f].ball is None for f in readings.facet])
    result = estimate(cell.machine, cell.artefact, readings.rows(flat), ["S3"])
    truth = json.loads((cell.folder / "truth.json").read_text(encoding="utf-8"))
    assert {"EYY1-EXX1", "EZZ1-EXX1"} <= set(result.parameters) and "EXX1" not in result.parameters
    assert len(result.parameters) == 16
    for name, p in result.parameters.items():
        one, _, other = name.partition("-")
        assert abs(p.value - truth[one] + truth.get(other, 0.0)) < 4 * p.std, name
    assert any("absolute scale" in combination.text for combination in result.selection.unseen)


@pytest.fixture(scope="module")
def thesis_cell(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Table 4-4 made true, Table 4-2 planned, posted for Fanuc, executed by the simulated controller over a TCP line."""
    folder = tmp_path_factory.mktemp("thesis") / "cell"
    write_example(folder, "hu40t")
    cell = read_cell(folder)
    strategy = read_strategy(shared / "contract" / "thesis" / "table_4_2.yaml", cell.machine, cell.artefact)
    errors = yaml.safe_load((shared / "contract" / "thesis" / "table_4_4_subset4.yaml").read_text(encoding="utf-8"))
    world = World({name: float(value) for name, value in errors.items()}, noise=0.0006, seed=3)
    (folder / "strategy.yaml").write_text(strategy_text(strategy), encoding="utf-8")
    (folder / "world.yaml").write_text(world_text(world), encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-m", "sim_controller", "--cell", str(folder), "--tcp", "127.0.0.1:0", "--once"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        port = process.stdout.readline().strip()
        arguments = ["run", "-C", str(folder), "--port", port, "--yes"]
        assert guarded(tango.main, arguments, standalone_mode=False) == 0
    finally:
        process.terminate()
        process.wait()
    yield folder
    shutil.rmtree(folder)


@pytest.mark.long
@pytest.mark.parametrize(("subset", "mean"), [("S1", 25.8), ("S2", 25.7), ("S3", 2.4)])
def test_the_thesis_machine_through_a_program_and_a_controller(thesis_cell: Path, subset: str, mean: float) -> None:
    """An independent simulation of Table 4-2 leaves these means, in µm; the thesis measured 25.93, 25.85 and 2.87."""
    cell = read_cell(thesis_cell)
    readings = read_readings(thesis_cell / "readings.csv", cell.machine, cell.artefact)
    assert len(readings) == 383 and readings.ok.all()
    result = estimate(cell.machine, cell.artefact, readings, [subset])
    assert np.abs(result.residuals).mean() * 1e3 == pytest.approx(mean, rel=0.1)


@pytest.mark.long
def test_readings_through_a_program_and_a_controller_are_those_of_the_simulation(thesis_cell: Path) -> None:
    cell = read_cell(thesis_cell)
    readings = read_readings(thesis_cell / "readings.csv", cell.machine, cell.artefact)
    simulated = simulate(cell.machine, cell.artefact, cell.strategy, read_world(thesis_cell / "world.yaml"))
    assert simulated.facet == readings.facet
    linear = [cell.machine.column(name) for name in "XYZ"]
    apart = (readings.position - simulated.position)[:, linear]
    # two draws of 0.6 µm along the approach, four decimals printed, and up to 1 µm sideways from rounded targets
    assert np.abs(apart).max() < 0.006
    assert np.sqrt((apart**2).sum(axis=1).mean()) < 0.0012
