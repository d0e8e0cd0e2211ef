"""A history in the formats of others, one file a format: `ENDINGS`, and `write(history, machine, file, entry)`."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from typing import Any

from ...records import InputError

ESTIMATED = "isg"  # needs the cell, and is made by the command


def target(kind: str | None, file: Path) -> Any:
    """name of a format or None, file → module of the format; None: the one that has this ending. Raises InputError."""
    names = [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]
    allowed = ", ".join((*names, ESTIMATED))
    if kind is not None:
        if kind not in names:
            raise InputError(f"--as: found {kind!r}; allowed: {allowed}")
        return importlib.import_module(f"{__name__}.{kind}")
    for name in names:
        module = importlib.import_module(f"{__name__}.{name}")
        if file.suffix.lower() in module.ENDINGS:
            return module
    raise InputError(f"{file}: no format has the ending {file.suffix!r}; state one with --as: {allowed}")
