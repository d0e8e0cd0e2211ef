"""A real LinuxCNC with a COMP_FILE, and with a compensated program: touches before and after, on the same true machine."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.linuxcnc_compensated_parts import ERRORS, LATE, cell, probed
from support.realcontrol import HERE, ORDER, Control, linuxcnc

from sim_controller.world import nominal_machine, tip_in_table
from tango_cnc.cli import tango
from tango_cnc.compensate.targets import Request, load, options
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.records import Array, Plan

pytestmark = pytest.mark.system("linuxcnc", "rs274")


def files(folder: Path) -> dict[str, str]:
    """Cell → what the target linuxcnc writes for exactly these errors, over the whole travel."""
    machine = read_cell(folder).machine
    module = load("linuxcnc")
    limits = {a.name: a.travel for a in machine.axes if a.travel is not None}
    request = Request(machine, limits, options(module, ["kinematics=trivkins", f"joints={ORDER}", "points=9"]))
    held = module.held(request)
    own = {h.place: h.number(ERRORS.get(f"E{h.axis}{h.axis}1", 0.0) * h.at) for h in held}
    written: dict[str, str] = module.files(request, held, own)
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


PROGRAM_ERRORS = {"EX0C": 0.060, "EY0C": 0.050, "EX0B": -0.045, "EC0Y": 1.5e-4, "EXX1": 2e-4}
STRATEGY = """name: tilted
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 0, C: 0, facets: [top, 3]}
  - {S: 0, B: 40, C: 0, facets: [top]}
  - {S: 0, B: 40, C: 180, facets: [1]}
  - {S: 0, B: -30, C: -90, facets: [3]}
  - {S: 0, B: 30, C: -90, facets: [5]}
"""
TOUCH = re.compile(r"\(TOUCH (\d+)\)")
NEAR = 2.0  # mm from the surface: where the program leads the stylus, and where the search for the facet begins


def erring(folder: Path) -> Path:
    """Folder → the cell that the control has, with the touches above and a true machine that errs in its axes' places too."""
    cell(folder)
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "world.yaml").write_text(f"errors: {json.dumps(PROGRAM_ERRORS)}\n")
    return folder


def measured(folder: Path) -> Path:
    """Folder → the same machine under a table that determines these errors, measured by the simulated control with scatter.

    The stylus runs out by 5 µm: by one that runs true nobody would know that the spindle turned, and no program is moved then.
    """
    shutil.copytree(HERE.parent / "examples" / "hu40t", folder)
    (folder / "world.yaml").write_text(
        f"errors: {json.dumps(PROGRAM_ERRORS)}\nstylus: {{EXt: 0.004, EYt: -0.003}}\nnoise: 0.0007\nseed: 5\n"
    )
    done = CliRunner().invoke(tango, ["simulate", "-C", str(folder)])
    assert done.exit_code == 0, done.output
    return folder


def straight(made: Plan) -> list[tuple[Array, Array]]:
    """Plan → contact and direction of search of every touch, (3,) mm of X Y Z and unit."""
    columns = [made.machine.column(a) for a in "XYZ"]
    contact, begin = (np.array([getattr(t, w) for t in made.touches])[:, columns] for w in ("contact", "standoff"))
    return [(c, (c - b) / np.linalg.norm(c - b)) for c, b in zip(contact, begin, strict=True)]


def part_program(made: Plan) -> str:
    """Plan → lines that lead the stylus 2 mm in front of every facet; nothing in it touches."""
    z = made.machine.column("Z")
    top = max(touch.standoff[z] for touch in made.touches) + 150.0
    lines = ["G21 G90 G94 G54 G17 G40 G49", f"G0 Z{top:.3f}", "G0 X0.000 Y0.000", "F30000"]
    for touch, (contact, way) in zip(made.touches, straight(made), strict=True):
        at = dict(zip(made.machine.names, touch.standoff, strict=True))
        near = contact - NEAR * way
        lines += [
            f"G1 B{np.degrees(at['B']):.4f} C{np.degrees(at['C']):.4f}",
            f"G1 X{at['X']:.4f} Y{at['Y']:.4f}",
            f"G1 Z{at['Z']:.4f}",
            "G1 X{:.4f} Y{:.4f} Z{:.4f}".format(*near),
            f"(TOUCH {touch.number})",
            f"G1 X{at['X']:.4f} Y{at['Y']:.4f} Z{at['Z']:.4f}",
            f"G1 Z{top:.3f}",
        ]
    return "\n".join([*lines, "M2", ""])


def touching(text: str, made: Plan) -> str:
    """Program → the same, and where a comment says so a search straight on; both positions go into the log."""
    ways = {touch.number: way for touch, (_, way) in zip(made.touches, straight(made), strict=True)}

    def search(found: re.Match[str]) -> str:
        return (
            "(LOG,N X#5420 Y#5421 Z#5422)\nG91\nG38.2 X{:.6f} Y{:.6f} Z{:.6f} F180\nG90 F30000\n(LOG,P X#5061 Y#5062 Z#5063)"
        ).format(*(2.5 * NEAR * ways[int(found[1])]))

    return "(LOGOPEN,log.txt)\n" + TOUCH.sub(search, text).replace("\nM2", "\n(LOG,THE END)\n(LOGCLOSE)\nM2")


def tip_error(control: Control, text: str, made: Plan) -> Array:
    """Control, program → (n,) mm that the stylus truly stood too far from every facet, a shift of the workpiece taken out."""
    said, error = control.execute(touching(text, made))
    assert not error, said
    near, met = (np.array([[float(v) for v in re.findall(r"[XYZ](-?[\d.]+)", s)] for s in said if s[0] == w]) for w in "NP")
    assert len(near) == len(met) == len(made.touches), said
    contact, begin = (np.array([getattr(t, w) for t in made.touches]) for w in ("contact", "standoff"))
    nominal = nominal_machine(made.machine)
    way = tip_in_table(nominal, contact, contact * 0) - tip_in_table(nominal, begin, begin * 0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    far = np.linalg.norm(met - near, axis=1) - NEAR
    result: Array = far - way @ np.linalg.lstsq(way, far, rcond=None)[0]  # what a workpiece zero takes up
    return result


@pytest.mark.long
def test_a_compensated_program_leads_the_tip_where_it_was_meant(tmp_path: Path) -> None:
    folder, known = erring(tmp_path / "cell"), measured(tmp_path / "measured")
    made = plan(read_cell(folder))
    source, target = tmp_path / "part.ngc", tmp_path / "out.ngc"
    source.write_text(part_program(made))
    setup = ["--zero", "X=0,Y=0,Z=0", "--tool-length", str(made.machine.probe.length), "--language", "rs274"]
    done = CliRunner().invoke(tango, ["compensate", str(source), "-C", str(known), "-o", str(target), "--simulated", *setup])
    assert done.exit_code == 0, (done.output, done.exception)
    with linuxcnc(folder) as control:
        before, after = (tip_error(control, file.read_text(), made) for file in (source, target))
    size = [float(np.sqrt(np.mean(v**2)) * 1e3) for v in (before, after)]
    gain = f"gain {size[0] / size[1]:.0f}, {len(before)} touches"
    print(f"real LinuxCNC, compensated program: {size[0]:.1f} µm rms before, {size[1]:.2f} µm after, {gain}")
    assert np.abs(before).max() > 5 * LATE
    assert np.abs(after).max() < LATE
