"""Of many cases that fail together the default run has a few; CI has all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def some(values: Iterable[Any], kept: Callable[[Any], bool]) -> list[Any]:
    """values of a parameter, which of them the default run has → the values, the others marked long."""
    return [value if kept(value) else _long(*(value if isinstance(value, tuple) else (value,))) for value in values]


def _long(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.long)


def every(values: Iterable[Any], step: int, first: int = 0) -> list[Any]:
    """values, n → the default run has every n-th of them, from the `first` on: two tests of the same values may share them."""
    known = list(values)
    return some(known, lambda value: known.index(value) % step == first)
