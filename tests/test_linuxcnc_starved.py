"""A real LinuxCNC whose motion gets no time for more than a second, as on a busy computer: the program goes on all the same.

With COMM_TIMEOUT = 1.0, as most configurations have it, the control then ends the program without a word.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.linuxcnc_compensated_parts import cell
from support.realcontrol import Control, linuxcnc

pytestmark = [pytest.mark.campaign, pytest.mark.system("linuxcnc", "rs274")]
BLOCKS = 150
AWAY = 1.6  # s at a time


def motion(control: Control) -> Iterator[int]:
    """Control → its processes in which the servo thread runs."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "comm").read_text() == "rtapi_app\n" and str(control.folder).encode() in (
                process / "environ"
            ).read_bytes():
                yield int(process.name)
        except OSError:
            continue


def test_a_program_goes_on_when_its_motion_has_waited(tmp_path: Path) -> None:
    with linuxcnc(cell(tmp_path / "cell")) as control:
        z = control.position()["Z"]
        moves = [f"G1 Z{z - 0.5 * (i % 2):.3f} F600\nM66 E0 L0\n(LOG,{i})" for i in range(BLOCKS)]
        lines = ["G21 G90 G94 G54 G61", "(LOGOPEN,log.txt)", *moves, "(LOG,THE END)", "(LOGCLOSE)", "M2", ""]
        processes, ended = list(motion(control)), threading.Event()
        assert processes

        def starve() -> None:
            while not ended.wait(0.7):
                for process in processes:
                    os.kill(process, signal.SIGSTOP)
                time.sleep(AWAY)
                for process in processes:
                    os.kill(process, signal.SIGCONT)

        other = threading.Thread(target=starve)
        other.start()
        try:
            said, error = control.execute("\n".join(lines))
        finally:
            ended.set()
            other.join()
    assert not error
    assert len(said) == BLOCKS + 1
