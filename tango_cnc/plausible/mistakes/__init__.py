"""Single mistakes that people make, one file a kind: the name of the file is the kind.

A file has `hypotheses(case)` → the ways in which this mistake may have been made, each with the cell and the readings as they would
be without it. What is left of the touches then decides between them.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from types import ModuleType


@cache
def kinds() -> dict[str, ModuleType]:
    """→ every kind of mistake by name, found by walking this folder."""
    names = [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]
    return {name: importlib.import_module(f"{__name__}.{name}") for name in names}
