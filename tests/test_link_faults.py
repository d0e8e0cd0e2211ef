"""Every fault that `python -m sim_controller` has, over a real TCP connection or pseudo-terminal: what the person is told, and that
everything recorded truly happened."""

import json
import sys

import numpy as np
import pytest
from support.killed import controller
from support.runs import Result, readings
from support.simulated_runs import agree, cell  # noqa: F401  a fixture

from sim_controller.faults import KINDS, LINE_KINDS

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="fork and pseudo-terminals are POSIX")

SAID = {
    "stop-after": "has not done command",
    "probe-stuck-after": "the probe signal is on although nothing is measured",
    "alarm-after": "it is in alarm",
    "door-after": "its door is open",
    "estop-after": "emergency stop",
    "battery-low-after": "the battery of the probe is low",
    "reset-after": "it is in alarm",
    "bounce-after": "1 early",
}
# protocol, where, chance for every byte: so high that it happens, and not so high that nothing gets through
LINES = {
    "drop": ("grbl", "--tcp", 3e-4),
    "flip": ("grbl", "--tcp", 3e-4),
    "double": ("grbl", "--tcp", 3e-4),
    "delay": ("grbl", "--tcp", 3e-4),
    "late": ("modbus", "--pty", 5e-4),  # the answer to a request that has been given up
    "split": ("modbus", "--pty", 2e-3),
    "merge": ("grbl", "--tcp", 3e-4),
    "other": ("grbl", "--tcp", 3e-4),
}


def ran(folder, *options, protocol="modbus", where="--tcp", url="{}", resume=False, patience=2):
    """→ what `tango run` made of it, and what truly happened"""
    line = [where, "127.0.0.1:0"] if where == "--tcp" else [where]
    with controller(folder, "--protocol", protocol, *line, "--ledger", str(folder / "ledger"), *options) as address:
        port = url.format(address) + ("?orient=m19" if protocol == "grbl" else "")
        result = Result("run", "-C", folder, "--port", port, "--timeout", patience, *(["--resume"] if resume else []))
    return result, [json.loads(line) for line in (folder / "ledger").read_text().splitlines()]


def happened(folder, events, name="readings.csv"):
    """→ how many readings there are, each of them a contact of the ledger; nothing was asked for from an unsafe state."""
    assert not [event for event in events if event["event"] in ("unsafe", "collision")]
    got = readings(folder, name)
    contacts = np.array([list(event["at"].values()) for event in events if event["event"] == "contact"])
    for position in got.position[got.ok]:
        assert np.abs(contacts[:, :3] - position[:3]).max(axis=1).min() < 1e-3
    return len(got.touch)


@pytest.mark.long
@pytest.mark.parametrize("name", KINDS)
def test_a_fault_of_the_machine(cell, name):
    result, events = ran(cell, "--fault", f"{name}=4", patience=10 if name == "bounce-after" else 1)  # that one comes to its end
    assert SAID[name] in result.err + result.out
    if name == "bounce-after":  # a row that no estimate uses
        assert (result.code, happened(cell, events)) == (0, 7)
        return
    assert (result.code, happened(cell, events, "readings.partial.csv")) == (3, 4 if name == "probe-stuck-after" else 3)
    result, events = ran(cell, resume=True)
    assert result.code == 0, result.err
    assert agree(cell)


@pytest.mark.long
@pytest.mark.parametrize("kind", LINE_KINDS)
def test_a_fault_of_the_line(cell, kind):
    protocol, where, chance = LINES[kind]
    options = ["--line-fault", f"{kind}={chance}", "--line-seed", "4"]
    result, events = ran(cell, *options, protocol=protocol, where=where, patience=4)
    assert kind in {event["kind"] for event in events if event["event"] == "line fault"}
    if result.code == 3:
        if (cell / "readings.partial.csv").exists():
            happened(cell, events, "readings.partial.csv")
        started = (cell / "readings.journal").exists()
        result, events = ran(cell, protocol=protocol, where=where, resume=started)
    assert result.code == 0, result.err
    assert agree(cell)


SEVEN = "serial://{}?bits=7&parity=even&tv=even"


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "url", "alarm"),
    [
        (["--line-fault", "flip=3e-4"], SEVEN, "TH ALARM"),
        (["--line-fault", "drop=1e-4"], SEVEN, "TV ALARM"),
        ([], SEVEN.replace("&tv=even", ""), "TV ALARM"),  # the blocks were not given an even number of characters
        ([], SEVEN, None),
    ],
)
def test_the_reader_of_the_tape_stops_at_wrong_parity_and_at_a_wrong_number(cell, options, url, alarm):
    """A control that has stopped says nothing: the person is told how much has gone out, and nothing has moved."""
    result, events = ran(
        cell, "--parity", "--tv-check", *options, protocol="dnc", where="--pty", url=url, patience=1 if alarm else 10
    )
    assert [event["text"] for event in events if event["event"] == "alarm"] == ([alarm] if alarm else [])
    if alarm is None:
        assert result.code == 0, result.err
        assert agree(cell)
    else:
        assert (result.code, "0 of 7 touches are recorded" in result.err) == (3, True), result.err
        assert not any(event["event"] in ("rapid", "feed", "skip") for event in events)
