"""What several tests share of run."""

import contextlib
import re
import socket
import threading

import numpy as np
import pytest
from click.testing import CliRunner

from tango_cnc.cli import guarded, tango
from tango_cnc.commands.init import write_example
from tango_cnc.files import read_cell, read_readings
from tango_cnc.files.plan import read_plan

STRATEGY = """\
name: seven touches
approach: {standoff: 10, search: 5, feed: 180}
indexations:
  - {S: 0, B: 0, C: 0, facets: [3, 5, 7]}
  - {S: 0, B: 0, C: 90, facets: [3, 5]}
  - {S: 90, B: 0, C: 0, facets: [5, 7]}
"""


@pytest.fixture
def cell(tmp_path):
    folder = tmp_path / "cell"
    write_example(folder, "hu40t")
    (folder / "strategy.yaml").write_text(STRATEGY)
    return folder


class Control:
    """Prints the nominal contact of every touch, shifted by `proud` mm outwards; stops printing after `stop` touches."""

    whole = 7  # touches of the plan

    def __init__(self, folder, proud=0.01, stop=None, hang_up=False, edit=lambda number, line: line, delay=None):
        self.folder, self.proud, self.stop, self.hang_up, self.edit = folder, proud, stop, hang_up, edit
        self.tape = b""
        self.server = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self.server.getsockname()[1]}"
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self):
        connection, _ = self.server.accept()
        with connection, contextlib.suppress(ConnectionError):
            while not re.search(rb"\n%\n$", self.tape):
                if not (piece := connection.recv(4096)):
                    return  # who has hung up sends nothing more: asked again and again, this takes a core from all tests behind it
                self.tape += piece
            text = self.tape.decode()
            mark = re.search(r"TANGO\*START\*([0-9A-F]+)", text)[1]
            touches = re.findall(r"\(TOUCH (\d+) ", text)
            machine = read_cell(self.folder).machine
            here = self.folder / "program" / ("plan.csv" if len(touches) == self.whole else "rest/plan.csv")
            planned = read_plan(here, machine)
            self._print(connection, f"TANGO START {mark} {len(touches)}")
            for i, number in enumerate(planned.touch):
                if self.stop is not None and i >= self.stop:
                    if not self.hang_up:
                        connection.recv(1)  # silent until the other side leaves
                    return
                away = planned.standoff[i] - planned.contact[i]
                at = planned.contact[i] + self.proud * away / np.linalg.norm(away)
                at[3:] = np.degrees(at[3:])
                values = dict(zip(machine.names, at, strict=True)) | {"K": sum(at)}
                words = " ".join(f"{name}{value:.4f}" for name, value in values.items())
                self._print(connection, self.edit(number, f"P{number} H1 {words}"))
            self._print(connection, f"TANGO END {len(touches)}")
            connection.recv(1)

    @staticmethod
    def _print(connection, line):
        connection.sendall(b"\x12" + line.encode() + b"\n\r\r\x14")


class Result:
    def __init__(self, *args):
        runner = CliRunner()
        with runner.isolation() as streams:
            self.code = guarded(tango.main, [str(a) for a in args], standalone_mode=False)
            self.out, self.err = streams[0].getvalue().decode(), streams[1].getvalue().decode()


def run(folder, control, *more):
    """Nobody waits to hear whether a control that has just been started still executes an old program."""
    return Result("run", "-C", folder, "--port", f"{control.url}?listen=no", *more)


def readings(folder, name="readings.csv"):
    cell = read_cell(folder)
    return read_readings(folder / name, cell.machine, cell.artefact)
