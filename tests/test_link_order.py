"""Every reading is forced to the disk before the next motion is asked for, or its record acknowledged."""

import os
import random
from types import SimpleNamespace

import pytest
from support.linkfaults import Bus, Cable, Ledger, Tape, Turns, post, resident, scene
from support.linkparts import FakeClock

from sim_controller.faults import Disturbance, Faults
from sim_controller.languages import grbl
from sim_controller.motion import Motion
from sim_controller.protocols.grbl import Input
from sim_controller.protocols.modbus import CONFIRMED, REQUEST, Registers
from tango_cnc.link import measure as measuring
from tango_cnc.link.measure import Wanted, measure
from tango_cnc.link.wire import Parity

PORTS = {
    "grbl": "grbl+serial:///dev/ttyACM0",
    "modbus": "modbus+tcp://localhost:1/1",
    "modbus, program": "modbus+tcp://localhost:1/1?run=program",
    "dnc": "socket://localhost:1?tv=even",
}


class Overheard:
    """A line on which somebody listens: before what asks for a motion goes out, `asked` is called."""

    def __init__(self, line, asks, asked):
        self._line, self._asks, self._asked = line, asks, asked
        self.chunk, self.read, self.close = line.chunk, line.read, line.close

    def write(self, data):
        if self._asks(data):
            self._asked()
        return self._line.write(data)


def controls(kind, ledger, clock, text):
    """→ a control without faults on its line, and which of the bytes sent to it ask for motion"""
    still, motion = Disturbance({}, 0), Motion(scene(kind != "grbl")[2], ledger.note)
    if kind == "grbl":
        return Cable(grbl.switched_on(motion, ledger.note), Input(True), ledger, clock, still, still, None), lambda data: data[
            :1
        ] in b"GM"
    if kind == "dnc":
        return Parity(Tape(ledger, clock, Faults(), still, still, None), False), bool
    turns = Turns() if kind == "modbus, program" else None
    more = {"program": lambda motion, punch: resident(text, motion, punch), "waited": turns.waited} if turns else {}
    bus = Bus(Registers(motion, ledger.note, clock=clock, **more), clock, random.Random(0), {}, turns)
    taken = [b"0"]

    def takes(data):
        """Whether another record is taken: it is repeated whenever this end says that it is there."""
        before, taken[0] = taken[0], data.split()[-1] if data.startswith(b"16 %d " % CONFIRMED) else taken[0]
        return taken[0] != before

    return bus, takes if turns else lambda data: data.startswith(b"16 %d " % REQUEST)


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", PORTS)
def test_no_motion_is_asked_for_before_the_last_reading_is_on_disk(kind, tmp_path, monkeypatch):
    clock, ledger, order = FakeClock(), Ledger(), []
    cell, made, _ = scene(kind != "grbl")
    journal, durable = tmp_path / "readings.journal", [0]

    def forced(handle):
        durable[0] = journal.read_bytes().count(b'"kind":"reading"') if journal.exists() else 0

    def opened(address, **how):
        line, asks = controls(kind, ledger, clock, post(made)[0].text)
        return Overheard(line, asks, lambda: order.append((len(ledger.contacts), durable[0])))

    monkeypatch.setattr(measuring, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr(os, "fsync", forced)
    monkeypatch.setattr(measuring, "open_port", opened)
    wanted = Wanted(PORTS[kind], "dnc", "fanuc", tmp_path / "readings.csv")
    measure(cell, made, wanted, post, lambda step: None, lambda part, program: None)
    assert durable[0] == len(made.touches)
    made_before = [contacts for contacts, _ in order]
    if kind == "dnc":  # all of it goes out before the first motion; nothing is sent after the first record
        assert set(made_before) == {0}
    else:
        assert set(made_before) == set(range(len(made.touches) + 1))
        assert all(contacts == on_disk for contacts, on_disk in order)
