"""linuxcncrsh and the two files beside it."""

from __future__ import annotations

import re
import time
from pathlib import Path

from ...files.targets import same
from ...records import InputError
from ..address import OWN, Address
from ..ways import Way
from ._line import REST, SLICE, Lost, reason
from ._tcp import Tcp

HEAD = 4000  # bytes by which a file of an earlier run is recognized
PROGRAM = re.compile(rb"[^\0]*\(PROGRAM [0-9A-F]{12} PLAN [0-9A-F]{12}.*", re.DOTALL)
RECORDS = re.compile(rb"\s*(TANGO (START|END) .*)?", re.DOTALL)


def _head(file: Path) -> bytes:
    with file.open("rb") as opened:
        return opened.read(HEAD)


class LinuxCnc(Tcp):
    """linuxcncrsh on this computer, and the two files that it cannot carry: `put` writes the program, the log is read."""

    def __init__(self, address: Address) -> None:
        foreseen(address)
        self._file, self._log = Path(address.options["file"]), Path(address.options["log"])
        self._at, self._due, self._rest = 0, 0.0, b""
        self._answers = b""
        super().__init__(address)

    def read(self, timeout: float) -> bytes:
        """s → what linuxcncrsh answers, and new whole lines of the log with LOG in front. Raises Lost."""
        new = self._answers + self._logged()
        self._answers = b""
        return new or super().read(min(timeout, SLICE))

    def write(self, data: bytes) -> int:
        """bytes → all taken; whole lines go out, LF CR of some dialects is no line end here. Raises Lost."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if line.startswith(b"put "):
                self._put(bytes.fromhex(line.split()[2].decode("ascii")))
                continue
            time.sleep(max(0.0, self._due - time.monotonic()))  # the log and the status are looked at, not hammered
            self._due = time.monotonic() + REST
            self._socket.setblocking(True)
            try:
                self._socket.sendall(line + b"\n")
            except OSError as error:
                raise Lost(f"the connection broke: {reason(error)}") from None
            finally:
                self._socket.setblocking(False)
        return len(data)

    def _put(self, program: bytes) -> None:
        file = self._file
        try:
            with file.open("wb", buffering=0) as out:
                left = memoryview(program)
                try:
                    while left:
                        left = left[out.write(left) or 0 :]
                except OSError:  # a piece of a program is nothing to be started, and would keep every later run out
                    out.truncate(0)
                    raise
            file = self._log
            file.unlink(missing_ok=True)
        except OSError as error:
            raise Lost(f"{file}: cannot be written ({error.strerror}); make room, or check the rights of the folder") from None
        self._at, self._answers = 0, b"PUT\n"

    def _logged(self) -> bytes:
        try:
            with self._log.open("rb") as log:
                log.seek(self._at)
                whole = log.read().rpartition(b"\n")
        except OSError:
            return b""
        self._at += len(whole[0] + whole[1])
        return b"".join(b"LOG %s\n" % line for line in whole[0].split(b"\n") if line.strip())


def foreseen(address: Address) -> None:
    """port → nothing. Raises InputError where a file is not named, and unless both may be replaced.

    They may when nothing is there, or what a run has left there.
    """
    missing = [name for name in ("file", "log") if name not in address.options]
    if missing:
        raise InputError(
            f"port {address.url}: found no {' and no '.join(missing)}; e.g. ?file=/tmp/tango.ngc&log=/tmp/tango-readings.txt"
        )
    program, log = Path(address.options["file"]), Path(address.options["log"])
    if same(program, log):
        raise InputError(f"port {address.url}: file and log are one file, {program}; allowed: two names")
    for name, file, own in (("file", program, PROGRAM), ("log", log, RECORDS)):
        if file.is_dir() or not file.absolute().parent.is_dir():
            raise InputError(f"port {address.url}: {name}: found {file}; allowed: a file in a folder that is there")
        if not file.exists() and not file.is_symlink():
            if file.name.lower().endswith(OWN):  # it may be an input of a cell tomorrow
                raise InputError(
                    f"port {address.url}: {name}: found {file}, a name of tango's own files, into which no control may write; "
                    f"allowed: another name, e.g. {'tango.ngc' if name == 'file' else 'tango-readings.txt'}"
                )
            continue
        if file.is_file() and not file.stat().st_size:  # nothing to lose: the disk was full, or the plug was pulled, before a byte
            continue
        if not file.is_file() or not own.fullmatch(_head(file)):
            what = "a program of 'tango plan'" if name == "file" else "records that such a program wrote"
            raise InputError(
                f"port {address.url}: {name}: found {file}, which is there and is not {what}; it would be lost. Allowed: another "
                "name, or move that file away"
            )


WAYS = {"rsh": Way(LinuxCnc, "host", stored=True, foreseen=foreseen)}
