"""A hundred programs with one thing wrong in them for every language, and a judge that shares nothing with the reader.

The judge is the simulated control: it carries the changed program out beside the right one, on a machine as planned and on ones
with a miss, an early contact, something in the way, a dead probe, a work offset. Dangerous is a program that moves otherwise
(another place, or unguarded where it was guarded), goes on where the right one has stopped, or prints anything else.
Stopping sooner is no danger. Every dangerous one has to be refused by the read-back.
"""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import pytest
from support.dialects import ALONE
from support.programmutants import mutant
from support.readback import GOLDEN, MACRO_B, bare, counted, read_back, refused
from support.rehearsed import Endless, Trace, carried_out, compared, short, worlds

from postprocessors import names
from tango_cnc.files import read_cell
from tango_cnc.plan import part, plan
from tango_cnc.records import Find, Plan

PROVEN = 5  # dangerous mutants that were refused: the judge is not blind


@dataclass(frozen=True)
class Case:
    """A dialect with options of its profile."""

    post: str
    options: tuple[tuple[str, Any], ...] = ()
    find: Find | None = None  # every facet is touched twice

    def __str__(self) -> str:
        return "-".join([self.post, *(str(value) for _, value in self.options)])


# The relatives of Fanuc write its text; what the driver of grbl does is decided by the plan, not by the text.
CASES = [Case(name) for name in names() if name in ALONE and name not in MACRO_B[1:]] + [Case("fanuc", (("macros", "called"),))]
CASES += [Case("heidenhain", (("cycle", 444),), Find(feed=800.0, retreat=8.5))]


def plan_of(case: Case) -> Plan:
    """→ the three touches, as the case makes them."""
    cell = read_cell(GOLDEN / "cell")
    approach = replace(cell.strategy.approach, find=case.find)
    return part(plan(replace(cell, strategy=replace(cell.strategy, approach=approach))), [1, 2, 6]) if case.find else short()


def danger(post: str, originals: list[tuple[Trace, list[str]]], lines: list[str]) -> str:
    """→ how the program is dangerous, empty when it is not."""
    for world, right in zip(worlds(), originals, strict=True):
        try:
            if how := compared(right, carried_out(post, lines, world)):
                return how
        except Endless:
            return "never ends"
    return ""


def judged(case: Case, count: int, seed: int = 7) -> tuple[Counter[str], Counter[str], list[tuple[str, ...]]]:
    """dialect, number of mutants → dangers by kind, those of them refused, and what got through with its line.

    Every one that is not refused is judged. What is refused gets through nowhere: of those the judge sees as many as prove it.
    """
    rng, options, made = random.Random(seed), dict(case.options), plan_of(case)
    lines = bare(case.post, made, **options)
    number = partial(counted, case.post)
    originals = [carried_out(case.post, number(lines), world) for world in worlds()]
    dangers: Counter[str] = Counter()
    caught: Counter[str] = Counter()
    through = []
    for _ in range(count):
        kind, at, mutated = mutant(lines, rng)
        stopped = bool(refused(number(mutated), case.post, made, **options))
        if stopped and sum(caught.values()) >= PROVEN:
            continue
        if how := danger(case.post, originals, number(mutated)):
            dangers[how] += 1
            if stopped:
                caught[how] += 1
            else:
                through.append((how, kind, lines[at], *mutated[at : at + 1]))
    return dangers, caught, through


def table(case: Case, count: int, dangers: Mapping[str, int], caught: Mapping[str, int]) -> str:
    kinds = "; ".join(f"{how}: {caught[how]} of {n}" for how, n in sorted(dangers.items()))
    seen = f"{sum(dangers.values())} dangerous were judged, {sum(caught.values())} of them refused ({kinds})"
    return f"\n{case}: {count} mutants, all that are not refused were judged; {seen}"


@pytest.mark.few(1)
@pytest.mark.parametrize("case", [case for case in CASES if str(case) in ("linuxcnc", "mach3")], ids=str)
def test_dangerous_mutants_are_refused(case: Case) -> None:
    """Four of them, and four more until one is dangerous: a program of many questions has many that are not."""
    for seed in range(7, 17):
        dangers, _, through = judged(case, 4, seed)
        assert not through
        if dangers:
            return
    pytest.fail("none of forty mutants is dangerous: the judge sees nothing")


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=str)
def test_every_dangerous_one_of_a_hundred_mutants_is_refused(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    dangers, caught, through = judged(case, 100)
    with capsys.disabled():
        print(table(case, 100, dangers, caught))
    assert not through
    assert sum(dangers.values()) >= 5, "a judge that finds next to nothing dangerous proves nothing"


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_judge_finds_the_right_program_harmless(case: Case) -> None:
    """And the control runs it to its end, so that a mutant has something to differ from."""
    made = plan_of(case)
    lines = bare(case.post, made, **dict(case.options))
    lines = counted(case.post, lines)
    originals = [carried_out(case.post, lines, world) for world in worlds()]
    assert not danger(case.post, originals, lines)
    assert re.search(r"TANGO END \w+ 3", " ".join(" ".join(originals[0][1]).split()))
    assert [len(moves) for moves, _ in originals][4] < len(originals[0][0]), "a dead probe stops the program"
    assert read_back(lines, made, case.post, **dict(case.options))
