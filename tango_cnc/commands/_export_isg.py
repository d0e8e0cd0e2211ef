"""A night as an Etalon file, which ISG kernels read: the errors of the machine, estimated from the readings of that night."""

from __future__ import annotations

from pathlib import Path

from ..compensate import propose
from ..estimate import estimate
from ..files import read_cell, read_readings_text, write_text
from ..history import History
from ..records import InputError

TARGET = "etalon"


def full_night(history: History, machine: str) -> int:
    """history, machine → entry of its last full night with all touches: a check alone tells few errors. Raises InputError."""
    found = next((n for n in history.nights(machine) if n.kind == "full" and n.status == "complete"), None)
    if found is None:
        raise InputError(f"{machine}: no full night is complete yet; allowed: one night by its date or entry, with --night")
    return found.entry


def write(history: History, folder: Path, file: Path, entry: int) -> None:
    """history, folder of the cell, file, entry of a night → written. Raises InputError without readings, or for another machine."""
    cell, stored = read_cell(folder), history.night(entry)
    if cell.machine.name != stored.night.machine:
        raise InputError(
            f"{folder}: its machine is {cell.machine.name!r} and the night is of {stored.night.machine!r}; name its cell with -C"
        )
    if stored.readings is None:
        raise InputError(
            f"night {stored.night.night}: it has no readings; allowed: a night that measured, see 'tango history list'"
        )
    readings = read_readings_text(stored.readings, cell.machine, cell.artefact)
    proposal = propose(estimate(cell.machine, cell.artefact, readings, cell.terms), TARGET)
    (text,) = proposal.files.values()
    write_text(file, text)
