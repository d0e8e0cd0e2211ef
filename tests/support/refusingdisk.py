"""A disk that refuses a write: at which call, with which error, once or from then on; and which calls of which functions there are.

It stands in the places of what Python offers for writing, so it meets every call of a run, through whatever library it goes.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
import errno
import io
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
OURS = f"{ROOT / 'tango_cnc'}{os.sep}"
SHORT = -1  # no error: half of the bytes are taken
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
BY_PATH = ("mkdir", "rename", "replace", "unlink", "remove", "rmdir", "chmod")
BY_HANDLE = ("fsync", "ftruncate", "write")
# Attributes by which a text of Python writes; `open` and `replace` are told from those of texts by what stands before them.
CALLS = {"write_text", "write_bytes", "rename", "unlink", "mkdir", "fsync", "ftruncate", "rmdir", "mkstemp", "chmod", "touch"}
OF_OS = {"write", "replace", "open", "remove"}


@dataclass(frozen=True)
class Call:
    """One call that writes: what it does, to which file, and the function of the project that asks for it."""

    what: str
    path: str
    site: str  # files/write.py:_replaced


@dataclass
class Disk:
    """Refuses the call number `at` (from 0) inside the folders, and those after it where `on`. `at` None: it takes everything."""

    folders: tuple[Path, ...]
    at: int | None = None
    error: int = errno.ENOSPC
    on: bool = False
    calls: list[Call] = field(default_factory=list)
    refused: list[Call] = field(default_factory=list)

    def meets(self, what: str, path: object) -> bool:
        """call, its file → whether half of it is taken. Raises OSError where it is refused."""
        where = _absolute(path)
        if where is None or not any(where.startswith(f"{folder}{os.sep}") or where == str(folder) for folder in self.folders):
            return False
        number = len(self.calls)
        self.calls.append(Call(what, where, _site()))
        if self.at is None or not (number == self.at or (self.on and number > self.at)):
            return False
        if self.error == SHORT:
            if what == "write":
                self.refused.append(self.calls[-1])
            return what == "write"
        self.refused.append(self.calls[-1])
        raise OSError(self.error, os.strerror(self.error), *([] if what in BY_HANDLE else [where]))


def _absolute(path: object) -> str | None:
    if isinstance(path, int):
        try:
            return os.readlink(f"/proc/self/fd/{path}")
        except OSError:
            return None
    if isinstance(path, str | bytes | os.PathLike):
        return os.path.abspath(os.fsdecode(path))
    return None


def _site() -> str:
    frame = sys._getframe(2)
    while frame is not None:
        code = frame.f_code
        if code.co_filename.startswith(OURS):
            return f"{code.co_filename.removeprefix(OURS)}:{code.co_name}"
        frame = frame.f_back  # type: ignore[assignment]
    return ""


class _Raw(io.FileIO):
    disk: Disk

    def write(self, data: Any) -> int:
        if self.disk.meets("write", self.fileno()):
            return super().write(bytes(data)[: max(1, len(bytes(data)) // 2)]) or 0
        return super().write(data) or 0


@contextlib.contextmanager
def refusing(disk: Disk) -> Iterator[Disk]:
    """disk → until the block ends, everything that this process writes in its folders goes through it."""
    real_open = io.open
    real = {name: getattr(os, name) for name in (*BY_PATH, *BY_HANDLE, "open")}

    def by_path(name: str) -> Callable[..., Any]:
        def call(path: Any, *more: Any, **named: Any) -> Any:
            if name != "mkdir" or not os.path.isdir(path):  # of one that is there nothing is written
                disk.meets(name, path)
            return real[name](path, *more, **named)

        return call

    def by_handle(name: str) -> Callable[..., Any]:
        def call(handle: Any, *more: Any) -> Any:
            if disk.meets(name, handle):
                return real[name](handle, more[0][: max(1, len(more[0]) // 2)])
            return real[name](handle, *more)

        return call

    def os_open(path: Any, flags: int, *more: Any, **named: Any) -> int:
        if flags & WRITES:
            disk.meets("open", path)
        return int(real["open"](path, flags, *more, **named))

    def opened(
        file: Any, mode: str = "r", buffering: int = -1, encoding: Any = None, errors: Any = None, newline: Any = None, **more: Any
    ) -> Any:
        where = _absolute(file)
        inside = where is not None and any(where.startswith(f"{folder}{os.sep}") for folder in disk.folders)
        if not inside or not set(mode) & set("wax+"):
            return real_open(file, mode, buffering, encoding, errors, newline, **more)
        if not isinstance(file, int):
            disk.meets("open", file)
        raw = _Raw(file, mode.replace("b", "").replace("t", ""), **more)
        raw.disk = disk
        if buffering == 0:
            return raw
        out = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return out if "b" in mode else io.TextIOWrapper(out, encoding, errors, newline, line_buffering=buffering == 1)

    stands = {(os, name): by_path(name) for name in BY_PATH} | {(os, name): by_handle(name) for name in BY_HANDLE}
    stands |= {(os, "open"): os_open, (io, "open"): opened, (builtins, "open"): opened}
    before = {(module, name): getattr(module, name) for module, name in stands}
    for (module, name), call in stands.items():
        setattr(module, name, call)
    try:
        yield disk
    finally:
        for (module, name), call in before.items():
            setattr(module, name, call)


def sites(files: Iterator[Path] | list[Path]) -> set[str]:
    """modules of the project → functions whose text writes, as `Call.site` names them."""
    found = set()
    for file in files:
        text = file.read_text(encoding="utf-8")
        for function in ast.walk(ast.parse(text)):
            if isinstance(function, ast.FunctionDef) and any(map(_writes, _own(function))):
                found.add(f"{str(file).removeprefix(OURS)}:{function.name}")
    return found


def _own(function: ast.FunctionDef) -> Iterator[ast.AST]:
    """function → what stands in it, without the functions inside it."""
    left: list[ast.AST] = list(function.body)
    while left:
        node = left.pop()
        if not isinstance(node, ast.FunctionDef):
            yield node
            left += ast.iter_child_nodes(node)


def _writes(node: ast.AST) -> bool:
    if not isinstance(node, ast.Call):
        return False
    called = node.func
    if isinstance(called, ast.Name):
        return called.id == "open" and _mode(node, 1)
    if not isinstance(called, ast.Attribute):
        return False
    of = ast.unparse(called.value)
    if called.attr in OF_OS and of == "os":
        return called.attr != "open" or any(word in ast.unparse(node) for word in ("WRONLY", "RDWR", "CREAT", "flags"))
    if called.attr in ("open", "fdopen", "open_file"):
        return _mode(node, 1 if of in ("os", "io", "click") else 0)
    return called.attr in CALLS


def _mode(node: ast.Call, at: int) -> bool:
    stated = [*node.args[at : at + 1], *(word.value for word in node.keywords if word.arg == "mode")]
    return any(isinstance(mode, ast.Constant) and isinstance(mode.value, str) and set(mode.value) & set("wax+") for mode in stated)
