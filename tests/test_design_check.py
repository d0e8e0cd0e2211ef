"""The quick check: what it says it sees, and what it does see on a simulated machine that shares no mathematics with it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import special
from support.designs import quickly, takes_the_plan

from sim_controller.simulate import simulate
from tango_cnc.cli import guarded, tango
from tango_cnc.design.check import Seen
from tango_cnc.files import read_cell, read_world, readings_text
from tango_cnc.plan import last_moves, plan
from tango_cnc.records import Cell, World


def test_the_limit_for_one_unknown_in_one_direction_is_the_normal_quantile() -> None:
    one = Seen(np.array([[4.0]]), np.array([[[0.5], [0.0], [0.0]]]), np.zeros((0, 1)))
    assert one.worst == pytest.approx(1.0)
    assert one.limit(0.01) == pytest.approx(-special.ndtri(0.005), rel=0.02)


def test_the_limit_for_a_place_that_moves_any_way_is_the_quantile_of_its_distance() -> None:
    # The distance of three independent standard normal coordinates has the χ distribution of 3 degrees of freedom.
    three = Seen(np.eye(3), np.eye(3)[None], np.zeros((0, 3)))
    assert three.limit(0.01) == pytest.approx(special.chdtri(3, 0.01) ** 0.5, rel=0.01)
    with_lost = Seen(np.eye(3), np.zeros((1, 3, 3)), np.array([[0.0, 2.0, 0.0]]))
    assert with_lost.worst == pytest.approx(2.0)
    assert with_lost.most(np.array([[9.0, -3.0, 9.0]])) == pytest.approx([6.0])


def measured(cell: Cell, world: World, seed: int, file: Path) -> Path:
    made = plan(cell, "leave-out")
    moved = last_moves(made)
    readings = simulate(cell.machine, cell.artefact, made.strategy, world, seed=seed, moved=moved)
    file.write_text(readings_text(readings), encoding="utf-8")
    return file


@pytest.mark.long
def test_a_check_that_was_designed_tells_a_machine_that_changed_from_one_that_did_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    quickly(monkeypatch)
    folder = tmp_path / "cell"
    assert guarded(tango.main, ["init", str(folder), "--example", "trunnion"], standalone_mode=False) == 0
    cell, world = read_cell(folder), read_world(folder / "world.yaml")
    full = measured(cell, world, 1, tmp_path / "full.csv")
    asked = ["design", "-C", str(folder), "--readings", str(full)]
    told = tmp_path / "told.json"
    made = [*asked, "--goal", "check", "--minutes", "5", "--within", "0.3", "-o", str(tmp_path / "check.yaml"), "--json", str(told)]
    assert guarded(tango.main, made, standalone_mode=False) == 0
    data = json.loads(told.read_text(encoding="utf-8"))
    size = data["check"]["size_um"]
    takes_the_plan(folder, tmp_path / "check.yaml", data)
    # A check rests on the full run: alone it need not determine every parameter, which `tango check` says with status 1.
    assert guarded(tango.main, ["check", "-C", str(folder)], standalone_mode=False) in (0, 1)
    few = read_cell(folder)
    capsys.readouterr()
    same = measured(few, world, 2, tmp_path / "same.csv")
    assert guarded(tango.main, [*asked, "--judge", str(same)], standalone_mode=False) == 0
    assert guarded(tango.main, [*asked, "--judge", asked[asked.index("--readings") + 1]], standalone_mode=False) == 2
    assert "not changed" in capsys.readouterr().out
    # Twice what is stated: power beyond 0.999. An axis of the table that moves by s moves a part by s at least.
    moved = replace(world, errors={**world.errors, "EY0C": world.errors["EY0C"] + 2e-3 * size})
    other = measured(few, moved, 3, tmp_path / "other.csv")
    judged = tmp_path / "judged.json"
    assert guarded(tango.main, [*asked, "--judge", str(other), "--json", str(judged)], standalone_mode=False) == 1
    data = json.loads(judged.read_text(encoding="utf-8"))
    assert data["changed"] and next(iter(data["parameters"])) == "EY0C"
    assert data["p_other"] < data["p_left"] and data["p_left"] > 0.01, "what has changed leaves nothing but scatter"
    assert data["parameters"]["EY0C"]["change"] == pytest.approx(2e-3 * size, abs=4 * data["parameters"]["EY0C"]["std"])
    # Checks right after the full run say more of what its touches are; one that finds a change is none of these.
    again = [part for n in (4, 5) for part in ("--again", str(measured(few, world, n, tmp_path / f"again{n}.csv")))]
    assert guarded(tango.main, [*asked, *again, "--judge", str(other), "--json", str(judged)], standalone_mode=False) == 1
    assert json.loads(judged.read_text(encoding="utf-8"))["limit_um"] < 0.95 * data["limit_um"]
    assert guarded(tango.main, [*asked, *again, "--judge", str(same)], standalone_mode=False) == 0
    assert guarded(tango.main, [*asked, "--again", str(other), "--judge", str(same)], standalone_mode=False) == 2
    assert "by which the machine has changed since the full run" in capsys.readouterr().err
    assert guarded(tango.main, [*asked, *again, "--goal", "check", "-o", again[-1]], standalone_mode=False) == 2
    assert "which --again names too" in capsys.readouterr().err


def test_a_check_without_its_full_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, file = tmp_path / "cell", tmp_path / "few.csv"
    assert guarded(tango.main, ["init", str(folder), "--example", "trunnion"], standalone_mode=False) == 0
    file.write_text("", encoding="utf-8")
    assert guarded(tango.main, ["design", "-C", str(folder), "--judge", str(file)], standalone_mode=False) == 2
    assert "--readings of the full run" in capsys.readouterr().err
    assert guarded(tango.main, ["design", "-C", str(folder), "--again", str(file)], standalone_mode=False) == 2
    assert "--again: found neither a check nor its full run" in capsys.readouterr().err
