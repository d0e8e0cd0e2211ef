"""A file that another computer writes: read as it grows, in whole lines."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path
from typing import BinaryIO

from ...duration import spoken
from ...records import InputError, LinkError
from ..address import Address
from ..ways import Way
from ._line import Lost, reason

LOOK = 0.2  # s between two looks
MOST = 1 << 20  # bytes in one look
REMEMBERED = 64  # bytes before the place that was reached, by which the file is known again
BOM = b"\xef\xbb\xbf"
START = b"TANGO START"
HEAD = 4000  # bytes at either end by which a file is seen to hold records
CODES = b"\0\x11\x12\x13\x14\x7f"  # leader and print codes, which some controls write into files too
FOREIGN = (
    "found a file without a record of a TANGO program, and the control would write into it; allowed: a new name, an empty file, or "
    "one that such a program has written; if the control made it, move it away"
)
RECORD = re.compile(rb"^[ \t]*(TANGO +(START|END) |P *[0-9]+\.?[0-9]* *H *[0-9])", re.MULTILINE)


class File:
    """The growing file. It is opened anew at each look: over a network only who opens a file is told its size.

    A half line is left where it is until its end has come, and so is everything from a NUL on: where a file has grown before
    its data has arrived, NULs stand for it. A file in which what was read last is not there any more has been replaced and is
    read from its beginning; numbers of files are not what they are on a disk where a share is mounted.
    """

    chunk = 256

    def __init__(self, address: Address) -> None:
        foreseen(address)
        self._file = Path(address.target)
        if not self._file.parent.is_dir():
            raise LinkError(
                f"port {address.url}: there is no folder {self._file.parent}. Is the share of the control mounted, the path right?"
            )
        self._at, self._before = 0, b""
        if self._file.exists():
            try:
                with self._file.open("rb") as file:
                    old = file.seek(0, os.SEEK_END)
                    if address.options.get("from", "now") == "last":
                        old = _last_start(file, old)
                    file.seek(max(0, old - REMEMBERED))
                    self._at, self._before = old, file.read(old - file.tell())
            except OSError as error:
                raise LinkError(f"port {address.url}: the file cannot be read: {reason(error)}") from None

    def read(self, timeout: float) -> bytes:
        """s → the whole lines that have been added. Raises Lost when the folder is gone."""
        new = self._new()
        if not new and timeout > 0:
            time.sleep(min(timeout, LOOK))
            new = self._new()
        return new

    def _new(self) -> bytes:
        try:
            with self._file.open("rb") as file:
                file.seek(self._at - len(self._before))
                data = file.read(MOST)
                if not data.startswith(self._before):
                    self._at, self._before = 0, b""
                    file.seek(0)
                    data = file.read(MOST)
        except FileNotFoundError:
            if not self._file.parent.is_dir():
                raise Lost(f"the folder {self._file.parent} is gone: is the share still mounted?") from None
            return b""  # it is not there yet, or is being replaced
        except PermissionError:
            return b""  # the control has it open for itself
        except OSError as error:
            raise Lost(f"{self._file} cannot be read: {reason(error)}") from None
        added = data[len(self._before) :].partition(b"\0")[0]
        whole = whole_lines(added)
        first, self._at = self._at == 0, self._at + len(whole)
        self._before = (self._before + whole)[-REMEMBERED:]
        return whole.removeprefix(BOM) if first else whole

    def write(self, data: bytes) -> int:
        """bytes → all taken: nothing is sent over this link."""
        return len(data)

    def close(self) -> None:
        """Nothing is held open."""


def foreseen(address: Address) -> None:
    """port → nothing. Raises InputError for what no control may write its records into: seen before anything is written.

    A file that is there must be empty or have records in it; any other would be spoilt by what the control appends to it.
    """
    file = Path(address.target)
    if file.is_dir():
        raise InputError(f"port {address.url}: found a folder; allowed: the file in it that the control writes")
    if not file.exists():
        return
    if not file.is_file():
        raise InputError(f"port {address.url}: found a device or a pipe; allowed: a file that the control writes")
    try:
        with file.open("rb") as opened:
            head = opened.read(HEAD)
            opened.seek(max(0, opened.seek(0, os.SEEK_END) - HEAD))
            tail = opened.read(HEAD)
    except OSError:
        return  # said in the words of the system when it is opened
    if foreign(head, tail):
        raise InputError(f"port {address.url}: {FOREIGN}")


def aged(address: Address) -> str:
    """port → with `from=last`, how old what is read is: nobody else notices that it is yesterday's."""
    file = Path(address.target)
    if address.options.get("from", "now") != "last" or not file.is_file():
        return ""
    seconds = max(0.0, time.time() - file.stat().st_mtime)
    days = f"{seconds / 86400:.0f} days" if seconds >= 2 * 86400 else spoken(seconds)
    return f"from=last reads what is in {file.name} already, from its last start mark on; it was last written {days} ago"


def whole_lines(added: bytes) -> bytes:
    """what a file has more → as far as its last whole line; a Haas ends them with CR alone, others with LF or both."""
    return added[: max(added.rfind(b"\n"), added.rfind(b"\r")) + 1]


def foreign(head: bytes, tail: bytes) -> bool:
    """first and last bytes of a file that a control is to write into → whether it is neither empty nor one of records."""
    text = [piece.removeprefix(BOM).translate(None, CODES).replace(b"\r", b"\n") for piece in (head, tail)]
    return not START.startswith(text[0].strip()[: len(START)]) and not any(RECORD.search(piece) for piece in text)


def _last_start(file: BinaryIO, size: int) -> int:
    """open file, its size → where the last start mark begins, 0 where there is none; it is searched from the end."""
    end, tail = size, b""
    while end > 0:
        begin = max(0, end - MOST)
        file.seek(begin)
        piece = file.read(end - begin) + tail
        if (at := piece.rfind(START)) >= 0:
            return begin + at
        end, tail = begin, piece[: len(START) - 1]
    return 0


WAYS = {"file": Way(File, "file", path=True, foreseen=foreseen, before=aged)}
