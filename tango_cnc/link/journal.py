"""The journal of a run: one line an entry, on disk before anything else happens.

Each line is the CRC-32 of the JSON after it, the JSON, and a line end. Entries are numbered, and each has the hash of the line
before it: a line that was changed, taken out or put in shows, even where somebody has made its CRC anew. A line is written in
one call and forced to the disk before `add` returns. A process or a computer that stops in the middle leaves at most one
unfinished last line, which is dropped on reading; damage anywhere else is refused, because nobody can say what it was.
A run is a list of segments: what was measured before and after each `--resume`.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shlex
import stat
import zlib
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..files import checked
from ..files.readjson import parse_json
from ..records import InputError, LinkError
from .entries import Entry, Opened, Reading, entry_of, plain
from .lock import lock
from .trust import FARTHEST

FORMAT = "tango-journal/1"
LONGEST = 1 << 20  # bytes of one line; a program of ten thousand touches has an entry of 60 000
MOST = 1 << 28  # bytes of a journal: a million touches
RETURNS = "its lines end in CR LF: another program has saved it, or it was copied as text"
HASH = 32  # hexadecimal digits of SHA-256


@dataclass(frozen=True)
class JournalLine:
    """One line of a journal: its entry, its number in the file, and what is wrong with it, '' for nothing."""

    number: int
    entry: Entry | None
    wrong: str
    digest: str
    size: int
    chained: bool = False  # whether this line or one before it has the hash of the line before
    before: str = ""  # the hash of the line before, as it says


@dataclass(frozen=True)
class Found:
    """A journal as it is on disk; `unfinished`: bytes of a last line that was never finished."""

    lines: tuple[JournalLine, ...]
    unfinished: int
    returns: bool = False  # whether another program has ended its lines with CR LF; they are read all the same

    @property
    def wrong(self) -> JournalLine | None:
        """→ the first line that is damaged or was changed."""
        return next((line for line in self.lines if line.wrong), None)


@dataclass(frozen=True)
class ReadSoFar:
    """A journal as far as it was read: whole entries, the bytes they take, how its lines go on, and which file it was."""

    entries: tuple[Entry, ...] = ()
    size: int = 0
    last: int = 0  # bytes of the last line
    digest: str = ""  # of the last line
    chained: bool = False
    file: tuple[int, int] = (0, 0)


def digest_of(line: bytes) -> str:
    """line without its end → its hash."""
    return hashlib.sha256(line).hexdigest()[:HASH]


def _line(data: dict[str, Any]) -> bytes:
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _read(line: bytes) -> tuple[dict[str, Any], Entry]:
    """line without its end → its data, its entry. Raises ValueError: what is wrong with it."""
    crc, _, data = line.partition(b" ")
    try:
        intact = len(line) <= LONGEST and len(crc) == 8 and int(crc, 16) == zlib.crc32(data)
    except ValueError:
        intact = False
    if not intact:
        raise ValueError("a damaged line: its check sum is another one")
    try:
        found = parse_json(data.decode(), finite=False)
    except ValueError:
        raise ValueError("a line that is no JSON") from None
    if not isinstance(found, dict):
        raise ValueError("a line that is no entry")
    return found, entry_of(found)


def look_at(file: Path) -> Found:
    """file → every line of it, good or not. Raises InputError when it cannot be read."""
    data = _bytes(file)[0]
    if b"\r\n" in data:  # JSON has no CR of its own, so none of it is lost
        return replace(_looked_at(data.replace(b"\r\n", b"\n"), ReadSoFar()), returns=True)
    return _looked_at(data, ReadSoFar())


def _looked_at(data: bytes, known: ReadSoFar) -> Found:
    """bytes of a journal, what was read before them → every line of these bytes."""
    *lines, rest = data.split(b"\n")
    found: list[JournalLine] = []
    before, due, chained = known.digest, len(known.entries), known.chained
    for number, line in enumerate(lines, due + 1):
        n, entry, digest, wrong, was = None, None, digest_of(line), "", None
        try:
            plain_, entry = _read(line)
            n, was = plain_.get("n"), plain_.get("before")
            if type(n) is not int or n != due:
                wrong = f"entry {n!r:.20} where entry {due} was due"
            elif number == 1 and plain_.get("format") != FORMAT:
                wrong = f"found {plain_.get('format')!r:.40}; allowed: {FORMAT}"
            elif was is not None or chained:
                chained = True
                if was != before:
                    wrong = f"the hash of line {number - 1} is another one here: that line, or this one, was changed afterwards"
        except ValueError as error:
            wrong = str(error)
        found.append(JournalLine(number, entry, wrong, digest, len(line) + 1, chained, was if isinstance(was, str) else ""))
        before, due = digest, (n if type(n) is int else due) + 1
    if found and found[-1].wrong.startswith("a damaged line") and not rest:  # its blocks reached the disk in another order
        return Found(tuple(found[:-1]), found[-1].size)
    return Found(tuple(found), len(rest))


def salvaged(found: Found) -> tuple[list[Entry], list[int]]:
    """journal → (entries that are whole, numbers of the lines that are left out).

    Where a hash does not fit, the line before was changed, or is damaged by itself: that one is left out, this one is whole.
    No run writes a reading of one touch twice: the one in the chain of hashes counts, else the first. One at a place where no
    machine can be counts never.
    """
    changed = {line.number - 1 for line in found.lines if line.wrong.startswith("the hash of line")}
    entries: list[Entry] = []
    out: list[int] = []
    chosen = chosen_of(found, changed)
    for line in found.lines:
        reading = line.entry if isinstance(line.entry, Reading) else None
        if line.entry is None or line.number in changed or (reading is not None and chosen.get(reading.touch) is not line):
            out.append(line.number)
            continue
        entries.append(line.entry)
    return entries, out


def chosen_of(found: Found, without: Collection[int] = ()) -> dict[int, JournalLine]:
    """journal, numbers of lines that do not count → {touch: the line that has its reading}."""
    named, seen = {line.before for line in found.lines}, {""}
    best: dict[int, tuple[int, JournalLine]] = {}
    for line in found.lines:
        reading = line.entry
        if isinstance(reading, Reading) and line.number not in without and max(map(abs, reading.position), default=0.0) <= FARTHEST:
            rank = 2 * (line.digest in named) + (line.before in seen)  # a later line goes on from it; it goes on from one before
            if reading.touch not in best or rank > best[reading.touch][0]:
                best[reading.touch] = rank, line
        seen.add(line.digest)
    return {touch: line for touch, (_, line) in best.items()}


def _bytes(file: Path, known: ReadSoFar | None = None) -> tuple[bytes, ReadSoFar]:
    """file, what was read of it → the bytes after that, and what was read; from the beginning where it is another file now."""
    try:
        checked.plain(file)
        with file.open("rb") as opened:
            state = os.fstat(opened.fileno())
            if not stat.S_ISREG(state.st_mode) or state.st_size > MOST:
                raise InputError(f"{file}: found a device, or {state.st_size} bytes; allowed: a journal of at most {MOST} bytes")
            which = (state.st_dev, state.st_ino)
            if known is not None and known.file == which and 0 < known.size <= state.st_size:
                opened.seek(known.size - known.last)
                data = opened.read(state.st_size - known.size + known.last)
                if digest_of(data[: known.last - 1]) == known.digest:
                    return data[known.last :], known
                opened.seek(0)
            return opened.read(state.st_size), ReadSoFar(file=which)  # what is asked for is reserved in memory
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); there is no run to resume") from None


def read_journal(file: Path) -> tuple[list[Entry], int]:
    """file → (entries, bytes they take; beyond that is an unfinished line). Raises InputError for damage elsewhere."""
    found = read_on(file)
    return list(found.entries), found.size


def read_on(file: Path, known: ReadSoFar | None = None) -> ReadSoFar:
    """file, what was read of it before → what it holds now; only what is new is read. Raises InputError for damage."""
    data, known = _bytes(file, known)
    found = _looked_at(data, known)
    if (bad := found.wrong) is not None:
        salvage = f"'tango journal salvage {shlex.quote(str(file))}'"
        if b"\r\n" in data and (whole := look_at(file)).returns and whole.wrong is None:
            raise InputError(
                f"{file}: {RETURNS}. Make them LF again (dos2unix {shlex.quote(str(file))}), then --resume goes on; "
                f"{salvage} saves the readings as they are"
            )
        raise InputError(
            f"{file}:{bad.number}: {bad.wrong}. {salvage} saves the readings before and after it; then start anew without --resume"
        )
    if not found.lines:
        return known
    entries = (*known.entries, *(line.entry for line in found.lines if line.entry is not None))
    end = found.lines[-1]
    return ReadSoFar(entries, known.size + sum(line.size for line in found.lines), end.size, end.digest, end.chained, known.file)


class Journal:
    """An open journal; only one program may hold it."""

    def __init__(self, file: Path, resume: bool = False) -> None:
        """file, whether to continue it → open journal. Raises LinkError when it is in use or cannot be written."""
        self.file = file
        self.entries: list[Entry] = []
        self.digest = ""  # of the last line
        self._size, self._broken = 0, ""
        flags = os.O_WRONLY | os.O_APPEND | (0 if resume else os.O_CREAT | os.O_EXCL) | getattr(os, "O_BINARY", 0)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(file, flags, 0o666)
        except OSError as error:
            raise LinkError(f"{file}: the journal cannot be written ({error.strerror}); nothing was started") from None
        try:
            lock(self._handle)
            if resume:
                found = read_on(file)
                self.entries, self._size, self.digest = list(found.entries), found.size, found.digest
                os.ftruncate(self._handle, self._size)
                os.fsync(self._handle)
            else:
                _sync_folder(file.parent)
            if not self.entries:  # new, or cut off before its first line was finished
                self.add(Opened(FORMAT))
        except OSError as error:
            self.close()
            raise LinkError(f"{file}: {error.strerror}; is another 'tango run' using it? Nothing was started") from None
        except BaseException:
            self.close()
            raise

    def add(self, entry: Entry) -> None:
        """what happened → it is on disk when this returns. Raises LinkError when the disk refuses, and from then on."""
        if self._broken:
            raise LinkError(self._broken)
        data = plain(entry)
        line = _line({"n": len(self.entries), "kind": data.pop("kind"), "before": self.digest, **data})
        try:
            if os.write(self._handle, line) != len(line):
                raise OSError(28, os.strerror(28))
            os.fsync(self._handle)
        except OSError as error:
            self._broken = f"{self.file}: the reading cannot be stored ({error.strerror}); the run was stopped"
            with contextlib.suppress(OSError):  # what may stand there of it; else it is the unfinished last line
                os.ftruncate(self._handle, self._size)
            raise LinkError(self._broken) from None
        self.entries.append(entry)
        self.digest = digest_of(line[:-1])
        self._size += len(line)

    def close(self) -> None:
        """Lets go of the file."""
        with contextlib.suppress(OSError):
            os.close(self._handle)


def _sync_folder(folder: Path) -> None:
    """Makes the name of a new file survive a power cut."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
