"""What the model may contain, one family per file; the file name is the name of the family.

A family is a module with `TEXT` (what it is, for people), `SOURCE` (clause, equation or paper) and

    coefficients(machine, degree) → the coefficients of this family that a machine can have, in order of preference
    coefficient(name, machine)    → the one of that name, or None when the name is not of this family

A coefficient says where it acts (a slot of the chain, or `GAP`: directly on the gap) and with which regressor; its author
writes no derivative of the chain.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

from ..files.checked import suggestion
from ..kinematics import Slot
from ..records import Array, InputError, Machine, TermItem
from ..touches import Touches

GAP = Slot("", "stylus", -1)


@dataclass(frozen=True)
class Coefficient:
    """One unknown of the model: its error at a touch is value × regressor, acting at `slot`."""

    name: str
    unit: str
    slot: Slot
    regressor: Callable[[Touches], Array]  # → (n,)


def families() -> dict[str, ModuleType]:
    """→ every family by name, found by walking this folder."""
    names = [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]
    return {name: importlib.import_module(f"{__name__}.{name}") for name in names}


def find(item: TermItem, machine: Machine) -> list[Coefficient]:
    """name, or cause with its settings → coefficients. Raises InputError with the nearest names when no family knows it."""
    modules = families()
    name, detail = (item, {}) if isinstance(item, str) else (str(item["cause"]), {k: v for k, v in item.items() if k != "cause"})
    if name in modules and hasattr(modules[name], "cause"):
        found: list[Coefficient] = modules[name].cause(machine, **detail)
        return found
    for module in modules.values():
        one: Coefficient | None = module.coefficient(name, machine) if hasattr(module, "coefficient") else None
        if one is not None:
            return [one]
    known = [c.name for module in modules.values() if hasattr(module, "coefficients") for c in module.coefficients(machine, 3)]
    known += [name for name, module in modules.items() if hasattr(module, "cause")]
    raise InputError(
        f"terms: found {name!r}, which no term of machine {machine.topology} has; allowed: S1, S2, S3, S4, and names such as "
        f"{', '.join(known[:6])} …{suggestion(name, known)}"
    )
