"""A real LinuxCNC with trt-kins: touches with tool centre point control on, before and after its centers are corrected."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.realcontrol import HERE, Control, joints, linuxcnc

from sim_controller.simulate import simulate
from sim_controller.world import nominal_machine, tip_in_table
from tango_cnc.compensate import propose
from tango_cnc.estimate import estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.plan import plan
from tango_cnc.records import Array, Plan

pytestmark = pytest.mark.system("linuxcnc", "rs274")
# The height of the cradle is one with the length of the stylus.
ERRORS = {"B": {"EX0C": 0.060, "EX0B": -0.045, "EY0C": 0.050}, "A": {"EX0C": 0.110, "EY0A": -0.080, "EY0C": 0.090}}
RICH = {"B": "hu40t", "A": "trunnion"}  # the example whose touches the centers are estimated from
LATE = 0.004  # mm: what a contact is told late, as LinuxCNC samples its probe
STRATEGY = {
    "B": """name: tilted
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 0, C: 0, facets: [top]}
  - {S: 0, B: 40, C: 0, facets: [top, 4]}
  - {S: 0, B: 40, C: 180, facets: [top, 1]}
  - {S: 0, B: -30, C: -90, facets: [3]}
  - {S: 0, B: 30, C: -90, facets: [5]}
""",
    "A": """name: tilted
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, A: 0, C: 0, facets: [top]}
  - {S: 0, A: 40, C: 0, facets: [top, 3]}
  - {S: 0, A: 40, C: 180, facets: [top, 5]}
  - {S: 0, A: -30, C: -90, facets: [1]}
  - {S: 0, A: 30, C: -90, facets: [4]}
""",
}


def module(cradle: str) -> str:
    return f"xyz{cradle.lower()}c-trt-kins"


def cell(folder: Path, cradle: str) -> Path:
    """Folder, A or B → a machine whose table moves as the module has it, and errors of its centers alone."""
    folder.mkdir()
    for file in (HERE / "golden" / "cell").iterdir():
        text = file.read_text()
        if file.name == "machine.yaml":
            text = text.replace("X: {kind: linear, direction: [1, 0, 0]", "X: {kind: linear, direction: [-1, 0, 0]")
            if cradle == "A":
                text = text.replace("wCBX", "wCAX").replace(
                    "B: {kind: rotary, direction: [0, 1, 0]", "A: {kind: rotary, direction: [1, 0, 0]"
                )
        (folder / file.name).write_text(text)
    (folder / "strategy.yaml").write_text(STRATEGY[cradle])
    (folder / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, gate: none, positioning_feed: 24000}\n"
    )
    (folder / "world.yaml").write_text(f"errors: {json.dumps(ERRORS[cradle])}\n")
    return folder


def proposed(folder: Path, cradle: str) -> str:
    """Cell → the lines for the .hal file that `tango compensate` writes after a simulated measurement of an example's strategy."""
    here, rich = read_cell(folder), read_cell(HERE.parent / "examples" / RICH[cradle])
    machine, world = replace(here.machine, probe=rich.machine.probe), read_world(folder / "world.yaml")
    settings = (f"kinematics={module(cradle)}", f"joints={joints(machine)}", "comp=no")
    readings = simulate(machine, rich.artefact, rich.strategy, world)
    text: str = propose(estimate(machine, rich.artefact, readings, rich.terms), "linuxcnc", settings).files["compensation.hal"]
    return text


def with_module(place: Path, cradle: str, length: float, lines: str = "") -> None:
    """The configuration of the control: this module, its pins, and M68 E3 to switch between it and the bare axes."""
    ini, hal = place / "machine.ini", place / "machine.hal"
    text = ini.read_text().replace("trivkins coordinates=", f"{module(cradle)} coordinates=")
    ini.write_text(text.replace(f"coordinates=XYZ{cradle}C", f"coordinates=XYZ{cradle}C sparm=identityfirst"))
    hal.write_text(
        hal.read_text()
        + f"net kind motion.analog-out-03 => motion.switchkins-type\nsetp {module(cradle)}.tool-offset {length}\n{lines}"
    )


def words(made: Plan, positions: Array) -> Array:
    """Plan, (n, k) positions of the axes → (n, 3) words with tool centre point control: tip in the table, and tool length."""
    tip = tip_in_table(nominal_machine(made.machine), positions, np.zeros_like(positions))
    return np.asarray(tip + np.array([0.0, 0.0, made.machine.probe.length]))


def program(made: Plan, top: float) -> str:
    """Plan, where Z is drawn off → turns with bare axes, touches with tool centre point control."""
    lines = ["G21 G90 G94 G54 G17 G40 G49 G64", "(LOGOPEN,log.txt)", "F30000"]
    begin, end = (words(made, np.array([getattr(t, w) for t in made.touches])) for w in ("standoff", "contact"))
    for touch, a, b in zip(made.touches, begin, end, strict=True):
        at = dict(zip(made.machine.names, touch.standoff, strict=True))
        turn = " ".join(f"{n}{np.degrees(at[n]):.6f}" for n in joints(made.machine)[3:])
        deeper = b + 2.0 * (b - a) / np.linalg.norm(b - a)
        begun = b + 0.4 * (a - b)  # mm of search cost most of the time
        lines += [
            "M68 E3 Q0",
            "M66 E0 L0",
            f"G1 Z{top:.3f} F30000",
            f"G1 {turn}",
            f"G1 X{at['X']:.6f} Y{at['Y']:.6f}",
            f"G1 Z{at['Z'] + 10:.6f}",
            "M68 E3 Q1",
            "M66 E0 L0",
            "G1 X{:.6f} Y{:.6f} Z{:.6f}".format(*begun),
            "G38.2 X{:.6f} Y{:.6f} Z{:.6f} F180".format(*deeper),
            "(LOG,X#5061 Y#5062 Z#5063)",
            "G1 X{:.6f} Y{:.6f} Z{:.6f} F30000".format(*a),
        ]
    return "\n".join([*lines, "M68 E3 Q0", "M66 E0 L0", f"G1 Z{top:.3f}", "(LOG,THE END)", "(LOGCLOSE)", "M2", ""])


def away(control: Control, made: Plan) -> Array:
    """Control → (n,) mm from the nominal contacts along the approach, as the control tells them; a shift of the table taken out."""
    z = made.machine.column("Z")
    top = max(touch.standoff[z] for touch in made.touches) + 150.0  # mm: nothing of this table comes so high
    said, error = control.execute(program(made, top))
    assert not error, (error, said[-2:], control.contacts()[-2:])
    found = np.array([[float(v) for v in re.findall(r"[XYZ](-?[\d.]+)", line)] for line in said if line.startswith("X")])
    assert len(found) == len(made.touches), said
    begin, end = (words(made, np.array([getattr(t, w) for t in made.touches])) for w in ("standoff", "contact"))
    way = (end - begin) / np.linalg.norm(end - begin, axis=1, keepdims=True)
    far = np.sum((found - end) * way, axis=1)
    result: Array = far - way @ np.linalg.lstsq(way, far, rcond=None)[0]  # what a workpiece zero takes up
    return result


@pytest.mark.long
@pytest.mark.parametrize("cradle", ["A", "B"])
def test_corrected_centers_take_the_error_away(cradle: str, tmp_path: Path) -> None:
    folder = cell(tmp_path / "cell", cradle)
    made, lines = plan(read_cell(folder)), proposed(folder, cradle)
    length = made.machine.probe.length
    with linuxcnc(folder, change=lambda place: with_module(place, cradle, length)) as control:
        before = away(control, made)
    with linuxcnc(folder, change=lambda place: with_module(place, cradle, length, lines)) as control:
        after = away(control, made)
    size = [float(np.sqrt(np.mean(v**2)) * 1e3) for v in (before, after)]
    print(f"real LinuxCNC, {module(cradle)}: {size[0]:.1f} µm rms before, {size[1]:.2f} µm after, {len(before)} touches")
    assert np.abs(before).max() > 5 * LATE
    assert np.abs(after).max() < LATE
