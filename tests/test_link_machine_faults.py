"""Every fault of the machine over every protocol: what is told, that the records truly happened, that the rest can be made.

The fault comes behind the third touch of seven. A one-way control says nothing: its silence is what is told.
"""

import random

import pytest
from support.linkfaults import Bus, Cable, Ledger, Tape, Turns, judged, patched, post, resident, scene
from support.linkparts import FakeClock

from sim_controller.faults import WORDS, Disturbance, Faults
from sim_controller.languages import grbl
from sim_controller.motion import Motion
from sim_controller.protocols.grbl import Input
from sim_controller.protocols.modbus import Registers
from tango_cnc.files import read_readings
from tango_cnc.link import measure as measuring
from tango_cnc.link.measure import Wanted, measure
from tango_cnc.link.rest import rest_of
from tango_cnc.link.wire import Parity
from tango_cnc.records import LinkError

PORTS = {
    "dnc": "socket://localhost:1?tv=even",
    "modbus": "modbus+tcp://localhost:1/1",
    "program": "modbus+tcp://localhost:1/1?run=program",
    "grbl": "grbl+serial:///dev/ttyACM0",
}
SILENT = "has been silent for longer than"
ON = "the probe signal is on although nothing is measured"
ALARM, HELD = "it is in alarm", "its state is Alarm"
# fault → what is told over dnc, over modbus touch by touch and record by record, over grbl; nothing: the run comes to its end
SAID = {
    "stop-after": (SILENT, "were not answered", "were not answered", "has not acknowledged"),
    "probe-stuck-after": (SILENT, ON, ALARM, ON),
    "alarm-after": (SILENT, ALARM, ALARM, HELD),
    "door-after": (SILENT, "its door is open", ALARM, "its state is Door:0"),
    "estop-after": (SILENT, "emergency stop", ALARM, HELD),
    "battery-low-after": (SILENT, "the battery of the probe is low", ALARM, HELD),
    "reset-after": (SILENT, ALARM, ALARM, "ALARM:3"),
    "bounce-after": (SILENT, "", ALARM, "ALARM:4"),
}


def control(kind, ledger, clock, faults, text, turns):
    """→ a line to a control whose machine has these faults"""
    still, motion = Disturbance({}, 0), Motion(scene(kind != "grbl")[2], ledger.note, faults=faults)
    if kind == "grbl":
        return Cable(grbl.switched_on(motion, ledger.note), Input(True), ledger, clock, still, still, None)
    if kind == "dnc":
        return Parity(Tape(ledger, clock, faults, still, still, None), False)
    more = {"program": lambda motion, punch: resident(text, motion, punch), "waited": turns.waited} if turns else {}
    return Bus(Registers(motion, ledger.note, clock=clock, **more), clock, random.Random(0), {}, turns)


def attempt(kind, folder, monkeypatch, ledger, faults, resume):
    """→ what ended the run, nothing when it came to its end"""
    clock, all_turns = FakeClock(), []
    cell, whole, _ = scene(kind != "grbl")
    made, texts = rest_of(cell, whole, (), tuple(range(1, 8))), []

    def posted(part):
        found = post(part)
        texts[:] = [found[0].text]
        return found

    def opened(address, **how):
        all_turns.append(Turns() if kind == "program" else None)
        return control(kind, ledger, clock, faults, texts[0], all_turns[0])

    patched(monkeypatch, clock)
    monkeypatch.setattr(measuring, "open_port", opened)
    try:
        wanted = Wanted(PORTS[kind], "dnc", "fanuc", folder / "readings.csv", resume=resume)
        measure(cell, made, wanted, posted, lambda step: None, lambda part, program: None)
    except LinkError as error:
        return str(error)
    finally:
        if all_turns[0]:
            all_turns[0].end()
    return ""


@pytest.mark.few(3)
@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize("kind", PORTS)
def test_a_fault_of_the_machine(kind, name, tmp_path, monkeypatch):
    ledger, wanted = Ledger(), SAID[name][list(PORTS).index(kind)]
    said = attempt(kind, tmp_path, monkeypatch, ledger, Faults({name: 3}), False)
    assert wanted in said
    assert bool(wanted) == bool(said)
    if said:
        assert f"{3 if '3 of 7' in said else 2} of 7 touches are recorded" in said
        assert attempt(kind, tmp_path, monkeypatch, ledger, Faults(), True) == ""
    assert judged(tmp_path, ledger) == (len(scene()[1].touches) - 7, 0, 0)  # of 60 touches the other 53 were not asked for
    early = read_readings(tmp_path / "readings.csv", scene()[0].machine, scene()[0].artefact).status.count("early")
    assert early == (not wanted)  # a row that no estimate uses
