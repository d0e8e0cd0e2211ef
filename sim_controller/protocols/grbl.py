"""How grbl talks: a line ends with LF (or CR), ? is answered at once, everything else when it has been executed.

What the lines mean is `interpreters/grbl.py`; `--language grbl` gives it settings, without it the control is a grblHAL of all axes.
"""

from __future__ import annotations

import queue
import threading

from ..interpreters.grbl import Control, switched_on
from ..lines import Line
from ..session import Session

TCP, PTY = "grbl+socket://{}", "grbl+serial://{}"


def serve(line: Line, session: Session, once: bool) -> None:
    """line, session → served until the line closes; CR and LF both end a line, except where the firmware takes both as one end."""
    if session.device is None:
        known = session.family == "grbl"
        session.device = session.control(lambda data: None) if known else switched_on(session.motion(), session.note)
    control: Control = session.device
    lines: queue.Queue[str] = queue.Queue()
    lock = threading.Lock()

    def say(texts: list[str]) -> None:
        with lock:
            line.send("".join(f"{text}\r\n" for text in texts).encode("ascii"))

    def work() -> None:
        while True:
            say(control.line(lines.get()))

    threading.Thread(target=work, daemon=True).start()
    text, before = bytearray(), 0
    while True:
        data = line.receive(0.05)
        session.received(len(data))
        for byte in data:
            if byte == ord("?"):
                say(control.report())
            elif byte in b"\r\n":
                pair = control.kind.one_line_end and not text and before and before != byte
                if not pair:
                    lines.put(text.decode("latin-1").strip())
                before = 0 if pair else byte
                text.clear()
            else:
                text.append(byte)
