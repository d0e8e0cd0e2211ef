"""Who says at this computer that nothing moves."""

from __future__ import annotations

import contextlib
import os
import queue
import sys
import threading


class Person:
    """Somebody at this computer who presses Enter. Each time is asked for anew: what was typed before it does not count."""

    def __init__(self) -> None:
        self._said: queue.SimpleQueue[bool] | None = None

    def asked(self, timeout: float) -> bool | None:
        """s to wait → True: Enter was pressed; False: there is nobody; None: not yet."""
        if self._said is None:
            self._said = queue.SimpleQueue()
            threading.Thread(target=self._wait, args=(self._said,), daemon=True).start()
        with contextlib.suppress(queue.Empty):
            answer = self._said.get(timeout=max(timeout, 0.001))
            self._said = None
            return answer
        return None

    @staticmethod
    def _wait(said: queue.SimpleQueue[bool]) -> None:
        try:
            _forget_typed()
            said.put(bool(sys.stdin.readline()))
        except (AttributeError, OSError, ValueError):  # no standard input, or it was closed
            said.put(False)


def _forget_typed() -> None:
    """What was typed on the terminal up to now is not an answer."""
    if not sys.stdin.isatty():
        return
    if os.name == "nt":
        import msvcrt

        while msvcrt.kbhit():  # type: ignore[attr-defined, unused-ignore]
            msvcrt.getwch()  # type: ignore[attr-defined, unused-ignore]
        return
    with contextlib.suppress(ImportError):
        import termios

        termios.tcflush(sys.stdin, termios.TCIFLUSH)
