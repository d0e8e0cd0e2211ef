"""A table that is warmer on the machine than on the CMM: the simulator grows table and bar, the CMM measured at 20 °C."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sim_controller.simulate import simulate
from tango_cnc.cli import guarded, tango
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world, readings_text
from tango_cnc.iso230 import figures
from tango_cnc.iso230.temperature import Known, Thermal, grown, scale
from tango_cnc.records import Artefact, Id, Readings
from tango_cnc.verify import cmm

CELL = read_cell(Path(__file__).parents[1] / "examples" / "hu40t")
STEEL, ALUMINIUM = Known(11.5e-6, 0.5e-6), Known(23e-6, 1e-6)
WARM = Thermal(Known(23.0, 0.1), Known(25.0, 0.1), STEEL, STEEL, Known(25.0, 0.1), ALUMINIUM, Known(20.0, 0.1))
AT_20 = -11e-6  # the gain of X at 20 °C
OFF = {facet.id: float(o) for facet, o in zip(CELL.artefact.facets.values(), np.linspace(-0.02, 0.03, 200), strict=False)}


def longer_bar(artefact: Artefact, by: float) -> Artefact:
    """The same with its balls farther apart; the certificate still says what it said at 20 °C."""
    assert artefact.scale_bar is not None
    one, two = (np.array(artefact.balls[b].centre) for b in artefact.scale_bar.balls)
    away = dict(zip(artefact.scale_bar.balls, ((one - two) * by / 2, (two - one) * by / 2), strict=True))

    def moved(point: tuple[float, float, float], ball: Id) -> tuple[float, float, float]:
        x, y, z = np.array(point) + away[ball]
        return float(x), float(y), float(z)

    balls = {i: replace(b, centre=moved(b.centre, i)) for i, b in artefact.balls.items()}
    facets = {i: f if f.ball is None else replace(f, point=moved(f.point, f.ball)) for i, f in artefact.facets.items()}
    return replace(artefact, balls=balls, facets=facets)


@cache
def warm() -> tuple[Readings, Estimate]:
    """Bar at +3 K, aluminium table and machine at +5 K; the machine's own scales are wrong by AT_20 at 20 °C."""
    grows = 23e-6 * 5
    planes = {f.id: f for f in CELL.artefact.facets.values() if f.ball is None}
    true = {i: OFF[i] + grows * float(np.dot(f.point, f.normal)) for i, f in planes.items()}
    errors = {"EXX1": AT_20 + 11.5e-6 * 5, "EYY1": 11.5e-6 * 5, "EZZ1": 11.5e-6 * 5}
    world = replace(read_world(CELL.folder / "world.yaml"), errors=errors, facets=true, noise=0.0005)
    readings = simulate(CELL.machine, longer_bar(CELL.artefact, 11.5e-6 * 3), CELL.strategy, world)
    return readings, estimate(CELL.machine, CELL.artefact, readings, ("S3",))


def table(folder: Path) -> Path:
    """What a CMM writes of the table at 20 °C."""
    file = folder / "cmm.csv"
    rows = [f"{f.id},{OFF[f.id]:.9f}" for f in CELL.artefact.facets.values() if f.ball is None]
    file.write_text("\n".join(["facet,offset", *rows]) + "\n", encoding="utf-8")
    return file


def test_gains_at_20_degrees_are_those_of_the_machine_at_20_degrees() -> None:
    found = {f.name: f.value for f in figures(warm()[1], expansion=scale(WARM, at_reference=True)) if f.kind == "positioning gain"}
    assert found["EXX"] == pytest.approx(AT_20 * 1e6, abs=5)  # bar and touches: 2 µm/m
    assert found["EYY"] == pytest.approx(0.0, abs=5)


def test_an_aluminium_table_of_25_degrees_agrees_with_a_cmm_of_20(tmp_path: Path) -> None:
    readings, result = warm()
    points = cmm.read_cmm(table(tmp_path), CELL.artefact)
    cold = cmm.compare_tips(result, readings, points)
    assert cold.figures.worst > 0.010, "without its temperature the table looks wrong"
    assert cold.scale.value == pytest.approx(23e-6 * 5 - 11.5e-6 * 3, abs=5e-6)
    for found in (
        cmm.compare_tips(result, readings, points, grown=grown(WARM, by_bar=True)),
        cmm.compare_tips(result, readings, points, free=True),
    ):
        assert found.figures.worst < 0.002
    assert cmm.compare_artefact(result, points, grown(WARM, by_bar=True)).figures.worst < 0.002


def test_growth_by_hand() -> None:
    found = grown(WARM, by_bar=True)
    assert found.value == pytest.approx(115e-6 - 34.5e-6)
    by_hand = (1.0 * 5) ** 2 + 2 * (23**2 + 1) * 0.01 + (0.5 * 3) ** 2 + (11.5**2 + 0.25) * 0.01
    assert found.std == pytest.approx(by_hand**0.5 * 1e-6)
    assert grown(WARM, by_bar=False).value == pytest.approx(115e-6 - 57.5e-6)


@pytest.mark.long
def test_verify_takes_the_temperatures_of_the_cell_or_says_that_they_are_not_stated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = tmp_path / "cell"

    def call(*arguments: object) -> int:
        return guarded(tango.main, [str(a) for a in arguments], prog_name="tango", standalone_mode=False)

    assert call("init", cell) == 0
    (cell / "readings.csv").write_text(readings_text(warm()[0]), encoding="utf-8")
    file = table(tmp_path)
    capsys.readouterr()
    assert call("verify", "-C", cell, "--cmm", file, "--limit-um", 5) == 1
    told = capsys.readouterr().out
    assert "temperatures of table and CMM are not stated" in told
    assert "would fit better" in told
    stated = "bar: [23, 0.1]\nmachine: [25, 0.1]\nbar_expansion: [11.5, 0.5]\n"
    stated += "table: [25, 0.1]\ntable_expansion: [23, 1]\ncmm: [20, 0.1]\n"
    (cell / "temperature.yaml").write_text(stated, encoding="utf-8")
    assert call("verify", "-C", cell, "--cmm", file, "--limit-um", 5, "--json", "-") == 0
    data = json.loads(capsys.readouterr().out)["cmm"]["S3"]["tips"]
    assert data["grown_um_m"]["value"] == pytest.approx(80.5)
    assert call("verify", "-C", cell, "--cmm", file, "--cmm-scale") == 0
    assert "residuals say nothing of scale" in capsys.readouterr().out
