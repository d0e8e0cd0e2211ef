"""A stylus that is longer than machine.yaml says looks like a table that is higher: `tango locate` says so and does not place it.

Placed all the same, the table was 20 mm too high, "known to 0.04 mm", and the first touches of a tilted table met it at full feed.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.located import touched
from support.runs import Result

from tango_cnc import locate
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, readings_text
from tango_cnc.files.artefact import read_artefact
from tango_cnc.records import Cell, Plan


def _cycle(tmp_path: Path, example: str) -> tuple[Path, Cell, Plan]:
    write_example(tmp_path / "cell", example)
    cell = read_cell(tmp_path / "cell")
    return tmp_path / "cell", cell, locate.strategy(cell)


def _with_stylus(made: Plan, longer: float) -> Plan:
    """The same touches, of a stylus that is so much longer in truth."""
    probe = made.machine.probe
    return replace(made, machine=replace(made.machine, probe=replace(probe, length=probe.length + longer)))


@pytest.mark.few(0)
@pytest.mark.parametrize("longer", [20.0, -7.5])
@pytest.mark.parametrize("example", ["trunnion", "hu40t", "fork_head"])
def test_a_stylus_of_another_length_is_not_taken_for_a_table_elsewhere(tmp_path: Path, example: str, longer: float) -> None:
    folder, cell, made = _cycle(tmp_path, example)
    length, file = cell.machine.probe.length, tmp_path / "touches.csv"
    file.write_text(readings_text(touched(_with_stylus(made, longer), true=made.artefact)))
    refused = Result("locate", "-C", folder, "--readings", file)
    assert refused.code == 1 and not (folder / "locate").exists()
    way = f"{abs(longer):.2f} mm {'longer' if longer > 0 else 'shorter'} than the {length:g} mm of machine.yaml"
    assert way in refused.err and "Measure the probe in the spindle" in refused.err
    wrong = Result("locate", "-C", folder, "--readings", file, "--length", length + longer)
    assert wrong.code == 2 and f"--length: found {length + longer:g} mm; allowed: {length:g} mm to 0.5 mm" in wrong.err
    assert not (folder / "locate").exists()
    machine = folder / "machine.yaml"
    assert f"length: {length:g}" in machine.read_text()
    machine.write_text(machine.read_text().replace(f"length: {length:g}", f"length: {length + longer:g}", 1))
    right = Result("locate", "-C", folder, "--readings", file, "--json", "-")
    assert right.code == 0, right.err
    assert np.abs(json.loads(right.out)["moved_mm"]).max() < 1e-3


def test_a_table_that_is_higher_is_placed_once_the_stylus_is_measured(tmp_path: Path) -> None:
    folder, cell, made = _cycle(tmp_path, "trunnion")
    file, true = tmp_path / "touches.csv", locate.moved(made.artefact, np.array([2.0, -8.0, 5.0]), np.zeros(3))
    file.write_text(readings_text(touched(made, true=true)))
    refused = Result("locate", "-C", folder, "--readings", file)
    assert refused.code == 1 and re.search(r"a table that is [\d.]+ mm (nearer to|farther from) the spindle than", refused.err)
    assert f"'tango locate -C {folder} --readings {file} --length {cell.machine.probe.length:g}' places the table" in refused.err
    placed = Result("locate", "-C", folder, "--readings", file, "--length", cell.machine.probe.length, "--json", "-")
    assert placed.code == 0 and json.loads(placed.out)["longer_beside_mm"] > 1.0
    found = read_artefact(folder / "locate" / "artefact.yaml").facets
    assert max(np.abs(np.subtract(found[name].point, facet.point)).max() for name, facet in true.facets.items()) < 1e-3


def test_where_the_spindle_always_stands_the_same_way_nobody_has_to_measure(tmp_path: Path) -> None:
    """The sum of both is all that such a machine ever meets."""
    folder, _, made = _cycle(tmp_path, "three_axis")
    file = tmp_path / "touches.csv"
    file.write_text(readings_text(touched(_with_stylus(made, 6.0), true=made.artefact)))
    placed = Result("locate", "-C", folder, "--readings", file, "--json", "-")
    assert placed.code == 0, placed.err
    result = json.loads(placed.out)
    assert result["longer_mm"] == pytest.approx(6.0, abs=1e-3) and result["longer_beside_mm"] == pytest.approx(0.0, abs=1e-9)


def test_the_length_is_named_before_anything_moves(tmp_path: Path) -> None:
    folder, cell, _ = _cycle(tmp_path, "trunnion")
    said = Result("locate", "-C", folder, "--program")
    assert f"Probe ({cell.machine.probe.length:g} mm) in the spindle and on. Measure its length" in said.out


@pytest.mark.few(0)
def test_a_strategy_that_does_not_tilt_is_no_proof_for_one_that_does(tmp_path: Path) -> None:
    """The place was taken over, and the strategy of the next day met the table."""
    folder, cell, _ = _cycle(tmp_path, "hu40t")
    level = [at for at in cell.strategy.indexations if abs(at.position["B"]) < 1e-9]
    made = locate.strategy(replace(cell, strategy=replace(cell.strategy, indexations=tuple(level))))
    file = tmp_path / "touches.csv"
    file.write_text(readings_text(touched(_with_stylus(made, 6.0), true=made.artefact)))
    data = yaml.safe_load((folder / "strategy.yaml").read_text())
    data["indexations"] = [at for at in data["indexations"] if at.get("B", 0) == 0]
    (folder / "strategy.yaml").write_text(yaml.safe_dump(data))
    refused = Result("locate", "-C", folder, "--readings", file)
    assert refused.code == 1 and "6.00 mm longer" in refused.err


@pytest.mark.few(0)
def test_a_command_that_is_handed_out_states_again_what_was_stated(tmp_path: Path) -> None:
    """Two refusals sent each other round: each dropped what the person had stated after the other."""
    folder, _, made = _cycle(tmp_path, "trunnion")
    file = tmp_path / "touches.csv"
    file.write_text(readings_text(touched(_with_stylus(made, 6.0), true=made.artefact)))
    refused = Result("locate", "-C", folder, "--readings", file, "--agrees", 0.3, "--within", 15)
    assert f"'tango locate -C {folder} --within 15 --agrees 0.3 --readings {file} --length 240'" in refused.err, refused.err
    program = Result("locate", "-C", folder, "--program", "--within", 10)
    assert f"Then \"tango locate -C {folder} --within 10 --port '" in program.out, program.out


def test_of_walls_that_no_touch_sees_it_is_said_by_how_much_a_larger_table_has_them_elsewhere(tmp_path: Path) -> None:
    """1 % larger, placed, exit status 0: four walls were 3 mm beside, and the text did not say how much that is."""
    folder, cell, made = _cycle(tmp_path, "trunnion")
    larger = {key: replace(facet, point=tuple(1.01 * v for v in facet.point)) for key, facet in cell.artefact.facets.items()}
    file = tmp_path / "touches.csv"
    file.write_text(readings_text(touched(made, true=replace(cell.artefact, facets=larger))))
    placed = Result("locate", "-C", folder, "--readings", file, "--length", cell.machine.probe.length, "--agrees", 0.3)
    assert placed.code == 0, placed.err
    found = read_artefact(folder / "locate" / "artefact.yaml").facets
    names = placed.out.split("on the side of facets ")[1].split(":")[0].split(", ")
    away = {n: abs(np.dot(larger[n].normal, np.subtract(found[n].point, larger[n].point))) for n in names}
    said = re.search(r"On one that is 1 % larger facet (\w+), the worst, is ([\d.]+) mm beside that", placed.out)
    assert said is not None, placed.out
    assert float(said[2]) == pytest.approx(max(away.values()), abs=0.05) == pytest.approx(away[said[1]], abs=0.05)
    assert float(said[2]) > 2.0


def test_a_refusal_asks_for_the_length_of_the_probe(tmp_path: Path) -> None:
    """A stylus that was 20 mm too long met walls with its stem: another facet was asked for, and a rule."""
    folder, cell, made = _cycle(tmp_path, "trunnion")
    file, scatter = tmp_path / "touches.csv", np.random.default_rng(1)
    facets = cell.artefact.facets
    loose = {key: replace(f, point=tuple(np.add(f.point, scatter.normal(0, 3.0, 3)))) for key, f in facets.items()}
    file.write_text(readings_text(touched(made, true=replace(cell.artefact, facets=loose))))
    refused = Result("locate", "-C", folder, "--readings", file)
    length = cell.machine.probe.length
    assert refused.code == 1 and f"Is the probe {length:g} mm long, as machine.yaml has it? If so: measure the place" in refused.err
