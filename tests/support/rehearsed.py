"""What several tests share of readback mutants."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from sim_controller.languages import Alarm, Silence
from sim_controller.motion import Motion
from sim_controller.probing import Rig, rig
from sim_controller.session import language
from support.dialects import ALONE, OFFSETS
from support.readback import golden
from support.stored import stored
from tango_cnc.plan import part
from tango_cnc.records import Array, Plan, World

NEAR = 1.5e-3  # mm or deg: the same place
FAR = 10_000  # moves after which a program that never ends is called dangerous
LONG = 100_000  # blocks carried out; the right program has some hundred
Trace = list[tuple[str, tuple[float, ...]]]


@cache
def short() -> Plan:
    """Three touches: a face, the top, after a turn another face."""
    return part(golden(), [1, 2, 6])


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


@dataclass(frozen=True)
class Truth:
    """A world, what is true in it, and what moves have met there: mutants of one program make the same moves again and again."""

    world: World  # kept here, so that no other one comes to its address
    rig: Rig
    met: dict[tuple[bytes | float, ...], Any]


TRUTHS: dict[int, Truth] = {}


def truth(world: World) -> Truth:
    if id(world) not in TRUTHS:
        TRUTHS[id(world)] = Truth(world, rig(short().machine, short().artefact, world), {})
    return TRUTHS[id(world)]


class Traced(Motion):
    """Motion that notes where every move has led, and how."""

    def __init__(self, world: World) -> None:
        self.true = truth(world)
        super().__init__(self.true.rig)
        self.trace: Trace = []

    def _meets(self, end: Array, direction: Array, after: float) -> Any:
        move = (self._position.tobytes(), end.tobytes(), direction.tobytes(), after)
        if move not in self.true.met:
            self.true.met[move] = super()._meets(end, direction, after)
        return self.true.met[move]

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
    spoken = ALONE[post]
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
