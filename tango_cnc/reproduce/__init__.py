"""The thesis' tables beside this program's numbers: what is compared, what differs, and why.

A function `table_4_6(setting)` in one of the files here is a table; it is found by its name. The measured side comes from the
simulator, which shares no mathematics with the estimator; the printed side from `printed.yaml`.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable

from ..records import InputError
from ._setting import Arrows, Row, Setting, Table

TABLE = re.compile(r"table_\d_\d")

__all__ = ["Arrows", "Row", "Setting", "Table", "table", "tables"]


def tables() -> dict[str, Callable[[Setting], Table]]:
    """→ every table by its number in the thesis, in order."""
    found: dict[str, Callable[[Setting], Table]] = {}
    for module in pkgutil.iter_modules(__path__):
        if not module.name.startswith("_"):
            parts = vars(importlib.import_module(f"{__name__}.{module.name}"))
            found |= {name[6:].replace("_", "-"): call for name, call in parts.items() if TABLE.fullmatch(name)}
    return dict(sorted(found.items()))


def table(number: str, setting: Setting) -> Table:
    """number as in `4-6`, setting → that table. Raises InputError for one that is not reproduced."""
    known = tables()
    if number not in known:
        raise InputError(f"table: found {number!r}; allowed: {', '.join(known)}")
    return known[number](setting)
