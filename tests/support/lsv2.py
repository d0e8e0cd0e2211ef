"""A LSV2 server that stands in for the disk of a Heidenhain control.

It was written before any client of this project, from the facts that pyLSV2 1.8 has collected (docs/protocol.rst,
docs/lsv2-toolbox.rst, the numbers of const.py, and its issues 7, 26 and 58). No real control took part.

What it keeps of these: a telegram is a length (32 bit, most significant byte first), four letters and that many bytes; a login
opens groups of telegrams; a telegram longer than the agreed buffer is refused; a file without the binary mark travels as lines,
and a block that ends inside a line is refused; blocks go one by one, each acknowledged; a file in use is not deleted, and one
that exists is not replaced. `heard` is every telegram with what the machine did meanwhile: reports of an iTNC 530 whose PLC
restarted during a transfer are why a client must not be heard while it moves.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

FREE = {"A_LG", "A_LO", "R_ST", "C_ST"}
OF = {
    "INSPECT": {"R_VR", "R_PR", "R_CI", "R_MB", "R_MP", "R_RS", "R_SS", "C_CC"},
    "FILE": {
        "R_DI",
        "R_DR",
        "R_FI",
        "R_FL",
        "C_FD",
        "C_FR",
        "C_FC",
        "C_FA",
        "C_DC",
        "C_DM",
        "C_DD",
        "C_FL",
        "S_FL",
        "T_OK",
        "T_FD",
    },
    "DNC": {"R_RI"},
    "MONITOR": {"C_LK", "C_EK"},
    "DIAGNOSTICS": {"C_LK", "C_EK", "R_DT"},
}
ACTS = {"C_EK", "C_LK", "C_MC", "C_NC", "C_MB", "C_TP", "C_DT"}  # what presses a key or changes the control itself
SET_BUFFER = {3: 1024, 4: 512, 5: 2048, 6: 3072, 7: 4096}
SECURE_SEND = 19
STARTED, FINISHED, IDLE = 0, 2, 7
UNKNOWN_TELEGRAM, NO_RIGHT, WRONG, NO_FILE, EXISTS, IN_USE, NO_LOGIN, NO_SPACE, NO_DIRECTORY = 22, 23, 24, 32, 34, 36, 49, 53, 55
BLOCK_NO_SPACE, BLOCK_BAD = 101, 104


@dataclass(frozen=True)
class Heard:
    """One telegram that came: its letters, what it carried, and whether the machine moved."""

    command: str
    data: bytes
    moving: bool


@dataclass
class Control:
    """The control behind the server: its disk, its program, and what goes wrong.

    `fault` is asked before each telegram is answered and names what happens: "" nothing, hangup, half, bytes, error, silent.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    folders: set[str] = field(default_factory=lambda: {"TNC:", "TNC:\\TANGO"})
    name: str = "TNC640"
    users: dict[str, str] = field(default_factory=dict)  # login: password, where one is set
    logins: tuple[str, ...] = ("INSPECT", "FILE", "DNC")
    block: int = 4096
    secure: bool = True
    space: int = 10**9
    in_use: set[str] = field(default_factory=set)
    state: int = IDLE
    moving: Callable[[], bool] = lambda: False
    fault: Callable[[str], str] = lambda command: ""
    heard: list[Heard] = field(default_factory=list)
    joined: list[bool] = field(default_factory=list)  # one for each connection: did the machine move
    talking: int = 0  # connections that are open

    def acted(self) -> list[Heard]:
        """→ telegrams that could have moved or changed the control: none may ever come."""
        resets = [one for one in self.heard if one.command == "C_CC" and one.data[:2] == b"\0\1"]
        return [one for one in self.heard if one.command in ACTS] + resets

    def while_moving(self) -> int:
        """→ how often the control was spoken to while it moved: telegrams and connections."""
        return sum(one.moving for one in self.heard) + sum(self.joined)

    def real(self, path: str) -> str:
        """→ the name under which the disk has a file: the letters of a name are the same small and capital."""
        return next((own for own in self.files if own.upper() == path.upper()), path)


class _Refused(Exception):
    def __init__(self, code: int, kind: str = "T_ER") -> None:
        self.code, self.kind = code, kind


class _Talk:
    """One connection and what it has opened."""

    def __init__(self, control: Control) -> None:
        self.control, self.opened, self.buffer, self.secure = control, set[str](), 256, False
        self.folder = "TNC:"
        self._out: list[bytes] = []
        self._in: tuple[str, bool, bytearray] | None = None

    def answer(self, command: str, data: bytes) -> tuple[str, bytes] | None:
        """Letters and what they carry → the answer; None where the protocol has none."""
        if 8 + len(data) > self.buffer:
            raise _Refused(BLOCK_BAD, "T_BD") if command == "S_FL" else _Refused(WRONG)
        if command not in FREE and not any(command in OF[login] for login in self.opened):
            raise _Refused(NO_RIGHT if any(command in group for group in OF.values()) else UNKNOWN_TELEGRAM)
        if command == "T_FD" and not self.secure:
            self._store()
            return None
        return getattr(self, "_" + command.lower(), self._unknown)(data)

    def _unknown(self, data: bytes) -> tuple[str, bytes]:
        raise _Refused(UNKNOWN_TELEGRAM)

    def _a_lg(self, data: bytes) -> tuple[str, bytes]:
        name, *rest = [part.decode("latin1") for part in data.rstrip(b"\0").split(b"\0")]
        wanted = self.control.users.get(name)
        if name not in self.control.logins or (wanted is not None and rest[:1] != [wanted]):
            raise _Refused(NO_LOGIN)
        self.opened.add(name)
        return "T_OK", b""

    def _a_lo(self, data: bytes) -> tuple[str, bytes]:
        name = data.rstrip(b"\0").decode("latin1")
        self.opened = self.opened - {name} if name else set()
        return "T_OK", b""

    def _r_vr(self, data: bytes) -> tuple[str, bytes]:
        if not data:
            return "S_VR", self.control.name.encode() + b"\x00340595 08\x00Basic V1\x0000000001\x00"
        return "S_VR", b"340595 08\0"

    def _r_pr(self, data: bytes) -> tuple[str, bytes]:
        numbers = [0] * 14 + [0] * 8 + [0] * 8 + [1, 0, self.control.block, 0, 0, 0, 0] + [0, 0, 0, 0, 0]
        return "S_PR", struct.pack("!14L8B8L2BH4B2L2HL", *numbers)

    def _r_ci(self, data: bytes) -> tuple[str, bytes]:
        return "S_CI", struct.pack("!LL", 1, 1 if data[-1:] == b"\x02" and "DNC" in self.control.logins else 0)

    def _c_cc(self, data: bytes) -> tuple[str, bytes]:
        (what,) = struct.unpack("!H", data[:2])
        if what in SET_BUFFER and SET_BUFFER[what] <= self.control.block:
            self.buffer = SET_BUFFER[what]
        elif what == SECURE_SEND and self.control.secure:
            self.secure = True
        else:
            raise _Refused(WRONG)
        return "T_OK", b""

    def _r_ri(self, data: bytes) -> tuple[str, bytes]:
        (what,) = struct.unpack("!H", data[:2])
        if what == 26:
            return "S_RI", struct.pack("!H", STARTED if self.control.moving() else self.control.state)
        if what == 23:
            return "S_RI", struct.pack("!H", 4)
        raise _Refused(WRONG)

    def _whole(self, data: bytes) -> str:
        path = data.split(b"\0")[0].decode("latin1").rstrip("\\")
        return path if path[:4].upper() in ("TNC:", "PLC:", "SYS:", "LOG:") else self.folder + "\\" + path

    def _r_di(self, data: bytes) -> tuple[str, bytes]:
        return "S_DI", struct.pack("!L", 0xFFFFFFFF) + bytes(160) + self.folder.encode("latin1") + b"\\\0"

    def _c_dc(self, data: bytes) -> tuple[str, bytes]:
        path = self._whole(data)
        if path.upper() not in {own.upper() for own in self.control.folders}:
            raise _Refused(NO_DIRECTORY)
        self.folder = path
        return "T_OK", b""

    def _c_dm(self, data: bytes) -> tuple[str, bytes]:
        self.control.folders.add(self._whole(data))
        return "T_OK", b""

    def _r_fi(self, data: bytes) -> tuple[str, bytes]:
        path = self._whole(data)
        name = self.control.real(path)
        if name in self.control.files:
            entry = struct.pack("!LLL", len(self.control.files[name]), 1_700_000_000, 0x02)
        elif path.upper() in {own.upper() for own in self.control.folders}:
            entry = struct.pack("!LLL", 0, 1_700_000_000, 0x20)
        else:
            raise _Refused(NO_FILE)
        return "S_FI", entry + name.rpartition("\\")[2].encode("latin1") + b"\0"

    def _c_fd(self, data: bytes) -> tuple[str, bytes]:
        name = self.control.real(self._whole(data))
        if name not in self.control.files:
            raise _Refused(NO_FILE)
        if name in self.control.in_use:
            raise _Refused(IN_USE)
        del self.control.files[name]
        return "T_OK", b""

    def _c_fl(self, data: bytes) -> tuple[str, bytes]:
        path, binary = self._whole(data), data.split(b"\0", 1)[1][:1] == b"\x01"
        if self.control.real(path) in self.control.files:
            raise _Refused(EXISTS)
        if path.rpartition("\\")[0].upper() not in {own.upper() for own in self.control.folders}:
            raise _Refused(NO_DIRECTORY)
        self._in = (path, binary, bytearray())
        return "T_OK", b""

    def _s_fl(self, data: bytes) -> tuple[str, bytes]:
        if self._in is None:
            raise _Refused(21)
        path, binary, whole = self._in
        if not binary and not data.endswith((b"\0", b"\n")):
            self._in = None
            raise _Refused(BLOCK_BAD, "T_BD")
        whole += data
        if sum(map(len, self.control.files.values())) + len(whole) > self.control.space:
            self.control.files[path] = bytes(whole[: -len(data)])
            self._in = None
            raise _Refused(BLOCK_NO_SPACE, "T_BD")
        return "T_OK", b""

    def _t_fd(self, data: bytes) -> tuple[str, bytes]:
        self._store()
        return "T_OK", b""

    def _store(self) -> None:
        if self._in is None:
            raise _Refused(21)
        path, binary, whole = self._in
        self.control.files[path] = bytes(whole) if binary else bytes(whole).replace(b"\0", b"\r\n")
        self._in = None

    def _r_fl(self, data: bytes) -> tuple[str, bytes]:
        name = self.control.real(self._whole(data))
        if name not in self.control.files:
            raise _Refused(NO_FILE)
        whole = self.control.files[name]
        if data.split(b"\0", 1)[1][:1] != b"\x01":
            whole = whole.replace(b"\r\n", b"\0")
        room = self.buffer - 8
        self._out = [whole[at : at + room] for at in range(0, len(whole), room)]
        return self._t_ok(b"")

    def _t_ok(self, data: bytes) -> tuple[str, bytes]:
        return ("S_FL", self._out.pop(0)) if self._out else ("T_FD", b"")


def _exactly(line: socket.socket, count: int) -> bytes:
    got = b""
    while len(got) < count:
        more = line.recv(count - len(got))
        if not more:
            raise ConnectionError
        got += more
    return got


def _serve(control: Control, line: socket.socket, over: threading.Event) -> None:
    control.talking += 1
    try:
        _talked(control, line, over)
    finally:
        control.talking -= 1


def _talked(control: Control, line: socket.socket, over: threading.Event) -> None:
    talk = _Talk(control)
    control.joined.append(control.moving())
    line.settimeout(30.0)
    with line, contextlib.suppress(OSError):
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while not over.is_set():
            (length,) = struct.unpack("!L", _exactly(line, 4))
            command = _exactly(line, 4).decode("latin1")
            data = _exactly(line, length)
            control.heard.append(Heard(command, data, control.moving()))
            fault = control.fault(command)
            if fault == "hangup":
                return
            if fault == "silent":
                over.wait(30.0)
                return
            try:
                if fault == "error":
                    raise _Refused(90)
                said = talk.answer(command, data)
            except _Refused as refused:
                said = (refused.kind, bytes((1, refused.code)))
            if said is None:
                continue
            whole = struct.pack("!L", len(said[1])) + said[0].encode() + said[1]
            if fault == "half":
                line.sendall(whole[: len(whole) // 2])
                return
            for piece in [whole[at : at + 3] for at in range(0, len(whole), 3)] if fault == "bytes" else [whole]:
                line.sendall(piece)
                if fault == "bytes":
                    over.wait(0.0005)


@contextlib.contextmanager
def serving(control: Control) -> Iterator[int]:
    """A control → the port at which it listens on this computer, until the block ends."""
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as door:
        door.settimeout(0.05)

        def listen() -> None:
            while not over.is_set():
                with contextlib.suppress(TimeoutError):
                    threading.Thread(target=_serve, args=(control, door.accept()[0], over), daemon=True).start()

        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        try:
            yield door.getsockname()[1]
        finally:
            over.set()
            thread.join()
