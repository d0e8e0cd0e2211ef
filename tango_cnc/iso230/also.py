"""Which error motions a parameter of the fit may hold beside its own, as these touches do not separate them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..records import Machine
from ..texts import joined, say

TURNED = {("A", "Y"): "Z", ("A", "Z"): "Y", ("B", "Z"): "X", ("B", "X"): "Z", ("C", "X"): "Y", ("C", "Y"): "X"}
# A turn about X, and what lies along Y goes along Z: a squareness is a slope in a straightness.


def motion_of(name: str, machine: Machine) -> str:
    """parameter such as EYY1 or EB0Z, machine → the error motion that it is a part of (EYY, EXZ); '' for all others.

    Source: ISO 230-1:2012, 3.6.2: the squareness of two axes is an angle between lines through their straightness.
    """
    if len(name) == 4 and name[0] == "E" and name[3].isdigit():
        return name[:3]
    if len(name) == 4 and name[2] == "0" and name[3] in machine.linear and (name[1], name[3]) in TURNED:
        return f"E{TURNED[name[1], name[3]]}{name[3]}"
    return ""


def also_held(
    parameters: Sequence[str], machine: Machine, undecided: Iterable[tuple[str, Sequence[str]]]
) -> dict[str, tuple[str, ...]]:
    """names of fitted parameters, machine, every angular error motion that is withheld with the motions that it is mixed with →
    of every parameter that such a motion moves, these motions.
    """
    found: dict[str, tuple[str, ...]] = {}
    for own, mixed in undecided:
        for name in parameters:
            motion = motion_of(name, machine)
            if motion and motion in mixed and not name.startswith(own):
                found[name] = (*found.get(name, ()), own)
    return found


def said_also(found: Mapping[str, Sequence[str]]) -> list[str]:
    """{parameter: motions that it may hold} → a list of one sentence, which names them all; [] for no parameter."""
    parts = [say("iso_said.also.one", name=name, motions=", ".join(motions)) for name, motions in found.items()]
    return [say("iso_said.also.all", parts=joined("; ", parts))] if parts else []
