"""What the model may contain, one family per file; the file name is the name of the family.

A family is a module with `TEXT` (what it is, for people), `SOURCE` (clause, equation or paper) and

    coefficients(machine, degree) → the coefficients of this family that a machine can have, in order of preference
    coefficient(name, machine)    → the one of that name, or None when the name is not of this family

A family is also a cause that `diagnose` may name when it has `cause(machine, **setting)`; `_cause.py` says what belongs to it.

A coefficient says where it acts (a slot of the chain, or `GAP`: directly on the gap) and with which regressor; its author
writes no derivative of the chain.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

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


@cache
def families() -> dict[str, ModuleType]:
    """→ every family by name, found by walking this folder."""
    names = [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]
    return {name: importlib.import_module(f"{__name__}.{name}") for name in names}


def causes() -> dict[str, ModuleType]:
    """→ every family that `diagnose` may name as a cause, by name."""
    return {name: module for name, module in families().items() if hasattr(module, "cause")}


def cause(name: str, machine: Machine, setting: Mapping[str, Any]) -> list[Coefficient]:
    """name of a cause, its settings → coefficients. Raises InputError for settings that it does not have or needs."""
    make = families()[name].cause
    allowed = [key for key in inspect.signature(make).parameters if key != "machine"]
    for key in setting:
        if key not in allowed:
            raise InputError(
                f"terms: {name}: found {key!r}; allowed: {', '.join(allowed) or 'no settings'}{suggestion(key, allowed)}"
            )
    try:
        found: list[Coefficient] = make(machine, **setting)
    except (TypeError, ValueError) as error:
        raise InputError(f"terms: {name}: found {dict(setting)}; allowed: {', '.join(allowed)} ({error})") from None
    return found


def effects(name: str, machine: Machine, setting: Mapping[str, Any], values: Array) -> list[dict[str, Any]]:
    """name of a cause, its settings, values of its coefficients → entries of `effects` in world.yaml that do the same.

    Empty where the simulated machine has no such effect. Raises InputError for settings that the cause does not have.
    """
    from . import _world

    module = families()[name]
    if hasattr(module, "effects"):
        own: list[dict[str, Any]] = module.effects(machine, setting, values)
        return own
    defaults = {k: p.default for k, p in inspect.signature(module.cause).parameters.items() if p.default is not p.empty}
    return _world.usual(name, {**defaults, **setting}, [c.name for c in cause(name, machine, setting)], values)


def find(item: TermItem, machine: Machine) -> list[Coefficient]:
    """name, or cause with its settings → coefficients. Raises InputError with the nearest names when no family knows it."""
    modules = families()
    name, detail = (item, {}) if isinstance(item, str) else (str(item["cause"]), {k: v for k, v in item.items() if k != "cause"})
    if name in modules and hasattr(modules[name], "cause"):
        return cause(name, machine, detail)
    for module in modules.values():
        one: Coefficient | None = module.coefficient(name, machine) if hasattr(module, "coefficient") else None
        if one is not None:
            return [one]
    known = [c.name for module in modules.values() if hasattr(module, "coefficients") for c in module.coefficients(machine, 3)]
    known += [name for name, module in modules.items() if hasattr(module, "cause")]
    raise InputError(
        f"terms: found {name!r}, which no term of machine {machine.topology} has; allowed: S1, S2, S3, S4, and names such as "
        f"{', '.join(known[:6])} …{suggestion(name, ['S1', 'S2', 'S3', 'S4', *known])}"
    )
