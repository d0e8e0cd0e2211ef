"""A head whose tool lies at the first touch: the finger is asked for high up, before the probe goes down beside the table."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from support.gates import EVERY, ran, written
from support.readback import read_back

from tango_cnc.files import read_cell
from tango_cnc.gate import TOUCH, gate
from tango_cnc.plan import plan
from tango_cnc.records import InputError, Plan

FORK = Path(__file__).parents[1] / "examples" / "fork_head"
LYING, UPRIGHT = 85.0, 0.0  # deg of A


@cache
def made(angle: float) -> Plan:
    """deg of A at the first touch → a plan of a few touches of the fork head, the others with the tool upright."""
    cell = read_cell(FORK)
    every = cell.strategy.indexations
    lying = next(one for one in every if round(math.degrees(one.position["A"])) == LYING)
    few = (replace(lying, facets=lying.facets[:2]), replace(every[0], facets=every[0].facets[:2]))
    return plan(replace(cell, strategy=replace(cell.strategy, indexations=few if angle == LYING else tuple(reversed(few)))))


@pytest.mark.few(4)
@pytest.mark.parametrize("name", EVERY)
def test_a_dead_probe_is_found_high_up_where_the_tool_lies(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The finger was asked for after a descent from Z 412 to Z -96 beside the table, with a probe that nothing had proven."""
    of, finger = made(LYING), {"gate": "finger"}
    asked, z = gate(of), of.machine.column("Z")
    low = min(touch.over[z] for touch in of.touches[:2])
    assert asked.along and asked.start[z] > low + 100 and asked.end[z] > low + 100
    lines = written(name, of, finger)
    assert read_back(lines, of, name, **finger)
    if name != "grbl":
        assert any(f"{TOUCH} - THE PROBE MOVES ALONG {asked.along} FOR 20 S" in line for line in lines)
    alive = ran(name, of, finger)
    assert not alive.why and not alive.stops
    dead = ran(name, of, finger, probe="dead")
    assert dead.why or dead.stops
    assert not [event for event, _ in dead.events if event in ("contact", "collision", "bent")]
    monkeypatch.setattr("tango_cnc.gate._lies", lambda plan: False)
    late = written(name, replace(of), finger)
    monkeypatch.undo()
    assert late != lines
    with pytest.raises(InputError, match="The program is not the plan"):
        read_back(late, of, name, **finger)


def test_a_tool_that_stands_is_touched_at_the_clear_level_as_before() -> None:
    of = made(UPRIGHT)
    asked = gate(of)
    assert not asked.along and asked.start == (of.touches[0].enter or of.touches[0].over)
