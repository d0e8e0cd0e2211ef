"""Somebody at a Heidenhain control: starts every program that comes over LSV2, and says at the computer when nothing moves."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from postprocessors import heidenhain
from sim_controller.languages import Alarm, Silence
from sim_controller.probing import rig
from sim_controller.session import Session, Setup
from support.lsv2 import Control
from tango_cnc.files import read_cell, read_world

PROGRAM, RECORDS = "TNC:\\TANGO.H", "TNC:\\TANGO.TXT"
STORED = ("TNC:\\TANGO.A", *heidenhain.mask())
QUIET = 0.15  # s without a connection after which the person starts what is there


class Person:
    """Starts the programs. `asked` stands in for Enter at the computer: it is pressed once nothing moves any more."""

    def __init__(self, control: Control, cell: Path, cut: int | None = None) -> None:
        """control, cell with a world, after how many bytes of records somebody presses emergency stop: the first time alone."""
        self.control, self._cell, self._cut = control, cell, cut
        self._left, self._moves, self._ran = threading.Event(), threading.Event(), threading.Event()
        self.programs: list[bytes] = []
        self.pressed = 0
        control.moving = self._moves.is_set

    def asked(self, timeout: float) -> bool | None:
        """As `_lsv2.Person.asked`."""
        if self._ran.wait(timeout) and not self._moves.is_set():
            self._ran.clear()
            self.pressed += 1
            return True
        return None

    def _print(self, data: bytes) -> None:
        records = self.control.files.get(RECORDS, b"") + data
        if self._cut is not None and len(records) > self._cut:
            self.control.files[RECORDS], self._cut = records[: self._cut], None
            raise Silence
        self.control.files[RECORDS] = records

    def work(self) -> None:
        """Until the person leaves."""
        read = read_cell(self._cell)
        truth = rig(read.machine, read.artefact, read_world(self._cell / "world.yaml"), 1)
        session = Session(truth, Setup("klartext", library=STORED))
        since = time.monotonic()
        while not self._left.wait(0.02):
            text = self.control.files.get(PROGRAM, b"")
            if self.control.talking or text in (b"", *self.programs):
                since = time.monotonic()
            elif time.monotonic() - since > QUIET:
                self._moves.set()
                self.programs.append(text)
                with contextlib.suppress(Alarm, Silence):
                    session.run(session.control(self._print), iter(text.decode().splitlines()))
                self._moves.clear()
                self._ran.set()

    @contextlib.contextmanager
    def there(self) -> Iterator[Callable[[], None]]:
        """→ within it, the person is at work."""
        thread = threading.Thread(target=self.work, daemon=True)
        thread.start()
        try:
            yield self._left.set
        finally:
            self._left.set()
            thread.join(10)
