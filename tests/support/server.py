"""A server for tests: a folder of cells with thirty invented nights, and an application that is called without a network."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from support.nights import into, thirty
from tango_cnc.history import opened
from tango_cnc.link.entries import End, ProgramSent, Reading, StartMark
from tango_cnc.link.journal import Journal
from tango_cnc.link.lock import holding

EXAMPLE = Path(__file__).parents[2] / "examples" / "hu40t"
GOOD, BAD = "Elm", "Ash"  # machines whose histories can be read, and not
PASSWORD = "correct horse battery"
RHYTHM = "nightly: 1\nstale_days: 100000\n"  # invented nights have fixed dates: they answer on whatever day they are looked at


def cell(folder: Path, name: str = "HU40T-like", records: Sequence[dict[str, Any]] | None = None) -> Path:
    """folder, name of the machine, nights (default: thirty) → a cell with a history."""
    folder.mkdir(parents=True)
    for file in EXAMPLE.glob("*.yaml"):
        shutil.copy(file, folder / file.name)
    text = (folder / "machine.yaml").read_text(encoding="utf-8")
    quoted = name.replace("'", "''")
    (folder / "machine.yaml").write_text(text.replace("name: HU40T-like", f"name: '{quoted}'"), encoding="utf-8")
    (folder / "nightly.yaml").write_text(RHYTHM, encoding="utf-8")
    (folder / "history.db").write_bytes(_history(pickle.dumps(thirty(name) if records is None else records)))
    return folder


@cache
def _history(records: bytes) -> bytes:
    """nights, pickled → the file of a history that holds them: many tests begin with the same ones."""
    with TemporaryDirectory() as place:
        file = Path(place) / "history.db"
        with opened(file) as history:
            into(history, pickle.loads(records))
        return file.read_bytes()


class Recorded:
    """A run that writes its journal while it is looked at."""

    def __init__(self, folder: Path, touches: int = 393, simulated: bool = False, expected: float | None = None) -> None:
        self.journal = Journal(folder / "readings.journal")
        numbers = tuple(range(1, touches + 1))
        controller = {"post": "fanuc", "port": "x"} | ({"simulated": "yes"} if simulated else {})
        head = ProgramSent("2026-11-23T06:00:00.000+00:00", "0", "M", controller, "p", "3F02A91C77D0", numbers, expected_s=expected)
        self.journal.add(head)
        self.made = 0
        self._held = holding(folder, "tango run")

    def begin(self) -> None:
        self._held.__enter__()
        self.journal.add(StartMark("2026-11-23T06:00:01.000+00:00", 0.0))

    def touch(self, facet: str = "3", status: str = "ok", deviation: float | None = 12.5, drift: float | None = None) -> None:
        self.made += 1
        zero, still = (0.0,) * 6, (0,) * 6
        self.journal.add(Reading(self.made, facet, zero, 4.0 * self.made, status, deviation, drift, still, "P"))

    def end(self, complete: bool = True, why: str = "end mark") -> None:
        self.journal.add(End(complete, why, "2026-11-23T06:30:00.000+00:00"))
        self.gone()

    def gone(self) -> None:
        """Nobody is at work in the cell any more: the run ended, or its program was killed."""
        self._held.__exit__(None, None, None)


def asks(place: Path, more: str = "") -> Path:
    """folder → the same cell, whose alarms are asked of Ann."""
    file = place / "nightly.yaml"
    file.write_text(f"{file.read_text(encoding='utf-8')}owner: Ann Meier, 4711\n{more}", encoding="utf-8")
    return place
