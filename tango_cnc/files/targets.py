"""Files that a command is about to write: each can be written, and none is one that the cell is read from."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from ..records import InputError
from .checked import Node, load

OTHER_STYLI = tuple(f"readings.stylus{number}.csv" for number in range(2, 10))
KEPT = (
    "world.yaml",
    "uncertainty.yaml",
    "readings.csv",
    "simulated.csv",
    *OTHER_STYLI,
)  # what commands read from a cell without being told


def writable(what: str, file: Path) -> None:
    """option for complaints, file to be written → nothing. Raises InputError where it cannot be: before the work, not after it."""
    if file.is_dir():
        raise InputError(f"{what}: found {file}, which is a folder; allowed: a file; take another name, or the folder away")
    if file.exists() and not file.is_file():
        raise InputError(f"{what}: found {file}, which is a device or the like; allowed: a file of its own")
    folder = next(parent for parent in file.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise InputError(f"{what}: found {file}, and {folder} is a file; allowed: a file in a folder")
    try:
        with tempfile.TemporaryFile(dir=folder):  # permissions do not tell of file systems that take no files
            pass
    except OSError as error:
        raise InputError(
            f"{what}: found {file}, and nothing can be written to {folder} ({error.strerror}); choose another folder"
        ) from None


def sources(folder: Path) -> Iterator[Path]:
    """folder of a cell → the files it is read from. What is wrong with them is said by who reads them."""
    root = folder / "tango.yaml"
    yield root
    with suppress(InputError):
        fields = dict(load(root).items())
        files: dict[str, Path] = {}
        for key in ("machine", "artefact", "strategy"):
            with suppress(KeyError, InputError):  # a name that no file can have is not written to either
                files[key] = fields[key].named(folder)
        yield from files.values()
        with suppress(InputError):
            if (post := _named(fields.get("controller"), "post")) is not None:
                yield post.named(folder)
        for key in files.keys() & {"machine", "artefact"}:
            with suppress(InputError):
                yield from _drawings(files[key])
    yield from (folder / name for name in KEPT)


def _drawings(described: Path) -> Iterator[Path]:
    obstacles = dict(load(described).items()).get("obstacles")
    for item in obstacles.list() if obstacles is not None else ():
        with suppress(InputError):
            if (name := _named(item, "file")) is not None:
                yield name.named(described.parent)


def _named(node: Node | None, key: str) -> Node | None:
    return dict(node.items()).get(key) if node is not None else None


def spared(what: str, file: Path, folder: Path, more: Iterable[Path] = (), replaces: str | None = None) -> None:
    """option for complaints, file to be written, folder of the cell, what else is read → nothing.

    Raises InputError when the file is one that is read, other than the one of this name in the cell that it `replaces`.
    """
    if not file.exists() or (replaces is not None and same(file, folder / replaces)):
        return
    if any(same(file, source) for source in (*sources(folder), *more)):
        raise InputError(
            f"{what}: found {file}, which is read here and would be lost; allowed: another file, or a folder without such a file"
        )


def same(one: Path, other: Path) -> bool:
    """two paths → whether they lead to one file, there or not."""
    if one.exists() and other.exists():
        return os.path.samefile(one, other)
    return one.resolve() == other.resolve()
