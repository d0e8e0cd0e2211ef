"""What the keys of an effect may hold: the annotation of an argument of `disturb` says which of these it is."""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal

from tango_cnc.nearest import suggestion
from tango_cnc.records import COMPONENTS, LINEAR, ROTARY, Artefact, Id, InputError, Machine, Vector

# Beside float, int, bool, Literal[…], Id, tuple[Id, ...] and Vector (a direction: not all zero):
Positive = Annotated[float, "positive"]
Count = Annotated[int, "from 1"]
Point = Annotated[Vector, "any three numbers"]
Numbers = Annotated[tuple[float, ...], "numbers"]
Mappings = Annotated[tuple[Mapping[str, Any], ...], "a list of mappings"]
LinearAxis = Annotated[str, "linear axis"]
RotaryAxis = Annotated[str, "rotary axis"]
AnyAxis = Annotated[str, "linear or rotary axis"]
FacetId = Annotated[Id, "facet"]
FacetIds = Annotated[tuple[Id, ...], "facets"]
ErrorMotion = Annotated[str, "error motion"]  # EYX, EBX, EZC
AxisLocation = Annotated[str, "axis location error"]  # EX0C, EA0B


def value(given: Any, kind: Any, where: str, machine: Machine | None = None, artefact: Artefact | None = None) -> Any:
    """value of a key in world.yaml, its kind → the same, checked; names only where the machine or the artefact is known.

    Raises InputError.
    """
    if type(None) in typing.get_args(kind):  # None is a default and no value of a file
        kind = next(k for k in typing.get_args(kind) if k is not type(None))
    if typing.get_origin(kind) is Literal:
        return _one_of(given, typing.get_args(kind), where)
    if kind in (LinearAxis, RotaryAxis, AnyAxis):
        return _one_of(given, _axes(kind, machine), where)
    if kind in (ErrorMotion, AxisLocation):
        letters = (*LINEAR, *ROTARY, "S") if machine is None else machine.names
        zero = "0" if kind == AxisLocation else ""
        return _one_of(given, [f"E{component}{zero}{letter}" for letter in letters for component in COMPONENTS], where)
    if kind == FacetId:
        return _facet(given, where, artefact)
    if kind == FacetIds:
        return tuple(_facet(item, where, artefact) for item in _list(given, "a list of names", where))
    check, allowed, convert = _PLAIN[kind]
    if not check(given):
        raise _wrong(given, allowed, where)
    return convert(given)


def _wrong(given: Any, allowed: str, where: str) -> InputError:
    return InputError(f"{where}: found {given!r}; allowed: {allowed}")


def _one_of(given: Any, allowed: Sequence[Any], where: str) -> Any:
    if given not in allowed:
        named = f"{', '.join(map(str, allowed))}.{suggestion(str(given), allowed)}" if allowed else ""
        raise _wrong(given, named or "nothing: this machine has no such axis", where)
    return given


def _axes(kind: Any, machine: Machine | None) -> tuple[str, ...]:
    linear = tuple(LINEAR) if machine is None else machine.linear
    rotary = tuple(ROTARY) if machine is None else machine.rotary
    return linear if kind == LinearAxis else rotary if kind == RotaryAxis else (*linear, *rotary)


def _facet(given: Any, where: str, artefact: Artefact | None) -> Id:
    if isinstance(given, bool) or not isinstance(given, (int, str)):
        raise _wrong(given, "a name or whole number", where)
    if artefact is not None and str(given) not in artefact.facets:
        allowed = f"{', '.join(artefact.facets)}.{suggestion(str(given), artefact.facets)}"
        raise _wrong(given, f"facets of artefact {artefact.name!r}: {allowed}", where)
    return str(given)


def _list(given: Any, allowed: str, where: str) -> Sequence[Any]:
    if not isinstance(given, (list, tuple)):
        raise _wrong(given, allowed, where)
    return given


def _number(given: Any) -> bool:
    return isinstance(given, (int, float)) and not isinstance(given, bool) and math.isfinite(given)


def _numbers(given: Any) -> bool:
    return isinstance(given, (list, tuple)) and all(_number(item) for item in given)


def _floats(given: Any) -> tuple[float, ...]:
    return tuple(float(item) for item in given)


_PLAIN: dict[Any, tuple[Callable[[Any], bool], str, Callable[[Any], Any]]] = {
    float: (_number, "a finite number", float),
    Positive: (lambda v: _number(v) and v > 0, "a positive number", float),
    int: (lambda v: _number(v) and v == int(v), "a whole number", int),
    Count: (lambda v: _number(v) and v == int(v) and v >= 1, "a whole number from 1", int),
    Mappings: (lambda v: isinstance(v, (list, tuple)) and all(isinstance(f, Mapping) for f in v), "a list of mappings", tuple),
    str: (lambda v: isinstance(v, str), "a word", str),
    bool: (lambda v: isinstance(v, bool), "true or false", bool),
    Numbers: (_numbers, "a list of numbers", _floats),
    Point: (lambda v: _numbers(v) and len(v) == 3, "a list of three numbers", _floats),
    Vector: (lambda v: _numbers(v) and len(v) == 3 and any(v), "a list of three numbers, not all zero", _floats),
}
