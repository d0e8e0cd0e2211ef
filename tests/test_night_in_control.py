"""After a kept compensation a night judges what parts have, not what probing without tool center point control measures."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.commands import run
from support.compensated import ROOT, example, first, measured
from support.nights_parts import as_of, nights_of

from sim_controller.compensation import read
from sim_controller.simulate import simulate
from sim_controller.world import Control, nominal_machine, tip_in_table, true_machine
from tango_cnc.compensate import loop, propose
from tango_cnc.compensate.space import Poses
from tango_cnc.files import read_cell
from tango_cnc.files.nightly import Nightly
from tango_cnc.history import opened
from tango_cnc.iso230.poses import at_poses
from tango_cnc.nightly.ports import Measured
from tango_cnc.plan import plan
from tango_cnc.records import Cell, World
from tango_cnc.report.compensated import held
from tango_cnc.report.faults import faults
from tango_cnc.report.texts import texts
from tango_cnc.report.units import Units
from tango_cnc.state.volume import LEVELS
from tango_cnc.verify.volume import grid, set_up, setup_lever

NOW, LATER = "2026-01-01T00:00:00Z", "2026-02-01T00:00:00Z"

DECIDES = {"undecided": "--measured 1 --tcp", "not as promised": "--measured 1", "no help": "load its undo/"}


def worst(cell: Cell, world: World, control: Control | None) -> float:
    """→ µm, largest error of the true machine at the corners of what is touched, set-up taken out."""
    touches = first("trunnion").model.touches
    position = grid(cell.machine, touches, LEVELS, "probed")
    still = np.zeros_like(position)
    true = true_machine(cell.machine, replace(world, stylus={}), control)
    error = tip_in_table(true, position, still) - tip_in_table(nominal_machine(cell.machine), position, still)
    poses = Poses(at_poses(cell.machine, position, still))
    free = set_up(error[:, :, None], setup_lever(poses.touches, poses.nominal), np.ones(len(poses), dtype=np.bool_))
    return float(np.linalg.norm(free[:, :, 0], axis=1).max() * 1e3)


@pytest.mark.long
def test_a_night_is_judged_with_what_the_control_holds(tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", folder)
    cell, world = read_cell(folder), example("trunnion")[1]
    proposal = propose(measured(cell, world, seed=5), "fanuc", ["tables=no"])
    kept = loop.store(folder, proposal, NOW)
    readings, settings, made = (
        simulate(cell.machine, cell.artefact, cell.strategy, world, seed=6),
        Nightly(limits={"volume": 30.0}),
        plan(cell),
    )

    def night() -> dict[str, Any]:
        with opened("sqlite://") as history:
            return nights_of(cell, settings, made, deep=False).analysed(
                history, 1.0, "full", Measured(readings, None, len(readings), 60.0)
            )[0]

    bare = night()
    loop.note(folder, kept, NOW, "written")
    written = night()
    assert written["verdict"] == bare["verdict"] == "out_of_limits"  # nobody has measured yet whether it acts
    assert "tango compensate' writes" in bare["behind"][0]["do"] and "Enter nothing again" in written["behind"][0]["do"]
    for event in ("undecided", "not as promised", "no help"):  # a measurement that did not show that it acts
        loop.note(folder, kept, LATER, event, tcp=False)
        unsure = night()
        assert unsure["limits"] == bare["limits"] and unsure["in_control"]["event"] == event
        assert "measured with it was " + event in unsure["behind"][0]["do"]
        assert DECIDES[event] in unsure["behind"][0]["do"] and DECIDES[event] in held(unsure, texts())
    loop.note(folder, kept, LATER, "kept", tcp=True)
    assert night()["limits"] == bare["limits"]  # where probing sees it, nothing is taken off
    loop.note(folder, kept, LATER, "kept", tcp=False)
    own = night()
    assert own["verdict"] == "good" and "behind" not in own and own["in_control"]["target"] == "fanuc"
    true = worst(cell, world, read(kept.folder, cell.machine))
    print(bare["volume"], own["volume"], true)
    assert own["limits"][0]["low"] < true < own["limits"][0]["high"]
    for name, value in own["parameters"].items():  # the trend goes on as it was measured
        assert value["value"] == bare["parameters"][name]["value"]
    assert abs(own["parameters"]["EY0C"]["value"] - own["parameters"]["EY0C"]["in_control"]) < 0.002
    # A night before it was written, estimated again today, is judged by what the control held then.
    today = nights_of(cell, settings, made, deep=False)
    for moment, holds in ((NOW, None), ("2026-01-15T00:00:00Z", "written"), ("2026-03-01T00:00:00Z", "kept")):
        control = as_of(today, moment).control
        assert (control and control.event) == holds, moment
    assert as_of(today, NOW).given == () and as_of(today, LATER).given == today.given
    # A change of 20 µm after that: the whole error of parts is the change, and the page does not ask for what is there already.
    moved = {**own["parameters"]["EY0C"]}
    moved["value"] += 0.020
    alarm = {"id": "2026-02-02-1", "parameter": "EY0C", "cause": "axis_location", "size": 0.020, "std": 5e-4, "unit": "mm"}
    alarm |= {"text": "EY0C has moved", "since": "2026-02-01", "on_part_um": 20.0}
    record = {**own, "verdict": "changed", "kind": "full", "parameters": {"EY0C": moved}, "alarms": [alarm]}
    (fault,) = faults(record, (), {}, Units(), texts())
    assert "is +20 µm; it was" in fault["whole"] and "in the control" in fault["whole"], fault["whole"]
    second = loop.store(folder, proposal, LATER)  # on top of it: until it is kept, what the first was proven to take away is off
    for event in ("written", "undecided"):
        loop.note(folder, second, LATER, event)
        both = night()
        there = both["in_control"]
        assert both["limits"] == own["limits"] and (there["number"], there["event"], there["beneath"]) == (2, event, 1)
        said = held(both, texts())
        assert "Compensation 2 (fanuc)" in said and "Enter nothing again" in said and "What compensation 1 takes away" in said
        (fault,) = faults(record | {"in_control": there}, (), {}, Units(), texts())
        assert "nobody knows" in fault["whole"] and "20" not in fault["whole"] and "Correct" not in fault["whole"]
    loop.note(folder, second, LATER, "no help")  # a wrong sign, perhaps: then not even the first one acts
    assert night()["verdict"] == "out_of_limits" and night()["in_control"]["number"] == 2
    loop.note(folder, second, LATER, "rolled back", text="spindle")
    loop.note(folder, kept, LATER, "rolled back", text="spindle")
    assert night()["verdict"] == "out_of_limits"


@pytest.mark.long
def test_a_report_of_older_readings_asks_for_new_ones(tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    shutil.copytree(ROOT / "examples" / "trunnion", folder)
    assert run("simulate", "-C", folder).exit_code == 0
    assert run("compensate", "-C", folder, "--target", "fanuc", "--set", "tables=no", "--simulated").exit_code == 0
    for noted, said in ((False, "Have the largest errors compensated"), (True, "older than compensation 1")):
        if noted:
            assert run("compensate", "-C", folder, "--written", 1).exit_code == 0
        run("report", "-C", folder, "--limit-um", 20, "--no-pictures", "--no-diagnosis")
        assert said in (folder / "report.html").read_text(encoding="utf-8")
