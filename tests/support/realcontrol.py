"""A real LinuxCNC on this computer, without screen and iron: its planner and axes, and a probe that trips on a simulated table."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from postprocessors import load, program
from sim_controller.probing import home
from tango_cnc.files import read_cell
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Machine

HERE = Path(__file__).parents[1]
ORDER = "XYZBC"  # of the joints; of a machine with a cradle A: XYZAC
STANDS = 60.0  # s: a control that has done nothing for so long does nothing any more
# LinuxCNC 2.9 loses count of its own motions now and then, mostly on a busy computer (its issues 263, 662 and 3650). Nothing
# has been hit, and the program is none the worse: it is begun again, as docs/link.md tells a person to.
LOST_COUNT = "Queue is not empty after probing"
PERIOD = 0.001  # s, of the servo thread: the probe input is looked at once in it
# With this module no period begins before table.py has judged those before it (halcompile --install tests/linuxcnc/lockstep.comp).
# Without it the table of a busy computer answers too late now and then: it reports a false contact, or misses a true one.
LOCKSTEP = Path("/usr/lib/linuxcnc/modules/lockstep.so")
# Everything but measuring is to take little time: mm/s and mm/s², deg/s and deg/s². Within the periods that table.py may be
# silent no motion comes farther than some millimetres from where it began.
FAST = {"linear": (500.0, 5000.0), "rotary": (360.0, 3000.0)}
# The control is served before whatever else the computer does. Who may not ask for that goes on without.
FIRST = ("nice", "-n", "-10")
ENABLE = ("hello EMC tango 1.1", "set enable EMCTOO", "set echo off", "set verbose on")


@dataclass
class Control:
    """A running LinuxCNC and how to speak to its linuxcncrsh; one connection at a time."""

    folder: Path
    port: int

    @property
    def url(self) -> str:
        """→ what `tango run --port` wants."""
        return f"linuxcnc://127.0.0.1:{self.port}?file={self.folder / 'tango.ngc'}&log={self.folder / 'log.txt'}"

    def tell(self, *commands: str) -> list[str]:
        """commands → the answers to those that are `get …`, in order."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=20) as line, line.makefile("rb") as answers:
            found = []
            for command in (*ENABLE, *commands):
                # The answer to the second one comes when the first one is done, in every dialect.
                what = command.removeprefix("get ") if command.startswith("get ") else "enable"
                line.sendall(f"{command}\r\nget {what}\r\n".encode() if what == "enable" else f"{command}\r\n".encode())
                while not (answer := answers.readline()).strip().upper().startswith(what.upper().encode()):
                    if not answer:
                        raise ConnectionError(command)
                if what != "enable":
                    found.append(answer.decode().strip())
            return found

    def idle(self, seconds: float) -> bool:
        """s → whether the program ends within them."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if "IDLE" in self.tell("get program_status")[0]:
                return True
            time.sleep(0.3)
        return False

    def execute(self, text: str, last: str = "THE END") -> tuple[list[str], str]:
        """Program that writes log.txt, how its last line in there begins → lines of the log, last error of the control.

        A program that the control broke off because it lost count of its own motions is begun again.
        """
        for _ in range(5):
            said, error = self.once(text, last)
            if error != LOST_COUNT:
                break
            print(f"begun again after {len(said)} lines: {error}")
        return said, error

    def once(self, text: str, last: str) -> tuple[list[str], str]:
        """The same, whatever the error.

        It has ended when the control is idle and the log has that line or the control reported an error. An idle control with
        neither has not begun yet. A busy computer makes any program long. So it is given up only when nothing has happened for
        long: no axis has moved and the log has not grown.
        """
        log = self.folder / "log.txt"
        log.unlink(missing_ok=True)
        (self.folder / "tango.ngc").write_text(text, encoding="ascii")
        while not self.tell("get error")[0].endswith("OK"):
            pass  # what was said of something else
        self.tell("set mode auto", f"set open {self.folder / 'tango.ngc'}", "set run")
        error, before, changed = "", ([""], 0), time.monotonic()
        while True:
            time.sleep(0.3)
            # First the state, then the error: LinuxCNC reports an error once, and may do so between the two questions.
            status, told, *at = self.tell("get program_status", "get error", "get abs_act_pos")
            found = re.search(r"ERROR (?!OK)(.*)", told)
            error = found[1].strip() if found else error
            lines = log.read_text().splitlines() if log.exists() else []
            if "IDLE" in status and (error or (lines and lines[-1].startswith(last))):
                return lines, error
            if before != (before := (at, len(lines))):
                changed = time.monotonic()
            if time.monotonic() > changed + STANDS:
                more = self.tell("get operator_text", "get operator_display", "get machine", "get estop", "get program_line")
                output = (self.folder / "out.log").read_text()[-1500:]
                pytest.fail(f"nothing happens: {status}, {at}, {more} after {lines}; {output}")

    def position(self) -> dict[str, float]:
        """→ machine coordinates, mm and deg."""
        values = self.tell("get abs_act_pos")[0].split()[1:]
        return dict(zip("XYZABC", map(float, values), strict=False))

    def mdi(self, *blocks: str) -> None:
        """blocks → executed one by one, as an operator would."""
        for block in blocks:
            self.tell("set mode mdi", f"set mdi {block}")
            time.sleep(0.3)
            self.idle(60)
        self.tell("set mode auto")

    def run(self, cell: Path) -> tuple[list[str], str]:
        """cell → lines of the log, last error of the control."""
        made, controller = plan(read_cell(cell)), read_cell(cell).controller
        assert controller is not None
        lines = program(load("linuxcnc"), made, controller.options, plan_hash(made))[2]()
        return self.execute("".join(f"{line}\n" for line in lines), "TANGO END")

    def contacts(self) -> list[dict[str, object]]:
        """→ every contact that there has been: surface, and the axis positions at which it truly was."""
        file = self.folder / "contacts.jsonl"
        return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


@contextmanager
def linuxcnc(cell: Path, wrapped: str = "", change: Callable[[Path], None] = lambda folder: None) -> Iterator[Control]:
    """cell with its world.yaml, letters of axes with WRAPPED_ROTARY, what to change first → the control, on and homed."""
    folder = Path(tempfile.mkdtemp(prefix="tango-linuxcnc-"))
    folder.chmod(0o777)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    names = {"@PORT@": str(port), "@PYTHON@": sys.executable, "@CONTACT@": str(HERE / "linuxcnc" / "contact.py")}
    for file in (HERE / "linuxcnc").iterdir():
        if file.is_file():
            text = file.read_text(encoding="utf-8")
            for name, value in names.items():
                text = text.replace(name, value)
            (folder / file.name).write_text(text, encoding="utf-8")
    if not LOCKSTEP.exists():
        lines = (folder / "machine.hal").read_text().splitlines(keepends=True)
        (folder / "machine.hal").write_text("".join(line for line in lines if line[0] == "#" or "lockstep" not in line))
    letters = joints(read_cell(cell).machine)
    ini_text = (folder / "machine.ini").read_text().replace(ORDER, letters).replace(" ".join(ORDER), " ".join(letters))
    (folder / "machine.ini").write_text(ini_text)
    shutil.copytree(cell, folder / "cell", ignore=shutil.ignore_patterns("*.journal"))
    with (folder / "machine.ini").open("a") as ini:
        ini.write(_axes(read_cell(cell).machine, wrapped))
    (folder / "machine.tbl").touch()
    change(folder)
    variables = {**os.environ, "HOME": str(folder), "RTAPI_FIFO_PATH": str(folder / ".rtapi_fifo")}
    if os.geteuid() == 0:
        variables["RTAPI_UID"] = "65534"
    with (folder / "out.log").open("w") as out, Path(tempfile.gettempdir(), f"tango-linuxcnc-{os.getuid()}.lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # a second LinuxCNC ends the first one when it starts
        process = subprocess.Popen([*FIRST, "linuxcnc", "machine.ini"], cwd=folder, env=variables, stdout=out, stderr=out)
        try:
            yield _switched_on(folder, port, process)
        finally:
            _shut_down(port, process)
            errors = (folder / "contact.err").read_text() if (folder / "contact.err").exists() else ""
            shutil.rmtree(folder, ignore_errors=True)
            if errors:
                print(errors)


def joints(machine: Machine) -> str:
    """machine → letters of its axes in the order of the joints: X Y Z and the rotary ones."""
    return "XYZ" + "".join(sorted(machine.rotary))


def _axes(machine: Machine, wrapped: str) -> str:
    """machine → its sections of the ini file. Homed where it is; stands drawn off the table as `sim_controller` begins."""
    at, text = home(machine), ""
    for i, name in enumerate(joints(machine)):
        axis, column = machine.axis(name), machine.column(name)
        speed, acceleration = FAST[axis.kind]
        scale = 1.0 if axis.kind == "linear" else 180 / np.pi
        low, high = (scale * value for value in axis.travel)
        common = f"MIN_LIMIT = {low}\nMAX_LIMIT = {high}\nMAX_VELOCITY = {speed}\nMAX_ACCELERATION = {acceleration}\n"
        kind, stands = "LINEAR" if axis.kind == "linear" else "ANGULAR", scale * at[column]
        roll = "WRAPPED_ROTARY = 1\n" if name in wrapped else ""
        text += f"[AXIS_{name}]\n{common}{roll}[JOINT_{i}]\nTYPE = {kind}\n{common}"
        text += f"HOME = {stands}\nHOME_OFFSET = {stands}\nHOME_SEQUENCE = 0\n"
    return text


def _switched_on(folder: Path, port: int, process: subprocess.Popen[bytes]) -> Control:
    control = Control(folder, port)
    for _ in range(240):
        with suppress(OSError):
            control.tell("set estop off", "set machine on")
            break
        if process.poll() is not None:
            debug = folder / "linuxcnc_debug.txt"
            pytest.fail((debug if debug.exists() else folder / "out.log").read_text()[-2000:])
        time.sleep(0.25)
    else:
        pytest.fail("linuxcncrsh does not answer")
    homed = ""
    count = int(re.findall(r"JOINTS = (\d+)", (folder / "machine.ini").read_text())[0])
    for _ in range(20):  # what is told before the machine is really on has no effect
        for joint in range(count):
            if homed.split()[1 + joint : 2 + joint] != ["YES"]:
                control.tell("set machine on", f"set home {joint}")
                time.sleep(0.5)
        homed = control.tell("get joint_homed")[0]
        if homed.split()[1 : 1 + count] == ["YES"] * count:
            return control
    pytest.fail(f"not homed: {homed}; {(folder / 'out.log').read_text()[-1000:]}")


def _shut_down(port: int, process: subprocess.Popen[bytes]) -> None:
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=0.5) as line:
            for text in (*ENABLE, "set abort", "shutdown"):
                line.sendall(f"{text}\r\n".encode())
                time.sleep(0.3)
    except OSError:
        process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
