"""A control that is driven touch by touch through holding registers, behind a real pymodbus server, over TCP or RTU.

The registers and what the resident program does with them are written down again here, on purpose: the two sides have to
agree on the wire, not in a common file. Function 6 is refused, as FANUC's Modbus/TCP server does.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import re
import socket
import threading
import time
from collections.abc import Callable
from typing import Any, cast

from ..languages import Alarm, Silence
from ..lines import Closed, Line
from ..motion import Motion, MotionStop, Note
from ..session import Session
from . import Talk

SIZE = 96
STATUS, ACKNOWLEDGED, BEGUN, TICKET, TICK, POINT, FLAG, ALARM, PROBE_ON, RECORD, POSITION = range(11)
COUNT_OF, MARK, VERSION, PATTERN, ORDER, ECHO = 24, 25, 30, 31, 32, 34
REQUEST, CONFIRMED, HEARD, TAKEN = 60, 82, 83, 84  # written by the other side, which writes nothing below
CLIENT, SEQUENCE, COMMAND, MASK, NUMBER, FEED, TARGET = 0, 2, 3, 4, 5, 6, 8  # within a request and its echo
LONG = 22  # registers of a request
WORD = 0x10000
LETTERS = "XYZABCS"
COUNT = 1e-4  # mm, deg
FEED_COUNT = 0.1  # mm/min
BEGIN, MOVE, TURN, PROBE, END, RUN = 0x101F, 0x10E3, 0x116C, 0x12B4, 0x1351, 0x138A
FRESH, SILENCE = 2, 10  # ticks: so long a ticket can be confirmed; so long nobody need be heard
SWITCHED_ON = 100  # tick at power-on
LAST = 0xFFFF  # point of the end mark
IDLE, BUSY, IN_ALARM, HOLD = 0, 1, 2, 5
STATES = {"alarm": 2, "reset": 2, "door": 3, "estop": 4, "hold": 5, "battery": 6}
ALARMS = {"collision": 101, "overtravel": 102, "fault": 103}
POLL = 0.05  # s
WAIT = 0.001  # s between two looks whether a record has been taken
START_MARK = re.compile(r"TANGO START ([0-9A-F]{12}) +(\d+)\.?")
VALUE = re.compile(r"([A-Z]) *(-? *[\d.]+)")
Program = Callable[[Motion, Callable[[bytes], None]], None]  # runs on this machine, prints there


class Registers:
    """The control as the wire sees it: docs/link.md, rule by rule. A confirmed echo is `pending`; `execute` does it."""

    def __init__(
        self,
        motion: Motion,
        note: Note = lambda event, **data: None,
        *,
        big: bool = True,
        program: Program | None = None,
        waited: Callable[[], None] = lambda: time.sleep(WAIT),
        clock: Callable[[], float] = time.monotonic,
        ticket: int = 0,
    ) -> None:
        """The machine; `ticket`: the number after which tickets and records are counted, as it was not used lately."""
        self.words = [0] * SIZE
        self._program, self._waited, self._clock, self._began = program, waited, clock, clock()
        self.motion, self._note, self._big = motion, note, big
        self.pending = False
        self.silent = False  # its power is gone
        self._issued = 0  # tick at which the ticket was made up
        self._attended: int | None = None  # newest tick that the other side has read
        self.words[VERSION], self.words[PATTERN] = 3, 0x1234
        self.words[TICKET] = self.words[BEGUN] = self.words[RECORD] = ticket % WORD
        self._put(ORDER, [0x01020304])
        self._here()
        self.look()

    def look(self) -> bool:
        """One scan of the control's program → whether a command has just become `pending`."""
        words = self.words
        words[TICK] = (SWITCHED_ON + int(self._clock() - self._began)) % WORD
        self._hear()
        if words[STATUS] != IDLE or self.pending:
            return False
        request, echo = words[REQUEST : REQUEST + LONG], words[ECHO : ECHO + LONG]
        due = (words[ACKNOWLEDGED] + 1) % WORD
        old = (words[TICK] - self._issued) % WORD > FRESH
        if request[SEQUENCE] == due and (request != echo or words[TICKET] == words[BEGUN] or old):
            words[ECHO : ECHO + LONG] = echo = request
            words[TICKET] = (words[TICKET] + 1) % WORD
            self._issued, old = words[TICK], False
        confirmed = words[CONFIRMED] == words[TICKET] != words[BEGUN] and echo[SEQUENCE] == due and not old
        if not confirmed or not self._listening():
            return False
        self._note(
            "command", code=echo[COMMAND], sequence=echo[SEQUENCE], number=echo[NUMBER], client=self._numbers(ECHO + CLIENT, 1)[0]
        )
        if self.motion.deflected and echo[COMMAND] in (MOVE, TURN):
            self._note("unsafe", why="a move while the probe is deflected")
        self.pending = True
        words[STATUS], words[BEGUN] = BUSY, words[TICKET]
        return True

    def _hear(self) -> None:
        """A word that comes late is older than the one before it, and does not count."""
        heard, now = self.words[HEARD], self.words[TICK]
        if self._attended is None or (now - heard) % WORD < (now - self._attended) % WORD:
            self._attended = heard

    def _listening(self) -> bool:
        assert self._attended is not None
        return (self.words[TICK] - self._attended) % WORD <= SILENCE

    def write(self, address: int, values: list[int]) -> bool:
        """register, values → whether a command has become `pending` by that."""
        if address >= REQUEST:
            self.words[address : address + len(values)] = values
        return self.look()

    def reset(self) -> None:
        """Somebody at the control has cleared the alarm and freed the probe; an open command is dropped, not done."""
        self.pending = False
        self.words[STATUS] = IDLE
        self.words[ALARM] = 0
        self._here()

    def execute(self) -> None:
        """Does the pending command, from the first motion to the acknowledgement."""
        echo = self.words[ECHO : ECHO + LONG]
        try:
            contact = self._perform(echo[COMMAND])
            self.look()
            if not self._listening() and echo[COMMAND] not in (BEGIN, END):
                self._note("held", why="nobody has been heard for too long")
                raise MotionStop("fault", "hold")
        except MotionStop as stop:
            self.pending = False
            if str(stop) == "silence":
                self.silent = True
                self._note("power", state="off")
                return
            self._here()
            self.words[ALARM] = ALARMS[stop.cause]
            self.words[STATUS] = STATES.get(str(stop), IN_ALARM)
            self._note("alarm", code=self.words[ALARM], text=str(stop))
            return
        self._here()
        if contact is not None:
            self._put(POSITION, contact)
        self.pending = False
        self.words[ACKNOWLEDGED], self.words[STATUS] = echo[SEQUENCE], IDLE

    def _perform(self, command: int) -> list[int] | None:
        """→ counts of the contact after a measuring move."""
        if command in (MOVE, TURN):
            self.motion.rapid(self._target())
        elif command == PROBE:
            return self._touch()
        elif command == RUN and self._program is not None:
            try:
                self._program(self.motion, self._printed)
            except Silence:
                raise MotionStop("fault", "silence") from None
            except Alarm:
                raise MotionStop("fault", "alarm") from None
            except OSError as error:
                self._note("program", state=f"cannot be read: {error.strerror}")
                raise MotionStop("fault", "alarm") from None
        elif command not in (BEGIN, END):
            raise MotionStop("fault", "alarm")
        return None

    def _printed(self, data: bytes) -> None:
        """One printed line → the registers, and the program waits until the other side has taken it: what a PLC has to do."""
        text = data.translate(None, b"\x00\x11\x12\x13\x14\x7f").decode("ascii").strip()
        if found := START_MARK.fullmatch(text):
            self.words[MARK : MARK + 3] = [int(found[1][i : i + 4], 16) for i in (0, 4, 8)]
            self.words[COUNT_OF], self.words[POINT] = int(found[2]), 0
        elif text.startswith("TANGO END"):
            self.words[POINT] = LAST
        elif text:
            values = {letter: float(number.replace(" ", "")) for letter, number in VALUE.findall(text)}
            self.words[POINT], self.words[FLAG] = int(values["P"]), int(values["H"])
            self._put(POSITION, [round(values.get(letter, 0.0) / COUNT) for letter in LETTERS])
        else:
            return
        self.words[RECORD] = (self.words[RECORD] + 1) % WORD
        while self.words[TAKEN] != self.words[RECORD]:
            self._waited()

    def _touch(self) -> list[int]:
        """The resident measuring macro: search, latch, back to where it began."""
        start = dict(zip(self.motion.machine.names, self.motion.position, strict=True))
        early = self.motion.deflected
        feed = self._numbers(ECHO + FEED, 1)[0] * FEED_COUNT
        skip = self.motion.skip(self._target(), feed)
        if not early:
            self.motion.rapid({name: start[name] for name in self.motion.machine.linear})
        self.words[POINT], self.words[FLAG] = self.words[ECHO + NUMBER], 2 if early else int(skip.hit)
        return self._counts(skip.position)

    def _target(self) -> dict[str, float]:
        counts, mask = self._numbers(ECHO + TARGET, len(LETTERS)), self.words[ECHO + MASK]
        values = {letter: counts[i] * COUNT for i, letter in enumerate(LETTERS) if mask >> i & 1}
        return {letter: value if letter in "XYZ" else math.radians(value) for letter, value in values.items()}

    def _here(self) -> None:
        self.words[PROBE_ON] = int(self.motion.deflected)
        self._put(POSITION, self._counts(self.motion.position))

    def _counts(self, position: Any) -> list[int]:
        shown = dict(zip(self.motion.machine.names, map(float, position), strict=True))
        values = [shown.get(letter, 0.0) for letter in LETTERS]
        return [round((v if letter in "XYZ" else math.degrees(v)) / COUNT) for letter, v in zip(LETTERS, values, strict=True)]

    def _put(self, address: int, values: list[int]) -> None:
        for i, value in enumerate(values):
            pair = [value >> 16 & 0xFFFF, value & 0xFFFF]
            self.words[address + 2 * i : address + 2 * i + 2] = pair if self._big else pair[::-1]

    def _numbers(self, address: int, count: int) -> list[int]:
        found = []
        for i in range(count):
            pair = self.words[address + 2 * i : address + 2 * i + 2]
            high, low = pair if self._big else pair[::-1]
            found.append((high << 16 | low) - (high >> 15 << 32))
        return found


def serve(line: Line, session: Session, once: bool) -> None:
    """line, session → served until the line closes; with a new connection the control is the same, and still switched on."""
    if session.device is None:
        session.device = Registers(session.motion(), session.note, program=session.resident, ticket=int(time.time()))
    server = _Server(session.device, rtu=session.serial)
    inner = socket.create_connection(server.start())
    back = threading.Thread(target=_answers, args=(inner, line), daemon=True)
    back.start()
    try:
        while True:
            data = line.receive(POLL)
            if data and not session.device.silent:
                session.received(len(data))
                inner.sendall(data)
    finally:
        inner.close()
        server.stop()


def _answers(inner: socket.socket, line: Line) -> None:
    """What the server says → the line."""
    with contextlib.suppress(OSError, Closed):
        while data := inner.recv(4096):
            line.send(data)


class _Server:
    """A pymodbus server on a port of its own, in a thread of its own."""

    def __init__(self, registers: Registers, rtu: bool) -> None:
        self._registers, self._rtu = registers, rtu
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._address: tuple[str, int] = ("127.0.0.1", 0)

    def start(self) -> tuple[str, int]:
        """→ the address that it listens on."""
        self._thread.start()
        self._ready.wait(10)
        return self._address

    def stop(self) -> None:
        """Ends it; a motion that has begun goes on."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(2)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._listen())
        self._ready.set()
        self._loop.run_forever()

    async def _listen(self) -> None:
        import pymodbus
        from pymodbus import FramerType
        from pymodbus.pdu.device import ModbusDeviceIdentification
        from pymodbus.server import ModbusTcpServer
        from pymodbus.simulator import DataType, SimData, SimDevice

        pymodbus.pymodbus_apply_logging_config(logging.CRITICAL)
        device = SimDevice(id=1, simdata=[SimData(0, count=SIZE, datatype=DataType.REGISTERS)], action=self._asked)
        framer = FramerType.RTU if self._rtu else FramerType.SOCKET
        identity = ModbusDeviceIdentification(
            info_name={"VendorName": "sim_controller", "ProductCode": "TANGO", "MajorMinorRevision": "1"}
        )
        server = ModbusTcpServer(device, framer=framer, address=("127.0.0.1", 0), identity=identity)
        await server.serve_forever(background=True)
        self._address = cast(asyncio.Server, server.transport).sockets[0].getsockname()[:2]

    async def _asked(self, code: int, start: int, address: int, count: int, words: list[int], values: Any) -> Any:
        """One request, before it is answered: six arguments, as pymodbus 3.16 calls it."""
        from pymodbus.constants import ExcCodes

        if code not in (3, 16, 23):
            return ExcCodes.ILLEGAL_FUNCTION
        if values is not None and address < REQUEST:
            return ExcCodes.ILLEGAL_ADDRESS  # these are the control's own
        begun = self._registers.write(address, [int(value) for value in values]) if values is not None else self._registers.look()
        if begun:
            self._loop.run_in_executor(None, self._registers.execute)
        words[:] = self._registers.words
        return None


TALK = Talk(serve, "modbus+tcp://{}/1", "modbus+rtu://{}/1")
