"""`kill -9` at random instants, then `--resume`: judged by the journal at the moment of the kill and by the simulator's ledger."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import sys
import time

import numpy as np
import pytest
from support.killed import controller, process

from tango_cnc import readback
from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, read_readings
from tango_cnc.link import journal, transport  # noqa: F401  imported here, they need not be in every child
from tango_cnc.link.journal import read_journal
from tango_cnc.link.protocols import dnc, grbl, modbus  # noqa: F401
from tango_cnc.plan import plan
from tango_cnc.records import InputError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="fork and kill are POSIX")

TOUCHES = 60
CLOSE = 1e-3  # mm, deg
SETTINGS = {"dnc": "", "modbus": "", "grbl": "?orient=m19"}
KILLS = int(os.environ.get("TANGO_KILLS", "1000"))  # of the campaign


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    text, left = "name: sixty\napproach: {standoff: 10, search: 5, feed: 180}\nindexations:\n", TOUCHES
    for indexation in read_cell(folder).strategy.indexations:
        if left > 0:
            place = ", ".join(f"{name}: {np.degrees(value):g}" for name, value in indexation.position.items())
            facets = indexation.facets[:left]
            text += f"  - {{{place}, facets: [{', '.join(facets)}]}}\n"
            left -= len(facets)
    (folder / "strategy.yaml").write_text(text)
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    return folder


def child(folder, url, resume):
    """A `tango run` of its own process, which does not read its program back first: that is tested elsewhere. → its number"""
    arguments = ["run", "-C", str(folder), "--port", url, "--yes", "--timeout", "20", *(["--resume"] if resume else [])]

    def work():
        pytest.MonkeyPatch().setattr(readback, "check", lambda *program, **named: ())
        return guarded(tango.main, arguments, standalone_mode=False)

    return process(work)


def ended(number, seconds):
    """process, s → its exit status when it ends by itself in that time; None when it had to be killed."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        found, status = os.waitpid(number, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(number, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
    return None if status == -signal.SIGKILL else status


def on_disk(folder):
    """→ {touch: position} of the journal as it is now, and whether there is a run to resume."""
    try:
        entries, _ = read_journal(folder / "readings.journal")
    except InputError:
        return {}, False
    found = {entry.touch: entry.position for entry in entries if entry.kind == "reading"}
    return found, any(entry.kind == "segment" for entry in entries)


def last_words(folder):
    """→ why the run ended, as its journal says"""
    if not (folder / "readings.journal").exists():
        return "no journal was begun"
    entries, _ = read_journal(folder / "readings.journal")
    return str(entries[-1]) if entries else ""


def judge(folder, ledger, since, durable):
    """cell, ledger and where in it the measurement began, readings that were on disk at a kill → (lost, invented, unsafe)"""
    cell = read_cell(folder)
    readings = read_readings(folder / "readings.csv", cell.machine, cell.artefact)
    scale = np.array([1.0 if axis.kind == "linear" else 180 / np.pi for axis in cell.machine.axes])
    # the line that is being written while we read is not finished
    events = [json.loads(line) for line in ledger.read_bytes()[since:].splitlines(keepends=True) if line.endswith(b"\n")]
    contacts = np.array([[event["at"][name] for name in cell.machine.names] for event in events if event["event"] == "contact"])
    got = dict(zip(readings.touch.tolist(), readings.position, strict=True))
    lost = len({touch.number for touch in plan(cell).touches} - set(got))
    lost += sum(number not in got or np.abs(got[number] - position).max() > 1e-6 for number, position in durable.items())
    invented = 0
    for position in readings.position[readings.ok]:
        away = contacts - position * scale
        away[:, scale != 1.0] = np.remainder(away[:, scale != 1.0] + 180, 360) - 180
        invented += not (np.abs(away).max(axis=1) < CLOSE).any()
    invented += int((~readings.ok).sum())
    return lost, invented, sum(event["event"] in ("unsafe", "collision") for event in events)


def killed(protocol, kills, cell, seed):
    """→ complete measurements that were made while `kills` processes were killed, at instants within what a whole one takes."""
    chance, ledger = random.Random(seed), cell.parent / "ledger"
    done, complete, durable = 0, 0, {}
    with controller(cell, "--protocol", protocol, "--tcp", "127.0.0.1:0", "--ledger", str(ledger)) as url:
        url += SETTINGS[protocol]
        for _ in range(2):  # the control has to get to know the moves
            began = time.monotonic()
            assert ended(child(cell, url, False), 120.0) == 0, last_words(cell)
            longest = time.monotonic() - began
            (cell / "readings.journal").unlink()
        since = ledger.stat().st_size
        while done < kills or durable or not complete:
            before, resume = on_disk(cell) if durable or complete == 0 else ({}, False)
            assert all(before.get(number) == position for number, position in durable.items())
            # the last one is left alone
            status = ended(
                child(cell, url, resume),
                chance.uniform(0, longest) if done < kills else 120.0,
            )
            if status is None:
                done += 1
                durable = on_disk(cell)[0]
            else:
                assert status == 0, f"a run that nobody killed did not come to its end: {last_words(cell)}"
                assert judge(cell, ledger, since, durable) == (0, 0, 0)
                complete, durable, since = complete + 1, {}, ledger.stat().st_size
                with contextlib.suppress(OSError):
                    (cell / "readings.journal").unlink()
    return complete


@pytest.mark.campaign
@pytest.mark.parametrize("protocol", SETTINGS)
def test_a_hundred_kills(cell, protocol):
    print(f"\n{protocol}: 34 kills, {killed(protocol, 34, cell, 2)} complete measurements")


@pytest.mark.campaign
@pytest.mark.parametrize("protocol", SETTINGS)
@pytest.mark.parametrize("part", range(4))
def test_a_thousand_kills(cell, protocol, part):
    kills = -(-KILLS // (4 * len(SETTINGS)))
    print(f"\n{protocol}: {kills} kills, {killed(protocol, kills, cell, 10 + part)} complete measurements")
