"""The LinuxCNC program on the whole control: its real planner, its real axes, a probe input that trips on a table in HAL."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from postprocessors._base import load, program
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Plan

pytestmark = [pytest.mark.long, pytest.mark.system("linuxcnc", "linuxcncrsh"), pytest.mark.xdist_group("linuxcnc")]
HERE = Path(__file__).parent
LIMITS = {"X": (-400, 400), "Y": (-350, 350), "Z": (-100, 800), "B": (-95, 95), "C": (-36000, 36000)}


@dataclass
class Control:
    """A running LinuxCNC and the line to its linuxcncrsh."""

    folder: Path
    line: socket.socket

    def say(self, text: str, wait: float = 0.2) -> str:
        """command → its answer."""
        self.line.sendall(f"{text}\r\n".encode())
        time.sleep(wait)
        try:
            return self.line.recv(65536).decode()
        except TimeoutError:
            return ""

    def run(self, made: Plan) -> tuple[list[str], str]:
        """plan → lines of the log, last error of the control."""
        lines = program(load("linuxcnc"), made, {"positioning_feed": 20000.0, "log": "log.txt"}, plan_hash(made))[2]()
        (self.folder / "tango.ngc").write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
        for text in ("set mode mdi", "set mdi G53 G0 Z300", "set mode auto", f"set open {self.folder / 'tango.ngc'}", "set run"):
            self.say(text, 1.0)
        error, end, idle = "", time.monotonic() + 120, False
        while not idle and time.monotonic() < end:
            idle = "IDLE" in self.say("get program_status", 0.5)
            # Asked after the state: what ended the program is told only once, and may come between the two questions.
            found = re.search(r"ERROR (?!OK)(.*)", self.say("get error"))
            error = found[1].strip() if found else error
        if not idle:
            pytest.fail("the program did not end within two minutes")
        time.sleep(0.5)
        return (self.folder / "log.txt").read_text().splitlines(), error


@contextmanager
def linuxcnc(made: Plan, moved: dict[str, float]) -> Iterator[Control]:
    """plan, mm by which facets really lie farther out → the control with this table, switched on."""
    folder = Path(tempfile.mkdtemp(prefix="tango-linuxcnc-"))
    folder.chmod(0o777)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    for file in (HERE / "linuxcnc").iterdir():
        (folder / file.name).write_text(file.read_text().replace("@PORT@", str(port)))
    with (folder / "machine.ini").open("a") as ini:
        for i, (name, (low, high)) in enumerate(LIMITS.items()):
            common = f"MIN_LIMIT = {low}\nMAX_LIMIT = {high}\nMAX_VELOCITY = 400\nMAX_ACCELERATION = 2000\n"
            kind = "LINEAR" if name in "XYZ" else "ANGULAR"
            ini.write(f"[AXIS_{name}]\n{common}[JOINT_{i}]\nTYPE = {kind}\n{common}HOME = 0\nHOME_SEQUENCE = 0\n")
    (folder / "machine.tbl").touch()
    facets = [f for f in made.artefact.facets.values() if f.ball is None]
    points = [[p + moved.get(f.id, 0.0) * n for p, n in zip(f.point, f.normal, strict=True)] for f in facets]
    table = {
        "length": made.machine.probe.length,
        "radius": made.machine.probe.tip_radius,
        "facets": [[point, f.normal] for point, f in zip(points, facets, strict=True)],
        "balls": [[b.centre, b.radius] for b in made.artefact.balls.values()],
    }
    (folder / "table.json").write_text(json.dumps(table))
    variables = {**os.environ, "HOME": str(folder), "RTAPI_FIFO_PATH": str(folder / ".rtapi_fifo")}
    if os.geteuid() == 0:
        variables["RTAPI_UID"] = "65534"
    with (folder / "out.log").open("w") as out:
        process = subprocess.Popen(["linuxcnc", "machine.ini"], cwd=folder, env=variables, stdout=out, stderr=out)
        try:
            yield _switched_on(folder, port, process)
        finally:
            _shut_down(port, process)
            shutil.rmtree(folder, ignore_errors=True)


def _switched_on(folder: Path, port: int, process: subprocess.Popen[bytes]) -> Control:
    for _ in range(120):
        try:
            line = socket.create_connection(("127.0.0.1", port), timeout=0.4)
            break
        except OSError:
            if process.poll() is not None:
                pytest.fail((folder / "linuxcnc_debug.txt").read_text()[-2000:])
            time.sleep(0.25)
    else:
        pytest.fail("linuxcncrsh does not answer")
    control = Control(folder, line)
    for text in ("hello EMC tango 1.1", "set enable EMCTOO", "set echo off", "set verbose on", "set estop off", "set machine on"):
        control.say(text)
    for joint in range(5):
        control.say(f"set home {joint}", 0.5)
    return control


def _shut_down(port: int, process: subprocess.Popen[bytes]) -> None:
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=0.5) as line:
            for text in ("hello EMC tango 1.1", "set enable EMCTOO", "shutdown"):
                line.sendall(f"{text}\r\n".encode())
                time.sleep(0.3)
    except OSError:
        process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()


def words(line: str) -> dict[str, float]:
    return {letter: float(value) for letter, value in re.findall(r"([A-Z])(-?[\d.]+)", line)}


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(read_cell(HERE / "golden" / "cell"))


def test_every_touch_is_made_where_it_is_planned(made: Plan) -> None:
    """The probe input is asked every 0.3 ms and read every 1 ms; at 3 mm/s and on a busy computer that is some micrometres."""
    with linuxcnc(made, {}) as control:
        lines, error = control.run(made)
    assert not error
    assert re.fullmatch(r"TANGO START [0-9A-F]{12} 6", lines[0]) and lines[-1] == "TANGO END 6"
    for line, touch in zip(lines[1:-1], made.touches, strict=True):
        found = words(line)
        assert (found["P"], found["H"]) == (touch.number, 1)
        for name, value in zip(made.machine.names, touch.contact, strict=True):
            if name in made.machine.linear:
                assert found[name] == pytest.approx(value, abs=0.2), (touch.number, name)
            else:
                assert math.remainder(found[name] - math.degrees(value), 360) == pytest.approx(0, abs=1e-6)


def test_a_miss_and_an_early_contact_are_told_apart(made: Plan) -> None:
    with linuxcnc(made, {"top": 7.0, "3": -8.0}) as control:
        lines, error = control.run(made)
    assert not error
    assert [words(line)["H"] for line in lines[1:-1]] == [1, 2, 1, 2, 0, 1]


def test_a_contact_on_the_way_ends_the_program_before_its_record(made: Plan) -> None:
    with linuxcnc(made, {"top": 40.0}) as control:
        lines, error = control.run(made)
    assert "Probe tripped during non-probe move" in error
    assert [line[:5] for line in lines] == ["TANGO", "P1 H1"]
