"""A real LinuxCNC with matrixkins: touches before and after its nine parameters are corrected, on the same true machine.

Debian's LinuxCNC has no matrixkins. `linuxcnc/matrixkins.c` beside the tests has the equations of its manual page; halcompile
puts it among the modules of the control where it has none of its own.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.linuxcnc_compensated_parts import LATE, cell, probed
from support.realcontrol import HERE, linuxcnc

from sim_controller.simulate import simulate
from tango_cnc.compensate import propose
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.plan import plan
from tango_cnc.records import Array

MODULE = Path("/usr/lib/linuxcnc/modules/matrixkins.so")
INSTALL = "apt install linuxcnc-uspace-dev gcc libc6-dev; halcompile --install tests/linuxcnc/matrixkins.c"
pytestmark = [
    pytest.mark.long,
    pytest.mark.system("linuxcnc", "rs274"),
    pytest.mark.skipif(not MODULE.exists(), reason=f"needs a LinuxCNC with matrixkins ({INSTALL})"),
]
# A tilt of Z would move the tip of a long stylus, too, which under rotary axes is no matter of nine parameters.
ERRORS = {"EXX1": 2.4e-4, "EYY1": -3e-4, "EC0Y": 3e-4}
ARTEFACT = """name: block
facets:
  1: {point: [100, -60, -20], normal: [1, 0, 0]}
  2: {point: [100, 60, -20], normal: [1, 0, 0]}
  3: {point: [100, 0, -90], normal: [1, 0, 0]}
  4: {point: [-100, -60, -20], normal: [-1, 0, 0]}
  5: {point: [-100, 60, -20], normal: [-1, 0, 0]}
  6: {point: [-60, 80, -20], normal: [0, 1, 0]}
  7: {point: [60, 80, -20], normal: [0, 1, 0]}
  8: {point: [0, 80, -90], normal: [0, 1, 0]}
  9: {point: [-60, -80, -20], normal: [0, -1, 0]}
  10: {point: [60, -80, -20], normal: [0, -1, 0]}
  11: {point: [-70, -50, 0], normal: [0, 0, 1]}
  12: {point: [70, -50, 0], normal: [0, 0, 1]}
  13: {point: [0, 60, 0], normal: [0, 0, 1]}
"""
STRATEGY = """name: still
approach: {standoff: 2, search: 2, feed: 90}
indexations:
  - {S: 0, B: 0, C: 0, facets: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]}
"""


def block(folder: Path) -> Path:
    cell(folder)
    (folder / "artefact.yaml").write_text(ARTEFACT)
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "world.yaml").write_text(f"errors: {json.dumps(ERRORS)}\n")
    return folder


def proposed(folder: Path) -> str:
    """Cell → the lines for the .hal file, after a simulated measurement of the strategy of HU40T on the same true machine."""
    here, rich = read_cell(folder), read_cell(HERE.parent / "examples" / "hu40t")
    machine = replace(here.machine, probe=rich.machine.probe)
    readings = simulate(machine, rich.artefact, rich.strategy, read_world(folder / "world.yaml"))
    found = estimate(machine, rich.artefact, readings, rich.terms)
    text: str = propose(found, "linuxcnc", ["kinematics=matrixkins", "comp=no"]).files["compensation.hal"]
    return text


def by_matrix(place: Path, lines: str = "") -> None:
    """The configuration: this module has A B C as joints 4 5 6, all of which stand still. The table sees where the motors go."""
    ini, hal = place / "machine.ini", place / "machine.hal"
    text = ini.read_text().replace("trivkins coordinates=XYZBC", "matrixkins").replace("JOINTS = 5", "JOINTS = 6")
    ini.write_text(f"{text}[JOINT_5]{text.split('[JOINT_4]')[1]}")
    hal.write_text(f"{hal.read_text()}net fbA joint.5.motor-pos-cmd => joint.5.motor-pos-fb\n{lines}")


def touched(folder: Path, lines: str = "") -> Array:
    with linuxcnc(folder, change=lambda place: by_matrix(place, lines)) as control:
        return away(folder, probed(control, folder))


def away(folder: Path, found: Array) -> Array:
    """Cell, (n, 3) → (n,) mm from the nominal contacts along the approach; how the workpiece lies is taken out."""
    made = plan(read_cell(folder))
    columns = [made.machine.column(a) for a in "XYZ"]
    want = np.array([touch.contact for touch in made.touches])[:, columns]
    way = want - np.array([touch.standoff for touch in made.touches])[:, columns]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    far = np.sum((found - want) * way, axis=1)
    lies = np.hstack([way, np.cross(want, way)])
    result: Array = far - lies @ np.linalg.lstsq(lies, far, rcond=None)[0]
    return result


def test_corrected_parameters_take_the_error_away(tmp_path: Path) -> None:
    folder = block(tmp_path / "cell")
    lines = proposed(folder)
    before, after = touched(folder), touched(folder, lines)
    size = [float(np.sqrt(np.mean(v**2)) * 1e3) for v in (before, after)]
    print(f"real LinuxCNC, matrixkins: {size[0]:.1f} µm rms before, {size[1]:.2f} µm after, {len(before)} touches")
    assert np.abs(before).max() > 4 * LATE
    assert np.abs(after).max() < LATE
