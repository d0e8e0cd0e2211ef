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
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from support.programmutants import mutant
from test_dialects import OFFSETS, SPOKEN
from test_random_programs import stored
from test_readback import GOLDEN, MACRO_B, bare, golden, read_back, refused, renumbered

from postprocessors._base import names
from sim_controller.languages import Alarm, Silence
from sim_controller.motion import Motion
from sim_controller.probing import rig
from sim_controller.session import language
from tango_cnc.files import read_cell
from tango_cnc.plan import part, plan
from tango_cnc.records import Find, Plan, World

NEAR = 1.5e-3  # mm or deg: the same place
FAR = 10_000  # moves after which a program that never ends is called dangerous
LONG = 100_000  # blocks carried out; the right program has some hundred

Trace = list[tuple[str, tuple[float, ...]]]


@dataclass(frozen=True)
class Case:
    """A dialect with options of its profile."""

    post: str
    options: tuple[tuple[str, Any], ...] = ()
    find: Find | None = None  # every facet is touched twice

    def __str__(self) -> str:
        return "-".join([self.post, *(str(value) for _, value in self.options)])


# The relatives of Fanuc write its text; what the driver of grbl does is decided by the plan, not by the text.
CASES = [Case(name) for name in names() if name in SPOKEN and name not in MACRO_B[1:]] + [Case("fanuc", (("macros", "called"),))]
CASES += [Case("heidenhain", (("cycle", 444),), Find(feed=800.0, retreat=8.5))]


@cache
def short() -> Plan:
    """Three touches: a face, the top, after a turn another face."""
    return part(golden(), [1, 2, 6])


def plan_of(case: Case) -> Plan:
    """→ the three touches, as the case makes them."""
    cell = read_cell(GOLDEN / "cell")
    approach = replace(cell.strategy.approach, find=case.find)
    return part(plan(replace(cell, strategy=replace(cell.strategy, approach=approach))), [1, 2, 6]) if case.find else short()


@cache
def worlds() -> tuple[World, ...]:
    """As planned; the last touch misses; it comes early; something is in the way of the second one; nothing is ever met."""
    return (
        World(),
        World(facets={"4": -8.0}),
        World(facets={"4": 7.0}),
        World(facets={"top": 12.0}),
        World(facets={name: -900.0 for name in golden().artefact.facets if name.isdigit() and len(name) == 1} | {"top": -900.0}),
    )


class Endless(Exception):
    """A program that goes on for ever."""


class Traced(Motion):
    """Motion that notes where every move has led, and how."""

    def __init__(self, world: World) -> None:
        super().__init__(rig(short().machine, short().artefact, world))
        self.trace: Trace = []

    def _noted(self, kind: str) -> None:
        place = tuple(float(v) for v in np.round(self.position, 6))
        before = self.trace[-1][1] if self.trace else ()
        linear = len(self.machine.linear)
        stays = bool(before) and max(abs(a - b) for a, b in zip(place, before, strict=True)) <= NEAR
        if kind == "skip" or not stays:
            if kind == "rapid" and self.trace and self.trace[-1][0] == "rapid" and place[:linear] == before[:linear]:
                self.trace.pop()  # which axis turns first at one place is all the same
            self.trace.append((kind, place))
        if len(self.trace) > FAR:
            raise Endless

    def rapid(self, *args: Any, **kwargs: Any) -> None:
        super().rapid(*args, **kwargs)
        self._noted("rapid")

    def feed(self, *args: Any, **kwargs: Any) -> None:
        super().feed(*args, **kwargs)
        self._noted("feed")

    def skip(self, *args: Any, **kwargs: Any) -> Any:
        result = super().skip(*args, **kwargs)
        self._noted("skip")
        return result


def carried_out(post: str, lines: list[str], world: World, library: tuple[str, ...] | None = None) -> tuple[Trace, list[str]]:
    """program, true machine, what its control has in store → every place it moves to, every line it prints."""
    spoken = SPOKEN[post]
    family = language(spoken.family)
    printed: list[bytes] = []
    motion = Traced(world)
    profile = replace(family.default_profile(short().machine), g54=OFFSETS, **spoken.settings)
    blocks = iter(range(LONG))

    def counted(event: str, **data: object) -> None:
        if event == "block" and next(blocks, None) is None:
            raise Endless

    library = stored(post, short()) if library is None else library
    control = family.Control(motion, profile, printed.append, counted, library)
    with suppress(Alarm, Silence):
        control.run(iter(lines[spoken.frame : len(lines) - spoken.frame]), False)
    return motion.trace, b"".join(printed).decode("ascii").split("\n")


def danger(post: str, originals: list[tuple[Trace, list[str]]], lines: list[str]) -> str:
    """→ how the program is dangerous, empty when it is not."""
    for world, right in zip(worlds(), originals, strict=True):
        try:
            if how := compared(right, carried_out(post, lines, world)):
                return how
        except Endless:
            return "never ends"
    return ""


def compared(right: tuple[Trace, list[str]], other: tuple[Trace, list[str]]) -> str:
    """moves and records as they should be, as they are → how they are dangerous, empty when they are not."""
    (moves, said), (after, says) = right, other
    for (kind, place), (wanted, there) in zip(after, moves, strict=False):
        if kind != wanted:
            return "a move of another kind"
        if max(abs(a - b) for a, b in zip(place, there, strict=True)) > NEAR:
            return "a move to another place"
    if len(after) > len(moves):
        return "goes on where it has to stop"
    if any(not same(a, b) for a, b in zip(says[:-1], said, strict=False)) or len(says) > len(said):
        return "another record"
    return ""


def same(line: str, wanted: str) -> bool:
    """Two records say the same, but for the last digits of coordinates, the sign of zero and the blanks before a decimal number."""
    line, wanted = (re.sub(r" +(?=\d+\.\d)", "", re.sub(r"-(?=0(\.0*)?(?![\d.]))", "", text)) for text in (line, wanted))
    if re.sub(r"-?\d+\.\d+", "", line) != re.sub(r"-?\d+\.\d+", "", wanted):
        return line == wanted
    here, there = ([float(n) for n in re.findall(r"-?\d+\.\d+", text)] for text in (line, wanted))
    return all(abs(a - b) < 2 * NEAR for a, b in zip(here, there, strict=True))


def judged(case: Case, count: int, seed: int = 7) -> tuple[Counter[str], Counter[str], list[tuple[str, ...]]]:
    """dialect, number of mutants → dangers by kind, those of them refused, and what got through with its line."""
    rng, options, made = random.Random(seed), dict(case.options), plan_of(case)
    lines = bare(case.post, made, **options)
    number = renumbered if case.post == "heidenhain" else list
    originals = [carried_out(case.post, number(lines), world) for world in worlds()]
    dangers: Counter[str] = Counter()
    caught: Counter[str] = Counter()
    through = []
    for _ in range(count):
        kind, at, mutated = mutant(lines, rng)
        if how := danger(case.post, originals, number(mutated)):
            dangers[how] += 1
            if refused(number(mutated), case.post, made, **options):
                caught[how] += 1
            else:
                through.append((how, kind, lines[at], *mutated[at : at + 1]))
    return dangers, caught, through


def table(case: Case, count: int, dangers: Mapping[str, int], caught: Mapping[str, int]) -> str:
    kinds = "; ".join(f"{how}: {caught[how]} of {n}" for how, n in sorted(dangers.items()))
    return f"\n{case}: {count} mutants, {sum(dangers.values())} dangerous, {sum(caught.values())} of them refused ({kinds})"


@pytest.mark.parametrize("case", [case for case in CASES if str(case) in ("fanuc", "linuxcnc", "mach3", "okuma")], ids=str)
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
    lines = renumbered(lines) if case.post == "heidenhain" else lines
    originals = [carried_out(case.post, lines, world) for world in worlds()]
    assert not danger(case.post, originals, lines)
    assert re.search(r"TANGO END \w+ 3", " ".join(" ".join(originals[0][1]).split()))
    assert [len(moves) for moves, _ in originals][4] < len(originals[0][0]), "a dead probe stops the program"
    assert read_back(lines, made, case.post, **dict(case.options))
