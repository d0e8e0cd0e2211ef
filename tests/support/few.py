"""Of many cases that fail together the default run has a few; CI has all of them."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

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


def chosen(test: str, cases: int, few: int) -> set[int]:
    """name of a test, number of its cases, how many of them by default → their places, equally far from each other.

    Where they begin depends on the name: so tests of the same dialects have other dialects by default.
    """
    first = crc32(test.encode())
    return {(first + i * cases // few) % cases for i in range(few)} if few < cases else set(range(cases))


ROOT = Path(__file__).parents[2]


@cache
def new(folder: Path = ROOT) -> frozenset[str]:
    """checkout → names of plug-ins that somebody is adding: files of Python, outside of tests/, that the main branch has not.

    What is committed on a branch stays new until it is merged; where nothing is called main, until it is committed.
    """
    if shutil.which("git") is None:
        return frozenset()

    def asked(*words: str) -> list[str]:
        return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=False).stdout.splitlines()

    begun = next((found[0] for main in ("origin/main", "main") if (found := asked("merge-base", "HEAD", main))), "HEAD")
    ours = ("--", "*.py", ":!tests")
    added = asked("diff", "--name-only", "--no-renames", "--diff-filter=A", begun, *ours)
    added += asked("ls-files", "--others", "--exclude-standard", *ours)
    return frozenset(Path(file.strip('"')).stem for file in added)


def concerns(nodeid: str, names: frozenset[str]) -> bool:
    """id of a case, names of new plug-ins → whether the case is one of theirs."""
    return not names.isdisjoint(re.split(r"[^\w]+", nodeid.partition("[")[2]))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """`@pytest.mark.few(n)`: of the cases of this test the default run has n, and those of a plug-in that is new; others are long.

    `make mutants` asks all. Cases of a new plug-in are marked `new`.
    """
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("few") is not None and item.get_closest_marker("long") is None:
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for item in items:
        if "[" in item.nodeid and concerns(item.nodeid, new()):
            item.add_marker("new")
    for test, cases in tests.items():
        mark = cases[0].get_closest_marker("few")
        kept = chosen(test, len(cases), mark.args[0]) if mark else set()
        for i, item in enumerate(cases):
            if i not in kept and not concerns(item.nodeid, new()):
                item.add_marker("long")
