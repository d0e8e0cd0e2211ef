"""Fagor 8060, 8065, 8070: user offsets of the kinematics table, capped by the maker's MAX OFFSET."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...records import InputError
from ..space import Held
from . import COMPARE, SIGN_TRIAL, Fact, Option, Request, none_derived
from ._parts import across, centre

TEXT = "Fagor 8060, 8065, 8070: user offsets of the kinematics (OFTDATA)"
SOURCE = "Fagor CNC 8060 installation manual, p. 392"
FACTS = (
    Fact("(V.)G.OFTDATAkin[nb] is the user's offset of a dimension, limited to +-MAX OFFSET of the maker", SOURCE),
    Fact("it takes effect at #KIN ID or RTCP", SOURCE),
    Fact("nb 1 2 3 … are X Y Z of the first rotary axis and then of the second, in machine coordinates", "memory", confirmed=False),
    Fact("VALUE plus OFFSET is what the kinematics use, with the sign of machine coordinates", SOURCE, confirmed=False),
)
UNIT_BESIDE = False
OPTIONS = {
    "kin": Option(1, "number of the kinematics", within=(1, 99)),
    "first": Option(1, "nb of X of the first rotary axis", within=(1, 99)),
    "max_offset": Option(0.2, "MAX OFFSET of the maker, mm: a larger one would be cut off", within=(0.001, 10)),
}
derived = none_derived


def check(request: Request) -> None:
    """job → nothing. Raises InputError for a machine without rotary axes."""
    if not request.machine.rotary:
        raise InputError("--target fagor: found no rotary axis; allowed: a machine with one or two; take value_sheet for tables")


def held(request: Request) -> list[Held]:
    """job → offsets of the centres of the rotary axes; 0 is no offset."""
    machine, result = request.machine, []
    for n, axis in enumerate(machine.rotary):
        for c in across(machine, axis):
            nb = int(request.options["first"]) + 3 * n + c
            place = f"OFTDATA{request.options['kin']}[{nb}] ({axis}, {'XYZ'[c]})"
            result.append(centre(machine, axis, c, place, "offsets", increment=1e-4))
    return result


def files(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, str]:
    """job, entries, numbers → offsets.nc. Raises InputError for an offset beyond MAX OFFSET."""
    most = float(request.options["max_offset"])
    lines = ["; offsets of the centres of the rotary axes, mm"]
    for h in held:
        if abs(numbers[h.place]) > most:
            raise InputError(
                f"--target fagor: found {h.place} = {numbers[h.place]:.4f} mm, beyond MAX OFFSET; allowed: {most:g} mm "
                "(--set max_offset=… when the maker has set more)"
            )
        lines.append(f"V.G.{h.place.split()[0]} = {numbers[h.place]:.4f} ; {h.place.split(' ', 1)[1]}")
    lines.append(f"#KIN ID [{request.options['kin']}]")
    return {"offsets.nc": "\n".join([*lines, "M30"]) + "\n"}


def steps(request: Request) -> list[str]:
    """job → what a person does with the file."""
    return [
        "Compare nb of offsets.nc with the drawing of your kinematics: which dimension is which is not confirmed.",
        COMPARE,
        SIGN_TRIAL,
        "Run offsets.nc in MDI mode or as a program; RTCP off.",
        "Touch one facet at two indexations with RTCP on, before and after.",
    ]
