"""`tango run` against the simulated control as a process of its own: a real program, interpreted, on a machine with errors."""

import json
import re
import sys

import numpy as np
import pytest
import yaml
from support.runs import Result, readings
from support.simulated_runs import (
    agree,
    cell,  # noqa: F401  fixtures
    controller,
    simulated,
)


@pytest.mark.few(0)
@pytest.mark.parametrize(("mode", "alarm"), [("memory", "tidy"), ("dnc", "at once")])
def test_readings_over_tcp_are_those_of_the_true_machine(cell, mode, alarm):
    """A program that is drip-fed cannot jump to where an alarm leaves things in order."""
    described = yaml.safe_load((cell / "tango.yaml").read_text())
    described["controller"]["alarm"] = alarm
    (cell / "tango.yaml").write_text(yaml.safe_dump(described))
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


@pytest.mark.long
def test_a_probe_that_stays_deflected_stops_the_run_and_nothing_false_is_recorded(cell):
    with controller(cell, "--tcp", "127.0.0.1:0", "--fault", "probe-stuck-after=3") as url:
        result = Result("run", "-C", cell, "--port", url, "--timeout", "1")
    assert result.code == 3
    partial = readings(cell, "readings.partial.csv")
    whole = simulated(cell)
    assert np.abs(partial.position - whole.position[: len(partial)])[partial.ok, :3].max() < 1.5e-3
