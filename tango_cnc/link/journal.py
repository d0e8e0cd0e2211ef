"""The journal of a run: one line an entry, on disk before anything else happens.

Each line is the CRC-32 of the JSON after it, the JSON, and a line end; entries are numbered. A line is written in one call
and forced to the disk before `add` returns. A process or a computer that stops in the middle leaves at most one unfinished
last line, which is dropped on reading; damage anywhere else is refused, because nobody can say what it was.
A run is a list of segments: what was measured before and after each `--resume`.
"""

from __future__ import annotations

import contextlib
import json
import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..records import InputError, LinkError

FORMAT = "tango-journal/1"
Entry = Mapping[str, Any]


def _line(entry: Entry) -> bytes:
    text = json.dumps(entry, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    data = text.encode()
    return b"%08x %s\n" % (zlib.crc32(data), data)


def _entry(line: bytes) -> dict[str, Any] | None:
    """line without its end → entry, None when it is damaged."""
    crc, _, data = line.partition(b" ")
    try:
        if len(crc) != 8 or int(crc, 16) != zlib.crc32(data):
            return None
        entry = json.loads(data)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None


def read_journal(file: Path) -> tuple[list[dict[str, Any]], int]:
    """file → (entries, bytes they take; beyond that stands an unfinished line). Raises InputError for damage elsewhere."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); there is no run to resume") from None
    entries: list[dict[str, Any]] = []
    good = 0
    lines = data.split(b"\n")  # the last item is what follows the last line end
    for number, line in enumerate(lines[:-1], 1):
        entry = _entry(line)
        if entry is None or entry.get("n") != len(entries):
            if number == len(lines) - 1 and not lines[-1]:
                break  # a last line whose blocks reached the disk in another order
            raise InputError(
                f"{file}:{number}: a damaged line before the end; allowed: only the last line may be unfinished. Start anew"
            )
        entries.append(entry)
        good += len(line) + 1
    if entries and entries[0].get("format") != FORMAT:
        raise InputError(f"{file}:1: found {entries[0].get('format')!r}; allowed: {FORMAT}. Start anew with this version")
    return entries, good


class Journal:
    """An open journal; only one program may hold it."""

    def __init__(self, file: Path, resume: bool = False) -> None:
        """file, whether to continue it → open journal. Raises LinkError when it is in use or cannot be written."""
        self.file = file
        flags = os.O_WRONLY | os.O_APPEND | (0 if resume else os.O_CREAT | os.O_EXCL) | getattr(os, "O_BINARY", 0)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(file, flags, 0o644)
        except OSError as error:
            raise LinkError(f"{file}: the journal cannot be written ({error.strerror}); nothing was started") from None
        try:
            _lock(self._handle)
            self.entries, good = read_journal(file) if resume else ([], 0)
            if resume:
                os.ftruncate(self._handle, good)
                os.fsync(self._handle)
            else:
                _sync_folder(file.parent)
                self.add("journal", format=FORMAT)
        except OSError as error:
            self.close()
            raise LinkError(f"{file}: {error.strerror}; is another 'tango run' using it? Nothing was started") from None
        except BaseException:
            self.close()
            raise

    def add(self, kind: str, **values: Any) -> dict[str, Any]:
        """what happened → the entry, which is on disk when this returns. Raises LinkError when the disk refuses."""
        entry = {"n": len(self.entries), "kind": kind, **values}
        line = _line(entry)
        try:
            if os.write(self._handle, line) != len(line):
                raise OSError(28, os.strerror(28))
            os.fsync(self._handle)
        except OSError as error:
            raise LinkError(f"{self.file}: the reading cannot be stored ({error.strerror}); the run was stopped") from None
        self.entries.append(entry)
        return entry

    def close(self) -> None:
        """Lets go of the file."""
        with contextlib.suppress(OSError):
            os.close(self._handle)


def _lock(handle: int) -> None:
    """Raises OSError when another program holds the file."""
    if os.name == "posix":
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    else:
        import msvcrt

        os.lseek(handle, 1 << 30, os.SEEK_SET)  # far behind the text, which others may read
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]


def _sync_folder(folder: Path) -> None:
    """Makes the name of a new file survive a power cut."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
