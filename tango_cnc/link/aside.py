"""Screen and pipes beside a run: a reader that pauses (Ctrl-S, a stopped pager, a full pipe) must not hold the machine up.

Each stream gets a thread of its own that writes what waits in a bounded queue. The run itself never waits for a reader.
Where a system has no such calls (Windows), the streams stay as they are.
"""

from __future__ import annotations

import atexit
import io
import os
import select
import stat
import sys
import threading
import time
from collections import deque
from contextlib import suppress

MOST = 1 << 22  # bytes that wait for a reader: some ten thousand touches; what comes on top is dropped
KEPT = 0.2  # s that a line waits to be seen, so that stdout and stderr keep their order where somebody reads
LAST = 3.0  # s without a byte taken, after which the end of the program waits no longer


class Aside(io.TextIOBase):
    """A text stream over an open file of the system: `write` and `flush` come back at once, whoever reads."""

    def __init__(self, handle: int, encoding: str = "utf-8", errors: str = "replace") -> None:
        self._handle, self._encoding, self._errors = handle, encoding, errors
        self._lines: deque[bytes] = deque()
        self._size, self._taken = 0, 0  # bytes that wait, bytes that a reader took
        self._error: OSError | None = None
        self._stuck = False  # nobody has read for a while: nothing waits for it any more
        self._change = threading.Condition()
        self._thread: threading.Thread | None = None

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """→ how text becomes bytes."""
        return self._encoding

    @property
    def errors(self) -> str:  # type: ignore[override]
        """→ what becomes of a sign that cannot be encoded."""
        return self._errors

    def writable(self) -> bool:
        """→ True."""
        return True

    def isatty(self) -> bool:
        """→ whether it is a terminal."""
        return os.isatty(self._handle)

    def fileno(self) -> int:
        """→ number of the open file."""
        return self._handle

    def write(self, text: str) -> int:
        """text → its length; it is written as soon as somebody reads, or dropped. Raises OSError of a write before, once."""
        data = text.encode(self._encoding, self._errors)
        with self._change:
            if self._error is not None:
                error, self._error = self._error, None
                raise error
            if data and self._size + len(data) <= MOST:
                self._lines.append(data)
                self._size += len(data)
                self._change.notify_all()
            if self._thread is None:  # a daemon: it may stand in a write for ever, and the program ends all the same
                self._thread = threading.Thread(target=self._goes_on, daemon=True)
                self._thread.start()
        return len(text)

    def flush(self) -> None:
        """Waits a moment for the reader; not again until it has read on."""
        with self._change:
            if not self._stuck and not self._change.wait_for(lambda: not self._size, KEPT):
                self._stuck = True

    def drain(self) -> None:
        """Waits until all is written, as long as the reader takes something."""
        with self._change:
            before = -1
            while self._size and self._taken != before:
                before, until = self._taken, time.monotonic() + LAST
                while self._size and self._taken == before and (left := until - time.monotonic()) > 0:
                    self._change.wait(left)

    def _goes_on(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._lines)
                data = self._lines.popleft()
            error = self._written(data)
            with self._change:
                self._error = error or self._error
                self._change.notify_all()

    def _written(self, data: bytes) -> OSError | None:
        """bytes → why they could not be written, None when they are."""
        while data:
            try:
                taken = os.write(self._handle, data)
            except BlockingIOError:  # another program has made this pipe non-blocking
                select.select([], [self._handle], [], 1.0)
                continue
            except OSError as error:
                self._count(len(data))
                return error
            self._count(taken)
            data = data[taken:]
        return None

    def _count(self, taken: int) -> None:
        with self._change:
            self._size -= taken
            self._taken += taken
            self._stuck = False
            self._change.notify_all()


def set_aside() -> None:
    """stdout and stderr of this program, where a reader can pause (a terminal, a pipe) → the same by `Aside` until it ends."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if os.name != "posix" or stream is None or stream is not getattr(sys, f"__{name}__"):
            continue  # a test, or another program, has put a stream of its own there
        with suppress(OSError, ValueError):
            kind = os.fstat(stream.fileno()).st_mode
            if not (stat.S_ISFIFO(kind) or stat.S_ISSOCK(kind) or os.isatty(stream.fileno())):
                continue
            aside = Aside(stream.fileno(), stream.encoding, stream.errors or "replace")
            setattr(sys, name, aside)
            atexit.register(aside.drain)
            stream.flush()
