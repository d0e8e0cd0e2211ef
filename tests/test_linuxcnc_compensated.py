"""A real LinuxCNC with a COMP_FILE: the second run of the probing cycle, on axes that the control itself corrects."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.realcontrol import HERE, ORDER, Control, linuxcnc

from tango_cnc.compensate.targets import Job, load, options
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.records import Array

pytestmark = pytest.mark.system("linuxcnc", "rs274")
ERRORS = {"EXX1": 3e-4, "EYY1": -4e-4, "EZZ1": 2e-4}  # 30 µm and more on the way to this table: what a touch may be late by is 3
LATE = 0.004  # mm


def cell(folder: Path) -> Path:
    shutil.copytree(HERE / "golden" / "cell", folder)
    (folder / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, gate: none, positioning_feed: 30000}\n"
    )
    (folder / "world.yaml").write_text(f"errors: {json.dumps(ERRORS)}\n")
    return folder


def files(folder: Path) -> dict[str, str]:
    """Cell → what the target linuxcnc writes for exactly these errors, over the whole travel."""
    machine = read_cell(folder).machine
    module = load("linuxcnc")
    limits = {a.name: a.travel for a in machine.axes if a.travel is not None}
    job = Job(machine, limits, options(module, ["kinematics=trivkins", f"joints={ORDER}", "points=9"]))
    held = module.held(job)
    own = {h.place: h.number(ERRORS.get(f"E{h.axis}{h.axis}1", 0.0) * h.at) for h in held}
    written: dict[str, str] = module.files(job, held, own)
    return written


def given(texts: dict[str, str], folder: Path) -> None:
    """The files as the steps say: .comp beside the .ini, its lines into their sections. Axes then stand where the motors are."""
    for name, text in texts.items():
        if name.endswith(".comp"):
            (folder / name).write_text(text)
    ini = (folder / "machine.ini").read_text()
    for section, body in re.findall(r"(\[JOINT_\d\])\n(.*?)(?=\n\[|\Z)", texts["compensation.ini"], re.DOTALL):
        ini = ini.replace(section, f"{section}\n{body.strip()}")
    (folder / "machine.ini").write_text(ini)


def by_motors(folder: Path) -> None:
    """The table sees where the motors go: the commanded position and what the control adds to it."""
    hal = (folder / "machine.hal").read_text()
    names = ",".join(f"motor.{letter}" for letter in ORDER)
    hal = hal.replace("loadrt sum2 names=", f"loadrt sum2 names={names},")
    hal = hal.replace(
        "addf plane.xy servo-thread", "".join(f"addf motor.{a} servo-thread\n" for a in ORDER) + "addf plane.xy servo-thread"
    )
    for i, letter in enumerate(ORDER):
        hal = hal.replace(f"net {letter} joint.{i}.pos-cmd =>", f"net {letter} motor.{letter}.out =>")
        hal += (
            f"net c{letter} joint.{i}.pos-cmd => motor.{letter}.in0\nnet b{letter} joint.{i}.backlash-filt => motor.{letter}.in1\n"
        )
    (folder / "machine.hal").write_text(hal)


def probed(control: Control, folder: Path) -> Array:
    """Control, cell → (n, 3) mm: X Y Z that the control tells of every contact."""
    lines, error = control.run(folder)
    assert not error
    rows = [{w[0]: float(w[1:]) for w in re.findall(r"[XYZ]-?[\d.]+", line)} for line in lines if re.match(r"P\d+ H1", line)]
    return np.array([[row[a] for a in "XYZ"] for row in rows])


def away(folder: Path, found: Array) -> Array:
    """Cell, (n, 3) → (n,) mm from the nominal contacts along the approach: what a perfect machine would tell is 0."""
    made = plan(read_cell(folder))
    columns = [made.machine.column(a) for a in "XYZ"]
    want = np.array([touch.contact for touch in made.touches])[:, columns]
    way = want - np.array([touch.standoff for touch in made.touches])[:, columns]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    result: Array = np.sum((found - want) * way, axis=1)
    return result


@pytest.mark.long
def test_a_comp_file_takes_the_error_away(tmp_path: Path) -> None:
    folder = cell(tmp_path / "cell")
    with linuxcnc(folder, change=by_motors) as control:
        before = away(folder, probed(control, folder))

    def both(place: Path) -> None:
        by_motors(place)
        given(files(folder), place)

    with linuxcnc(folder, change=both) as control:
        after = away(folder, probed(control, folder))
    size = [float(np.sqrt(np.mean(v**2)) * 1e3) for v in (before, after)]
    print(f"real LinuxCNC, COMP_FILE: {size[0]:.1f} µm rms before, {size[1]:.2f} µm after")
    assert np.abs(before).max() > 5 * LATE
    assert np.abs(after).max() < LATE
