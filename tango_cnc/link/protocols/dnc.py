"""RS-232 the way controls read and punch tape: the program goes out drip-fed, printed records come back.

    idle ──DC1 or start=now──▶ sending ──last byte──▶ running ──end mark──▶ done
              DC3 holds and DC1 releases the sending at any time; every state ends in failed on silence or a closed line

With program=stored nothing is sent: the control has the program already, and only its records are taken.

The control prints (`DPRNT`, `PRINT`, `PUT`) lines ended by CR, LF, CR LF or LF CR CR, with NUL and DEL as leader, most between
DC2 and DC4, some without. What is no record is complained of where records are printed; elsewhere it is somebody else's.
DC1 and DC3 are obeyed here, whatever the driver of a serial port does about them as well: behind a pty or a TCP converter
nobody else does. The line has no check sums; what a record is worth is decided by `words` and `trust`.
"""

from __future__ import annotations

from collections.abc import Mapping

from ...records import InputError
from .._listener import MOVES, STANDS, Listener
from ..client import Begun, Event, Refused, Task
from ..heard import noise
from ..words import record

DC1, DC2, DC3, DC4 = 0x11, 0x12, 0x13, 0x14
NUL, DEL = 0x00, 0x7F
SILENT = bytes((NUL, DEL, DC1, DC2, DC3, DC4)) + b"\r\n %"  # what a control sends that says nothing
LINE_LIMIT = 256  # characters; no control prints a longer one, so this is a lost line end
LAST = 40  # characters of it that are shown
REMEMBERED = 4096  # bytes that came since the last record
SAID = 3  # characters that are no disturbance any more
EOB = {"lf": "\n", "crlf": "\r\n", "lfcrcr": "\n\r\r"}

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "program": ("send", "stored"),  # stored: the control has it already, nothing is sent
    "start": ("now", "xon"),  # send at once, or when the control asks with DC1
    "eob": tuple(EOB),
    "bits": ("8", "7"),  # 7: the eighth bit is parity and is dropped
    "listen": ("auto", "no"),  # auto: a resumed run first hears whether the old program still runs; no: it does not
    "tv": ("no", "even"),  # even: blocks get a blank where they need one to have an even number of characters (unverified)
}
SCHEMES: Mapping[str, str] = {}  # none of its own: any serial line or socket


def tape(program: str, eob: str = "\n", even: bool = False) -> bytes:
    """program text, line end, whether blocks get an even number of characters → bytes framed by `%` lines.

    Raises InputError for characters that the line would not carry.

    A `%` within the program ends the tape for the control, and what follows would be read as the next program.
    """
    lines = program.splitlines()
    for i, line in enumerate(lines, 1):
        if not line.isascii() or not (line.isprintable() or line.replace("\t", " ").isprintable()):
            raise InputError(f"program line {i}: found {line!r}; allowed: printable ASCII; a control reads nothing else from tape")
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError("the program is empty: there is nothing to send")
    framed = lines[0].strip() == "%"
    lines = [*([] if framed else ["%"]), *lines, *([] if lines[-1].strip() == "%" and len(lines) > 1 else ["%"])]
    for at, line in enumerate(lines[1:-1], 1):
        if "%" in line:
            raise InputError(
                f"program line {at + framed}: found {line!r}; allowed: % on the first and the last line alone: it ends the tape, "
                "and the control would store half a program. Copy the program to the control, and read its records with file://"
            )
        if even and len(line) % 2 == 0:  # its line end would make it odd
            lines[at] = line + " "
    return "".join(line + eob for line in lines).encode("ascii")


class Client(Listener):
    """Sends one program and captures its records."""

    punches = True

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client. Raises InputError for a program that cannot go over the line."""
        chosen = {name: options.get(name, allowed[0]) for name, allowed in OPTIONS.items()}
        super().__init__(task)
        self.brought = chosen["program"] == "stored"  # the program comes to the control by other ways
        self._data = b"" if self.brought else tape(task.program, EOB[chosen["eob"]], chosen["tv"] == "even")
        if self.brought:
            self.advice = "nothing is sent: start the program at the control"
        self._at = 0
        self._mask = 0x7F if chosen["bits"] == "7" else 0xFF
        self._strange = bytearray()  # what came since the last record and is none
        self._punching = self._punches = False  # now between DC2 and DC4; this control sends them at all
        self._held = chosen["start"] == "xon"
        self._quiet = task.quiet if self._data and chosen["listen"] == "auto" else 0.0
        if self._quiet:
            self.before = (
                f"listening for {self._quiet:.0f} s whether the control still executes the program of before; "
                "listen=no in the port's URL: you have looked, and it does not"
            )

    @classmethod
    def begins(cls, options: Mapping[str, str]) -> bool:
        """{option: value} → whether the control waits for its tape; one that has the program already is started by a person."""
        return options.get("program", "send") == "send"

    @property
    def sent(self) -> tuple[int, int]:
        """→ (bytes sent, bytes in all) of the program."""
        return self._at, len(self._data)

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → the next piece of the program; empty while the control holds it or all is sent."""
        if self._held or self._over or self._quiet > 0:
            return b""
        piece = self._data[self._at : self._at + limit]
        self._at += len(piece)
        if piece:
            self._silence = 0.0
        return piece

    def receive(self, data: bytes) -> list[Event]:
        """bytes from the line, cut anywhere → the events they complete."""
        events: list[Event] = []
        for byte in data:
            if not self._over:
                if byte & self._mask not in SILENT:
                    self._strange.append(byte & self._mask)
                events += self._one(byte & self._mask)
        del self._strange[:-REMEMBERED]
        return events

    def _one(self, char: int) -> list[Event]:
        if char in (DC1, DC3):
            self._held = char == DC3
            self._quiet = 0.0 if char == DC1 else self._quiet  # who asks for a program executes none
        elif self._quiet > 0:
            return self._busy(char)
        elif char == DC2:
            cut = self._cut("a new record began before this one was complete")
            self._punching = self._punches = True
            return cut
        elif char == DC4:
            cut = self._cut("the record has no line end: its last digits may be missing")
            self._punching = False
            return cut
        elif char in b"\r\n":
            return self._whole()
        elif char not in (NUL, DEL):
            self._line.append(char)
            if len(self._line) > LINE_LIMIT:
                return self._cut(f"{LINE_LIMIT} characters without a line end")
        return []

    def _busy(self, char: int) -> list[Event]:
        """character that comes before anything was sent → Failed when it is of a program that the control executes."""
        self._line.append(char)
        said = self._line.translate(None, bytes([NUL, DEL, 0x0A, 0x0D])).decode("latin-1").strip(" ")
        if char not in (DC2, DC4) and len(said) < SAID:
            return []
        self._line.clear()
        return self._fail(
            "the control prints although nothing was sent: it still executes the program of before. Wait for its end or reset it, "
            "draw the probe clear, then resume"
        )

    def _take(self) -> str:
        text = self._line.decode("latin-1").strip(" ")
        self._line.clear()
        return text

    def _cut(self, why: str) -> list[Event]:
        text = self._take()
        return [Refused(why, text)] if text and self._printing else []

    @property
    def _printing(self) -> bool:
        """→ whether a line that comes now should be a record."""
        return self._punching if self._punches else self._begun

    def _whole(self) -> list[Event]:
        text = self._take()
        if text in ("", "%"):
            return []
        event = record(text, self._letters)
        if isinstance(event, Refused):
            return [event] if self._printing else []
        self._silence = 0.0
        self._strange.clear()
        if isinstance(event, Begun):
            return [event] if self._expected(event) else self._fail(self._stranger(event))
        return self._counted(event, text)

    def _expected(self, event: Begun) -> bool:
        fits = event.mark == self._task.mark and event.count == len(self._task.numbers) and not self._begun
        self._begun |= fits
        return fits

    def _stranger(self, event: Begun) -> str:
        if self._begun:
            return "the control began the program a second time; its touches cannot be separated from the first ones"
        ours = f"{self._task.mark} with {len(self._task.numbers)} touches"
        return (
            f"the control runs another program: its start mark is {event.mark} with {event.count} touches, sent was {ours}. {MOVES}"
        )

    def elapsed(self, seconds: float) -> list[Event]:
        """s since the last call → Failed when the control has been silent for longer than the next touch may take."""
        if self._quiet > 0 and not self._over:
            self._quiet -= seconds
            if self._quiet <= 0:
                self._line.clear()
            return []
        allowed = self._waited(seconds)
        if allowed is None:
            return self._noticed()
        at, total = self.sent
        where = f"{at} of {total} bytes are sent" + (" and the control holds the line (DC3)" if self._held and at else "")
        if self.brought:
            where = STANDS if self._begun else "start the program there; it has to print to this port"
        elif at == 0:
            where = "it never asked for the program (DC1)"
        if strange := len(self._strange):
            many = f"{strange} characters" if strange < REMEMBERED else f"{strange} characters and more"
            last = bytes(self._strange[-LAST:]).decode("latin-1").encode("unicode_escape").decode("ascii")
            why = noise(bytes(self._strange)) or [f"the last ones: {last}"]
            return self._fail(f"no record came within {allowed:.3g} s, but {many} that are none: {why[0]}; {where}")
        if ended := self._ended:
            return self._fail(f"{ended}: the control has been silent for longer than {allowed:.0f} s")
        return self._fail(f"the control has been silent for longer than {allowed:.0f} s; {where}")

    def closed(self) -> list[Event]:
        """the line is gone → what was cut off by it."""
        if self._over:
            return []
        return [*self._cut("the line was lost in the middle of this record"), *self._fail("the line was lost")]
