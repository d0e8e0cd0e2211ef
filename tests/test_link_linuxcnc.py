"""`tango run` over linuxcncrsh of a real LinuxCNC: stopped by the user, killed, resumed. And which way back there is."""

from __future__ import annotations

import json
import math
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.linkparts import plan as small_plan
from support.realcontrol import PERIOD, Control, linuxcnc

from sim_controller import probing, surfaces
from sim_controller.world import place
from tango_cnc.files import read_cell, read_readings, read_world
from tango_cnc.link.journal import read_journal
from tango_cnc.link.protocols.linuxcnc import way_back
from tango_cnc.link.transport import open_port, parse
from tango_cnc.plan import plan
from tango_cnc.records import InputError

real = pytest.mark.system("linuxcnc", "linuxcncrsh")
EXAMPLE = Path(__file__).parent.parent / "examples" / "hu40t"
STRATEGY = """\
name: fourteen touches
approach: {standoff: 4, search: 2, feed: 180}
indexations:
  - {S: 0, B: 30, C: -90, facets: [3, 8, 16, 21, 26]}
  - {S: 90, B: -45, C: 135, facets: [5, 8, 22, 24, 27]}
  - {S: 0, B: 0, C: 180, facets: [3, 5, 12, 17]}
"""
KNOWN_FAULT = "a known fault of LinuxCNC 2.9 and none of the program: resume it"
CLEAR = 1.0  # mm that a probe drawn clear is away from everything, at least
CLOSE = 1e-4  # mm


def test_both_files_have_to_be_named() -> None:
    with pytest.raises(InputError, match="no file and no log"):
        open_port(parse("linuxcnc://127.0.0.1:5007", {"file": (), "log": ()}))


# Which way back there is: the plan of linkparts touches facet 5 towards +X from (10, 0, 50), 7 towards -Y, then at B30 C-90


@pytest.mark.parametrize(
    ("due", "at", "way"),
    [
        (1, (18, 0, 50, 0, 0, 0), [(10, 0, 50), (10, 0, 100)]),  # on the measuring move
        (1, (25, 0, 50.3, 0, 0, 0), [(10, 0, 50), (10, 0, 100)]),  # at its end
        (1, (10, 0, 50, 0, 0, 360), [(10, 0, 50), (10, 0, 100)]),  # at the stand-off, a turn further
        (1, (10, 0, 70, 0, 0, 0), [(10, 0, 100)]),  # on the approach
        (2, (10, 0, 80, 0, 0, 0), [(10, 0, 100)]),  # on the way up from the touch before
        (2, (5, 20, 100, 0, 0, 0), []),  # on the way over
        (3, (0, 40, 50, 0, 0, 0), [(0, 40, 50), (0, 40, 100)]),  # still at the touch before; the table has not turned
        (3, (-5, 5, 70, 0, 30, -90), [(-5, 5, 80), (-5, 5, 100)]),
        (3, (-5, 5, 70, 0, 20, -90), []),  # the table is turning: nothing is near
    ],
)
def test_the_way_back_is_the_way_that_the_plan_came(due: int, at: tuple[float, ...], way: list[tuple[float, float, float]]) -> None:
    found = way_back(small_plan(), range(1, due + 1), dict(zip("XYZABC", at, strict=True)))
    assert [tuple(target[name] for name in "XYZ") for target in found] == way


# The real control


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    folder = tmp_path / "cell"
    shutil.copytree(EXAMPLE, folder)
    (folder / "strategy.yaml").write_text(STRATEGY)
    (folder / "tango.yaml").write_text(
        "tango: 1\nmachine: machine.yaml\nartefact: artefact.yaml\nstrategy: strategy.yaml\nterms: S1\n"
        "controller: {post: linuxcnc, log: log.txt, positioning_feed: 24000, gate: none}\n"
    )
    return folder


def running(cell: Path, control: Control, resume: bool) -> subprocess.Popen[str]:
    arguments = ["run", "-C", str(cell), "--port", control.url, "--yes", *(["--resume"] if resume else [])]
    return subprocess.Popen(
        [sys.executable, "-m", "tango_cnc", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def on_disk(cell: Path) -> dict[int, list[float]]:
    """→ {touch: position} of the journal as it is now."""
    file = cell / "readings.journal"
    entries = read_journal(file)[0] if file.exists() else []
    return {entry.touch: entry.position for entry in entries if entry.kind == "reading"}


def interrupted(cell: Path, control: Control, resume: bool, chance: random.Random, with_signal: signal.Signals) -> tuple[int, str]:
    """A run that is sent the signal at a random instant after its first new reading. → exit status, what it said"""
    process, before, end = running(cell, control, resume), len(on_disk(cell)), time.monotonic() + 120
    while len(on_disk(cell)) <= before and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(chance.uniform(0.0, 3.0))
    process.send_signal(with_signal)
    said = process.communicate(timeout=120)[1]
    return process.returncode, said


def clearance(cell: Path, control: Control) -> float:
    """→ mm from the ball to the nearest true surface, where the axes stand now."""
    parts = read_cell(cell)
    machine, at = parts.machine, control.position()
    rig = probing.rig(machine, parts.artefact, read_world(cell / "world.yaml"))
    position = np.array([[at.get(n, 0.0) if n in machine.linear else math.radians(at.get(n, 0.0)) for n in machine.names]])
    return float(surfaces.gaps(rig.surfaces, place(rig.true, position, np.ones_like(position)).tip).min())


def judged(cell: Path, control: Control, durable: dict[int, list[float]]) -> tuple[int, int]:
    """→ (lost, invented): readings that were on disk and changed or are missing, and those that no contact of the control made."""
    parts = read_cell(cell)
    readings = read_readings(cell / "readings.csv", parts.machine, parts.artefact)
    touches = {touch.number: touch for touch in plan(parts).touches}
    got = dict(zip(readings.touch.tolist(), readings.position, strict=True))
    lost = len(set(touches) - set(got)) + sum(np.abs(got[n] - position).max() > 1e-6 for n, position in durable.items())
    names, invented = parts.machine.names, int((~readings.ok).sum())
    for number, facet, position in zip(readings.touch.tolist(), readings.facet, readings.position, strict=True):
        way = np.subtract(touches[number].contact, touches[number].standoff)[:3]
        way = way / np.linalg.norm(way)
        assert names[:3] == ("X", "Y", "Z")
        invented += not any(
            contact["surface"] == facet
            and np.abs(np.remainder(position[3:] - contact["at"][3:] + math.pi, 2 * math.pi) - math.pi).max() < 1e-4
            and np.linalg.norm(late - (late @ way) * way) < CLOSE
            and -CLOSE < late @ way < 3.0 * PERIOD + CLOSE
            for contact in control.contacts()
            for late in [position[:3] - np.array(contact["at"][:3])]
        )
    return lost, invented


def resumed_to_the_end(cell: Path, control: Control, durable: dict[int, list[float]]) -> None:
    """A busy computer may meet the known fault of LinuxCNC 2.9 meanwhile: the run says that it has to be resumed once more."""
    for _ in range(3):
        process = running(cell, control, resume=True)
        said = process.communicate(timeout=300)[1]
        if process.returncode != 3 or KNOWN_FAULT not in said:
            break
        assert clearance(cell, control) > CLEAR, said
    assert process.returncode == 0, said
    assert judged(cell, control, durable) == (0, 0)
    origin = json.loads((cell / "readings.json").read_text())
    assert not origin["missing"] and len(origin["segments"]) > 1


def stopped(cell: Path, times: int, seed: int) -> Iterator[str]:
    """Ctrl-C, several times in one measurement. → what each of these runs said last"""
    chance, durable = random.Random(seed), {}
    with linuxcnc(cell) as control:
        for attempt in range(times):
            code, said = interrupted(cell, control, attempt > 0, chance, signal.SIGINT)
            if code == 0:
                break
            assert code == 3 and "stopped by the user" in said and f"tango run -C {cell} " in said and "--resume" in said, said
            assert "IDLE" in control.tell("get program_status")[0]
            assert clearance(cell, control) > CLEAR, said
            found = on_disk(cell)
            assert all(found[number] == position for number, position in durable.items())
            durable = found
            yield said
        if not (cell / "readings.csv").exists():
            resumed_to_the_end(cell, control, durable)


def killed(cell: Path, times: int, seed: int) -> int:
    """kill -9, several times in one measurement: the control goes on alone until an operator stops it. → kills"""
    chance, durable, done = random.Random(seed), {}, 0
    with linuxcnc(cell) as control:
        for attempt in range(times):
            code, _ = interrupted(cell, control, attempt > 0, chance, signal.SIGKILL)
            if code == 0:
                break
            done += 1
            found = on_disk(cell)
            assert all(found[number] == position for number, position in durable.items())
            durable = found
            if "IDLE" not in control.tell("get program_status")[0]:
                process = running(cell, control, resume=True)
                said = process.communicate(timeout=120)[1]
                assert process.returncode == 3 and "a program is running" in said, said
            control.tell("set abort")
            assert control.idle(30)
            control.mdi("G21 G90 G94 G53 G1 Z560 F6000")
        if not (cell / "readings.csv").exists():
            resumed_to_the_end(cell, control, durable)
    return done


@real
@pytest.mark.long
def test_ctrl_c_draws_the_probe_clear_and_the_run_goes_on(cell: Path) -> None:
    said = list(stopped(cell, 3, 1))
    assert len(said) == 3


@real
@pytest.mark.long
def test_a_killed_run_loses_nothing_and_invents_nothing(cell: Path) -> None:
    assert killed(cell, 3, 2) == 3


@real
@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10, 20))
def test_many_stops(cell: Path, seed: int) -> None:
    assert len(list(stopped(cell, 4, seed))) > 0


@real
@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(20, 30))
def test_many_kills(cell: Path, seed: int) -> None:
    assert killed(cell, 4, seed) > 0
