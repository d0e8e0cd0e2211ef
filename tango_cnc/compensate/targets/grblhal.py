"""grblHAL with the kinematics rtcp_ac: offsets of A and C, settings $640 to $645."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...records import InputError
from ..space import Held
from . import COMPARE, SIGN_TRIAL, Fact, Option, Request, none_derived
from ._parts import centre, parallel, rotary_order

TEXT = "grblHAL with rtcp_ac (XYZAC): settings $640 to $645"
SOURCE = "grblHAL core, kinematics/rtcp_ac.c"
FACTS = (
    Fact("$640-$642: offset of A in X Y Z; $643-$645: of C; mm, three decimals, within 1000", SOURCE),
    Fact("its own header calls it experimental and untested", SOURCE),
    Fact("the offsets are the centers in machine coordinates", SOURCE, confirmed=False),
    Fact("the senses of A and C are those of machine.yaml", SOURCE, confirmed=False),
)
UNIT_BESIDE = False
OPTIONS: dict[str, Option] = {}
derived = none_derived
USED = {640: ("A", 0), 641: ("A", 1), 642: ("A", 2), 643: ("C", 0), 644: ("C", 1), 645: ("C", 2)}


def check(request: Request) -> None:
    """job → nothing. Raises InputError for machines other than a table C on a cradle A."""
    if rotary_order(request.machine) != (["A", "C"], []) or not parallel(request.machine):
        raise InputError(
            f"--target grblhal: found {request.machine.topology}; allowed: a table C on a cradle A, parallel to Z and X"
        )


def held(request: Request) -> list[Held]:
    """job → the six settings; along an axis itself an offset does nothing and stays."""
    machine = request.machine
    return [
        centre(machine, axis, c, f"${n}", "settings", base=machine.axis(axis).point[c] - machine.spindle.point[c])
        for n, (axis, c) in USED.items()
    ]


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → settings.txt."""
    return {"settings.txt": "".join(f"{h.place}={numbers[h.place]:.3f}\n" for h in held)}


def steps(request: Request) -> list[str]:
    """job → what a person does with the settings."""
    return [
        "Write down the answer of the control to $$.",
        COMPARE,
        SIGN_TRIAL,
        "Send the lines of settings.txt one by one; each is answered with ok.",
        "Touch one facet with A and C at 0 and at 90 degrees: no test of rtcp_ac on a machine is known.",
    ]
