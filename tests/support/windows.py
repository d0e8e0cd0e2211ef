"""The project as Windows would run it, as far as another system can show that.

Modules and names that Python lacks there are missing for the modules of the project (typeshed says which), msvcrt is there, a file
that is open cannot be deleted, renamed or replaced, a name that is taken is not taken by a rename, and some signs are in no name.
The libraries run as they do here. Nothing of this says that a real Windows does not do something else.

python -X warn_default_encoding -m support.windows FILE: the commands of FILE, a JSON list of lists of words, one after the other.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
import ctypes
import errno
import fcntl
import functools
import importlib
import json
import os
import pkgutil
import signal
import struct
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import mypy

OURS = ("tango_cnc", "sim_controller", "postprocessors")
TYPESHED = Path(mypy.__file__).parent / "typeshed" / "stdlib"
STATED = {"os": {"name": "nt"}, "sys": {"platform": "win32"}, "signal": {"SIGBREAK": signal.SIGUSR2}}
FORBIDDEN = set('<>"|?*:')
DEVICES = {"con", "prn", "aux", "nul", *(f"com{n}" for n in range(1, 10)), *(f"lpt{n}" for n in range(1, 10))}
STILL_ACTIVE = 259
STUBS = ("typing", "typing_extensions", "_typeshed", "collections.abc", "types", "builtins", "enum")  # from which stubs import


def names(module: str, platform: str) -> set[str]:
    """module of Python, platform → names that it has there, as typeshed says; empty for a module that it does not know."""
    path = TYPESHED / module.replace(".", "/")
    file = path / "__init__.pyi" if path.is_dir() else path.with_suffix(".pyi")
    if not file.is_file():
        return set()
    known = {"sys": SimpleNamespace(platform=platform, version_info=sys.version_info), "TYPE_CHECKING": True}
    return set(_named(ast.parse(file.read_text(encoding="utf-8")).body, known))


def _named(body: list[ast.stmt], known: dict[str, Any]) -> Iterator[str]:
    for node in body:
        if isinstance(node, ast.If):
            holds = eval(compile(ast.Expression(node.test), "typeshed", "eval"), dict(known))
            yield from _named(node.body if holds else node.orelse, known)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            yield node.name
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            targets = [node.target] if isinstance(node, ast.AnnAssign) else node.targets
            yield from (target.id for target in targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.ImportFrom) and node.module not in STUBS:
            yield from (alias.asname or alias.name for alias in node.names)


@functools.cache
def missing(module: str) -> frozenset[str]:
    """module of Python → names that it has on Linux and not on Windows."""
    return frozenset(names(module, "linux") - names(module, "win32"))


def absent(module: str) -> bool:
    """module of Python → whether Windows has none: nothing of it is left there but what its stub imports."""
    return bool(missing(module)) and not {name for name in names(module, "win32") if not name.startswith("_")}


class There(ModuleType):
    """A module of Python as it is on Windows."""

    def __init__(self, real: ModuleType) -> None:
        super().__init__(real.__name__)
        self.__dict__["_real"] = real

    def __getattr__(self, name: str) -> Any:
        real = self.__dict__["_real"]
        if name in STATED.get(real.__name__, {}):
            return STATED[real.__name__][name]
        if name in missing(real.__name__):
            raise AttributeError(f"module {real.__name__!r} has no attribute {name!r} on Windows")
        return getattr(real, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.__dict__["_real"], name, value)


def importing(real: Callable[..., Any], keys: ModuleType) -> Callable[..., Any]:
    """how Python imports, msvcrt → the same; the modules of the project are given those of Windows."""
    there: dict[str, There] = {}

    def call(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> Any:
        importer = (globals or {}).get("__name__", "")
        if level or importer.partition(".")[0] not in OURS:
            return real(name, globals, locals, fromlist, level)
        if name == "msvcrt":
            return keys
        if absent(name):
            raise ModuleNotFoundError(f"No module named {name!r} on Windows", name=name)
        found = real(name, globals, locals, fromlist, level)
        key = found.__name__
        return there.setdefault(key, There(found)) if missing(key) or key in STATED else found

    return call


def msvcrt() -> ModuleType:
    """→ the part of msvcrt that is used: locks of bytes that belong to an open file, keys that were pressed."""
    module = ModuleType("msvcrt")
    typed: list[str] = []

    def locking(handle: int, mode: int, count: int) -> None:
        wanted = struct.pack("hhqqi", fcntl.F_WRLCK, os.SEEK_CUR, 0, count, 0)
        try:
            fcntl.fcntl(handle, fcntl.F_OFD_SETLK, wanted)
        except OSError:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from None

    vars(module).update(LK_NBLCK=2, locking=locking, kbhit=lambda: bool(typed), getwch=lambda: typed.pop(0), typed=typed)
    return module


def _held(path: str) -> bool:
    """file → whether this process has it open."""
    with contextlib.suppress(OSError):
        wanted = os.stat(path)
        for handle in os.listdir("/proc/self/fd"):
            with contextlib.suppress(OSError):
                if os.path.samestat(os.fstat(int(handle)), wanted):
                    return True
    return False


def _file_system() -> None:
    """Files of this process behave as on Windows."""
    real = {name: getattr(os, name) for name in ("unlink", "remove", "rename", "replace")}

    def refused(path: Any) -> None:
        if _held(os.fspath(path)):
            raise PermissionError(errno.EACCES, "The process cannot access the file because it is being used", os.fspath(path))

    def gone(name: str) -> Callable[..., None]:
        def call(path: Any, *more: Any, **named: Any) -> None:
            if named.get("dir_fd") is None and os.path.isfile(path):
                refused(path)
            real[name](path, *more, **named)

        return call

    def moved(name: str) -> Callable[..., None]:
        def call(old: Any, new: Any, **named: Any) -> None:
            refused(old)
            if os.path.lexists(new):
                if name == "rename":
                    raise FileExistsError(errno.EEXIST, "Cannot create a file when that file already exists", os.fspath(new))
                refused(new)
            real[name](old, new, **named)

        return call

    for name in ("unlink", "remove"):
        setattr(os, name, gone(name))
    for name in ("rename", "replace"):
        setattr(os, name, moved(name))

    def named(event: str, what: tuple[Any, ...]) -> None:
        if event not in ("open", "os.rename", "os.mkdir") or not isinstance(what[0], str | bytes):
            return
        for path in what[: 2 if event == "os.rename" else 1]:
            writes = event != "open" or bool((what[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
            for part in Path(os.fsdecode(path)).parts if writes and not os.fsdecode(path).startswith(("/dev", "/proc")) else ():
                if set(part) & FORBIDDEN or part[-1] in ". " or part.partition(".")[0].lower() in DEVICES or min(part) < " ":
                    raise OSError(errno.EINVAL, "The filename, directory name, or volume label syntax is incorrect", path)

    sys.addaudithook(named)


def _kernel() -> SimpleNamespace:
    """→ what kernel32 says of processes."""

    def opened(access: Any, inherited: bool, pid: Any) -> int | None:
        return int(pid.value) if os.path.exists(f"/proc/{pid.value}") else None

    def status(handle: Any, into: Any) -> bool:
        into._obj.value = STILL_ACTIVE
        return True

    def times(handle: Any, created: Any, *others: Any) -> bool:
        text = Path(f"/proc/{handle.value}/stat").read_text(encoding="ascii")
        created._obj.dwHighDateTime, created._obj.dwLowDateTime = 1, int(text.rpartition(")")[2].split()[19])
        return True

    return SimpleNamespace(OpenProcess=opened, GetExitCodeProcess=status, GetProcessTimes=times, CloseHandle=lambda handle: True)


def become() -> ModuleType:
    """From now on the modules of the project meet Windows. → its msvcrt."""
    keys = msvcrt()
    builtins.__import__ = importing(builtins.__import__, keys)
    _file_system()
    kernel = _kernel()
    ctypes.WinDLL = lambda *names, **more: kernel  # type: ignore[attr-defined]
    ctypes.get_last_error = lambda: 87  # type: ignore[attr-defined]
    warnings.filterwarnings("error", category=EncodingWarning, module="tango_cnc|sim_controller|postprocessors")
    return keys


def every_module() -> list[str]:
    """→ names of all modules of the project, each imported."""
    found = []
    for package in OURS:
        root = importlib.import_module(package)
        found += [one.name for one in pkgutil.walk_packages(root.__path__, f"{package}.")]
    for name in found:
        if not name.endswith((".__main__", ".env")):  # of programs, and of alembic, which alone can load it
            importlib.import_module(name)
    return found


def main(file: str) -> None:
    """commands → one JSON line each: exit status, what was said; the first one says how many modules were imported.

    `CONTROL` in a command is the port of a control that makes every touch of the cell of `-C`, `CONTROL=3` of one that stops then.
    """
    become()
    print(json.dumps({"modules": len(every_module())}), flush=True)
    from support.runs import Control, Result

    for words in json.loads(Path(file).read_text(encoding="utf-8")):
        for at, word in enumerate(words):
            if word.startswith("CONTROL"):
                stop = int(word.partition("=")[2] or 0) or None
                words[at] = f"{Control(Path(words[words.index('-C') + 1]), stop=stop, hang_up=True).url}?listen=no"
        result = Result(*words)
        print(json.dumps({"words": words, "code": result.code, "out": result.out, "err": result.err}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
