"""What pages have read and computed, kept as long as it holds: for seconds, until a file differs, until something is written."""

from __future__ import annotations

import contextlib
import os
import threading
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, cast

from ..history import History
from .served import Served

FRESH = 5.0  # s that what was read of a history is taken for new
AGAIN = 60.0  # s after which a history is asked again although its file is the same
SELDOM = 900.0  # s after which that is done for what no clock changes, or whose key has the day and who is late
MOST = 2000  # things that are kept
STATED = "stated "  # of each machine, by its slug: what nightly.yaml says
Stamp = tuple[int, ...]  # of a file: when it was changed, how large it is
T = TypeVar("T")


class Remembered:
    """Answers by their questions. `where`: by history, its file or URL."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock, self.where = clock, dict[int, str]()
        self._kept: dict[str, tuple[float, Any]] = {}
        self._lock, self._locks = threading.RLock(), dict[str, threading.RLock]()
        self._asked: dict[tuple[int, str], tuple[Stamp, float, Any]] = {}  # of histories that are files
        self._of: dict[str, tuple[object, Any]] = {}  # of single machines: end of the chain, what it says
        self._early: dict[int, float] = {}  # by thread: s by which it asks early

    @contextlib.contextmanager
    def early(self, seconds: float) -> Iterator[None]:
        """s → inside, this thread asks histories again what another would have to ask within that time."""
        self._early[threading.get_ident()] = seconds
        try:
            yield
        finally:
            del self._early[threading.get_ident()]

    def kept(self, key: str, make: Callable[[], T], fresh: float = FRESH) -> T:
        """key, how to compute → the value of at most `fresh` seconds ago; one thread computes it, the others wait for it."""
        with self._lock:
            own = self._locks.setdefault(key, threading.RLock())
        with own:
            at, value = self._kept.get(key, (-1e9, None))
            if self.clock() - at <= fresh:
                return value
            value = make()
            with self._lock:
                self._kept[key] = (self.clock(), value)
                for old in list(self._kept)[: max(0, len(self._kept) - MOST)]:
                    self._kept.pop(old)
                    self._locks.pop(old, None)
            return value

    def forget(self, history: History | None = None) -> None:
        """history in which something was decided (None: in any) → what was read is read anew, of others once their files differ."""
        with self._lock:
            self._kept = {k: known for k, known in self._kept.items() if k.startswith(STATED)}
            self._asked = {k: known for k, known in self._asked.items() if history is not None and k[0] != id(history)}

    def asked(self, history: History, what: str, make: Callable[[], T], again: float = AGAIN) -> T:
        """history, name of a question, how to ask it → the answer; that of before while the file of the history has not changed.

        A list of 200 machines, each with a history of its own, would ask 200 databases at every look. Late is a matter of the
        clock, so each question is asked again after one to two times `again` (s), not all of them at once. Of a thread that asks
        `early` that time is shorter.
        """
        stamp = self._stamp(history)
        key, now = (id(history), what), self.clock()
        known = self._asked.get(key)
        if stamp and known is not None and known[0] == stamp and now + self._early.get(threading.get_ident(), 0.0) < known[1]:
            return cast("T", known[2])
        answer = make()
        self._asked[key] = (stamp, now + again * (1 + zlib.crc32(str(key).encode()) % 100 / 100), answer)
        return answer

    def written(self, history: History, machine: str) -> object:
        """history, name of a machine → what differs once something is written of it: the end of its chain, and where the history
        has no other machine its file, which need not be opened for that.
        """
        stamp = self._stamp(history)
        if stamp and len(self.asked(history, "machines", history.machines, SELDOM)) < 2:
            return stamp
        return self.heads(history).get(machine)

    def heads(self, history: History) -> Mapping[str, object]:
        """history → {machine: end of its chain}."""
        if self._stamp(history):
            return self.asked(history, "heads", history.newest_hashes, SELDOM)
        return self.kept(f"heads {id(history)}", history.newest_hashes)

    def of_machine(self, machine: Served, what: str, make: Callable[[], T]) -> T:
        """machine, name of what its history says of it, how to read that → the same until something is written of the machine."""
        key = f"of {machine.slug} {what}"
        head = None if machine.history is None else self.written(machine.history, machine.name)
        known = self._of.get(key)
        if known is None or known[0] != head:
            known = self._of[key] = head, make()  # the head is older than what was read, never newer
        return cast("T", known[1])

    def _stamp(self, history: History) -> Stamp:
        """history → what its file and its log look like; empty for one on a server, which is asked every time."""
        where = self.where.get(id(history), "://")
        return () if "://" in where else (*looks_of(where), *looks_of(f"{where}-wal"))


def looks_of(name: str) -> tuple[int, int]:
    """file → time of its last change and its size; zeros for a file that does not exist."""
    try:
        stat = os.stat(name)
    except OSError:
        return 0, 0
    return stat.st_mtime_ns, stat.st_size


def file_of(name: str) -> tuple[int, int] | None:
    """name of a file → which file it is (device, number on it): another one may get its name; None for none, and for a URL."""
    try:
        stat = os.stat(name)
    except OSError:
        return None
    return stat.st_dev, stat.st_ino
