"""A control that writes its records into a file: the person starts the program there, the growing file is read here.

    waiting ──start mark of the program──▶ running ──end mark──▶ done

For controls that are sent no program over a line and print none: Siemens (`/dev/ext/1` on a share), Heidenhain (`TNC:\\TANGO.TXT`),
Mach3 and Mach4, LinuxCNC. The file is opened anew at each look, only whole lines are taken, and a file that was replaced is read
from its beginning (`transport/_file.py`). Records that stand in it already are of another run, however well they fit; where the
control was started first, `from=last` takes what follows the last start mark.
"""

from __future__ import annotations

from collections.abc import Mapping

from .._listener import MOVES, STANDS, Listener
from ..client import Begun, Ended, Event, Identified, Refused, Task
from ..words import record

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "from": ("now", "last"),  # of the transport: what is written from now on; or from the last start mark on
}
SCHEMES: Mapping[str, str] = {"file": "file"}


class Client(Listener):
    """Reads the records of one program; sends nothing."""

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client."""
        super().__init__(task)
        self.brought = True  # the program comes to the control by other ways
        self.advice = "nothing is sent over this link: bring the program to the control and start it there"

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
        """what was written meanwhile → whether that is of a TANGO program, and what it is, a sentence an item."""
        lines = [line for line in data.decode("latin-1").splitlines() if line.strip()]
        if not lines:
            return False, ["nothing was written: let the control write into this file, or add from=last to see an old run"]
        events = [record(line.strip(), ()) for line in lines]
        marks = [event.mark for event in events if isinstance(event, Begun)]
        touches = sum(line.lstrip().startswith("P") for line in lines)
        if not marks:
            return False, [f"{len(lines)} lines, none of them the start mark of a TANGO program; the last one: {lines[-1]!r}"]
        whole = "its end mark is there" if any(isinstance(event, Ended) for event in events) else "its end mark is not there"
        return True, [f"{len(lines)} lines: program {marks[-1]}, {touches} records, {whole}"]

    @property
    def sent(self) -> tuple[int, int]:
        """→ (0, 0): the program goes to the control by other ways."""
        return 0, 0

    def bytes_to_send(self, limit: int) -> bytes:
        """most bytes wanted → none."""
        return b""

    def _complete(self, text: str) -> list[Event]:
        event = record(text, self._letters)
        if isinstance(event, Refused):
            return [event] if self._begun else []
        if isinstance(event, Begun):
            return self._start(event, text)
        self._silence = 0.0
        return self._counted(event, text)

    def _start(self, event: Begun, text: str) -> list[Event]:
        if self._begun:
            return self._fail("the control began the program a second time; its touches cannot be separated from the first ones")
        if (event.mark, event.count) == (self._task.mark, len(self._task.numbers)):
            self._begun, self._silence = True, 0.0
            return [Identified("a control that writes into a file"), event]
        ours = f"this run is {self._task.mark} with {len(self._task.numbers)} touches"
        return self._fail(
            f"the control runs another program: {text!r}, and {ours}. {MOVES}; then bring the new program to the control"
        )

    def elapsed(self, seconds: float) -> list[Event]:
        """s since the last call → Failed when nothing was written for longer than the next touch may take."""
        allowed = self._waited(seconds)
        if allowed is None:
            return self._noticed()
        if why := self._ended:
            return self._fail(f"{why}: no record was written within {allowed:.0f} s")
        if self._begun:
            return self._fail(f"no record was written within {allowed:.0f} s. Go to the control and {STANDS}")
        return self._fail(
            f"no start mark was written within {allowed:.0f} s: start the program at the control; it has to write into this file"
        )

    def closed(self) -> list[Event]:
        """the file cannot be read any more → what was cut off by it."""
        return [] if self._over else self._fail("the file cannot be read any more")
