"""From one touch on, or in one part of the run, an axis counts from another zero: referenced anew, a preset, pulses lost."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...records import Array
from ...texts import joined, say
from ...touches import Touches, from_readings
from ._case import Case, Hypothesis
from ._midway import Changed, Part, zero_changed

PRICE = 5.0
MORE = 3.0  # for an end
SEVERAL = 6.0  # for all axes at once
NEARLY = 0.9  # of what an axis does to a part of a run is of one indexation: then that was turned
MOSTLY = 0.5  # and so much of that indexation is in the part
LEAST, LEAST_TURN = 0.05, 0.05 / 150  # mm, rad (as much 150 mm away): less is a knock or a drift, nothing that somebody sets


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis, and all linear axes together, from another zero in the part of the run where that explains most."""
    machine = case.machine
    touches = from_readings(machine, case.artefact, case.readings)
    for names in (*((name,) for name in (*machine.linear, *machine.rotary)), tuple(machine.linear)):
        found = zero_changed(case, names)
        if found is None or np.abs(found.size).max() < (LEAST if names[0] in machine.linear else LEAST_TURN):
            continue
        if names[0] in machine.rotary and _is_one(touches, names[0], found.part):
            continue
        yield _hypothesis(case, names, found)


def _is_one(touches: Touches, name: str, part: Part) -> bool:
    """→ whether what an axis does to the part of the run, or to the part before it, is nearly all of one indexation."""
    feels, inside = touches.lever(name) ** 2, part.rows(len(touches))
    every = np.bincount(touches.indexation, feels)
    for rows in (inside, ~inside):
        own = np.bincount(touches.indexation, feels * rows)
        most = int(np.argmax(own))
        if own[most] > NEARLY * own.sum() and own[most] > MOSTLY * every[most]:
            return True
    return False


def _hypothesis(case: Case, names: tuple[str, ...], found: Changed) -> Hypothesis:
    number = case.readings.touch[found.part.first : found.part.end]
    on = found.part.end == len(case.readings)
    which = {"first": int(number[0]), "last": int(number[-1]), "said": _said(case, names, -found.size)}
    return Hypothesis(
        say(f"mistake.zero_since.{'from' if on else 'between'}", **which),
        "readings",
        ", ".join(names),
        _change(case, names, found.part),
        readings=found.readings,
        touches=tuple(int(t) for t in number),
        price=PRICE + (0.0 if on else MORE) + (SEVERAL if len(names) > 1 else 0.0),
    )


def _change(case: Case, names: tuple[str, ...], part: Part) -> str:
    """→ where to look: between the last touch that has the old zero and the first that has the new one."""
    number, before = case.readings.touch, part.first - part.unfelt - 1
    which = {"axes": joined(", ", names), "first": int(number[part.first])}
    if before < 0:
        return say("mistake.zero_since.change", **which)
    return say("mistake.zero_since.change_between", before=int(number[before]), **which)


def _said(case: Case, names: tuple[str, ...], more: Array) -> str:
    """→ by how much each axis counts more, for people."""
    turned = [name in case.machine.rotary for name in names]
    return joined(
        ", ",
        (
            say(
                f"mistake.zero_since.{'degrees' if turn else 'mm'}",
                name=name,
                value=f"{math.degrees(v):+.4f}" if turn else f"{v:+.3f}",
            )
            for name, v, turn in zip(names, more.tolist(), turned, strict=True)
        ),
    )
