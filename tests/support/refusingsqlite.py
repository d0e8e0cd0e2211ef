"""What SQLite writes goes through a disk that refuses, too: its own way to the disk is in C, which Python's places do not meet.

SQLite asks a table of functions for every file that it opens (sqlite.org/vfs.html); here stand others in their places while it is
asked for. A page that is half taken is followed by an error, as on a disk that is full.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, ClassVar

from support.refusingdisk import Disk

OK, FULL, CANTOPEN = 0, 13, 14
IOERR = {"write": 10 | 3 << 8, "fsync": 10 | 4 << 8, "ftruncate": 10 | 6 << 8, "unlink": 10 | 10 << 8, "extend": 10 | 19 << 8}
WRITES = 0x2  # SQLITE_OPEN_READWRITE
File, Text = ctypes.c_void_p, ctypes.c_char_p
Int, Long = ctypes.c_int, ctypes.c_int64
XOpen = ctypes.CFUNCTYPE(Int, File, ctypes.c_void_p, File, Int, ctypes.POINTER(Int))
XDelete = ctypes.CFUNCTYPE(Int, File, Text, Int)
XWrite = ctypes.CFUNCTYPE(Int, File, ctypes.c_void_p, Int, Long)
XTruncate = ctypes.CFUNCTYPE(Int, File, Long)
XSync = ctypes.CFUNCTYPE(Int, File, Int)
XShmMap = ctypes.CFUNCTYPE(Int, File, Int, Int, Int, ctypes.POINTER(ctypes.c_void_p))


class Methods(ctypes.Structure):
    """sqlite3_io_methods."""

    _fields_: ClassVar = [
        *(("version", Int), ("close", ctypes.c_void_p), ("read", ctypes.c_void_p), ("write", ctypes.c_void_p)),
        *((name, ctypes.c_void_p) for name in ("truncate", "sync", "size", "lock", "unlock", "reserved", "control", "sector")),
        *((name, ctypes.c_void_p) for name in ("device", "shm_map", "shm_lock", "shm_barrier", "shm_unmap", "fetch", "unfetch")),
    ]


class System(ctypes.Structure):
    """sqlite3_vfs, as far as it is asked here."""

    _fields_: ClassVar = [
        *(("version", Int), ("file_size", Int), ("longest", Int), ("next", ctypes.c_void_p), ("name", Text)),
        *(("data", ctypes.c_void_p), ("open", ctypes.c_void_p), ("delete", ctypes.c_void_p)),
    ]


@cache
def system() -> System | None:
    """→ SQLite's way to the disk in this process; None where it cannot be found."""
    import _sqlite3

    try:
        found = ctypes.CDLL(_sqlite3.__file__).sqlite3_vfs_find
    except (AttributeError, OSError):
        return None
    found.restype, found.argtypes = ctypes.POINTER(System), [Text]
    here = found(None)
    return here.contents if here and here.contents.name.startswith(b"unix") else None


class _Hooked:
    """The functions in the places of SQLite's own; `disk` None: they only pass on."""

    def __init__(self) -> None:
        self.disk: Disk | None = None
        self.paths: dict[int, str] = {}  # of files that are open, by their place in memory
        self.copies: dict[int, Methods] = {}
        self.kept: list[Any] = []  # functions that C holds

    def meets(self, what: str, path: str, code: int) -> tuple[int, bool]:
        """call, file, code of its error → code (0: it goes on), whether half of it is taken."""
        if self.disk is None or not path:
            return OK, False
        try:
            return OK, self.disk.meets(what, path)
        except OSError as error:
            return FULL if error.errno == errno.ENOSPC and what in ("write", "extend") else code, False

    def methods(self, address: int) -> int:
        """table of functions of a file → one that passes through here."""
        if address not in self.copies:
            copy = Methods.from_buffer_copy(Methods.from_address(address))
            real: dict[str, Any] = {}
            own: dict[str, Any] = {"write": XWrite, "truncate": XTruncate, "sync": XSync, "shm_map": XShmMap}
            own = {name: kind for name, kind in own.items() if getattr(copy, name)}  # a journal has no memory that is shared
            for name, kind in own.items():
                real[name] = kind(getattr(copy, name))

            def write(file: int, data: int, size: int, at: int) -> int:
                code, half = self.meets("write", self.paths.get(file, ""), IOERR["write"])
                if half:
                    real["write"](file, data, max(1, size // 2), at)
                    return FULL
                return code or int(real["write"](file, data, size, at))

            def one(name: str, what: str) -> Callable[[int, int], int]:
                return lambda file, value: (
                    self.meets(what, self.paths.get(file, ""), IOERR[what])[0] or int(real[name](file, value))
                )

            def shm_map(file: int, page: int, size: int, extend: int, found: Any) -> int:
                path = self.paths.get(file, "")
                code = self.meets("extend", f"{path}-shm" if path else "", IOERR["extend"])[0] if extend else OK
                return code or int(real["shm_map"](file, page, size, extend, found))

            stands = {"write": write, "truncate": one("truncate", "ftruncate"), "sync": one("sync", "fsync"), "shm_map": shm_map}
            for name, kind in own.items():
                held = kind(stands[name])
                self.kept += [held, real[name]]
                setattr(copy, name, ctypes.cast(held, ctypes.c_void_p).value)
            self.copies[address] = copy
        return ctypes.addressof(self.copies[address])


_HOOKED = _Hooked()


@contextlib.contextmanager
def refusing_sqlite(disk: Disk) -> Iterator[None]:
    """disk → until the block ends, what SQLite writes in its folders goes through it. Raises LookupError where that cannot be."""
    if (own := system()) is None:
        raise LookupError("this Python's SQLite cannot be asked")
    before = own.open, own.delete
    real_open, real_delete = XOpen(own.open), XDelete(own.delete)

    def opened(vfs: int, name: int | None, file: int, flags: int, out: Any) -> int:
        # The name is passed on where it lies in memory: behind it SQLite has the names of the files beside this one.
        path = os.path.abspath(os.fsdecode(ctypes.string_at(name))) if name else ""
        code = _HOOKED.meets("open", path, CANTOPEN)[0] if flags & WRITES else OK
        code = code or int(real_open(vfs, name, file, flags, out))
        if code == OK:
            _HOOKED.paths[file] = path
            methods = ctypes.c_void_p.from_address(file)
            if methods.value:
                methods.value = _HOOKED.methods(methods.value)
        return code

    def deleted(vfs: int, name: bytes, sync: int) -> int:
        return _HOOKED.meets("unlink", os.path.abspath(os.fsdecode(name)), IOERR["unlink"])[0] or int(real_delete(vfs, name, sync))

    held = XOpen(opened), XDelete(deleted)
    own.open, own.delete = (ctypes.cast(one, ctypes.c_void_p).value for one in held)
    _HOOKED.disk = disk
    try:
        yield
    finally:
        own.open, own.delete = before
        _HOOKED.disk = None
        _HOOKED.kept += [*held, real_open, real_delete]
