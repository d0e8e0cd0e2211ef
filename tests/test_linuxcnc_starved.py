"""A real LinuxCNC whose motion, or whose simulated table, gets no time, as on a busy computer: the program goes on all the same.

With COMM_TIMEOUT = 1.0, as most configurations have it, the control ends the program without a word when its motion waits.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from support.linuxcnc_compensated_parts import cell
from support.realcontrol import LOCKSTEP, PERIOD, Control, linuxcnc

from tango_cnc.files import read_cell
from tango_cnc.plan import plan

pytestmark = [pytest.mark.campaign, pytest.mark.system("linuxcnc", "rs274")]
GOLDEN = Path(__file__).parent / "golden" / "cell"
BLOCKS = 150
AWAY = 1.6  # s at a time


def processes(control: Control, told: bytes) -> Iterator[int]:
    """Control, what their command has → the processes that belong to it."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if told in (process / "cmdline").read_bytes() and str(control.folder).encode() in (process / "environ").read_bytes():
                yield int(process.name)
        except OSError:
            continue


@contextmanager
def starving(control: Control, told: bytes, runs: float, waits: float) -> Iterator[None]:
    """Control, what the command of a process has, s → in turn it runs and waits for so long."""
    found, ended = list(processes(control, told)), threading.Event()
    assert found

    def starve() -> None:
        while not ended.wait(runs):
            for process in found:
                os.kill(process, signal.SIGSTOP)
            time.sleep(waits)
            for process in found:
                os.kill(process, signal.SIGCONT)

    other = threading.Thread(target=starve)
    other.start()
    try:
        yield
    finally:
        ended.set()
        other.join()


def test_a_program_goes_on_when_its_motion_has_waited(tmp_path: Path) -> None:
    with linuxcnc(cell(tmp_path / "cell")) as control:
        z = control.position()["Z"]
        moves = [f"G1 Z{z - 0.5 * (i % 2):.3f} F600\nM66 E0 L0\n(LOG,{i})" for i in range(BLOCKS)]
        lines = ["G21 G90 G94 G54 G61", "(LOGOPEN,log.txt)", *moves, "(LOG,THE END)", "(LOGCLOSE)", "M2", ""]
        with starving(control, b"rtapi_app", 0.7, AWAY):
            said, error = control.execute("\n".join(lines))
    assert not error
    assert len(said) == BLOCKS + 1


@pytest.mark.skipif(not LOCKSTEP.exists(), reason="needs halcompile --install tests/linuxcnc/lockstep.comp")
@pytest.mark.parametrize("waiting", [b"rtapi_app", b"table.py", b"contact.py"])
def test_a_table_that_waits_is_touched_where_it_is(tmp_path: Path, waiting: bytes) -> None:
    """Time waits for the table. It reports no false contact and misses no true one; each comes at the next period after it."""
    folder = tmp_path / "cell"
    shutil.copytree(GOLDEN, folder)
    (folder / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, gate: none, positioning_feed: 24000}\n"
    )
    (folder / "world.yaml").write_text("facets: {}\n")
    with linuxcnc(folder) as control, starving(control, waiting, 0.2, 0.2):
        lines, error = control.run(folder)
        contacts = control.contacts()
    cell = read_cell(folder)
    assert not error and [line.split()[1] for line in lines[1:-1]] == ["H1"] * len(plan(cell).touches)
    found = [[float(value) for value in re.findall(r" [XYZ](-?[\d.]+)", line)] for line in lines[1:-1]]
    late = np.linalg.norm(np.array(found) - [contact["at"][:3] for contact in contacts], axis=1)  # type: ignore[index]
    assert late.max() < 1.01 * cell.strategy.approach.feed / 60 * PERIOD
