"""Long plans: a program is written line by line, so that its length costs time and no memory."""

from __future__ import annotations

import gc
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from postprocessors._base import load, program
from tango_cnc.files import read_cell
from tango_cnc.files.plan import plan_lines
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import Plan

GOLDEN = Path(__file__).parent / "golden" / "cell"


@cache
def repeated(times: int) -> Plan:
    """The golden strategy again and again."""
    cell = read_cell(GOLDEN)
    return plan(replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations * times)))


def peak(lines: Callable[[], Iterable[str]]) -> float:
    """→ bytes that writing these lines takes at most beyond what there was before, in parts of the length of their text."""
    length, found = sum(len(line) for line in lines()), []
    gc.disable()  # it empties the lists of small objects that Python keeps to use them again
    try:
        for _ in range(3):  # the first time fills them
            tracemalloc.start()
            deque(lines(), maxlen=0)
            found.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    finally:
        gc.enable()
    return min(found) / length


@pytest.mark.parametrize("post", ["linuxcnc", "fanuc", "heidenhain"])
def test_a_program_is_never_in_memory_as_a_whole(post: str) -> None:
    made = repeated(60)
    options = {"macros": "called"} if post == "fanuc" else {}
    _, _, lines = program(load(post), made, options, plan_hash(made))
    assert peak(lines) < 0.5  # lists of small objects that Python keeps are some tens of kB


def test_plan_csv_is_never_in_memory_as_a_whole() -> None:
    assert peak(lambda: plan_lines(repeated(60))) < 0.1


def test_lines_that_are_kept_would_be_noticed() -> None:
    assert peak(lambda: iter([*plan_lines(repeated(60))])) > 1
