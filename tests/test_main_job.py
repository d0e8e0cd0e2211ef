"""The main job on the thesis' machine: planned, posted, executed by a controller, recorded, estimated."""

from __future__ import annotations

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
        [sys.executable, "-m", "sim_controller", "--cell", str(folder), "--tcp", "127.0.0.1:0"],
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
