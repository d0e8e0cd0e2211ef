"""Controls and file forms that can hold a compensation: one file a target, its name is the target's name.

A target is a module with `TEXT` (one line), `FACTS` (what it is built on, each with its source, and whether it was read in a
manual or in source code, or is somebody's memory that has to be confirmed), `OPTIONS` and

    held(request)                 → every number that the target can store, as `Held`
    files(request, held, numbers) → {file name: text}; numbers by place, in the control's units. A file that counts increments has
        `Held.counted`, and `Held.written` says what stands in it
    steps(request)                → what a person does, in order; `SIGN_TRIAL` among them where no source states a sign
    check(request)                → nothing; raises InputError for a machine that does not fit. `check = any_machine` where all do
    UNIT_BESIDE                   → whether its files say the unit of their lengths: a control in inches may get them
    derived(request, held, numbers) → {name of a number in the files: `Derived`}, of those that it calculates from the held ones, as
        the vector between two centers: the cap looks at them, too. `derived = none_derived` where the files have the held ones
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from types import ModuleType
from typing import Any

from ...files.checked import suggestion
from ...records import InputError, Machine
from ...terms import Coefficient
from ..frame import as_controlled
from ..space import Held, Limits

SIGN_TRIAL = "sign trial"  # a step; `loop.store` writes out what to try
COMPARE = (
    "Compare the files of undo/ with what the control holds now. Where a number differs, load nothing: read the numbers of the "
    "control, and propose anew with --present FILE."
)


@dataclass(frozen=True)
class Fact:
    """What a target is built on; `confirmed` only when it was read in a manual or in the source of the control."""

    text: str
    source: str
    confirmed: bool = True


@dataclass(frozen=True)
class Option:
    """A setting of a target: default, what it means, what is allowed (None: anything of the default's type)."""

    default: Any
    text: str
    allowed: tuple[Any, ...] | None = None
    within: tuple[float, float] | None = None  # of a number


@dataclass(frozen=True)
class Derived:
    """A number of the files that is calculated from held ones, as it is written."""

    value: float
    unit: str  # mm or deg


@dataclass(frozen=True)
class Request:
    """What a target is asked for."""

    described: Machine  # of machine.yaml, in its frame: the coefficients are of it
    limits: Limits
    options: Mapping[str, Any]
    coefficients: tuple[Coefficient, ...] = ()

    @cached_property
    def machine(self) -> Machine:
        """→ the machine as its control counts it: what a target writes is along these axes."""
        return as_controlled(self.described)


@cache
def names() -> tuple[str, ...]:
    """→ every target, found by walking this folder."""
    return tuple(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))


def load(name: str) -> ModuleType:
    """name → target. Raises InputError with the nearest name when there is none."""
    if name not in names():
        raise InputError(f"--target: found {name!r}; allowed: {', '.join(names())}.{suggestion(name, names())}")
    return importlib.import_module(f"{__name__}.{name}")


def options(target: ModuleType, given: Sequence[str]) -> dict[str, Any]:
    """target, NAME=VALUE … → its options. Raises InputError for names and values that it does not have."""
    known: Mapping[str, Option] = target.OPTIONS
    result = {name: option.default for name, option in known.items()}
    for text in given:
        name, separator, value = text.partition("=")
        if not separator or name not in known:
            allowed = ", ".join(f"{n}={o.default}" for n, o in known.items()) or "no settings"
            raise InputError(f"--set: found {text!r}; allowed: {allowed}.{suggestion(name, list(known))}")
        option = known[name]
        try:
            result[name] = type(option.default)(value)
        except ValueError:
            raise InputError(f"--set: {name}: found {value!r}; allowed: {type(option.default).__name__} ({option.text})") from None
        if option.allowed is not None and result[name] not in option.allowed:
            raise InputError(f"--set: {name}: found {value!r}; allowed: {', '.join(map(str, option.allowed))}")
        low, high = option.within or (-math.inf, math.inf)
        if isinstance(result[name], int | float) and not (low <= result[name] <= high and math.isfinite(result[name])):
            limits = f"{low:g} to {high:g}" if option.within else "a finite number"
            raise InputError(f"--set: {name}: found {value!r}; allowed: {limits} ({option.text})")
        points = name == "points" and not 2 <= result[name] <= 1000
        if points:
            raise InputError(f"--set: points: found {value}; allowed: 2 to 1000")
    return result


def unconfirmed(target: ModuleType) -> list[str]:
    """target → its facts that nobody has confirmed."""
    return [fact.text for fact in target.FACTS if not fact.confirmed]


def any_machine(request: Request) -> None:
    """request → nothing: the `check` of a target that fits every machine."""


def none_derived(request: Request, held: Sequence[Held], numbers: Mapping[str, float]) -> dict[str, Derived]:
    """job, entries, numbers → no number: the `derived` of a target whose files have the held ones as they are."""
    return {}
