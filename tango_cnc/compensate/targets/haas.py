"""Haas: machine rotary zero point, settings 255, 256 and 257."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...records import InputError
from ..space import Held, Lever
from . import Fact, Option, Request, none_derived
from ._parts import centre, parallel, rotary_order

TEXT = "Haas: machine rotary zero point (MRZP), settings 255 to 257"
FACTS = (
    Fact("settings 255, 256, 257: MRZP offset X, Y, Z, machine coordinates", "memory", confirmed=False),
    Fact("X and Y of the table's center, Z of the tilting axis, and both axes meet", "memory", confirmed=False),
    Fact("VPS writes the same settings: do not run it afterwards without need", "memory", confirmed=False),
)
MEET = 0.05  # mm by which nominal axes may miss each other
UNIT_BESIDE = False
OPTIONS = {"increment": Option(0.0001, "what the control stores in steps of, mm", within=(1e-7, 0.01))}
derived = none_derived


def check(request: Request) -> None:
    """job → nothing. Raises InputError for machines without a rotary table on a tilting axis."""
    work, tool = rotary_order(request.machine)
    if tool or len(work) != 2 or not parallel(request.machine):
        raise InputError(
            f"--target haas: found {request.machine.topology}; allowed: a rotary table on a tilting axis, parallel to X Y Z"
        )
    swing, table = (request.machine.axis(name) for name in work)
    if abs(table.direction[2]) < 1 - 1e-9:
        raise InputError(
            f"--target haas: found the table {table.name}, which turns about no Z; allowed: a table C, whose X and Y are 255, 256"
        )
    way = np.cross(swing.direction, table.direction)
    gap = abs(float(np.subtract(table.point, swing.point) @ way)) / float(np.linalg.norm(way))
    if gap > MEET:
        raise InputError(
            f"--target haas: found axes {swing.name} and {table.name} that miss each other by {gap:.4g} mm; allowed: "
            "axes that meet, as settings 255 to 257 are one point for both. State the points of machine.yaml as they are; for axes "
            "that do not meet take another target, or compensate programs"
        )


def held(request: Request) -> list[Held]:
    """job → the three settings; both axes go with what they share."""
    machine = request.machine
    swing, table = rotary_order(machine)[0]
    step, result = float(request.options["increment"]), []
    for i in range(3):
        axis = table if i < 2 else swing
        base = machine.axis(axis).point[i] - machine.spindle.point[i]
        h = centre(machine, axis, i, f"setting {255 + i} (MRZP {'XYZ'[i]})", "settings", increment=step, base=base)
        if i < 2:
            h = replace(h, lever=_both(h.lever, centre(machine, swing, i, "", "").lever))
        result.append(h)
    return result


def _both(one: Lever, other: Lever) -> Lever:
    return lambda poses: one(poses) + other(poses)


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → settings.txt."""
    return {"settings.txt": "".join(f"{h.place.split()[1]} {numbers[h.place]:.4f}\n" for h in held)}


def steps(request: Request) -> list[str]:
    """job → what a person does with the values."""
    return [
        "Write down settings 255, 256 and 257.",
        "Compare them with settings.txt: hundredths of a millimeter may differ. If millimeters do, the zero of machine.yaml is "
        "another one: enter nothing, and propose anew with --present.",
        "Enter the new values.",
    ]
