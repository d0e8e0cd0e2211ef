"""A Heidenhain control over LSV2: the program goes to its disk and is compared; the record file is fetched while nothing moves.

    { somebody says it stands } ─ open ─ { put, read back, the same } ─ the person starts it ┐
    ┌────────────────────────────────────────────────────────────────────────────────────────┘
    └▶ somebody says it stands ─ look ─ records ─ end mark ─▶ done

`lsv2://host/TNC:/TANGO.TXT`. There are reports of controls (iTNC 530) that stopped when they were spoken to while they moved. So
this computer connects only when somebody presses Enter: the program has come to its end, or stands. Where the control tells
the state of its program (option DNC), it is asked first, and nothing is read while the program runs. Nothing is started from here.

The lines between this client and the transport are requests and answers in words; an answer begins with the byte 1:

    still             STILL, or NOBODY: who could say it is not there
    open              OPEN TNC640%20340595%2008       what the control calls itself; where the record file ends is noted
    put 4F38…         PUT <SHA-256 of what was read back>
    look              <new whole lines> LOOK
                      RUNS                            its program runs: nothing was asked for
                      ! why                           it cannot be reached, or refuses
                      WRONG why                       a login or a place with which no run can ever be made
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from urllib.parse import unquote

from ..client import Asked, Begun, Event, Identified, Task
from . import file

OPTIONS: Mapping[str, tuple[str, ...]] = {
    **file.OPTIONS,
    "program": (),  # where the program goes
    "password": (),  # of the logins INSPECT and FILE, where the control asks for one
}
SCHEMES: Mapping[str, str] = {"lsv2": "lsv2"}
ANSWER = "\x01"
ENTER = "press Enter here when the program has come to its end, or when all axes stand and stay"


class Client(file.Client):
    """Puts the program where the control finds it, and reads its records when somebody says that nothing moves."""

    late = True
    longest = 4096  # an answer says why

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client."""
        super().__init__(task, options)
        self._program = task.program.encode() if options.get("program") else b""
        self._opened = self._ready = False
        self._limit = task.start_patience + sum(task.patience)
        self.brought = not self._program
        self.before = "LSV2: nothing may move while this computer speaks to the control, and it does so now"
        self.advice = f"the program is at the control, compared by reading it back: start it there; {ENTER}"
        if not self._program:
            self.advice = f"bring the program to the control and start it there; {ENTER}"
        self._out = b"open\n"
        if task.quiet:  # the control may still execute the program of before
            self.before, self._out = f"LSV2: nothing may move while this computer speaks to the control; {ENTER}", b"still\n"

    @classmethod
    def hello(cls, options: Mapping[str, str]) -> bytes:
        """{option: value} → bytes that ask the control what it is; it must not move meanwhile."""
        return b"open\n"

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
        """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
        said = data.decode("latin-1").strip().lstrip(ANSWER)
        if said.startswith("OPEN "):
            return True, [f"LSV2: {unquote(said[5:])}; its disk can be read"]
        if said == "RUNS":
            return False, ["the control says that its program runs: nothing more was asked; try again when it stands"]
        return False, [unquote(said.removeprefix("! ").removeprefix("WRONG ")) or "no control has answered by LSV2"]

    @property
    def sent(self) -> tuple[int, int]:
        """→ (bytes of the program that stand at the control and were compared, bytes in all)."""
        whole = len(self._task.program)
        return whole * self._ready, whole

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → the next piece of the request."""
        piece, self._out = self._out[:limit], self._out[limit:]
        return b"" if self._over else piece

    def _complete(self, text: str) -> list[Event]:
        if not text.startswith(ANSWER):
            return super()._complete(text)
        self._silence = 0.0
        word, _, rest = text[1:].partition(" ")
        if word == "STILL":
            self._out = b"look\n" if self._ready else b"open\n"
        elif word == "OPEN":
            first, self._opened = not self._opened, True
            self._out = b"put %s\n" % self._program.hex().encode() if self._program else b""
            return ([Identified(f"LSV2: {unquote(rest)}")] if first else []) + ([] if self._program else self._at_control())
        elif word == "PUT":
            if rest != hashlib.sha256(self._program).hexdigest():
                return self._fail(
                    "the program that was read back from the control is not the one that was put there: start nothing"
                )
            return self._at_control()
        elif word == "NOBODY":
            return self._fail("standard input has ended, so nobody can say when nothing moves: run this in a terminal")
        elif word == "RUNS":
            return self._again("the control says that its program runs: nothing was asked for")
        elif word == "LOOK":
            if not self._over:
                touches = f"{self._position} of {len(self._task.numbers)} touches"
                return self._again(f"{touches} are in the record file, and no end mark")
        elif self._ready:
            return self._again(unquote(rest))
        else:
            return self._fail(unquote(rest), wrong=word == "WRONG")
        return []

    def _at_control(self) -> list[Event]:
        self._ready, self._out = True, b"still\n"
        return []

    def _again(self, why: str) -> list[Event]:
        self._out = b"still\n"
        return [Asked(f"{why}. Again: {ENTER}")]

    def _start(self, event: Begun, text: str) -> list[Event]:
        return [one for one in super()._start(event, text) if not isinstance(one, Identified)]

    def elapsed(self, seconds: float) -> list[Event]:
        """s since the last call → Failed when nobody has said for longer than the whole program may take that nothing moves."""
        if self._over:
            return []
        self._silence += seconds
        if self._silence <= self._limit:
            return []
        return self._fail(
            f"within {self._limit:.0f} s nobody has said that nothing moves; 'from=last' in the port finds old records"
        )
