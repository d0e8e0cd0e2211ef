"""Old cells → nights: what was measured before there was a history."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from ..files import read_cell, read_readings
from ..files.checked import complaint
from ..files.nightly import Nightly, read_nightly
from ..files.origin import FEW, by_no_machine, edited_rows, look_up, other_machine, read_origin
from ..files.readjson import read_json
from ..history import History
from ..nightly import Measured, Ports, PreflightPoint, night
from ..plan import plan
from ..records import Cell, InputError, Readings
from ._cell_nights import nights_of
from ._simulated_nights import Folder, Nobody, Time


class _Old:
    """A run that was made long ago."""

    def __init__(self, cell: Cell, readings: Readings, text: str, origin: dict[str, Any], clock: Time) -> None:
        self._cell, self._readings, self._text, self._origin, self._clock = cell, readings, text, origin, clock

    def preflight(self, kind: str, touches: Sequence[int]) -> Sequence[PreflightPoint]:
        """→ nothing is asked of a machine."""
        return (PreflightPoint("import", True, f"readings of {self._cell.folder}"),)

    def measure(self, kind: str, touches: Sequence[int]) -> Measured:
        """→ the readings that there are."""
        hashes = tuple((key, str(self._origin.get(f"{key}_hash", ""))) for key in ("plan", "program"))
        seconds = float(self._readings.time.max() - self._readings.time.min())
        self._clock.moment += timedelta(seconds=round(seconds))
        made_up = bool(self._origin.get("simulated"))
        return Measured(self._readings, self._text, len(self._readings), seconds, "", hashes, simulated=made_up)


def _begun(file: Path, stamp: object) -> datetime | None:
    """readings.json, its `start_utc` → that time, None where there is none. Raises InputError for what is no time."""
    if not stamp:
        return None
    try:
        return datetime.fromisoformat(str(stamp)).astimezone(UTC)
    except (ValueError, OverflowError):
        raise complaint(file, None, "start_utc", repr(stamp), "a time such as 2026-05-01T06:00:00Z") from None


def _sound(file: Path, folder: Path) -> None:
    """readings.csv, its cell → nothing. Raises InputError for readings of another machine, and for edited rows."""
    origin = look_up(file)
    if named := other_machine(origin, folder):
        then, now = named
        raise InputError(
            f"{file}: found readings of the machine {then!r}; allowed: those of {now!r}, the machine of this cell. Nothing was "
            "added. If it is one machine with a new name: --despite"
        )
    lines, gone = edited_rows(origin)
    if lines or gone:
        listed = f" (lines {', '.join(map(str, lines[:FEW]))}{' …' if len(lines) > FEW else ''})" if lines else ""
        raise InputError(
            f"{file}: found {len(lines)} rows that are not as they were written{listed}, and {gone} that are gone; allowed: "
            "readings as the run wrote them. Nothing was added; --despite takes them"
        )


def imported(history: History, folders: Sequence[Path], home: Path, despite: bool = False) -> Iterator[tuple[Path, dict[str, Any]]]:
    """history, cells with readings.csv, folder of the cell that goes on with them → (cell, record of the night), oldest first.

    The night is one of `home`, where that is a cell: its owner, and where its alarms are answered. `despite`: also readings of
    another machine, and such as somebody has edited. Raises InputError before anything is added.
    """
    own, quiet = read_nightly(home), Nightly(free_mb=0.0, full_every_days=1e-6)
    found = []
    for folder in folders:
        cell = read_cell(folder)
        file = folder / "readings.csv"
        readings = read_readings(file, cell.machine, cell.artefact)
        beside = file.with_suffix(".json")
        origin = read_json(beside, "what 'tango run' wrote") if beside.exists() else {}
        when = _begun(beside, origin.get("start_utc")) or datetime.fromtimestamp(file.stat().st_mtime, UTC)
        if not despite:
            _sound(file, folder)
        if by_no_machine(read_origin(file) or {}):
            origin = {**origin, "simulated": True}
        found.append((when, cell, readings, file.read_text(encoding="utf-8"), origin))
    found.sort(key=lambda item: item[0])
    for when, cell, *_ in found:
        known = history.nights(cell.machine.name) if cell.machine.name in history.machines() else ()
        if any(n.start_utc == when.strftime("%Y-%m-%dT%H:%M:%SZ") for n in known):
            raise InputError(f"{cell.folder}: its run of {when:%Y-%m-%d %H:%M} UTC is in the history already; nothing was added")
    for when, cell, readings, text, origin in found:
        kept = {key: getattr(own, key) for key in ("diagnose", "owner", "volume_std_um", "every_days", "limits")}
        settings = replace(quiet, **kept)
        analysis, clock = replace(nights_of(cell, settings, plan(cell)), old=True), Time(when.astimezone())
        old, nothing = _Old(cell, readings, text, origin, clock), Folder(lambda stamp, name, text: None)
        world = Ports(clock, nothing, old, Nobody(), history, analysis, nullcontext())
        answered = home if (home / "tango.yaml").exists() else cell.folder
        none_missed = replace(settings, every_days=1e6)
        yield cell.folder, night(cell.machine.name, str(answered.resolve()), none_missed, world)
