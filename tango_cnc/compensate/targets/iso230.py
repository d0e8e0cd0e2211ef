"""ISO 230-1 names and values as YAML, for programs and post-processors that compensate by themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ...records import COMPONENTS
from ..space import Held, by_slot, sample
from . import Fact, Option, Request, any_machine, none_derived
from ._parts import point_of

TEXT = "ISO 230-1 names and values in a YAML file, with frames and signs, for programs that compensate by themselves"
FACTS = (
    Fact("names and signs are those of docs/model.md; who reads the file does the compensation", "ISO 230-1:2012, docs/model.md"),
)
FINEST = 1e-15  # in the unit of a value; a coefficient of degree 3 is finer, so digits count, and no increments
OPTIONS = {"digits": Option(9, "significant digits of each value", tuple(range(4, 16)))}
UNIT_BESIDE = True
check = any_machine
derived = none_derived


def held(request: Request) -> list[Held]:
    """job → every estimated coefficient."""
    result = []
    somewhere = sample(request.described, request.limits, 64).touches
    for c in request.coefficients:
        angle = c.unit.startswith("rad")
        ratio = "/" in c.unit
        kind: Literal["length", "angle", "ratio"] = "ratio" if ratio else "angle" if angle else "length"
        h = Held(c.name, "coefficients", c.unit, kind, FINEST, by_slot(c.slot, c.regressor), digits=int(request.options["digits"]))
        reach = float(np.abs(c.regressor(somewhere)).max())
        result.append(replace(h, turns=True, coefficient=c.name, reach=reach))
    return result


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → iso230.yaml."""
    lines = [
        "format: tango-iso230-errors/1",
        f"topology: {request.described.topology}",
        "meaning: actual minus commanded, of the body of the axis, in the frame of the axis at the zero pose",
        "components: |\n  " + "; ".join(f"E{c}: {'along' if i < 3 else 'about'} {'xyz'[i % 3]}" for i, c in enumerate(COMPONENTS)),
        "axes:",
    ]
    for name in (*request.described.linear, *request.described.rotary):
        direction = ", ".join(f"{v:.9g}" for v in request.described.axis(name).direction)
        point = ", ".join(f"{v:.9g}" for v in point_of(request.described, name))
        lines.append(f"  {name}: {{direction: [{direction}], point: [{point}]}}")
    lines.append("errors:")
    lines += [f"  {h.place}: {{value: {numbers[h.place]:.15g}, unit: {h.unit}}}" for h in held]
    return {"iso230.yaml": "".join(f"{line}\n" for line in lines)}


def steps(request: Request) -> list[str]:
    """job → what a person does with the file."""
    return ["Give iso230.yaml to the program that compensates. Compare one pose by hand before you trust its signs."]
