"""What the model may contain, one family per file; the file name is the name of the family.

A file ends with its record `TERM`: a `Family`, or a `Cause` where `diagnose` may name it. What is special about one cause is a
field of that record; what its file leaves out has the default that stands here.

A coefficient says where it acts (a slot of the chain, or `GAP`: directly on the gap) and with which regressor; its author
writes no derivative of the chain.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from ..files.checked import suggestion
from ..kinematics import Slot
from ..records import Array, InputError, Machine, TermItem
from ..touches import Touches

GAP = Slot("", "stylus", -1)
SEARCHES = ("log", "wave", "linear", "touch", "order")  # how a setting may be searched: by factors, in its unit, in whole numbers
SCALES = ("EXX1", "EYY1", "EZZ1")  # how far a linear axis goes for each mm that is commanded: a scale bar tells them
# What `role` may be: touches of one moment or pose, which a diagnosis sets aside; shapes kept in learned/ of the cell; what a
# machine does that is not warm yet; what an interrupted run may have left behind.
ROLES = ("moment", "learned", "warm-up", "interruption")


@dataclass(frozen=True)
class Coefficient:
    """One unknown of the model: its error at a touch is value × regressor, acting at `slot`."""

    name: str
    unit: str
    slot: Slot
    regressor: Callable[[Touches], Array]  # → (n,)


Setting = Mapping[str, Any]
Detail = Mapping[str, Any]  # of a finding: its setting, the key with its unit behind it where `units` has one: at_mm
Shape = tuple[str, str, str, Array]  # of what has no name: covariate, frame, kind, columns (n, k)
Spread = Iterable[tuple[dict[str, Any], Array]]


@dataclass(frozen=True, kw_only=True)
class Family:
    """Terms that belong together: what they are, and the coefficients that the model may have of them."""

    text: str  # what it is, for people
    source: str  # clause, equation or paper
    coefficients: Callable[[Machine, int], list[Coefficient]] = lambda machine, degree: []  # all, in order of preference
    coefficient: Callable[[str, Machine], Coefficient | None] = lambda name, machine: None  # the one of that name


@dataclass(frozen=True, kw_only=True)
class Cause(Family):
    """A family with a physical reason, which `diagnose` may name. It has a pattern (`variants`) or a spread, never both.

    A value of a coefficient that acts on the gap is positive when the surface is read too early, outside of where it is.
    """

    make: Callable[..., list[Coefficient]]  # machine, **setting → the coefficients that these settings stand for
    frame: str  # in which it acts: machine, table, spindle, axis, probe, log
    mistaken: tuple[str, ...]  # names of the causes that it is taken for
    plainer: tuple[str, ...] = ()  # of these, what is more usual or has fewer settings: named first where it comes near
    parted: Mapping[str, str] = field(default_factory=dict)  # another cause → what to do so that touches tell the two apart
    in_place_of: str = ""  # a cause that is searched for; this one is tried in its place, or alone where none was found
    says: str  # the finding as a sentence; the words in braces come from tango_cnc/diagnose/sentences.py
    meaning: str  # what it does to parts, for a person at the machine
    advice: str  # what that person does about it
    refine: Mapping[str, str] = field(default_factory=dict)  # what is searched between `variants`: name → one of `SEARCHES`
    example: Setting = field(default_factory=dict)  # a setting of it, for tests on a plan of which `variants` offers none
    variants: Callable[[Touches], Iterator[dict[str, Any]]] = lambda touches: iter(())  # settings that are worth trying
    spread: Callable[[Touches], Spread] | None = None  # → settings, variances (n,) or covariances (n, n) of unit size
    fitted: Callable[[Touches], dict[str, Any]] = lambda touches: {}  # setting of a spread that the model can fit
    effects: Callable[[Machine, Setting, Array], list[dict[str, Any]]] | None = None  # None: by the names of its coefficients
    # values, setting, estimated facet offsets in mm → whether the cause can have these values
    plausible: Callable[[Array, Setting, Mapping[str, float]], bool] = lambda values, setting, offsets: True
    # touches, setting, settings of the same cause and axis that are chosen → whether it can be told beside them
    beside: Callable[[Touches, Setting, Sequence[Setting]], bool] = lambda touches, setting, chosen: True
    units: Mapping[str, str] = field(default_factory=dict)  # of settings, where a reader sees them: {"period": "s"}
    words: Callable[[Detail], Mapping[str, str]] = lambda detail: {}  # words of `says` that only this cause has
    over: str = ""  # what its picture is drawn over: time, probe (angle around the stylus); "": the axis that its setting names
    follows: str = ""  # the covariate of its pattern, such as d{axis}; "": that of its picture, or the axis that its setting names
    both_ways: bool = False  # a machine may have it for one direction of an axis only
    scatters: str = ""  # a spread: what has a scatter of its own: indexation, facet, or all (every touch alike: the noise)
    once: bool = False  # a machine has it once an axis; a second one only follows curves
    expected: bool = False  # every machine has it: it is also tested alone, not only as one of hundreds
    # touches, rows that are searched → plain shapes that stand for it where a diagnosis is not to name it
    unnamed: Callable[[Touches, int], Iterator[Shape]] = lambda touches, rows: iter(())
    turning: bool = False  # an error motion of a rotary axis, one wave an `order` (ISO 230-7): the ISO figures allow for it
    role: str = ""  # what the program itself uses it for, one of `ROLES`; one cause has each
    known: int = 0  # coefficients whose values follow from what is estimated already; `plausible` compares
    needs: str = ""  # "tip": it has to know how far a touch missed, which a first estimate without it tells


@cache
def families() -> dict[str, Family]:
    """→ every family by name, found by walking this folder."""
    names = [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]
    return {name: importlib.import_module(f"{__name__}.{name}").TERM for name in names}


@cache
def causes() -> dict[str, Cause]:
    """→ every family that `diagnose` may name as a cause, by name."""
    return {name: family for name, family in families().items() if isinstance(family, Cause)}


def scattering(what: str) -> str:
    """indexation, facet or all → name of the cause that scatters so. Raises KeyError when no file has one."""
    return {record.scatters: name for name, record in causes().items()}[what]


@cache
def serving(role: str) -> str:
    """one of `ROLES` → name of the cause that the program uses for it. Raises KeyError when no file has it."""
    return {record.role: name for name, record in causes().items()}[role]


def patterns() -> list[str]:
    """→ names of the causes that have a pattern, not a spread."""
    return [name for name, cause in causes().items() if cause.spread is None]


@cache
def _settings(name: str) -> tuple[str, ...]:
    """name of a cause → its settings: a diagnosis asks thousands of times."""
    return tuple(key for key in inspect.signature(causes()[name].make).parameters if key != "machine")


def cause(name: str, machine: Machine, setting: Mapping[str, Any]) -> list[Coefficient]:
    """name of a cause, its settings → coefficients. Raises InputError for settings that it does not have or needs."""
    make, allowed = causes()[name].make, _settings(name)
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

    one = causes()[name]
    if one.effects is not None:
        return one.effects(machine, setting, values)
    defaults = {k: p.default for k, p in inspect.signature(one.make).parameters.items() if p.default is not p.empty}
    return _world.usual(name, {**defaults, **setting}, [c.name for c in cause(name, machine, setting)], values)


def find(item: TermItem, machine: Machine) -> list[Coefficient]:
    """name, or cause with its settings → coefficients. Raises InputError with the nearest names when no family knows it."""
    name, detail = (item, {}) if isinstance(item, str) else (str(item["cause"]), {k: v for k, v in item.items() if k != "cause"})
    if name in causes():
        return cause(name, machine, detail)
    for family in families().values():
        if (one := family.coefficient(name, machine)) is not None:
            return [one]
    listed = f" Write a list: [{name}]" if "," in name else ""
    known = [*(c.name for family in families().values() for c in family.coefficients(machine, 3)), *causes()]
    raise InputError(
        f"terms: found {name!r}, which no term of machine {machine.topology} has; allowed: S1, S2, S3, S4, and names such as "
        f"{', '.join(known[:6])} …{listed or suggestion(name, ['S1', 'S2', 'S3', 'S4', *known])}"
    )
