"""What was read from a file of a cell is not read again from the same text: hundreds of tests read the cells of the examples.

Whoever tests the reading itself (`test_files*.py`) reads every file anew.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tango_cnc.files import cell

KEPT = 200  # files, some kB each
READ: OrderedDict[tuple[Any, ...], tuple[Any, tuple[Any, ...]]] = OrderedDict()
anew = False  # whether the test that is executed wants every file read


def _remembered(read: Callable[..., Any]) -> Callable[..., Any]:
    """reader of a file → the same; the same text beside the same records gives the same record. What is refused is read again."""

    def reader(file: Path, *beside: Any) -> Any:
        try:
            text = b"" if anew or not file.is_file() else file.read_bytes()
        except OSError:
            text = b""
        if not text:
            return read(file, *beside)
        key = (read, text, *map(id, beside))  # what `id` names is kept beside what was made with it
        if key not in READ:
            READ[key] = (read(file, *beside), beside)
        READ.move_to_end(key)
        while len(READ) > KEPT:
            READ.popitem(last=False)
        return READ[key][0]

    return reader


for _name in ("read_machine", "read_artefact", "read_strategy"):
    setattr(cell, _name, _remembered(getattr(cell, _name)))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before any fixture of the test, those of its module too."""
    global anew
    anew = item.path.name.startswith("test_files")
