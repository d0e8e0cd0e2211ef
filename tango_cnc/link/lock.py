"""One writer a cell: who measures in a folder holds it, and whoever comes second reads who that is.

The lock is one that the system keeps (flock, on Windows a locked byte). It ends with its process, however that ends, so the
file that a killed program leaves locks nothing. Its text names the holder. Where a file system keeps no locks, or does not show
them to other computers, the text decides: a process of this computer that is gone holds nothing, even where another one has its
number by now (`born`); of another computer only the person who knows can tell.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import socket
import stat
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from ..files.readjson import parse_json
from ..files.shape import misfit
from ..nearest import printable
from ..records import LinkError
from .entries import End, Reading, StartMark
from .process import alive, born

NAME = ".tango.lock"
ME = secrets.token_hex(8)  # this process; the system gives its number to another one some day
JOURNAL = "readings.journal"
TAIL = 1 << 14  # bytes in which the last entry stands
OVER = 24 * 3600.0  # s after which no program of touches is executed any more
BEYOND = 1 << 30  # on Windows a locked byte cannot be read: one far beyond the text
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # a file system without locks
HOLDER = {"what": str, "pid": int, "host": str, "since": str, "process": str, "thread": int, "born?": str}
LONGEST = 2000  # bytes that are read of a lock
# Of how a lock is opened: no link is followed, a pipe is not waited for, Windows changes no byte.
PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
NOTHING = "Nothing was started"


@dataclass(frozen=True)
class Holder:
    """Who holds a folder: the text of its lock."""

    what: str
    pid: int
    host: str
    since: str  # UTC
    process: str
    thread: int
    born: str = ""  # when the process began; '' in locks of older versions, and where nobody can say

    def here(self) -> bool:
        """→ whether it is this thread itself."""
        return (self.process, self.pid, self.thread) == (ME, os.getpid(), threading.get_ident())

    def gone(self) -> bool:
        """→ whether it was a process of this computer that is at work no more."""
        return self.host == socket.gethostname() and not alive(self.pid, self.born)

    def named(self) -> str:
        """→ for people."""
        what, host, since = (printable(text, 200) for text in (self.what, self.host, self.since))
        return f"{what!r} (process {self.pid} on {host}, since {since})"


class HeldError(LinkError):
    """Another program is at work in the folder; `holder` names it: nothing was begun."""

    def __init__(self, text: str, holder: str) -> None:
        super().__init__(text)
        self.holder = holder


@contextlib.contextmanager
def holding(folder: Path, what: str) -> Iterator[None]:
    """folder of a cell, what is done there ('tango run') → until the block ends, nothing else that holds the folder can begin.

    The thread that holds a folder may hold it again. Raises HeldError that names the holder, LinkError that says why the folder
    cannot be locked; nothing has been changed then.
    """
    file = folder / NAME
    try:
        handle = _taken(file, what)
    except OSError as error:
        raise LinkError(f"{folder}: the folder cannot be locked ({error.strerror}); nothing was started") from None
    try:
        yield
    finally:
        if handle is not None:
            _released(file, handle)


def at_work(folder: Path) -> str:
    """folder of a cell → who is at work there, by the text of its lock; '' for nobody. Nothing is locked, so nobody is kept out.

    Of another computer nobody knows here whether its program still runs: it is taken to.
    """
    try:
        handle = os.open(folder / NAME, os.O_RDONLY | PLAIN)
    except OSError:
        return ""
    try:
        holder = _holder(handle) if stat.S_ISREG(os.fstat(handle).st_mode) else None
    finally:
        os.close(handle)
    if holder is None or holder.gone():
        return ""
    return holder.named()


def cut_off(folder: Path) -> list[str]:
    """folder of a cell → stamps of nights that were begun and have not ended while nobody is at work there any more.

    A power cut or a kill leaves their mark, and nothing else says so before the next night.
    """
    stamps = begun(folder)
    return stamps if stamps and not at_work(folder) else []


def begun(folder: Path) -> list[str]:
    """folder of a cell → stamps of nights that have begun and are not on record yet, in their order."""
    try:
        return sorted(f.name for f in (folder / "nights" / "begun").iterdir() if not f.name.startswith("."))
    except OSError:
        return []


def ended(folder: Path, stamps: Sequence[str]) -> dict[str, str]:
    """folder of a cell, stamps of nights with the mark of one at work → {stamp: how it ended} of those that did end.

    `waiting`: its record is beside its readings until the history takes it. `unsent`: nothing had been sent to the control, as a
    night writes down what it is to touch, or a warm-up, before that. A disk that is full refuses a night there.
    """
    nights, left, found = folder / "nights", ("planned.json", "readings*", "warm-up*"), {}
    for stamp in stamps:
        if (nights / stamp / "unkept.json").is_file():
            found[stamp] = "waiting"
        elif not any(next((nights / stamp).glob(name), None) for name in left):
            found[stamp] = "unsent"
    return found


def broken_off(folder: Path) -> float | None:
    """folder of a cell → when its last run broke off, s since 1970, where the control may still execute the program; else None.

    That is: its newest journal (of `--readings` besides), of the last day, ends with a touch, the beginning, or an end that is not
    complete and for which the control has not said that its program is over; nobody is at work there; and no night has measured
    since.
    """
    try:
        found = [(file.stat().st_mtime, file) for file in folder.glob("*.journal") if file.is_file()]
        at, last = max(found, default=(0.0, folder / JOURNAL))
        if not 0 <= time.time() - at < OVER or not _goes_on(last) or at_work(folder):
            return None
        later = (f.stat().st_mtime for f in (folder / "nights").glob("*/readings*.csv"))
        return None if any(measured > at for measured in later) else at
    except OSError:
        return None


def newest_run(folder: Path) -> Path:
    """folder of a cell → journal of its last run, under any name of its readings; readings.journal before the first run."""
    own = (f for f in folder.glob("*.journal") if "." not in f.stem and not f.stem.startswith("commission"))
    return max(own, key=lambda f: f.stat().st_mtime, default=folder / JOURNAL)


def _goes_on(journal: Path) -> bool:
    """journal → whether by its last entry the program was begun and is not known to be over."""
    with journal.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL))
        lines = file.read().split(b"\n")
    found = []
    for line in lines:
        try:
            entry = parse_json(line.partition(b" ")[2].decode(), finite=False)
        except ValueError:  # the first is cut where the tail begins, the last where a plug was pulled
            continue
        found += [entry] if isinstance(entry, dict) else []
    if not any(entry.get("kind") in (StartMark.kind, Reading.kind) for entry in found):
        return False
    last = found[-1]
    return last.get("kind") != End.kind or not (last.get("complete") or last.get("stands"))


def lock(handle: int) -> None:
    """open file → locked until it is closed. Raises OSError: another program has locked it, or the file system has no locks."""
    if os.name == "posix":
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    else:
        import msvcrt

        os.lseek(handle, BEYOND, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]
        os.lseek(handle, 0, os.SEEK_SET)


def _taken(file: Path, what: str) -> int | None:
    """lock file → its handle, None where this thread holds it already. Raises HeldError where another one does, OSError."""
    while True:
        if file.is_symlink():
            raise LinkError(f"{file}: found a link to another file, which a lock would overwrite; delete the link. {NOTHING}")
        handle = os.open(file, os.O_RDWR | os.O_CREAT | PLAIN, 0o666)
        kept = False
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise LinkError(f"{file}: found a device or a pipe in the place of the lock; move it away. {NOTHING}")
            holder = _held(handle)
            if holder is not None and holder.here():
                return None
            if holder is not None:
                raise HeldError(
                    f"{file.parent}: {holder.named()} is at work in this folder; wait until it has ended, or follow it with "
                    f"'tango run --watch'. Only if it runs no more, delete {file}. Nothing was changed",
                    holder.named(),
                )
            if _still(file, handle):  # else its last holder has deleted it between open and lock
                _name(handle, what)
                kept = True
                return handle
        finally:
            if not kept:
                os.close(handle)


def _held(handle: int) -> Holder | None:
    """open lock file → its holder; None: nobody else has it, and it is locked now. Raises OSError."""
    locked = True
    try:
        lock(handle)
    except OSError as error:
        if error.errno not in NO_LOCKS:
            return _holder(handle) or Holder("another program", 0, "this or another computer", "unknown", "", 0)
        locked = False
    holder = _holder(handle)
    if holder is None or (locked and holder.host == socket.gethostname()) or holder.gone():
        return None
    return holder


def _holder(handle: int) -> Holder | None:
    """open lock file → whom its text names; None where a program stopped before it had written one."""
    os.lseek(handle, 0, os.SEEK_SET)
    try:
        found = json.loads(os.read(handle, LONGEST))
    except (ValueError, RecursionError):
        return None
    if misfit(found, HOLDER):
        return None
    return Holder(**{key: found[key] for key in HOLDER if not key.endswith("?")}, born=found.get("born") or "")


def _name(handle: int, what: str) -> None:
    since = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    holder = Holder(what, os.getpid(), socket.gethostname(), since, ME, threading.get_ident(), born(os.getpid()))
    os.ftruncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, json.dumps(asdict(holder)).encode())


def _still(file: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.stat(file), os.fstat(handle))
    except FileNotFoundError:
        return False


def _released(file: Path, handle: int) -> None:
    """The file goes while it is locked; Windows deletes no open file, and deletes none that somebody has opened since."""
    with contextlib.suppress(OSError):
        if os.name == "posix":
            file.unlink()
    with contextlib.suppress(OSError):
        os.close(handle)
    with contextlib.suppress(OSError):
        if os.name != "posix":
            file.unlink()
