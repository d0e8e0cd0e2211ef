"""A control with an OPC UA server: the program goes there as a file, its records come through variables, one by one.

    ask ▶ { put ▶ read back, the same } ▶ start mark ▶ { record read twice ▶ on disk ▶ taken } ▶ end mark

`opcua://host:port`. Nothing is started from here: the person does that at the control. The control's program puts each record
into variables (`opcua.yaml`), adds 1 to `record` and waits until `taken` is the same. Point 0 is the start mark. Nothing moves
before it has been taken, and it is taken only when it is the one of this run.

The lines between this client and the transport are requests and answers in words, one a line:

    ask               ASK Sinumerik%20One 6.2            what the server calls itself
    put 4F38…         PUT <SHA-256 of what was read back>
    get               GET record=5 point=0 flag=…        every variable, in one request
    alarm             ALARM 10720%20software%20limit
    take 5            TAKE                               5 is written to `taken`
                      ! why                              the server refuses, or a variable has no value
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Generator, Mapping
from urllib.parse import unquote

from ...records import InputError
from .._dialogue import Dialogue, Stop, Talk
from ..client import Begun, Ended, Event, Identified, Refused, Task, Touched
from ..nodes import DIGITS, Nodes, read_nodes

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "nodes": (),  # a file with the names of the variables
    "program": (),  # NodeId of a folder or a file of the server, where the program goes
    "name": (),  # of the program in that folder
    "user": (),
    "password": (),
    "path": (),  # of the endpoint, where the server has one
}
SCHEMES: Mapping[str, str] = {"opcua": "opcua"}
WORD, END = 1 << 16, 0xFFFF  # records count modulo WORD; point of the end mark
READS = 5  # times that a record is read until two readings agree
WRITES = 3  # times that `taken` is written until it stands there
HELLO = b"ask\nget\n"
EXACT = 1e-6  # mm: the sum is that of the very numbers in the variables, nothing is rounded for print
SINGLE = 23  # binary places of a REAL of 32 bits
Values = dict[str, float]


class Client(Dialogue):
    """Brings the program, then takes its records one by one."""

    drives = False  # the control's program runs by itself from record to record

    def __init__(self, task: Task, options: Mapping[str, str]) -> None:
        """task, {option: value of `OPTIONS`} → client. Raises InputError for nodes that cannot carry the records."""
        self._task, self._nodes = task, read_nodes(options.get("nodes", ""))
        for letter in task.letters:
            if letter not in self._nodes.position:
                raise InputError(
                    f"nodes: position: found {' '.join(self._nodes.position)}; allowed: all that move, {letter} is missing"
                )
        if 'WRITE(TG_ERROR,"' in task.program:
            raise InputError(
                "this program writes its records into a file, and opcua takes them from variables: state handshake: R700 under "
                "controller in tango.yaml, or use file:// as the port"
            )
        self._program = task.program.encode() if options.get("program") else b""
        self.brought = not self._program
        self.advice = "start the program at the control" + ("; it was compared by reading it back" if self._program else "")
        self._put = self._begun = self._left = False
        self._count = 0  # records taken
        super().__init__(task.start_patience)

    @classmethod
    def named(cls, options: Mapping[str, str]) -> None:
        """{option: value} → nothing. Raises InputError naming file, line and key where the file of nodes is wrong."""
        read_nodes(options.get("nodes", ""))

    @classmethod
    def hello(cls, options: Mapping[str, str]) -> bytes:
        """{option: value} → bytes that ask the server what it is and read every variable."""
        return HELLO

    @classmethod
    def told(cls, data: bytes, options: Mapping[str, str]) -> tuple[bool, list[str]]:
        """what came after `hello` → whether this control can be worked with, and what it says of itself, a sentence an item."""
        lines = data.decode("latin-1").splitlines()
        asked = [line for line in lines if line.startswith("ASK ")]
        got = [line for line in lines if line.startswith("GET ")]
        said = [f"OPC UA server: {unquote(asked[0][4:])}"] if asked else ["no OPC UA server has answered"]
        said += [unquote(line[2:]) for line in lines if line.startswith("! ")]
        if not asked or not got:
            return False, said
        try:
            nodes = read_nodes(options.get("nodes", ""))
            values = _values(got[0], nodes)
        except (ValueError, InputError) as error:
            return False, [*said, str(error)]
        said.append(f"every variable has a value; the last record is {values['record']:.0f}, taken {values['taken']:.0f}")
        fine = values.get("state") not in nodes.alarms
        return fine, said if fine else [*said, "the control is in alarm"]

    @property
    def sent(self) -> tuple[int, int]:
        """→ (bytes of the program that stand at the control and were compared, bytes in all)."""
        return len(self._program) * self._put, len(self._program)

    def stop(self) -> bool:
        """The user wants an end → False: no further record is taken, so the control waits at its next one."""
        return False

    def _late(self) -> str:
        return "put a record into its variables" if self._begun else "begun the program"

    def _conversation(self) -> Talk:
        said = yield from self._ask("ask", "ASK ")
        self._events.append(Identified(f"OPC UA: {unquote(said)}"))
        values = yield from self._look()
        if self._program:
            back = yield from self._ask(f"put {self._program.hex()}", "PUT ")
            if back != hashlib.sha256(self._program).hexdigest():
                raise Stop("the program that was read back from the control is not the one that was put there: start nothing")
            self._put = True
        taken, last = int(values["taken"]), int(values["record"])
        if last != taken and values["point"] == 0 and self._ours(values):
            # the control was started first and waits with the start mark; or it was reset, and the mark is of the start before
            last, self._left = (last - 1) % WORD, True
        while True:
            values = yield from self._look()
            self._untaken(values, taken)
            number, due = int(values["record"]), (last + 1) % WORD
            if number == last:
                continue
            if number == due:
                values = yield from self._steady(values)
                self._untaken(values, taken)
                number = int(values["record"])
            if number != due and not (self._again(values) and number == (due + 1) % WORD):
                raise Stop(
                    f"record {number} came where record {due} was due: another program takes them, or the control began anew"
                )
            ended = self._handed_over(values)
            self._done()
            self._count += self._begun and not (values["point"] == 0 and self._count > 0)
            self._allowed = self._task.patience[min(self._count - 1, len(self._task.patience) - 1)]
            if self._left:  # the person may have to start the program yet
                self._allowed, self._left = max(self._allowed, self._task.start_patience), False
            yield from self._take(number, taken)  # goes out when what the record said is on disk
            if ended is not None:
                self._events.append(Ended(ended, self._task.mark))
                return
            taken = last = number

    def _ask(self, request: str, answer: str) -> Generator[str, str, str]:
        """request, how its answer begins → the rest of the answer. Raises Stop when the server refuses."""
        line = yield request
        if not line.startswith(answer):
            raise Stop(f"the control refuses: {unquote(line.removeprefix('! '))}")
        return line.removeprefix(answer)

    def _look(self) -> Generator[str, str, Values]:
        """→ {what it means: value}. Raises Stop in an alarm; a variable that has no value now is looked at again."""
        while True:
            line = yield "get"
            if line.startswith("!"):
                self._doubts(line)
                continue
            try:
                values = _values(line, self._nodes)
            except ValueError as error:
                self._doubts(str(error))
                continue
            self._doubted = 0
            if values.get("state") in self._nodes.alarms:
                text = (yield from self._ask("alarm", "ALARM ")) if self._nodes.text else ""
                raise Stop(f"the control is in alarm{': ' if text else ''}{unquote(text)}")
            return values

    _doubted = 0

    def _doubts(self, line: str) -> None:
        self._doubted += 1
        if self._doubted >= READS:
            raise Stop(f"the variables cannot be read: {unquote(line.removeprefix('! '))}")

    def _steady(self, values: Values) -> Generator[str, str, Values]:
        """a first reading of a record → two that agree. Raises Stop when none do."""
        number = values["record"]
        for _ in range(READS):
            again = yield from self._look()
            if again == values:
                return again
            values = again
        raise Stop(f"the variables keep changing although record {number:.0f} has not been taken")

    def _untaken(self, values: Values, taken: int) -> None:
        """values, what stood in taken → nothing. Raises Stop where it is another number."""
        if int(values["taken"]) != taken:
            raise Stop(f"{values['taken']:.0f} stands in taken where {taken} was: another program takes the records")

    def _again(self, values: Values) -> bool:
        """values → whether it is a start mark, and no touch has come since the one before: nothing has moved."""
        return values["point"] == 0 and self._count <= 1 and self._ours(values)

    def _take(self, number: int, before: int) -> Generator[str, str, None]:
        """number of a record, what stands in taken → it is written until it stands there. Raises Stop for a third number."""
        for _ in range(WRITES):
            yield from self._ask(f"take {number}", "TAKE")
            values = yield from self._look()
            if int(values["taken"]) == number:
                return
            self._untaken(values, before)
        raise Stop("what is written as taken does not stand there afterwards: do the nodes fit the control?")

    def _ours(self, values: Values) -> bool:
        return (_mark(values, self._nodes), int(values["count"])) == (self._task.mark.rjust(DIGITS, "0"), len(self._task.numbers))

    def _handed_over(self, values: Values) -> int | None:
        """One record → its event; the touches made, where it is the end mark. Raises Stop for another program."""
        point, count = int(values["point"]), int(values["count"])
        if not self._ours(values):
            ours = f"{self._task.mark} with {len(self._task.numbers)} touches"
            found = f"{_mark(values, self._nodes)} with {count} touches"
            raise Stop(f"the control runs program {found}, this run is {ours}: bring the new program to the control")
        if point == 0 and self._begun and self._count > 1:
            raise Stop("the control began the program a second time")
        if point != 0 and not self._begun:
            raise Stop("a record came before the start mark")
        if point == 0 and self._begun:
            return None
        if point == 0:
            self._begun = True
            self._events.append(Begun(self._task.mark, count))
        elif point == END:
            return count
        else:
            self._events.append(self._record(values))
        return None

    def _record(self, values: Values) -> Event:
        place = {letter: values[letter] for letter in self._task.letters}
        point, flag = int(values["point"]), int(values["flag"])
        text = f"P{point} H{flag} " + " ".join(f"{letter}{value:.4f}" for letter, value in place.items())
        if flag not in (0, 1, 2):
            return Refused(f"flag {flag}; it is 0 (no contact), 1 (contact) or 2 (early contact)", text)
        if self._task.summed and self._nodes.sum:
            said, found = values["sum"], sum(place.values())
            if abs(said - found) > _most_off(said, list(place.values())):
                return Refused(f"the places add up to {found:.6f}, and sum is {said:.6f}", text)
        return Touched(point, flag, place, text)


def _values(line: str, nodes: Nodes) -> Values:
    """answer to `get` → {what it means: value}. Raises ValueError for what is missing, no number, or no whole number."""
    found = {}
    for word in line.split()[1:]:
        name, _, text = word.partition("=")
        found[name] = float(text)
        if not math.isfinite(found[name]):
            raise ValueError(f"{name}: found {text}; allowed: a finite number")
    if not line.startswith("GET ") or set(found) != set(nodes.looked_at):
        raise ValueError("not all variables were read")
    for name, value in found.items():
        whole = name not in (*nodes.position, "sum")
        if whole and (value != int(value) or (name in ("record", "taken", "point") and not 0 <= value < WORD)):
            raise ValueError(f"{name}: found {value:g}; allowed: a whole number{' of 0 … 65535' if name != 'state' else ''}")
    return found


def _most_off(said: float, places: list[float]) -> float:
    """sum and places → mm by which they may differ: nothing, but REALs of 32 bits are rounded once each, their sum at each step."""
    numbers, whole = [said, *places], sum(map(abs, places))
    if whole > 1e30 or any(struct.unpack("f", struct.pack("f", x))[0] != x for x in numbers):
        return EXACT
    rounded = sum(map(_half_unit, places)) + len(places) * _half_unit(whole)
    return max(EXACT, rounded)


def _half_unit(number: float) -> float:
    """number → half of the last place that a REAL of 32 bits has of it."""
    return float(2.0 ** (math.frexp(number)[1] - 1 - SINGLE) / 2) if number else 0.0


def _mark(values: Values, nodes: Nodes) -> str:
    """values → the hash of the program that the control runs."""
    each = DIGITS // len(nodes.mark)
    return "".join(f"{int(values[f'mark{i}']):0{each}X}" for i in range(len(nodes.mark)))
