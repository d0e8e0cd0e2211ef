"""Error motions `EYX2`: polynomials of the command in mm and rad; positioning `EXX1` acts in command units in the motion."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from ..kinematics import Slot
from ..records import COMPONENTS, Array, InputError, Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import moved_axes, times
from ._world import Effects, full

PATTERN = re.compile(r"E([XYZABC])([XYZABC])([0-9])")


def coefficient(name: str, machine: Machine) -> Coefficient | None:
    """`EYX2` → coefficient in mm/mm², rad/mm², mm/rad² …, or None."""
    match = PATTERN.fullmatch(name)
    if match is None or match[2] not in machine.names:
        return None
    letter, axis, degree = match[1], match[2], int(match[3])
    component = COMPONENTS.index(letter)
    slot = Slot(axis, "motion") if letter == axis else Slot(axis, "intra", component)
    own = "mm" if component < 3 else "rad"
    unit = (
        own if degree == 0 else f"{own}/{'mm' if axis in machine.linear else 'rad'}{'' if degree == 1 else '²³⁴⁵⁶⁷⁸⁹'[degree - 2]}"
    )

    return Coefficient(name, unit, slot, lambda touches: touches.power(axis, degree))


def scales(machine: Machine) -> list[Coefficient]:
    """machine → linear positioning gains, X last: where only mismatches are visible they count from X."""
    return [c for axis in reversed(machine.linear) if (c := coefficient(f"E{axis}{axis}1", machine)) is not None]


def coefficients(machine: Machine, degree: int) -> list[Coefficient]:
    """machine, degree → coefficients of degree 1 … `degree` of every axis, translations before rotations, low degrees first."""
    axes = [name for name in (*machine.workpiece_branch, *machine.tool_branch) if name != "S"]
    names = [f"E{c}{axis}{d}" for d in range(1, degree + 1) for axis in axes for c in COMPONENTS]
    return [found for name in names if (found := coefficient(name, machine)) is not None]


def variants(touches: Touches) -> Iterator[dict[str, Any]]:
    """touches → every coefficient up to degree 3."""
    for c in coefficients(touches.machine, 3):
        yield {"name": c.name}


def make(machine: Machine, name: str) -> list[Coefficient]:
    """machine, name such as EYX2 → that coefficient. Raises InputError for a name that the machine lacks."""
    found = coefficient(name, machine)
    if found is None:
        raise InputError(f"terms: error_motion: name: found {name!r}; allowed: EYX2 … for axes {' '.join(machine.names)}")
    return [found]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the same power of the way, as large as it is after 100 mm or 1 rad (world.yaml)."""
    name = str(setting["name"])
    degree = int(name[3])
    if not degree:
        return []
    own, span = full(machine, name[2])
    return [
        {"cause": "error_motion", "name": name[:3], "degree": degree, "amplitude": float(values[0]) * own**degree, "span": span}
    ]


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → powers of the place of linear axes, without its name."""
    for axis in moved_axes(touches, touches.machine.linear, 1.0):
        for turn in range(6):
            if (lever := touches.seen.slots.get(Slot(axis, "intra", turn))) is not None:
                for degree in (1, 2, 3):
                    what = f"{'tilt' if turn > 2 else 'shift'} of {axis}"
                    yield axis, what, "power", times((touches.axis(axis) ** degree)[:, None], lever)


TERM = Cause(
    text="error motion",
    source="ISO 230-1:2012, 3.6; thesis eq. 4-6, 4-8",
    frame="axis",
    mistaken=("compensation_kink", "moving_mass"),
    says="the model lacks {name}; the touch that feels it most is off by {size}",
    meaning="the tool leaves its straight line or its plane by this within the travel",
    advice="put the coefficient into the terms of the model (S4 has them all) and compensate it",
    refine={},
    coefficients=coefficients,
    coefficient=coefficient,
    variants=variants,
    make=make,
    unnamed=unnamed,
    effects=effects,
)
