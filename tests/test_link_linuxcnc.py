"""`tango run` over linuxcncrsh of a real LinuxCNC: its planner, its axes, a table in HAL."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from test_linuxcnc_whole import linuxcnc
from test_run import Result

from tango_cnc.files import read_cell, read_readings
from tango_cnc.link.transport import open_port, parse
from tango_cnc.plan import plan
from tango_cnc.records import LinkError

HERE = Path(__file__).parent


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    shutil.copytree(HERE / "golden" / "cell", folder)
    (folder / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, positioning_feed: 20000}\n"
    )
    return folder


def test_both_files_have_to_be_named():
    with pytest.raises(LinkError, match="no file and no log"):
        open_port(parse("linuxcnc://127.0.0.1:5007", {"file": (), "log": ()}))


@pytest.mark.long
@pytest.mark.system("linuxcnc", "linuxcncrsh")
@pytest.mark.xdist_group("linuxcnc")
def test_a_run_over_linuxcncrsh(cell):
    made = plan(read_cell(cell))
    with linuxcnc(made, {}) as control:
        for text in ("set mode mdi", "set mdi G53 G0 Z300"):
            control.say(text, 1.0)
        port = control.line.getpeername()[1]
        control.line.close()
        url = f"linuxcnc://127.0.0.1:{port}?file={control.folder / 'tango.ngc'}&log={control.folder / 'log.txt'}"
        result = Result("run", "-C", cell, "--port", url, "--timeout", "60", "--transcript", cell / "transcript.txt")
        said = (cell / "transcript.txt").read_text()
    assert result.code == 0, result.err + said[-2000:]
    parts = read_cell(cell)
    readings = read_readings(cell / "readings.csv", parts.machine, parts.artefact)
    contacts = np.array([touch.contact for touch in made.touches])
    away = readings.position - contacts
    turned = [axis.kind != "linear" for axis in parts.machine.axes]
    away[:, turned] = np.remainder(away[:, turned] + math.pi, 2 * math.pi) - math.pi
    print(f"\nreal controller minus plan: at most {np.abs(away[:, :3]).max() * 1e3:.1f} µm (servo period, acceleration, HAL)")
    assert set(readings.status) == {"ok"}
    assert np.abs(away[:, :3]).max() < 0.2
