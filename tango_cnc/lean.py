"""What libraries do when they are loaded and no command needs: it is put off, or left out.

Python has no clean way to ask numpy and scipy for less. Each of these steps aside where a library has changed: then it loads
as its makers meant it to.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

UNUSED = ("f2py", "testing")  # of numpy: scipy asks for all that numpy has, and these two take as long to load as scipy itself
WRITES = "scipy.special._support_alternative_backends"  # adds a note to the documentation of a hundred functions


def put_off(package: str, names: Sequence[str]) -> None:
    """package, names of its modules → each is there at once, and is loaded when something of it is used."""
    for name in names:
        full = f"{package}.{name}"
        spec = importlib.util.find_spec(full)
        if full in sys.modules or spec is None or spec.loader is None:
            continue
        spec.loader = importlib.util.LazyLoader(spec.loader)
        module = sys.modules[full] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        setattr(sys.modules[package], name, module)


def leave_notes_out() -> None:
    """From now on scipy's functions keep the documentation that they have: to write it anew is most of loading scipy.special."""
    if WRITES not in sys.modules:
        sys.meta_path.insert(0, _Finder())


class _Finder:
    """Finds that one module as Python does, and has it executed without its notes."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != WRITES:
            return None
        sys.meta_path.remove(self)
        spec = PathFinder.find_spec(name, path)
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader)  # type: ignore[assignment]
        return spec


class _Loader:
    """Executes a module while nothing writes documentation."""

    def __init__(self, loader: Any) -> None:
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        made: ModuleType | None = self._loader.create_module(spec)
        return made

    def exec_module(self, module: ModuleType) -> None:
        try:
            writer: Any = importlib.import_module("scipy._lib._array_api")
            kept, writer.FunctionDoc = writer.FunctionDoc, _Unwritten
        except (ImportError, AttributeError):  # another scipy
            self._loader.exec_module(module)
            return
        try:
            self._loader.exec_module(module)
        except Exception:
            writer.FunctionDoc = kept
            self._loader.exec_module(module)
        finally:
            writer.FunctionDoc = kept


class _Unwritten:
    """In place of what takes a text apart and puts it together again: the text as it is, below a line for the signature."""

    def __init__(self, function: Any) -> None:
        self._text = function.__doc__ or ""

    def __getitem__(self, section: str) -> list[Any]:
        return []

    def __str__(self) -> str:
        return f"\n{self._text}"
