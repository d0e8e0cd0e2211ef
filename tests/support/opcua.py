"""An OPC UA server that stands in for a control: R parameters, an alarm, a file system; it runs the program that it is given.

It is written from docs/link.md and OPC 10000-5 (FileType, FileDirectoryType), not from the client.
"""

from __future__ import annotations

import contextlib
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sim_controller.languages import Alarm
from sim_controller.probing import rig
from sim_controller.session import Session, Setup
from tango_cnc.files import read_cell, read_world

FOLDER = "ns=2;s=/NC/MPF.DIR"
R = {"record": 700, "taken": 701, "point": 702, "flag": 703, "count": 704, "sum": 708}
MARK, PLACE = (705, 706, 707), dict(zip("XYZABCS", range(710, 717), strict=True))
NUMBER = re.compile(r"([A-Z])\s*([-+]?)\s*([0-9]*\.?[0-9]*)")


class Parameters(dict):  # type: ignore[type-arg]
    """The R parameters of a control, as its program sees them: those that the server shows."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def get(self, name: str, default: float = 0.0) -> float:
        if not self._control.on or self._control.left.is_set():
            raise Gone
        return self._control.read(int(name[1:]))

    def __setitem__(self, name: str, value: float) -> None:
        self._control.put(int(name[1:]), value)


class Known:
    """Lets anna in who has the password."""

    def __init__(self, word: str) -> None:
        self._word = word

    def get_user(self, iserver, username=None, password=None, certificate=None):  # type: ignore[no-untyped-def]
        from asyncua.server.user_managers import User, UserRole

        return User(role=UserRole.User) if (username, password) == ("anna", self._word) else None


class Gone(Exception):
    """The control was switched off."""


class Control:
    """The server, its variables and files. `taken` waits as the program of a control does."""

    def __init__(self, port: int, files: bool = True, word: str = "") -> None:
        """port, whether it has a file system, the password of user anna where one is asked for."""
        from asyncua import ua  # takes a second, and every worker reads this file
        from asyncua.sync import Server

        self._ua = ua
        self.files: dict[str, bytearray] = {}
        self._made: set[str] = set()  # files that have a node
        self.on, self.spoil = True, lambda data: data
        self.left = threading.Event()  # the person has
        self._open: dict[int, tuple[str, int]] = {}
        self.server = Server()
        if word:
            self.server.aio_obj.iserver.user_manager = Known(word)
            self.server.aio_obj.set_identity_tokens([ua.UserNameIdentityToken])
        self.server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/")
        self.server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        self.url = f"opcua://127.0.0.1:{port}"
        self.server.register_namespace("http://example.org/one")
        objects = self.server.nodes.objects
        self._nodes = {}
        for number in range(700, 720):
            node = objects.add_variable(f"ns=2;s=/Channel/Parameter/R[u1,{number}]", f"2:R{number}", 0.0)
            node.set_writable(number == R["taken"])
            self._nodes[number] = node
        self.alarm = objects.add_variable("ns=2;s=/Channel/State/chanAlarm[u1]", "2:chanAlarm", 0)
        self.text = objects.add_variable("ns=2;s=/Nck/SequencedAlarms/alarmNo", "2:alarmNo", "")
        if files:
            self._folder = objects.add_folder(FOLDER, "2:MPF.DIR")
            self._method(self._folder, "CreateFile", self._create, "si", "nu")
        self.server.start()

    def _method(self, parent, name, function, takes, gives):
        kinds = {"s": "String", "i": "Boolean", "n": "NodeId", "u": "UInt32", "b": "Byte", "d": "ByteString", "l": "Int32"}
        made = [[getattr(self._ua.VariantType, kinds[letter]) for letter in letters] for letters in (takes, gives)]

        def called(_, *arguments):
            values = function(*[argument.Value for argument in arguments])
            return [self._ua.Variant(value, kind) for value, kind in zip(values, made[1], strict=True)]

        at = parent.nodeid.Identifier
        parent.add_method(self._ua.NodeId(f"{at}.{name}", 2), self._ua.QualifiedName(name, 2), called, *made)

    def keep(self, name: str, text: bytes) -> None:
        """A file that is there already."""
        made, self.files[name] = name in self._made, bytearray(text)
        if made:
            return
        file = self._folder.add_object(self._ua.NodeId(f"/NC/{name}", 2), self._ua.QualifiedName(name, 2))
        self._method(file, "Open", lambda mode: self._opened(name, mode), "b", "u")
        self._method(file, "Close", lambda handle: [][: self._open.pop(handle) is None], "u", "")
        self._method(file, "Write", self._write, "ud", "")
        self._method(file, "Read", self._read, "ul", "d")
        self._made.add(name)

    def _create(self, name, _):
        threading.Thread(target=self.keep, args=(name, b"")).start()  # the server's own loop waits for this call
        while name not in self._made:
            time.sleep(0.01)
        return [self._ua.NodeId(f"/NC/{name}", 2), 0]

    def _opened(self, name, mode):
        handle = len(self._open) + 1000 + int(time.monotonic() * 1000) % 100000
        if mode & 4:
            self.files[name].clear()
        self._open[handle] = (name, 0)
        return [handle]

    def _write(self, handle, data):
        self.files[self._open[handle][0]] += self.spoil(data)
        return []

    def _read(self, handle, most):
        name, at = self._open[handle]
        piece = bytes(self.files[name][at : at + most])
        self._open[handle] = (name, at + len(piece))
        return [piece]

    def anew(self) -> None:
        """Variables are 0, files empty, the alarm gone."""
        self._put(dict.fromkeys(self._nodes, 0.0))
        self.alarm.write_value(0)
        self.spoil = lambda data: data
        for content in self.files.values():
            content.clear()

    def put(self, number: int, value: float) -> None:
        """R parameter, value → written."""
        self._put({number: value})

    def _put(self, values: dict[int, float]) -> None:
        """{R parameter: value} → written one after the other; the server's loop is asked once."""

        async def written() -> None:
            for number, value in values.items():
                await self._nodes[number].aio_obj.write_value(float(value))

        self.server.tloop.post(written())

    def read(self, number: int) -> float:
        """R parameter → its value, as it stands in the server."""
        space = self.server.aio_obj.iserver.aspace
        return float(space.read_attribute_value(self._nodes[number].nodeid, self._ua.AttributeIds.Value).Value.Value)

    def printed(self, data: bytes) -> None:
        """A line that a program prints → its variables; returns when it has been taken."""
        text = data.translate(None, b"\x00\x11\x12\x13\x14\x7f").decode("ascii").strip()
        if not text:
            return
        if text.startswith("TANGO START"):
            _, _, mark, count = text.split()
            words = [int(mark.rjust(12, "0")[4 * place : 4 * place + 4], 16) for place in range(len(MARK))]
            self._put({**dict(zip(MARK, words, strict=True)), R["count"]: int(count), R["point"]: 0})
        elif text.startswith("TANGO END"):
            self.put(R["point"], 65535)
        else:
            said = {letter: float(sign + digits) for letter, sign, digits in NUMBER.findall(text)}
            place = {number: said.get(letter, 0.0) for letter, number in PLACE.items()}
            whole = sum(place.values())  # a control adds the numbers that it has, not those that it prints
            sum_ = whole if abs(whole - said["K"]) < 0.0002 * len(place) else said["K"]
            self._put({R["point"]: said["P"], R["flag"]: said["H"], R["sum"]: sum_, **place})
        self.given()

    def given(self) -> None:
        """One more record → waits until it has been taken."""
        number = (int(self.read(R["record"])) + 1) % 65536
        self.put(R["record"], number)
        while self.read(R["taken"]) != number:
            if not self.on or self.left.is_set():
                raise Gone
            time.sleep(0.001)

    @contextlib.contextmanager
    def attended(self, cell: Path, file: str = "TANGO.MPF", family: str = "macro_b") -> Iterator[None]:
        """cell with a world, name of the program → within it, somebody at the control starts every new program that comes."""
        left = self.left = threading.Event()

        def text() -> str:
            return "" if self._open else bytes(self.files.get(file, b"")).decode()

        def run() -> None:
            read = read_cell(cell)
            session = Session(rig(read.machine, read.artefact, read_world(cell / "world.yaml"), 1), Setup(family))
            done = ""
            while not left.wait(0.05):
                if (program := text()) in ("", done):
                    continue
                done = program
                control = session.control(self.printed)
                if family == "siemens":
                    control.parameters = Parameters(self)
                with contextlib.suppress(Gone, Alarm):
                    session.run(control, (line for line in done.splitlines() if line.strip() != "%"))

        person = threading.Thread(target=run, daemon=True)
        person.start()
        try:
            yield
        finally:
            left.set()
            person.join(5)


@contextlib.contextmanager
def control(port: int, **options: Any) -> Iterator[Control]:
    """port → a control that is switched on."""
    one = Control(port, **options)
    try:
        yield one
    finally:
        one.on = False
        one.server.stop()
