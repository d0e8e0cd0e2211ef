"""A record file on the disk of a control, followed over the network; the program put there and read back."""

from __future__ import annotations

import contextlib
import hashlib
import posixpath
import re
import time
from pathlib import Path
from urllib.parse import unquote, urlsplit

from ...records import InputError, LinkError
from ..address import Address
from ..ways import Way
from ._file import FOREIGN, foreign, whole_lines
from ._line import Lost, reason
from ._refused import RefusedError
from ._stores import PORTS, RemoteFiles, Store, needed, store

LOOK = 1.0  # s between two looks
MOST = 1 << 20  # bytes in one look
REMEMBERED = 64  # bytes before the place that was reached, by which the file is known again
AGAIN = 60.0  # s for which a connection that broke is tried again: controls close idle ones
BETWEEN = 2.0  # s between two tries
BOM = b"\xef\xbb\xbf"
START = b"TANGO START"
OURS = re.compile(rb"PROGRAM [0-9A-F]{12} PLAN [0-9A-F]{12}")
HEAD = 4000  # bytes within which a program of ours names itself
NAMES = {rb"^DEF INT TG_": "TANGO.MPF", rb"^OTNGO\b": "TANGO.MIN"}  # of programs for Siemens and Okuma in a folder
HEX = frozenset(b"0123456789ABCDEF")
LIES = "; a part of it may lie there: delete it, and start nothing"
BROKEN = (OSError, EOFError, LinkError)


def foreseen(address: Address) -> None:
    """port → nothing. Raises InputError where the library is missing, or the key is no file."""
    if address.scheme in ("sftp", "smb"):
        needed({"sftp": "paramiko", "smb": "smbclient"}[address.scheme], address.scheme)
    _paths(address)
    key = Path(address.options.get("key") or __file__)
    if not key.is_file():
        raise InputError(f"port {address.url}: key: found {key}; allowed: the file of a private key")


def paths(address: Address) -> tuple[str, str]:
    """port → path of the record file, place of the program or ''."""
    return unquote(urlsplit(f"//{address.target}").path), address.options.get("program", "")


def _paths(address: Address) -> None:
    """port → nothing. Raises InputError for a share without a file, and for one file of program and records."""
    path, program = paths(address)
    if address.scheme == "smb":
        for key, name in (("path", path), ("program", program)):
            if name and len(name.strip("/").split("/")) < 2 and not (key == "program" and name.strip("/") and name.endswith("/")):
                raise InputError(
                    f"port {address.url}: {key}: found {name}; allowed: the share, then a file on it, e.g. /SHARE/TANGO.TXT"
                )
    if program and _same(program, path):
        raise InputError(f"port {address.url}: program: found {program}, which is the file of the records; allowed: another file")


def fits(address: Address, program: bytes) -> None:
    """port, program → nothing. Raises InputError where it would have the name of the record file in the folder it goes to."""
    path, place = paths(address)
    if place.endswith("/") and _same(name := place + _name(program), path):
        raise InputError(
            f"port {address.url}: program: found the folder {place}, where this program is called {name}, which is the file of the "
            "records; allowed: another folder, or the name of another file"
        )


def _same(one: str, other: str) -> bool:
    """two paths at a control → whether they are one file; a Heidenhain path has its backslashes and no slash in front."""
    first, second = (posixpath.normpath("/" + path.replace("\\", "/").lstrip("/")).upper() for path in (one, other))
    return first == second


class Remote:
    """The growing file: whole lines alone; from a NUL on it waits; a file that was replaced is read from its beginning."""

    chunk = 1 << 16

    def __init__(self, address: Address) -> None:
        self._address, self._parts = address, urlsplit(f"//{address.target}")
        self._path = unquote(self._parts.path)
        self._program = address.options.get("program", "")
        self._rest, self._answers, self._due = b"", b"", 0.0
        self._store: Store | None = None
        self._failed: Lost | None = None  # of a program of which a part lies at the control
        self._writing = False  # a program goes there, or has gone
        self._at, self._before = 0, b""
        self._begin()

    def _begin(self) -> None:
        """Notes where the record file ends now, or where its last start mark is."""
        there = self._open()
        size = self._usable(there) or 0
        if size and foreign(there.read(self._path, 0, HEAD), there.read(self._path, max(0, size - HEAD), HEAD)):
            raise InputError(f"port {self._address.url}: {FOREIGN}. Nothing was put at the control")
        old = size
        if self._address.options.get("from", "now") == "last":
            old = max(0, there.read(self._path, 0, size).rfind(START))
        if old:
            begin = max(0, old - REMEMBERED)
            self._at, self._before = old, there.read(self._path, begin, old - begin)

    def _usable(self, there: RemoteFiles) -> int | None:
        """open store → bytes of the record file, None for none. Raises InputError for places where nothing can be written."""
        size = self._size(there, self._path, "the file of the records")
        program, there_is = self._program, False
        if program and not program.endswith("/"):
            with contextlib.suppress(OSError):  # a name that the control does not take is said when the program goes there
                there_is = self._size(there, program, "program= a file, or a folder with / at its end") is not None
        for name, path, here in (("", self._path, size is not None), ("program: ", program, there_is)):
            if path and not here and self._lacked(there, path):
                why = "" if name else "; no program can write its records there"
                raise InputError(
                    f"port {self._address.url}: {name}there is no folder {posixpath.dirname(path)} at the control{why}. Correct "
                    "the path. Nothing was put at the control"
                )
        return size

    def _size(self, there: RemoteFiles, path: str, allowed: str) -> int | None:
        """open store, path → bytes of the file, None for none. Raises InputError for a folder."""
        try:
            return there.size(path)
        except IsADirectoryError:
            raise InputError(
                f"port {self._address.url}: {path} is a folder at the control; allowed: {allowed}. Nothing was put at the control"
            ) from None

    @staticmethod
    def _lacked(there: RemoteFiles, path: str) -> bool:
        """open store, path → whether it is certain that its folder does not exist."""
        folder = posixpath.dirname(path)
        return bool(folder.strip("/")) and there.lacks(folder)

    def _open(self) -> Store:
        self._store = store(self._address.scheme, self._parts, dict(self._address.options))
        return self._store

    def read(self, timeout: float) -> bytes:
        """s → the whole lines that have been added. Raises Lost when the control cannot be reached for a minute."""
        if self._failed is not None:
            raise self._failed
        answers, self._answers = self._answers, b""
        if answers:
            return answers
        wait = self._due - time.monotonic()
        if wait > 0:
            time.sleep(min(wait, timeout))
            return b""
        self._due = time.monotonic() + LOOK
        until = time.monotonic() + AGAIN
        while True:
            try:
                return self._new(self._store or self._open())
            except RefusedError as error:
                self._hang_up()
                raise Lost(str(error)) from None
            except BROKEN as error:
                self._hang_up()
                if time.monotonic() > until:
                    raise Lost(f"the control cannot be reached any more: {_why(error)}") from None
                time.sleep(BETWEEN)

    def _new(self, there: RemoteFiles) -> bytes:
        data = there.read(self._path, self._at - len(self._before), MOST)
        if not data.startswith(self._before):
            if not data and there.size(self._path) is None:
                return b""  # it is being replaced
            self._at, self._before = 0, b""
            data = there.read(self._path, 0, MOST)
        added = data[len(self._before) :].partition(b"\0")[0]
        whole = whole_lines(added)
        first, self._at = self._at == 0, self._at + len(whole)
        self._before = (self._before + whole)[-REMEMBERED:]
        return whole.removeprefix(BOM) if first else whole

    def write(self, data: bytes) -> int:
        """bytes of a request → all taken; a whole one puts the program. Raises Lost."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._answers += self._put(bytes.fromhex(line.removeprefix(b"put ").decode("ascii")))
        return len(data)

    def _put(self, program: bytes) -> bytes:
        """program → what was read back, by its hash; nothing where it was cut off and a part of it lies there. Raises Lost."""
        name = self._place(program)
        try:
            return self._put_at(self._store or self._open(), program)
        except (OSError, EOFError, LinkError) as error:
            if isinstance(error, Lost | RefusedError):
                raise Lost(str(error)) from None
            lost = Lost(f"the program cannot be put at the control as {name}: {_why(error)}{self._left(name, program)}")
            if self._failed is None:
                raise lost from None
            self._failed = lost
            return b""

    def _left(self, name: str, program: bytes) -> str:
        """place of a program that was cut off, the program → what became of the part of it, as the end of a sentence."""
        if not self._writing:
            return ""
        part = True
        self._hang_up()  # what is still to come over it belongs to the program
        try:
            there = self._open()
            back = there.read(name, 0, len(program) + 1)
            part = (bool(back) or there.size(name) is not None) and len(back) < len(program) and program.startswith(back)
            if part:
                there.remove(name)
                return "; the part of it that lay there was taken away"
        except (OSError, EOFError, LinkError):
            pass
        if not part:  # nothing lies there, or the file of before
            return ""
        self._failed = Lost("")
        return LIES

    def _place(self, program: bytes) -> str:
        """program → where it goes."""
        return self._program + (_name(program) if self._program.endswith("/") else "")

    def _put_at(self, there: RemoteFiles, program: bytes) -> bytes:
        """open store, program → what was read back, by its hash. Raises Lost for a place where it may not go."""
        name = self._place(program)
        if _same(name, self._path):
            raise Lost(f"program and records are one file, {name}; state two names")
        before = there.read(name, 0, HEAD)
        if before and not OURS.search(before) and not began(before, program):
            raise Lost(f"{name} is at the control already and is no program of 'tango plan'; it would be lost: another name")
        self._writing = True
        there.write(name, program)
        back = there.read(name, 0, len(program) + 1)
        if len(back) < len(program) and program.startswith(back):
            self._left(name, program)  # a disk that was full without a word; what was read says that it is not the program
        return b"PUT %s\n" % hashlib.sha256(back).hexdigest().encode()

    def _hang_up(self) -> None:
        if self._store is not None:
            self._store.close()
            self._store = None

    def close(self) -> None:
        """Hangs up."""
        self._hang_up()


def began(there: bytes, program: bytes) -> bool:
    """bytes that lie at the control, program → whether they are the beginning of one of ours that was cut off before its name."""
    named = OURS.search(program)
    ends = 0 if named is None else named.end()
    return len(there) < ends and all(a == b or {a, b} <= HEX for a, b in zip(there, program, strict=False))


def _name(program: bytes) -> str:
    """program → the name under which it goes into a folder: its O number, its Klartext name, one of `NAMES`, else TANGO.NC."""
    if klartext := re.match(rb"(?:\d+ )?BEGIN PGM ([A-Za-z0-9_-]{1,32}) ", program):
        return f"{klartext[1].decode()}.H"
    number = re.search(rb"^O(\d{4,5})", program, re.MULTILINE)
    if number:
        return f"O{number[1].decode()}"
    return next((name for shape, name in NAMES.items() if re.search(shape, program, re.MULTILINE)), "TANGO.NC")


def _why(error: BaseException) -> str:
    if isinstance(error, EOFError):
        return "the connection was closed"
    return reason(error) if isinstance(error, OSError) else str(error)


WAYS = {
    name: Way(
        Remote,
        "disk",
        path=True,
        stored=True,
        foreseen=foreseen,
        fits=fits,
        example=f"{name}://user@192.168.1.20/folder/TANGO.TXT?password=env:NAME",
    )
    for name in PORTS
}
