"""A plan that a process has made is not made again for the same cell: hundreds of tests plan the cells of the examples.

Whoever tests the plan itself (`test_plan*.py`) makes every one anew.
"""

from __future__ import annotations

import pickle
from collections import OrderedDict
from typing import Any

import pytest

from tango_cnc.plan import build
from tango_cnc.records import Cell, Plan

KEPT = 24  # plans, some MB each
MADE: OrderedDict[bytes, Plan] = OrderedDict()
_make = build._planned


def _remembered(cell: Cell, obstructed: str | None, faults: Any, looked: Any = None, turns_alone: bool = False) -> Plan:
    """As `build._planned`; a plan whose faults or turns somebody wants to see is made."""
    if faults is not None or looked is not None or turns_alone:
        return _make(cell, obstructed, faults, looked, turns_alone)
    key = pickle.dumps((cell, obstructed))  # equal bytes are equal cells; the other way round a plan is made once more
    if key not in MADE:
        MADE[key] = _make(cell, obstructed, None)
    MADE.move_to_end(key)
    while len(MADE) > KEPT:
        MADE.popitem(last=False)
    return MADE[key]


@pytest.fixture(autouse=True)
def plans_are_remembered(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if not request.path.name.startswith("test_plan"):
        monkeypatch.setattr(build, "_planned", _remembered)
