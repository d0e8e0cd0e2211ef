"""What the link adds to a touch: a run over a real TCP connection or pty, against a control whose machine needs no time.

    python benchmarks/link.py [--touches 200]

Everything that is measured here is the link's: requests and answers, checks, the journal with its fsync. The wire is what is
between two processes' threads on this computer; at 9600 baud a record of 80 characters alone takes 83 ms more.
"""

from __future__ import annotations

import argparse
import math
import socket
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from sim_controller.languages.grbl import switched_on
from sim_controller.lines import PtyLine, TcpLine
from sim_controller.motion import Skip
from sim_controller.probing import home
from sim_controller.protocols import grbl, modbus
from tango_cnc.files import read_cell
from tango_cnc.link.measure import Wanted, measure
from tango_cnc.plan import plan
from tango_cnc.program import Program

LIMIT = 50.0  # ms a touch
NEAR = 0.01  # mm between the end of a measuring move as planned and as sent
EXAMPLE = Path(__file__).parents[1] / "examples" / "hu40t"


class Still:
    """A machine that is at once where it is told to be, and touches everything where it nominally is."""

    def __init__(self, cell, made) -> None:
        self.machine, self.deflected, self.time = cell.machine, False, 0.0
        self.position = home(cell.machine)
        self._ends = np.array([touch.end[:3] for touch in made.touches])
        self._contacts = np.array([touch.contact[:3] for touch in made.touches])

    def rapid(self, target, **_) -> None:
        for name, value in target.items():
            self.position[self.machine.column(name)] = value

    def feed(self, target, feed) -> None:
        self.rapid(target)

    def dwell(self, seconds) -> None:
        pass

    def skip(self, target, feed) -> Skip:
        self.rapid(target)
        away = np.abs(self._ends - self.position[:3]).max(axis=1)
        hit = bool(away.min() < NEAR)
        if hit:
            self.position[:3] = self._contacts[away.argmin()]
        return Skip(hit, self.position.copy())


def tape(connection: socket.socket, made) -> None:
    """Reads a program to its closing % and prints the records of the plan, as fast as they are taken."""
    got = b""
    while got.count(b"%") < 2:
        got += connection.recv(65536)
    lines = [f"TANGO START 5AFE {len(made.touches)}"]
    for touch in made.touches:
        values = [v if a.kind == "linear" else math.degrees(v) for v, a in zip(touch.contact, made.machine.axes, strict=True)]
        words = " ".join(f"{name}{value:.4f}" for name, value in zip(made.machine.names, values, strict=True))
        lines.append(f"P{touch.number} H1 {words} K{sum(values):.4f}")
    connection.sendall("".join(f"{line}\n" for line in [*lines, f"TANGO END {len(made.touches)}"]).encode())
    connection.recv(1)


def served(how: str, cell, made) -> str:
    """Starts the other side in a thread. → the port's URL"""
    still = Still(cell, made)
    nothing = {"device": None, "serial": False, "resident": None, "received": lambda n: None}
    session = SimpleNamespace(motion=lambda: still, note=lambda *a, **d: None, **nothing)
    if how == "modbus+rtu":
        line = PtyLine()
        session.serial = True
        threading.Thread(target=modbus.serve, args=(line, session, True), daemon=True).start()
        return f"modbus+rtu://{line.path}/1"
    server = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        connection, _ = server.accept()
        if how == "dnc":
            tape(connection, made)
        elif how == "grbl":
            session.device = switched_on(still)  # type: ignore[arg-type]
            grbl.serve(TcpLine(connection), session, True)  # type: ignore[arg-type]
        else:
            modbus.serve(TcpLine(connection), session, True)  # type: ignore[arg-type]

    threading.Thread(target=lambda: _until_closed(answer), daemon=True).start()
    host = f"127.0.0.1:{server.getsockname()[1]}"
    return {"dnc": f"socket://{host}", "grbl": f"grbl+socket://{host}?orient=m19", "modbus+tcp": f"modbus+tcp://{host}/1"}[how]


def _until_closed(talk: Callable[[], None]) -> None:
    try:
        talk()
    except Exception as error:  # the other side hangs up at the end
        if type(error).__name__ not in ("Closed", "ConnectionResetError"):
            raise


def overhead(how: str, touches: int) -> tuple[float, float]:
    """protocol, number of touches → ms a touch, and how many of them this process computed (both ends of the line)."""
    cell = read_cell(EXAMPLE)
    kept, left = [], touches
    for indexation in cell.strategy.indexations:
        if left > 0:
            kept.append(replace(indexation, facets=indexation.facets[:left]))
            left -= len(kept[-1].facets)
    cell = replace(cell, strategy=replace(cell.strategy, indexations=tuple(kept)))
    made = plan(cell)
    seen: list[tuple[float, float]] = []
    program = Program("O1.nc", "5AFE", lambda: iter(("%", "O1", "M30", "%")), made, cell.machine.names, summed=False)
    with tempfile.TemporaryDirectory() as folder:
        wanted = Wanted(served(how, cell, made), "dnc", "fanuc", Path(folder) / "readings.csv", timeout=60.0)
        watch = lambda step: seen.append((time.perf_counter(), time.process_time()))  # noqa: E731
        measure(cell, made, wanted, lambda part: [program], watch, lambda part, text: None)
    wall, computed = ((last - first) / len(made.touches) * 1e3 for first, last in zip(seen[0], seen[-1], strict=True))
    return wall, computed


def main() -> int:
    """→ 0 when every protocol keeps to the limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--touches", type=int, default=200)
    touches = parser.parse_args().touches
    found = {how: overhead(how, touches) for how in ("dnc", "modbus+tcp", "modbus+rtu", "grbl")}
    for how, (wall, computed) in found.items():
        verdict = "within" if wall < LIMIT else "BEYOND"
        print(f"{how:12}{wall:8.1f} ms a touch, {computed:5.1f} ms of them computing at both ends   {verdict} {LIMIT:g} ms")
    return int(max(wall for wall, _ in found.values()) >= LIMIT)


if __name__ == "__main__":
    raise SystemExit(main())
