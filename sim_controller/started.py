"""A control whose program is started by hand and whose records go into a file: what a share or a memory card shows of it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tango_cnc.records import LinkError

from .languages import Alarm, Silence
from .motion import Motion
from .session import Session, tape

LOOK = 0.1  # s between two looks for the program
WAITS = 600.0  # s for which somebody who has said yes waits for the start of his program


def start(program: Path, records: Path, session: Session, patience: float = 60.0) -> None:
    """files of program and records, session → executed once it is there, records appended as they come.

    Raises LinkError when nobody brings the program within `patience` s, for an alarm, in its words, and for a program that came to
    its end although the control has left something out in silence.
    """
    until = time.monotonic() + patience
    while not program.exists():
        if time.monotonic() > until:
            raise LinkError(f"--start {program}: there is no such program after {patience:g} s")
        time.sleep(LOOK)
    time.sleep(LOOK)  # whoever copies it has finished
    _carried_out(program, records, session, session.motion())


def attend(folder: Path, records: Path, session: Session, once: bool) -> None:
    """cell, file of the records, session → its programs, each carried out when a command waits for its start; one with `once`.

    A command that waits has said so in its journal, after the person has said yes, and after it has looked how long the file of the
    records is. Raises LinkError as `start`, with `once`; else the control shows it and waits for the next program.
    """
    motion, done = session.motion(), set[tuple[Path, str]]()
    while True:
        for journal, mark in _waiting(folder):
            if (journal, mark) in done:
                continue
            done.add((journal, mark))
            program = _program(folder, mark.split()[-1])
            if program is None:
                session.show(f"a program is waited for, and no file below {folder} is it: {mark}")
                continue
            session.show(f"starts {program}")
            try:
                _carried_out(program, records, session, motion)
            except LinkError as error:
                if once:
                    raise
                session.show(f"{program.name} stopped: {error}")
            if once:
                return
        time.sleep(LOOK)


def waited(folder: Path, session: Session) -> Callable[[Motion, Callable[[bytes], None]], None]:
    """cell, session → what carries out its program that a command waits for. That raises FileNotFoundError while none does."""
    done = set[tuple[Path, str]]()

    def started(motion: Motion, punch: Callable[[bytes], None]) -> None:
        for journal, mark in _waiting(folder):
            program = _program(folder, mark.split()[-1])
            if program is not None and (journal, mark) not in done:
                done.add((journal, mark))
                session.show(f"starts {program}")
                session.run(session.control(punch, motion, program), tape(program))
                return
        raise FileNotFoundError

    return started


def _carried_out(program: Path, records: Path, session: Session, motion: Any) -> None:
    """Runs it once. Raises LinkError as `start`."""
    session.lost.clear()
    with records.open("ab", buffering=0) as out:
        control = session.control(lambda data: _write(out.write, data), motion, program)
        try:
            session.run(control, tape(program))
        except Alarm as alarm:
            session.note("alarm", code=alarm.code, text=alarm.text, detail=alarm.detail)
            raise LinkError(str(alarm)) from None
        except Silence:
            session.note("power", state="off")
            return
    if session.lost:
        raise LinkError(
            f"{program}: it came to its end, but the control has left out, and shows nothing of it: "
            f"{', '.join(dict.fromkeys(session.lost))}. What it needs lies beside the program, or in --stored FILE"
        )


def _waiting(folder: Path) -> Iterator[tuple[Path, str]]:
    """cell → journal and "time hash" of each program that a command waits for now: it has not begun, and nobody has given up."""
    for journal in folder.rglob("*.journal"):
        try:
            if time.time() - journal.stat().st_mtime > WAITS:
                continue
            lines = journal.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:  # it was set aside meanwhile
            continue
        waits = ""
        for line in lines:
            try:
                entry = json.loads(line.partition(" ")[2])
            except ValueError:  # half a line
                continue
            if entry.get("kind") == "segment":
                waits = f"{entry.get('utc')} {entry.get('program_hash')}"
            elif entry.get("kind") in ("begun", "end"):
                waits = ""
        if waits:
            yield journal, waits


def _program(folder: Path, mark: str) -> Path | None:
    """cell, hash of a program → its file; None where the cell has no such program."""
    text = f"PROGRAM {mark} ".encode()
    files = (file for file in folder.rglob("*") if file.is_file() and file.suffix not in (".journal", ".csv", ".json"))
    return next((file for file in files if text in file.read_bytes()), None)


def _write(out: Callable[[bytes], object], data: bytes) -> None:
    """bytes → in the file in two pieces, as a disk cache may write them."""
    half = len(data) // 2
    for piece in (data[:half], data[half:]):
        out(piece)
