"""Habits of a control that the profile or machine.yaml states: programs, times and turns go by them, and a stranger is told."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from support.controls import GOLDEN, golden, lines_of
from support.dialects import EVERY

from postprocessors import companions, load, program
from postprocessors import settings as settings_of
from tango_cnc import commission, readback
from tango_cnc.duration import duration
from tango_cnc.files import machine_text, read_cell
from tango_cnc.files.cell import read_machine
from tango_cnc.plan import plan, plan_hash
from tango_cnc.records import InputError, Machine, Plan

LIMIT = math.radians(365.0)


def with_c(machine: Machine, nearer: bool) -> Machine:
    """machine → its C has limits, and takes the nearer way or not."""
    axes = tuple(replace(axis, travel=(-LIMIT, LIMIT), nearer=nearer) if axis.name == "C" else axis for axis in machine.axes)
    return replace(machine, axes=axes)


def rolling(nearer: bool) -> Plan:
    """→ the golden plan with a turn from 350 to 10 deg at its end."""
    cell = read_cell(GOLDEN)
    return plan(commission.rolling(replace(cell, machine=with_c(cell.machine, nearer))))


def angles(made: Plan) -> list[float]:
    """plan → angles of C one after the other, deg."""
    return [math.degrees(move.target["C"]) for move in made.moves if "C" in move.target]


def test_an_axis_that_takes_the_nearer_way_is_turned_in_steps_of_less_than_half_a_turn_to_the_same_places() -> None:
    plainly, stepwise = angles(rolling(False)), angles(rolling(True))
    assert max(abs(b - a) for a, b in pairwise(plainly)) > 300
    assert max(abs(b - a) for a, b in pairwise(stepwise)) < 170.001
    assert [touch.end for touch in rolling(True).touches] == [touch.end for touch in rolling(False).touches]
    left = iter(stepwise)
    assert all(any(angle == step for step in left) for angle in plainly)  # the same stops in the same order, and more


@pytest.mark.few(1)
@pytest.mark.parametrize("name", sorted(EVERY))
def test_its_programs_are_read_back_and_say_what_a_person_has_to_do(name: str) -> None:
    made, post = rolling(True), load(name)
    stated = {"feed_override": "acts"} | ({"records_file": "anew"} if post.link != "grbl" else {})
    lines = program(post, made, stated, plan_hash(made))[2]
    beside = companions(post, made, stated)
    assert not readback.check(lines, made, settings_of(post, stated), beside, written_in=post.language)
    text, usual = "\n".join(lines()), "\n".join(lines_of(name, golden()))
    acts = settings_of(post, {})["feed_override"] == "acts"  # as is known of a SINUMERIK and of LinuxCNC
    assert "KEEP THE FEED OVERRIDE AT 100 PERCENT" in text and ("FEED OVERRIDE AT" in usual) == acts
    assert ("COPY THE FILE OF THE RECORDS" in text) == (post.link != "grbl") and "COPY THE FILE" not in usual


def test_what_a_control_needs_for_itself_is_in_the_predicted_time() -> None:
    made = golden()
    slow = replace(made, machine=replace(made.machine, overhead=4.5))
    more = sum(duration(slow, 3000.0).values()) - sum(duration(made, 3000.0).values())
    assert more == pytest.approx(4.5 * len(made.touches))


def test_both_are_in_machine_yaml(tmp_path: Path) -> None:
    machine = replace(with_c(golden().machine, True), overhead=4.5)
    file = tmp_path / "machine.yaml"
    file.write_text(machine_text(machine), encoding="utf-8")
    found = read_machine(file)
    assert found.overhead == 4.5 and [axis.name for axis in found.axes if axis.nearer] == ["C"]
    endless = tuple(replace(axis, travel=None) if axis.name == "C" else axis for axis in machine.axes)
    file.write_text(machine_text(replace(machine, axes=endless)), encoding="utf-8")
    with pytest.raises(InputError, match=r"(?s)nearer.*at most 800 deg"):
        read_machine(file)
