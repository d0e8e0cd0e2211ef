"""The disk of a Heidenhain control by LSV2 (pyLSV2): connected for one request at a time, and only when somebody says it stands.

Requests and answers in words (`protocols/lsv2.py`). An answer begins with a character that no file brings in here.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import re
import socket
import struct
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import quote

from ...files.checked import printable
from ...records import InputError, LinkError
from ..address import Address
from ..ways import Way
from ._file import FOREIGN, foreign
from ._line import Lost, reason
from ._person import Person
from ._refused import RefusedError
from ._remote import HEAD, START, Remote, fits, paths
from ._remote import foreseen as remote_foreseen
from ._stores import needed

PATIENCE = 10.0  # s for one telegram
TRIES, BETWEEN = 3, 2.0  # of a request whose connection broke; s between two
PORT = 19000
LARGEST = 1 << 26  # bytes of a file
BLOCK = 256 - 8 - 2  # bytes of a file in one telegram; some iTNC 530 refuse longer ones although they agree to them
BINARY = b"\x01"
SECURE = 19  # C_CC: the end of a transfer is acknowledged
LATER = ("LSV2_BUSY", "LSV2_X_BUSY", "T_ER_ACCESS_TIMEOUT", "LSV2_TIMEOUT")  # what may be asked once more
ANSWER = b"\x01"
LONGEST = 1000  # characters of a reason; each may need three
MOST = BLOCK  # bytes of a path in one telegram
# drive, folders, file, in the letters of the protocol; none that a name of a file may not have
ALLOWED = 'drive, folders, file, in Western letters, without * ? " < > | in names, at most 244 characters'
PLACE = re.compile(r'[A-Za-z][A-Za-z0-9_]*:(?:\\[^\\/:*?"<>|\x00-\x1f\x7f-\x9f]+)*\\?')


class Lsv2:
    """One connection: the verbs of a store, and what the control is doing. Every error is an OSError or LinkError."""

    def __init__(self, host: str, port: int, password: str = "") -> None:
        """host, port, password of the logins where the control asks for one → connected and logged in."""
        library = needed("pyLSV2", "lsv2")
        logging.getLogger("LSV2 Client").setLevel(logging.CRITICAL + 1)
        logging.getLogger("LSV2 TCP").setLevel(logging.CRITICAL + 1)
        self._consts = library.const
        self._text = library.translate_messages.get_error_text
        # the least that every control can: telegrams of 256 bytes; safe mode: no command that acts
        self._control = library.LSV2("127.0.0.1", port, PATIENCE, safe_mode=True, compatibility_mode=True)
        self._line = self._control._llcom
        self._line._tcpsock.close()  # the library knows IPv4 alone
        # the library's own takes half a telegram for a whole one, and waits for ever on a line that was closed
        self._line.telegram = self._telegram
        logins = library.const.Login
        with self._asked():
            self._line._tcpsock = socket.create_connection((host, port), PATIENCE)
            self._line._is_connected = True
            self._login(logins.INSPECT, password)
            self._login(logins.FILETRANSFER, password)
            self._control._configure_connection()  # which finds both logins done
            asked = self._control._send_recive(self._consts.CMD.C_CC, struct.pack("!H", SECURE), self._consts.RSP.T_OK)
            self._secure = bool(asked)

    def _telegram(self, command: Any, payload: bytes = b"", wait_for_response: bool = True) -> bytearray:
        """letters, what they carry → what the answer carries; its letters and its error are kept as the library does."""
        line, rsp = self._line._tcpsock, self._consts.RSP
        until = time.monotonic() + PATIENCE
        line.settimeout(PATIENCE)
        line.sendall(struct.pack("!L", len(payload)) + command.value.encode("ascii") + bytes(payload))
        self._line._last_lsv2_response, self._line._last_error = rsp.NONE, type(self._line.last_error)()
        if not wait_for_response:
            return bytearray()
        length, letters = struct.unpack("!L4s", self._exactly(8, until))
        if length > 1 << 16:
            raise OSError(f"a telegram of {length} bytes: that is no LSV2")
        content = self._exactly(length, until)
        self._line._last_lsv2_response = rsp(letters.decode("latin1"))  # ValueError: not one of the protocol
        if self._line.last_response in (rsp.T_ER, rsp.T_BD):
            self._line._last_error = self._line.last_error.from_ba(content) if length == 2 else self._line.last_error
            self._line._last_error.e_type = 1
        return content

    def _exactly(self, count: int, until: float) -> bytearray:
        got = bytearray()
        while len(got) < count:
            left = until - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"no answer within {PATIENCE:.0f} s")
            self._line._tcpsock.settimeout(left)
            more = self._line._tcpsock.recv(count - len(got))
            if not more:
                raise EOFError
            got += more
        return got

    @contextlib.contextmanager
    def _asked(self) -> Iterator[None]:
        """Within it, what the library raises is an OSError or a LinkError, and the connection is closed."""
        try:
            yield
        except LinkError:
            self._drop()
            raise
        except EOFError:
            self._drop()
            raise OSError("the control closed the connection") from None
        except Exception as error:  # of sockets, of the library, of what it makes of a telegram that is none
            self._drop()
            raise error if isinstance(error, OSError) else OSError(f"{type(error).__name__}: {error}"[:200]) from None

    def _refused(self, what: str) -> Exception:
        """what was asked → the error of the control in its words."""
        error = self._line.last_error
        text = f"{what}: {self._text(error)}" if error.e_code.value >= 0 else f"{what}: answered {self._line.last_response.value}"
        return OSError(text) if error.e_code.name in LATER else LinkError(f"the control refuses {text}")

    def _login(self, login: Any, password: str) -> None:
        """login, password → logged in; the password goes out only where it does not work without. Raises LinkError."""
        if self._control.login(login):
            return
        if password and self._control.login(login, password):
            return
        error = self._refused(f"the login {login.value}")
        if not isinstance(error, LinkError):
            raise error
        asked = "with this password" if password else "without a password: state password=env:NAME in the port's URL"
        raise RefusedError(
            f"the control does not let this computer in (login {login.value}) {asked}. A control with user administration may "
            f"want an SSH tunnel instead (docs/link.md). It says: {self._text(self._line.last_error)}"
        )

    def name(self) -> str:
        """→ what the control calls itself."""
        versions = self._control.versions
        return f"{versions.control} {versions.nc_sw}".strip()

    def runs(self) -> bool:
        """→ whether the control says that its program runs; False too where it does not tell (option DNC)."""
        if not self._control.parameters.dnc_mode_allowed:
            return False
        with self._asked():
            self._control.switch_safe_mode(False)  # which forbids the login that reads the state
            try:
                return bool(self._control.program_status() == self._consts.PgmState.STARTED)
            finally:
                self._control.switch_safe_mode(True)

    def size(self, path: str) -> int | None:
        """path → bytes of the file, None when there is none. Raises IsADirectoryError for a folder."""
        with self._asked():
            found = self._control.file_info(_named(path))
            if found is not None and found.is_directory:
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if found is None and self._line.last_error.e_code.name != "T_ER_NO_FILE":
                raise self._refused(path)
            return None if found is None else int(found.size)

    def lacks(self, folder: str) -> bool:
        """folder → whether the control says that it does not exist."""
        cmd, rsp, name = self._consts.CMD, self._consts.RSP, _named(folder)
        with self._asked():
            # of this connection alone; files are named by their whole paths
            self._line.telegram(cmd.C_DC, (name + "\\" * name.endswith(":")).encode("latin1") + b"\0")
            return self._line.last_response is rsp.T_ER and self._line.last_error.e_code.name == "T_ER_NO_DIR"

    def read(self, path: str, offset: int, most: int) -> bytes:
        """path, from where, how many at most → bytes of the file; the protocol knows whole files alone."""
        cmd, rsp = self._consts.CMD, self._consts.RSP
        with self._asked():
            whole, piece = bytearray(), self._line.telegram(cmd.R_FL, _zero(path) + BINARY)
            while self._line.last_response is rsp.S_FL and len(whole) <= LARGEST:
                whole += piece
                piece = self._line.telegram(rsp.T_OK)
            if self._line.last_response is rsp.T_FD:
                return bytes(whole[offset : offset + most])
            if self._line.last_error.e_code.name == "T_ER_NO_FILE" and not whole:
                return b""
            raise self._refused(path)

    def write(self, path: str, data: bytes) -> None:
        """path, bytes → the file has them; one that is there is deleted first, as the protocol wants it."""
        cmd, rsp = self._consts.CMD, self._consts.RSP
        with self._asked():
            if self.size(path) is not None and not self._control.delete_file(_named(path)):
                raise self._refused(path)
            self._line.telegram(cmd.C_FL, _zero(path) + BINARY)
            for at in range(0, len(data), BLOCK):
                if self._line.last_response is not rsp.T_OK:
                    raise self._refused(path)
                self._line.telegram(rsp.S_FL, data[at : at + BLOCK])
            if self._line.last_response is not rsp.T_OK:
                raise self._refused(path)
            self._line.telegram(rsp.T_FD, b"", self._secure)
            if self._secure and self._line.last_response is not rsp.T_OK:
                raise self._refused(path)

    def remove(self, path: str) -> None:
        """path → the file is there no more."""
        with self._asked():
            if not self._control.delete_file(_named(path)):
                raise self._refused(path)

    def close(self) -> None:
        """Logs out and hangs up."""
        with contextlib.suppress(Exception):
            self._control.logout()
        self._drop()

    def _drop(self) -> None:
        with contextlib.suppress(Exception):
            self._line.disconnect()


def _named(path: str) -> str:
    """'/TNC:/A/B.H' → 'TNC:\\A\\B.H'."""
    return path.lstrip("/").replace("/", "\\")


def _zero(path: str) -> bytes:
    return _named(path).encode("latin1") + b"\0"


def _places(address: Address) -> None:
    """port → nothing. Raises InputError for a user, and for places that no control has: LSV2 knows whole paths from a drive on."""
    if "@" in address.target:
        raise InputError(
            f"port {address.url}: found a user; allowed: none. LSV2 has logins alone: password=env:NAME, if they need one"
        )
    for key, name in zip(("path", "program"), paths(address), strict=True):
        there = _named(name)
        try:
            fits = (
                PLACE.fullmatch(there) and len(there.encode("latin1")) + len(BINARY) < MOST and (key == "program" or "\\" in there)
            )
        except UnicodeEncodeError:
            fits = False
        if name and not fits:
            raise InputError(
                f"port {address.url}: {key}: found {printable(repr(name), 80)}; allowed: {ALLOWED}, e.g. /TNC:/TANGO.TXT"
                + (" or TNC:/ for a folder" if key == "program" else "")
            )


def foreseen(address: Address) -> None:
    """port → nothing. Raises InputError where the library is missing, for places that cannot be meant, and one file of both."""
    needed("pyLSV2", "lsv2")
    _places(address)
    remote_foreseen(address)


class Runs(LinkError):
    """The control says that its program runs: nothing is asked for, nothing taken away."""


class AtRest(Remote):
    """The record file and the program; a connection for each request, none in between."""

    def __init__(self, address: Address) -> None:
        needed("pyLSV2", "lsv2")
        _places(address)
        super().__init__(address)
        self._person, self._requests, self._known = Person(), [], False
        self._program = "/" + self._program.replace("\\", "/").lstrip("/") if self._program else ""

    _requests: list[bytes]

    def _begin(self) -> None:
        """Nothing is opened before a request says so, or `look`."""

    def look(self) -> None:
        """Connects, unless the program runs, notes where the record file ends, and hangs up: nothing moves meanwhile.

        Raises InputError and RefusedError for what no run can use: the control would refuse it again. OSError: nobody answers.
        """
        self._repeated(b"open", b"")

    def write(self, data: bytes) -> int:
        """bytes of a request → all taken."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._requests += lines
        return len(data)

    def read(self, timeout: float) -> bytes:
        """s → lines of the record file and the answer to the request written last; empty when there is none to answer."""
        if not self._requests:
            time.sleep(timeout)
            return b""
        verb, _, value = self._requests[0].partition(b" ")
        if verb == b"still":
            said = self._person.asked(timeout)
            if said is None:
                return b""
            answer = ANSWER + (b"STILL" if said else b"NOBODY")
        else:
            answer = self._tried(verb, value)
        self._requests.pop(0)
        return answer + b"\n"

    def _tried(self, verb: bytes, value: bytes) -> bytes:
        """what to do → the answer, over a new connection each time."""
        self._writing = False
        try:
            return self._repeated(verb, value)
        except OSError as error:
            away = isinstance(error, ConnectionError | TimeoutError | socket.gaierror)
            why = f"the control cannot be reached: {reason(error)}" if away else reason(error)
        except (InputError, RefusedError) as error:
            return ANSWER + f"WRONG {quote(str(error)[:LONGEST])}".encode()
        except (Lost, LinkError) as error:
            why = str(error)
        if verb == b"put":
            program = bytes.fromhex(value.decode("ascii"))
            why += self._left(self._place(program), program)
        return ANSWER + f"! {quote(why[:LONGEST])}".encode()

    def _repeated(self, verb: bytes, value: bytes) -> bytes:
        """what to do → the answer; a connection that breaks is made again. Raises OSError, InputError, LinkError."""
        for _ in range(TRIES - 1):
            try:
                return self._done(verb, value)
            except OSError:
                time.sleep(BETWEEN)
        return self._done(verb, value)

    def _open(self) -> Lsv2:
        """→ connected and logged in. Raises Runs where the control says that its program runs."""
        self._store = there = Lsv2(self._parts.hostname or "", self._parts.port or PORT, self._address.options.get("password", ""))
        if there.runs():
            self._hang_up()
            raise Runs("its program runs")
        return there

    def _done(self, verb: bytes, value: bytes) -> bytes:
        try:
            there = self._open()
            if verb == b"open":
                if not self._known:
                    self._mark(there)
                return ANSWER + f"OPEN {quote(there.name())}".encode()
            if verb == b"put":
                return ANSWER + self._put_at(there, bytes.fromhex(value.decode("ascii"))).strip()
            lines = b""
            while piece := self._new(there):
                lines += piece.replace(ANSWER, b"?")
            return lines + ANSWER + b"LOOK"
        except Runs:
            return ANSWER + b"RUNS"
        finally:
            self._hang_up()

    def _mark(self, there: Lsv2) -> None:
        """Notes where the record file ends now: what stands in it is of another run."""
        self._usable(there)
        whole = there.read(self._path, 0, LARGEST)
        if whole and foreign(whole[:HEAD], whole[-HEAD:]):
            raise InputError(f"port {self._address.url}: {FOREIGN}. Nothing was put at the control")
        old = max(0, whole.rfind(START)) if self._address.options.get("from", "now") == "last" else len(whole)
        self._at, self._before, self._known = old, whole[max(0, old - 64) : old], True


WAYS = {
    "lsv2": Way(
        AtRest,
        "disk",
        path=True,
        stored=True,
        foreseen=foreseen,
        fits=fits,
        look=AtRest.look,
        example="lsv2://192.168.1.20/TNC:/TANGO.TXT",
    )
}
