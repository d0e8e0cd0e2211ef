"""`world.yaml`'s list of effects → one disturbance; keys and values checked against the signature of each effect."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import typing
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from tango_cnc.nearest import suggestion
from tango_cnc.records import Artefact, InputError, Machine

from . import _kinds
from ._history import Disturbance, History, no_touches

Effect = tuple[str, Mapping[str, Any]]


def names() -> list[str]:
    """→ every cause that can be simulated: the files of this folder."""
    from . import __path__ as folder

    return sorted(m.name for m in pkgutil.iter_modules(folder) if not m.name.startswith("_"))


def example(cause: str) -> dict[str, Any]:
    """cause → keys as `world.yaml` may give them on the HU40T: every required one, of a size that a machine has.

    Raises InputError for a file that states none.
    """
    module = importlib.import_module(f".{cause}", __package__)
    if "EXAMPLE" not in vars(module):
        needed = ", ".join(name for name, p in _keys(cause)[0].items() if p.default is p.empty)
        raise InputError(f"sim_controller/effects/{cause}.py: no EXAMPLE; state a dict of the keys that it needs: {needed}")
    return dict(module.EXAMPLE)


def stated(what: str) -> dict[str, str]:
    """OTHERWISE or UNDRAWN → cause → what its file states there; causes that state nothing are left out."""
    modules = {cause: importlib.import_module(f".{cause}", __package__) for cause in names()}
    return {cause: vars(module)[what] for cause, module in modules.items() if what in vars(module)}


def described() -> Iterator[tuple[str, str, str]]:
    """→ cause, its keys (those with a default in brackets), what it is; of every cause."""
    for cause in names():
        keys = (name if p.default is p.empty else f"[{name}]" for name, p in _keys(cause)[0].items())
        yield cause, ", ".join(keys), (importlib.import_module(f".{cause}", __package__).__doc__ or "").split("\n\n")[0]


def checked(
    effects: Sequence[Mapping[str, Any]], machine: Machine | None = None, artefact: Artefact | None = None
) -> tuple[Effect, ...]:
    """effects as in world.yaml → (cause, arguments) each. Raises InputError for unknown causes, keys and values.

    With machine and artefact it also refuses axes and facets that they lack, and keys that do not go together.
    """
    return tuple(_checked(dict(effect), f"effects[{i}]", machine, artefact) for i, effect in enumerate(effects))


def _checked(given: dict[str, Any], where: str, machine: Machine | None, artefact: Artefact | None) -> Effect:
    cause = str(given.pop("cause", ""))
    if cause not in names():
        raise InputError(f"{where}.cause: found {cause!r}; allowed: {', '.join(names())}.{suggestion(cause, names())}")
    parameters, hints = _keys(cause)
    for key in given:
        if key not in parameters:
            allowed = f"{', '.join(parameters)}.{suggestion(key, parameters)}"
            raise InputError(f"{where}: found the unknown key {key!r}; allowed for {cause}: {allowed}")
    for key, parameter in parameters.items():
        if key not in given and parameter.default is inspect.Parameter.empty:
            raise InputError(f"{where}: found no key {key!r}; {cause} requires it")
    arguments = {key: _kinds.value(value, hints[key], f"{where}.{key}", machine, artefact) for key, value in given.items()}
    if machine is not None and artefact is not None:
        try:
            _disturb(cause)(no_touches(machine, artefact), np.random.default_rng(0), **arguments)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
    return cause, arguments


def _disturb(cause: str) -> Any:
    return importlib.import_module(f".{cause}", __package__).disturb


def _keys(cause: str) -> tuple[dict[str, inspect.Parameter], dict[str, Any]]:
    function = _disturb(cause)
    parameters = inspect.signature(function).parameters
    keys = {name: p for name, p in parameters.items() if p.kind is inspect.Parameter.KEYWORD_ONLY}
    return keys, typing.get_type_hints(function, include_extras=True)


def disturbance(effects: Sequence[Effect], history: History, seed: int) -> Disturbance:
    """checked effects, history of n touches, seed → the sum of what they change, all n rows of it filled in."""
    count = len(history)
    gap, work, table = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3))
    errors: dict[str, Any] = {}
    facet = history.facet
    for number, (cause, arguments) in enumerate(effects):
        rng = np.random.default_rng([seed, 1 + number, zlib.crc32(cause.encode())])
        change: Disturbance = _disturb(cause)(history, rng, **arguments)
        gap = gap if change.gap is None else gap + change.gap
        work = work if change.work is None else work + change.work
        table = table if change.table is None else table + change.table
        if change.facet is not None:
            facet = tuple(old if new == true else new for old, new, true in zip(facet, change.facet, history.facet, strict=True))
        for name, value in change.errors.items():
            errors[name] = errors.get(name, 0.0) + value
    return Disturbance(gap, work, table, errors, facet)
