"""Modbus behind a gateway that delivers late, twice, in another order, out of a cache: nothing moves that nobody asks for now."""

import os
import random
import sys

import pytest
from support import gateway, gateway_wire
from support.gateway import BEGIN, END, OTHERS, Control, session
from support.linkfaults import scene

from sim_controller.motion import Motion
from sim_controller.protocols.modbus import Registers
from tango_cnc.link.transport import _modbus

CAMPAIGN = int(os.environ.get("TANGO_SESSIONS", "1000"))
ELSEWHERE = {"tcp": ("frame spoilt",), "rtu": ("connection closed",)}  # what cannot happen there
linux = pytest.mark.skipif(sys.platform != "linux", reason="pairs of sockets that keep pieces apart are of Linux")


def sessions(seeds, behind=gateway.Gateway, computer=gateway.Run, others=OTHERS):
    """→ what went wrong on the way, in all; every session has an end, and nothing was lost, invented or unsafe"""
    happened, runs = dict.fromkeys(behind.KINDS, 0), 0
    for seed in seeds:
        verdict = session(seed, behind, computer, others)
        assert not verdict.unsafe, f"seed {seed}: {verdict.unsafe}"
        assert (verdict.lost, verdict.invented, verdict.hung) == (0, 0, False), f"seed {seed}: {verdict}"
        runs += verdict.runs
        for kind, count in verdict.happened.items():
            happened[kind] += count
    print(f"\n{len(seeds)} sessions, {runs} runs, {happened}: 0 unsafe, 0 lost, 0 invented")
    return happened


@pytest.mark.few(0)
def test_a_few_sessions_behind_a_gateway():
    assert sum(sessions(range(1, 5)).values()) > 20


@pytest.mark.long
def test_thirty_sessions_behind_a_gateway():
    assert min(sessions(range(100, 130)).values()) > 0


@pytest.mark.campaign
@pytest.mark.parametrize("part", range(10))
def test_a_thousand_sessions_behind_a_gateway(part):
    many = -(-CAMPAIGN // 10)
    sessions(range(1000 + many * part, 1000 + many * (part + 1)))


def wired(monkeypatch, kind, seeds):
    """→ what went wrong on the way, over real frames and pymodbus; two computers cannot share a serial line."""
    gateway_wire.near(monkeypatch, kind)
    happened = sessions(seeds, gateway_wire.Near, gateway_wire.WireRun, OTHERS if kind == "tcp" else 0.0)
    frames, injected = gateway_wire.Near.frames, sum(happened.values())
    print(f"over {kind}, seeds {seeds.start} to {seeds.stop - 1}: {frames} frames, {injected} injected")
    return happened


@pytest.mark.few(1)
@linux
@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_a_few_sessions_over_frames(monkeypatch, kind):
    assert sum(wired(monkeypatch, kind, range(1, 3)).values()) > 20


@pytest.mark.long
@linux
@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_sixty_sessions_over_frames(monkeypatch, kind):
    happened = wired(monkeypatch, kind, range(100, 160))
    assert min(count for what, count in happened.items() if what not in ELSEWHERE[kind]) > 0


@pytest.mark.campaign
@linux
@pytest.mark.parametrize("part", range(10))
@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_a_thousand_sessions_over_frames(monkeypatch, kind, part):
    many = -(-CAMPAIGN // 10)
    wired(monkeypatch, kind, range(10_000 + many * part, 10_000 + many * (part + 1)))


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")
@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_a_session_over_a_socket_and_a_serial_line(monkeypatch, kind):
    monkeypatch.setattr(_modbus, "ANSWER", 0.25)
    monkeypatch.setattr(gateway_wire.Far, "kind", kind)
    seeds = range(5001, 5002)
    assert sum(sessions(seeds, gateway_wire.Far, gateway_wire.WireRun, OTHERS if kind == "tcp" else 0.0).values()) > 10


@linux
def test_the_judge_notices_a_control_over_frames_that_acts_on_what_comes_late(monkeypatch):
    monkeypatch.setattr(gateway, "Control", Credulous)
    monkeypatch.setattr(gateway, "LONGEST", 60.0)
    gateway_wire.near(monkeypatch, "tcp")
    assert session(1, gateway_wire.Near, gateway_wire.WireRun).unsafe


class Credulous(Control):
    """A control of layout 1: a new sequence means a new command, whenever it comes and whoever confirms."""

    def scan(self):
        r = self.r
        if r[0] == 0 and r[62] != r[36]:
            r[1], r[34:56] = (r[62] - 1) % gateway.WORD, r[60:82]
            r[3] = (r[3] + 1) % gateway.WORD
            r[82], self.issued = r[3], r[4]
            self.newest = r[4]
        super().scan()


def test_the_judge_notices_a_control_that_acts_on_what_comes_late(monkeypatch):
    monkeypatch.setattr(gateway, "Control", Credulous)
    monkeypatch.setattr(gateway, "LONGEST", 60.0)
    assert session(1).unsafe


def test_the_simulated_control_does_what_the_rules_say():
    """The control of sim_controller and one written from docs/link.md, given the same writes at the same times."""
    for seed in range(20):
        chance = random.Random(seed)
        ours = Control(chance)
        start = chance.randrange(gateway.WORD)
        ours.r[2] = ours.r[3] = start
        ours.r[1] = 0
        clock = [0.0]
        theirs = Registers(Motion(scene()[2]), clock=lambda clock=clock: clock[0], ticket=start)
        commands = 0
        for _ in range(300):
            clock[0] += chance.choice([0.0, 0.02, 0.5, 1.0, 3.0, 12.0])
            ours.now = clock[0]
            ours.scan()
            theirs.look()
            at, words = _write(chance, ours.r)
            ours.r[at : at + len(words)] = words
            ours.done_at = 0.0
            before = len(ours.begun)
            ours.scan()
            pending = theirs.write(at, words)
            assert pending == (len(ours.begun) > before), f"seed {seed}"
            commands += pending
            if pending:
                theirs.execute()
                ours.done_at = 0.0
                ours.scan()
            assert theirs.words[:4] == ours.r[:4], f"seed {seed}"
            assert theirs.words[34:56] == ours.r[34:56], f"seed {seed}"
        assert commands > 5


def _write(chance, r):
    """registers → a write that is right, or nearly."""
    kind = chance.randrange(6)
    if kind < 2:
        sequence = (r[1] + chance.choice([1, 1, 1, 0, 2, -1])) % gateway.WORD
        return 60, [0, chance.choice([7, 8]), sequence, chance.choice([BEGIN, END]), *[0] * 18]
    if kind < 5:
        heard = (r[4] - chance.choice([0, 0, 1, 9, 10, 11, 40000])) % gateway.WORD
        return 82, [(r[3] - chance.choice([0, 0, 0, 1])) % gateway.WORD, heard, 0]
    return 83, [r[4]]
