"""The main job from end to end: `tango demo` starts a simulated controller in a process of its own and calibrates it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.demo import LIMIT, _against
from tango_cnc.files import read_world

pytestmark = pytest.mark.long  # by default test_run_simulated.py goes the same way with seven touches


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo") / "cell"
    assert guarded(tango.main, ["demo", "--out", str(folder)], standalone_mode=False) == 0
    return folder


@pytest.fixture(scope="module")
def result(demo: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((demo / "estimate.json").read_text(encoding="utf-8"))
    return found


def test_every_file_of_the_flow_is_kept(demo: Path) -> None:
    names = {file.name for file in demo.rglob("*") if file.is_file()}
    assert {"tango.yaml", "world.yaml", "plan.csv", "readings.csv", "readings.json", "estimate.json", "controller.jsonl"} <= names
    assert list(demo.glob("program/*.nc"))


def test_readings_came_from_the_program_that_lies_beside_them(demo: Path) -> None:
    origin = json.loads((demo / "readings.json").read_text(encoding="utf-8"))
    programs = "".join(file.read_text(encoding="utf-8") for file in demo.glob("program/*.nc"))
    assert len(origin["segments"]) == 2, "longer than the control's memory"
    assert all(segment["program_hash"] in programs for segment in origin["segments"])


def test_the_true_machine_is_found(demo: Path, result: dict[str, Any]) -> None:
    world = read_world(demo / "world.yaml")
    found = result["parameters"]
    assert result["verdict"] == "trustworthy"
    assert set(found) == set(world.errors)
    for name, parameter in found.items():
        assert abs(parameter["value"] - world.errors[name]) < LIMIT * parameter["std"], name
    assert 0.6 < result["residual"]["std_um"] < 0.8


def test_another_truth_would_not_pass(demo: Path, result: dict[str, Any]) -> None:
    world = read_world(demo / "world.yaml")
    world.errors["EX0C"] += 0.001  # type: ignore[index]
    _, worst = _against(result, world)
    assert worst > LIMIT


def test_a_folder_in_use_is_not_touched(demo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {file: file.stat().st_mtime_ns for file in demo.rglob("*")}
    assert guarded(tango.main, ["demo", "--out", str(demo)], standalone_mode=False) == 2
    assert "already there and not empty" in capsys.readouterr().err
    assert {file: file.stat().st_mtime_ns for file in demo.rglob("*")} == before


def test_each_demo_has_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demo" / "1").mkdir(parents=True)
    monkeypatch.setattr("tango_cnc.commands.init.write_example", lambda folder, example: (_ for _ in ()).throw(SystemExit(folder)))
    with pytest.raises(SystemExit) as stopped:
        guarded(tango.main, ["demo"], standalone_mode=False)
    assert str(stopped.value) == os.path.join("demo", "2")
