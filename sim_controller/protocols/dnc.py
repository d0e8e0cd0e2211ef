"""A serial port that reads and punches tape: DC1 asks for the program, DC3 holds it, DPRNT comes back between DC2 and DC4."""

from __future__ import annotations

import threading
import time
from typing import Any

from ..languages import Alarm, Silence
from ..lines import Closed, Line
from ..session import Session
from . import Talk
from ._tape import Tape

DC1, DC3 = 0x11, 0x13
ASK_AGAIN = 1.0  # s after which an operator presses start once more because nothing has come
SILENT_OPERATOR = 0.5  # s without a byte after which the operator has reset an alarm
POLL = 0.02  # s


class _Punch:
    """The sending side: output waits while the other side has sent DC3, flow characters do not."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._allowed = threading.Event()
        self._allowed.set()
        self._lock = threading.Lock()
        self._dead = False

    def obey(self, byte: int) -> None:
        """DC1 or DC3 from the other side."""
        if byte == DC3:
            self._allowed.clear()
        else:
            self._allowed.set()

    def flow(self, byte: int) -> None:
        """DC1 or DC3 → sent."""
        with self._lock:
            self._line.send(bytes([byte]))

    def __call__(self, data: bytes) -> None:
        self._allowed.wait()
        with self._lock:
            if not self._dead:
                self._line.send(data)

    def hang_up(self) -> None:
        """Nothing more is sent; whoever waits goes on."""
        self._dead = True
        self._allowed.set()


def serve(line: Line, session: Session, once: bool) -> None:
    """line, session → programs are received and executed until the line closes, or one of them has ended when `once` is set."""
    punch = _Punch(line)
    control = session.control(punch)
    waiting = b""
    while True:
        tape = Tape(session.buffer, session.counted)
        outcome: list[str] = []
        runner = threading.Thread(target=_execute, args=(control, tape, session, outcome), daemon=True)
        try:
            waiting = _receive(line, punch, tape, session, runner, outcome, waiting)
        except Closed:
            punch.hang_up()
            tape.close()
            if runner.ident is not None:
                runner.join()
            raise
        if outcome == ["silence"]:
            session.note("power", state="off")
            while True:
                line.receive(1.0)
        if once:
            return


def _execute(control: Any, tape: Tape, session: Session, outcome: list[str]) -> None:
    """Runs one tape and puts down how it ended."""
    try:
        session.run(control, tape.lines())
        outcome.append("end")
    except Alarm as alarm:
        session.note("alarm", code=alarm.code, text=alarm.text, detail=alarm.detail)
        session.show(str(alarm))
        outcome.append("alarm")
    except Silence:
        outcome.append("silence")
    except Closed:
        outcome.append("closed")
    except Exception as error:  # a fault of the simulator itself must not look like a control that is still at work
        session.note("alarm", code="SYS", text="SYSTEM ALARM", detail=repr(error))
        session.show(f"SYSTEM ALARM: the simulator failed: {error!r}")
        outcome.append("alarm")


def _receive(
    line: Line, punch: _Punch, tape: Tape, session: Session, runner: threading.Thread, outcome: list[str], data: bytes
) -> bytes:
    """Feeds one tape and minds the flow until its program has ended; → what came behind it. After an alarm that is thrown away."""
    held = False
    asked = time.monotonic() - ASK_AGAIN
    quiet_since = time.monotonic()
    behind = b""
    while not outcome or (outcome == ["alarm"] and time.monotonic() - quiet_since < SILENT_OPERATOR):
        now = time.monotonic()
        if not tape.begun and not outcome and now - asked >= ASK_AGAIN:
            punch.flow(DC1)
            asked = now
        data = data or line.receive(POLL)
        if data:
            quiet_since = now
            session.received(len(data))
        for byte in data:
            if byte in (DC1, DC3):
                punch.obey(byte)
        behind += tape.put(bytes(byte for byte in data if byte not in (DC1, DC3)))
        data = b""
        if tape.begun and runner.ident is None:
            runner.start()
        if held and (tape.wants_more or outcome):
            held = False
            punch.flow(DC1)
        elif not held and tape.wants_pause and not outcome:
            held = True
            punch.flow(DC3)
            session.note("flow", code="DC3")
    if runner.ident is not None:
        runner.join()
    return b"" if "alarm" in outcome else behind


TALK = Talk(serve)
