"""Tables of ISO 230-1 errors → errors at a pose, as volumetric compensation has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from tango_cnc.records import COMPONENTS, Array, Machine

Errors = Callable[[Array, Array], Mapping[str, Array]]
Tabulated = Mapping[str, tuple[str, Array, Array]]  # EXX: axis, where (mm, rad), value


def errors(machine: Machine, locations: Mapping[str, float], tables: Tabulated) -> Errors:
    """machine, location errors by name (EX0C), tables by name (EYX) → errors at poses; tables hold their end values beyond."""

    def at(positions: Array, directions: Array) -> dict[str, Array]:
        n = len(positions)
        found = {name: np.full(n, value) for name, value in locations.items()}
        for name, (axis, where, value) in tables.items():
            found[f"{name}0"] = np.interp(positions[:, machine.column(axis)], where, value)
        return found

    return at


def is_location(name: str, machine: Machine) -> bool:
    """`X0C` → whether it is a location error of an axis that the machine has."""
    return len(name) == 3 and name[0] in COMPONENTS and name[1] == "0" and name[2] in machine.names


def is_component(name: str, machine: Machine) -> bool:
    """`EYX` → whether it is a component error of an axis that the machine has."""
    return len(name) == 3 and name[0] == "E" and name[1] in COMPONENTS and name[2] in machine.names
