"""`world.yaml`'s list of effects → one disturbance; keys and values checked against the signature of each effect."""

from __future__ import annotations

import difflib
import importlib
import inspect
import math
import pkgutil
import typing
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from tango_cnc.records import InputError, Vector

from ._history import Disturbance, History

Effect = tuple[str, Mapping[str, Any]]


def names() -> list[str]:
    """→ every cause that can be simulated: the files of this folder."""
    from . import __path__ as folder

    return sorted(m.name for m in pkgutil.iter_modules(folder) if not m.name.startswith("_"))


def checked(effects: Sequence[Mapping[str, Any]]) -> tuple[Effect, ...]:
    """effects as in world.yaml → (cause, arguments) each. Raises InputError for unknown causes, keys and values."""
    return tuple(_checked(dict(effect), f"effects[{i}]") for i, effect in enumerate(effects))


def _checked(given: dict[str, Any], where: str) -> Effect:
    cause = str(given.pop("cause", ""))
    if cause not in names():
        near = difflib.get_close_matches(cause, names(), n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise InputError(f"{where}.cause: found {cause!r}; allowed: {', '.join(names())}.{hint}")
    parameters, hints = _keys(cause)
    for key in given:
        if key not in parameters:
            near = difflib.get_close_matches(key, list(parameters), n=1)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            raise InputError(f"{where}: found the unknown key {key!r}; allowed for {cause}: {', '.join(parameters)}.{hint}")
    for key, parameter in parameters.items():
        if key not in given and parameter.default is inspect.Parameter.empty:
            raise InputError(f"{where}: found no key {key!r}; {cause} requires it")
    return cause, {key: _value(value, hints[key], f"{where}.{key}") for key, value in given.items()}


def _disturb(cause: str) -> Any:
    return importlib.import_module(f".{cause}", __package__).disturb


def _keys(cause: str) -> tuple[dict[str, inspect.Parameter], dict[str, Any]]:
    function = _disturb(cause)
    parameters = inspect.signature(function).parameters
    keys = {name: p for name, p in parameters.items() if p.kind is inspect.Parameter.KEYWORD_ONLY}
    return keys, typing.get_type_hints(function)


def _value(value: Any, kind: Any, where: str) -> Any:
    def wrong(allowed: str) -> InputError:
        return InputError(f"{where}: found {value!r}; allowed: {allowed}")

    number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if typing.get_origin(kind) is Literal:
        if value not in typing.get_args(kind):
            raise wrong(", ".join(map(str, typing.get_args(kind))))
        return value
    if kind == Vector:
        three = isinstance(value, (list, tuple)) and len(value) == 3
        if not three or not all(isinstance(v, (int, float)) and math.isfinite(v) for v in value) or not any(value):
            raise wrong("a list of three numbers, not all zero")
        return tuple(float(v) for v in value)
    if kind is float:
        if not number:
            raise wrong("a finite number")
        return float(value)
    if kind is int:
        if not number or value != int(value):
            raise wrong("a whole number")
        return int(value)
    if kind is bool:
        if not isinstance(value, bool):
            raise wrong("true or false")
        return value
    if kind is str:  # Id
        if not isinstance(value, (int, str)):
            raise wrong("a name or whole number")
        return str(value)
    if not isinstance(value, (list, tuple)):
        raise wrong("a list of names")
    return tuple(_value(item, str, where) for item in value)


def disturbance(effects: Sequence[Effect], history: History, seed: int) -> Disturbance:
    """checked effects, history of n touches, seed → the sum of what they change, all n rows of it filled in."""
    count = len(history)
    gap, work, table = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3))
    errors: dict[str, Any] = {}
    for number, (cause, arguments) in enumerate(effects):
        rng = np.random.default_rng([seed, 1 + number, zlib.crc32(cause.encode())])
        change: Disturbance = _disturb(cause)(history, rng, **arguments)
        gap = gap if change.gap is None else gap + change.gap
        work = work if change.work is None else work + change.work
        table = table if change.table is None else table + change.table
        for name, value in change.errors.items():
            errors[name] = errors.get(name, 0.0) + value
    return Disturbance(gap, work, table, errors)
