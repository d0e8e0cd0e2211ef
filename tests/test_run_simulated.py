"""`tango run` against the simulated control as a process of its own: a real program, interpreted, on a machine with errors."""

import contextlib
import json
import re
import select
import subprocess
import sys

import numpy as np
import pytest
from test_run import STRATEGY, Result, readings

from tango_cnc.commands.init import write_example


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    return folder


@contextlib.contextmanager
def controller(folder, *options, once=True):
    """A simulated control → its address; it is gone afterwards."""
    command = [
        sys.executable,
        "-m",
        "sim_controller",
        "--cell",
        str(folder),
        "--speed",
        "inf",
        *(["--once"] if once else []),
        *options,
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert select.select([process.stdout], [], [], 20)[0], "the simulated control does not start"
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def simulated(folder):
    """What the true machine gives when nobody has to program it."""
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    return readings(folder, "simulated.csv")


def agree(folder):
    got, expected = readings(folder), simulated(folder)
    order = np.argsort(got.touch)
    assert list(got.touch[order]) == list(expected.touch)
    assert tuple(got.facet[i] for i in order) == expected.facet
    assert set(got.status) == {"ok"}
    # a tenth of a micrometre printed, and the least increment of 1 µm in which the control was told where to go sideways
    assert np.abs(got.position[order] - expected.position)[:, :3].max() < 1.5e-3
    return True


@pytest.mark.parametrize("mode", ["memory", "dnc"])
def test_readings_over_tcp_are_those_of_the_true_machine(cell, mode):
    with controller(cell, "--tcp", "127.0.0.1:0", "--mode", mode) as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "10")
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")
def test_seven_bits_with_parity_over_a_serial_line(cell):
    with controller(cell, "--pty", "--parity") as device:
        result = Result("run", "-C", cell, "--port", f"serial://{device}?bits=7&parity=even&start=xon", "--timeout", "10")
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.long
def test_a_control_that_stops_and_a_run_that_is_resumed(cell):
    with controller(cell, "--tcp", "127.0.0.1:0", "--fault", "stop-after=4") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "1")
    assert result.code == 3
    assert re.search(r"[34] of 7 touches are recorded", result.err)
    with controller(cell, "--tcp", "127.0.0.1:0") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "10", "--resume")
    assert result.code == 0, result.err
    assert agree(cell)
    repeated = json.loads((cell / "readings.json").read_text())["repeated"]
    assert repeated
    assert all(again["moved_mm"] < 1e-3 for again in repeated)


def test_a_probe_that_stays_deflected_stops_the_run_and_nothing_false_is_recorded(cell):
    with controller(cell, "--tcp", "127.0.0.1:0", "--fault", "probe-stuck-after=3") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "1")
    assert result.code == 3
    partial = readings(cell, "readings.partial.csv")
    whole = simulated(cell)
    assert np.abs(partial.position - whole.position[: len(partial)])[partial.ok, :3].max() < 1.5e-3
