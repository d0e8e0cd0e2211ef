"""How grbl talks: a line ends with LF (or CR), ? is answered at once, everything else when it has been executed.

An alarm is said before any ? is answered with its state, as in grbl, whose main loop writes both.

What the lines mean is `languages/grbl.py`; `--language grbl` gives it settings, without it the control is a grblHAL of all axes.
"""

from __future__ import annotations

import contextlib
import queue
import threading

from ..languages.grbl.control import REALTIME, RESET, Control, switched_on
from ..lines import Closed, Line
from ..session import Session
from . import Talk


def serve(line: Line, session: Session, once: bool) -> None:
    """line, session → served until the line closes; CR and LF both end a line, except where the firmware takes both as one end."""
    if session.device is None:
        known = session.family == "grbl"
        session.device = session.control(lambda data: None) if known else switched_on(session.motion(), session.note)
    control: Control = session.device
    control.motion.lets_go()  # who held the stylus for the program before
    lines: queue.Queue[str] = queue.Queue()
    lock = threading.Lock()
    working, waiting = threading.Event(), list[str]()  # a line is executed; states of an alarm that has not been said yet

    def say(texts: list[str]) -> None:
        line.send("".join(f"{text}\r\n" for text in texts).encode("ascii"))

    def work() -> None:
        with contextlib.suppress(Closed):
            while True:
                text = lines.get()
                working.set()
                answers = control.line(text)
                with lock:
                    say([*answers, *waiting])
                    waiting.clear()
                    working.clear()

    threading.Thread(target=work, daemon=True).start()
    into = Input(control.kind.one_line_end)
    while True:
        data = line.receive(0.05)
        session.received(len(data))
        for byte in data:
            taken = into.take(byte)
            if isinstance(taken, int):
                with lock:
                    answers = control.realtime(taken)
                    if working.is_set() and any(text.startswith("<Alarm") for text in answers):
                        waiting += answers
                    else:
                        say(answers)
            elif taken is not None:
                lines.put(taken)


class Input:
    """Characters as they come → complete lines and real-time characters; what a connection that ends leaves of a line stays."""

    def __init__(self, one_line_end: bool) -> None:
        """whether CR LF is one end of a line, not two → nothing taken yet."""
        self._one, self._text, self._before = one_line_end, bytearray(), 0

    def take(self, byte: int) -> str | int | None:
        """character → the line that it ends, itself when it is a real-time one, else None."""
        if byte in REALTIME:
            if byte == RESET:
                self._text.clear()
            return byte
        if byte not in b"\r\n":
            self._text.append(byte)
            return None
        pair = self._one and not self._text and self._before not in (0, byte)
        self._before = 0 if pair else byte
        line = self._text.decode("latin-1").strip()
        self._text.clear()
        return None if pair else line


TALK = Talk(serve, "grbl+socket://{}", "grbl+serial://{}")
