"""A plan that a process has made is not made again for the same cell: hundreds of tests plan the cells of the examples.

Whoever tests the plan itself (`test_plan*.py`) makes every one anew.
"""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tango_cnc import locate
from tango_cnc.plan import build
from tango_cnc.records import Cell, Plan

NOWHERE = Path()
KEPT = 24  # plans, some MB each
MADE: OrderedDict[bytes, Plan] = OrderedDict()
_make, _find = build._planned, locate._cycle
anew = False  # whether the test that is executed wants every plan made


def _remembered(cell: Cell, obstructed: str | None, faults: Any, looked: Any = None, turns_alone: bool = False) -> Plan:
    """As `build._planned`; a plan whose faults or turns somebody wants to see is made."""
    if anew or faults is not None or looked is not None or turns_alone:
        return _make(cell, obstructed, faults, looked, turns_alone)
    return _kept((cell, obstructed), lambda: _make(cell, obstructed, None))


def _remembered_cycle(cell: Cell, count: int, within: float) -> Plan:
    """As `locate._cycle`."""
    return _find(cell, count, within) if anew else _kept((cell, count, within), lambda: _find(cell, count, within))


def _kept(of: tuple[Any, ...], make: Callable[[], Plan]) -> Plan:
    """Equal bytes are equal cells, wherever their files are; the other way round a plan is made once more."""
    key = pickle.dumps((replace(of[0], folder=NOWHERE), *of[1:]))
    if key not in MADE:
        MADE[key] = make()
    MADE.move_to_end(key)
    while len(MADE) > KEPT:
        MADE.popitem(last=False)
    return MADE[key]


build._planned, locate._cycle = _remembered, _remembered_cycle


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before any fixture of the test, those of its module too."""
    global anew
    anew = item.path.name.startswith("test_plan")
