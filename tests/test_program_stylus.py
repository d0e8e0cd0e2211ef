"""Programs of two styli lie in one control: none has the name or number of another, and each is read back as it stands."""

from __future__ import annotations

from dataclasses import replace

import pytest

import postprocessors as posts
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.program import programs
from tango_cnc.records import Cell, Plan

EVERY = posts.names()


@pytest.fixture(scope="module")
def plans(root) -> dict[int, Plan]:  # type: ignore[no-untyped-def]
    """→ the first two indexations of the example, planned with a stylus and with one that is 60 mm longer."""
    cell: Cell = read_cell(root / "examples" / "trunnion")
    first = replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations[:2]))
    probe = cell.machine.probe
    two = replace(cell.machine, styli=(probe, replace(probe, length=probe.length + 60)))
    found = {}
    for number in (1, 2):
        touched = tuple(replace(i, stylus=number) for i in first.strategy.indexations)
        own = replace(first, machine=two.with_stylus(number), strategy=replace(first.strategy, indexations=touched))
        found[number] = plan(own)
    return found


@pytest.mark.few(0)
@pytest.mark.parametrize("name", EVERY)
def test_a_second_stylus_has_programs_of_its_own_names(name: str, plans: dict[int, Plan]) -> None:
    post = posts.load(name)
    made = {number: programs(post, one, {"gate": "none"}, 5) for number, one in plans.items()}
    every = [program for several in made.values() for program in several]
    assert len({program.name for program in every}) == len(every) > 2
    heads = ["\n".join(list(program.lines())[:4]) for program in every]
    if "program_number" in posts.settings(post, {}):
        assert all(program.name.split(".")[0].lstrip("O") in head for program, head in zip(every, heads, strict=True))
