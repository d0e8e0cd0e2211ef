"""The loop walked on every target: proposed, written, measured again, kept, taken out; and one that was never loaded."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from support.closing import SETTINGS
from support.commands import run
from support.compensated import ROOT

from tango_cnc.compensate import loop, targets
from tango_cnc.loaded import HELPS

WALKED = [*((name, "trunnion") for name in targets.names()), *((name, "three_axis_calibrated") for name in ("linuxcnc", "fanuc"))]


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Example → a cell of it that was measured twice before anything was compensated."""
    cells = {}
    for name in sorted({name for _, name in WALKED}):
        cells[name] = tmp_path_factory.mktemp("cells") / name
        shutil.copytree(ROOT / "examples" / name, cells[name])
        assert run("simulate", "-C", cells[name]).exit_code == 0
        assert run("simulate", "-C", cells[name], "-o", cells[name] / "once more.csv", "--seed", 57).exit_code == 0
        (cells[name] / "once more.origin.json").unlink()  # by the clock they were made before any proposal
    return cells


def judged(cell: Path, number: int, readings: Path) -> dict[str, object]:
    """Cell, number, readings → the outcome of the second measurement."""
    target = loop.one(cell, number).record["target"]
    asked = run("compensate", "-C", cell, "--measured", number, "--readings", readings, "--json", "-")
    if asked.exception is not None and "--tcp" in str(asked.exception):
        asked = run("compensate", "-C", cell, "--measured", number, "--readings", readings, "--json", "-", "--tcp")
    assert asked.exception is None or isinstance(asked.exception, SystemExit), (target, asked.exception)
    return dict(json.loads(asked.stdout))


@pytest.mark.long
@pytest.mark.parametrize(("target", "name"), WALKED, ids=lambda v: str(v))
def test_the_loop_is_walked(measured: dict[str, Path], target: str, name: str, tmp_path: Path) -> None:
    cell = tmp_path / name
    shutil.copytree(measured[name], cell)
    proposed = ["compensate", "-C", cell, "--target", target, "--present", "none", "--simulated"]
    for setting in SETTINGS.get(target, ()):
        proposed += ["--set", setting]
    for number in (1, 2):
        done = run(*proposed)
        assert done.exit_code == 0, done.exception
        folder = loop.one(cell, number).folder
        assert run("compensate", "--check", folder).exit_code == 0
        assert run("compensate", "-C", cell, "--written", number).exit_code == 0
        if number == 1:
            done = run("simulate", "-C", cell, "--compensation", folder, "-o", cell / "after.csv", "--seed", 99)
            assert done.exit_code == 0, done.exception
            found = judged(cell, 1, cell / "after.csv")
            print(f"{name:22s} {target:12s}", found)
            assert run("compensate", "-C", cell, "--rolled-back", 1, "--reason", "spindle changed").exit_code == 0
            assert found["verdict"] in HELPS
            first = found["verdict"]
        else:  # its files never came into the control
            found = judged(cell, 2, cell / "once more.csv")
            print(f"{name:22s} {target:12s}", found)
            assert found["verdict"] == "no help"
    events = [(e["compensation"], e["event"]) for e in loop.history(cell)]
    assert events == [(1, "proposed"), (1, "written"), (1, first), (1, "rolled back"), (2, "proposed"), (2, "written"),
                      (2, "no help")]  # fmt: skip
    listed = json.loads(run("history", "list", "-C", cell, "--json", "-").stdout)["compensations"]
    assert [(e["number"], e["event"]) for e in reversed(listed)] == events


@pytest.mark.long
def test_a_file_that_was_forgotten_is_not_as_promised(measured: dict[str, Path], tmp_path: Path) -> None:
    """Everything is loaded but the CEC tables: what they hold is left, and that is more than was promised."""
    cell = tmp_path / "trunnion"
    shutil.copytree(measured["trunnion"], cell)
    assert run("compensate", "-C", cell, "--target", "siemens", "--simulated").exit_code == 0
    assert run("compensate", "-C", cell, "--written", 1).exit_code == 0
    folder, loaded = loop.one(cell, 1).folder, tmp_path / "loaded"
    shutil.copytree(folder, loaded)
    shutil.copy(folder / "undo" / "cec.ini", loaded / "cec.ini")
    done = run("simulate", "-C", cell, "--compensation", loaded, "-o", cell / "after.csv", "--seed", 99)
    assert done.exit_code == 0, done.exception
    found = judged(cell, 1, cell / "after.csv")
    print(found)
    assert found["verdict"] == "not as promised"
    assert loop.state(cell, 1) == "not as promised"
