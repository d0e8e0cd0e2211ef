"""Names of error coefficients (`EX0C`, `EYX2`, `EXXb`) and what each of them says."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from tango_cnc.records import COMPONENTS, InputError, Machine

STYLUS = ("EXt", "EYt", "EZt")
RADIUS = "ERt"  # of the tip of another stylus, beyond what is stated
_INTER = re.compile(r"E(?P<component>[XYZABC])0(?P<axis>[XYZABCS])")
_INTRA = re.compile(r"E(?P<component>[XYZABC])(?P<axis>[XYZABCS])(?P<degree>\d|b)")


@dataclass(frozen=True)
class Coefficient:
    """One term of one component of one axis: constant before the motion, power of the command after it, or backlash."""

    kind: Literal["inter", "power", "backlash"]
    axis: str
    component: int  # 0–5: X Y Z A B C
    degree: int = 0


def coefficient(name: str, machine: Machine) -> Coefficient:
    """`EX0C`, `EYX2`, `EXXb` → what it says. Raises InputError for a name or an axis that the machine lacks (model.md, Names)."""
    inter, intra = _INTER.fullmatch(name), _INTRA.fullmatch(name)
    match = inter or intra
    if match is None or match["axis"] not in machine.names:
        letters = " ".join(machine.names)
        raise InputError(
            f"errors: found {name!r}; allowed: E<component>0<axis> (EX0C), E<component><axis><degree> (EYX2), "
            f"E<component><axis>b (EXXb) with component X Y Z A B C and axis {letters}.{_nearest(name, machine)}"
        )
    component = COMPONENTS.index(match["component"])
    if inter:
        return Coefficient("inter", match["axis"], component)
    if match["degree"] == "b":
        return Coefficient("backlash", match["axis"], component)
    return Coefficient("power", match["axis"], component, int(match["degree"]))


def _nearest(name: str, machine: Machine) -> str:
    words = {known.lower(): known for known in _all_names(machine)}
    if (small := name.lower()) in words:
        return f" Did you mean {words[small]!r}?"
    near = difflib.get_close_matches(name, list(words.values()), n=20, cutoff=0.5)
    best = max(near, key=lambda known: sum(a == b for a, b in zip(name, known, strict=False)), default=None)
    return f" Did you mean {best!r}?" if best else ""


def _all_names(machine: Machine) -> Iterable[str]:
    for axis in machine.names:
        for letter in COMPONENTS:
            yield f"E{letter}0{axis}"
            yield from (f"E{letter}{axis}{degree}" for degree in (0, 1, 2, 3, "b"))
