"""A control whose program is started by hand and whose records go into a file: what a share or a memory card shows of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from tango_cnc.records import LinkError

from .languages import Alarm, Silence
from .session import Session, tape

LOOK = 0.1  # s between two looks for the program


def start(program: Path, records: Path, session: Session, patience: float = 60.0) -> None:
    """files of program and records, session → executed once it is there, records appended as they come.

    Raises LinkError when nobody brings the program within `patience` s, and for an alarm, in its words.
    """
    until = time.monotonic() + patience
    while not program.exists():
        if time.monotonic() > until:
            raise LinkError(f"--start {program}: there is no such program after {patience:g} s")
        time.sleep(LOOK)
    time.sleep(LOOK)  # whoever copies it has finished
    with records.open("ab", buffering=0) as out:
        control = session.control(lambda data: _write(out.write, data))
        try:
            session.run(control, tape(program))
        except Alarm as alarm:
            session.note("alarm", code=alarm.code, text=alarm.text, detail=alarm.detail)
            raise LinkError(str(alarm)) from None
        except Silence:
            session.note("power", state="off")


def _write(out: Callable[[bytes], object], data: bytes) -> None:
    """bytes → in the file in two pieces, as a disk cache may write them."""
    half = len(data) // 2
    for piece in (data[:half], data[half:]):
        out(piece)
