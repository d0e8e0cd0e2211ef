"""A control that prints into a TCP connection: Ethernet DPRNT. Its program came by other ways; somebody starts it.

The records go out as the printing of the language makes them. What comes in is read and thrown away, but put down in the ledger.
"""

from __future__ import annotations

import threading
import time

from ..languages import Alarm, Silence
from ..lines import Closed, Line
from ..session import Session
from . import Talk

LOOK = 0.1  # s between two looks for the program
PATIENCE = 60.0  # s for which somebody waits for it


def serve(line: Line, session: Session, once: bool) -> None:
    """line, session → the stored program runs as soon as it is there, once a connection; the line stays open afterwards.

    Raises Closed when the other side hangs up.
    """
    ended = threading.Event()
    threading.Thread(target=_run, args=(line, session, ended), daemon=True).start()
    try:
        while not (once and ended.is_set()):
            session.received(len(line.receive(LOOK)))
    finally:
        ended.set()  # who has hung up hears no program that is started later: it is for the next connection


def _run(line: Line, session: Session, ended: threading.Event) -> None:
    motion, until = session.motion(), time.monotonic() + PATIENCE
    try:
        while time.monotonic() < until and not ended.is_set():
            try:
                assert session.resident is not None
                session.resident(motion, line.send)
                return
            except FileNotFoundError:
                time.sleep(LOOK)
    except Alarm as alarm:
        session.note("alarm", code=alarm.code, text=alarm.text, detail=alarm.detail)
        session.show(str(alarm))
    except Silence:
        session.note("power", state="off")
    except Closed:
        pass
    finally:
        ended.set()


TALK = Talk(serve, stored=True)
