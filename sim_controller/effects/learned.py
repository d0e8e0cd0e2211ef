"""A shape that was learned from a machine: a sum of products of functions of what a touch knows, as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np

from tango_cnc.records import Array, InputError

from . import Disturbance, History
from ._kinds import Mappings, Numbers
from ._parts import positioning

EXAMPLE = {
    "factors": [{"covariate": "X", "kind": "polynomial", "low": -300, "high": 300, "count": 2}],
    "weight": "machine z",
    "values": [0.002, 0.001],
}
OTHERWISE = "a file of the cell; test_learned_terms.py"
UNDRAWN = "a shape without a name; tests/test_learned_terms.py"

WEIGHTS = "none, across, machine [x y z], table [x y z], spindle [x y z], axis X, tilt A of X"


def disturb(
    history: History,
    rng: np.random.Generator,
    *,
    factors: Mappings,
    values: Numbers,
    weight: str = "none",
    amplitude: float = 1.0,
    name: str = "",
) -> Disturbance:
    """n touches → the sum over all products of functions, in mm or rad, `amplitude` times as large.

    `weight` says what it moves. Raises InputError for functions, covariates and weights that do not exist.
    """
    known = [_functions(history, dict(f)) for f in factors]
    terms = [np.prod(parts, axis=0) for parts in product(*([np.ones(len(history)), *f] for f in known))]
    if len(known) == 2 and factors[0].get("kind") == "side":
        terms = [a * b for a in known[0] for b in (np.ones(len(history)), *known[1])]
    else:
        terms = terms[1:]
    directions = _directions(weight)
    if len(terms) * len(directions) != len(values):
        raise InputError(f"values: found {len(values)}; allowed: {len(terms) * len(directions)}, one for each product of functions")
    size = amplitude * np.array(values).reshape(len(terms), len(directions))
    along = np.zeros((len(history), len(directions)))
    for term, own in zip(terms, size, strict=True):  # one by one: a product of matrices rounds by the number of touches
        along += np.outer(term, own)
    return _moved(history, weight, along)


def _functions(h: History, f: Mapping[str, Any]) -> Sequence[Array]:
    kind, count = str(f.get("kind", "")), int(f.get("count", 0))
    x = _covariate(h, str(f.get("covariate", "")))
    low, high = float(f.get("low", 0)), float(f.get("high", 1))
    if kind == "side":
        return [np.sign(x)]
    if kind == "beyond":
        return [np.heaviside(x - low, 0.0)]
    if kind == "even":
        distance = np.minimum(np.hypot(x, 0.0), high) / (high or 1.0)
        return [np.polynomial.Legendre.basis(j)(2 * distance - 1) for j in range(1, count + 1)]
    x = np.minimum(np.maximum(x, low), high)
    part = (x - low) / (high - low or 1.0)
    orders = range(1, count + 1)
    if kind == "polynomial":
        return [np.polynomial.Legendre.basis(j)(2 * part - 1) for j in orders]
    if kind == "waves":
        return [np.cos(j * np.pi * part) / j for j in orders]
    half = range(1, count // 2 + 1)
    if kind == "turn":
        return [*(np.cos(j * x) / j for j in half), *(np.sin(j * x) / j for j in half)]
    if kind == "cycle":
        turns = 2 * np.pi * float(f.get("cycles", 1)) * part
        return [*(np.cos(j * turns) / j for j in half), *(np.sin(j * turns) / j for j in half)]
    raise InputError(f"factors: found the kind {kind!r}; allowed: polynomial, waves, turn, cycle, side, beyond, even")


def _covariate(h: History, name: str) -> Array:
    first, _, rest = name.partition(" ")
    letters = h.machine.names
    if name == "time":
        return h.warm
    if name in letters:
        return h.position[:, h.column(name)]
    if len(name) == 2 and name[0] == "d" and name[1] in letters:
        return h.direction[:, h.column(name[1])]
    if first == "way" and rest[3:] in letters:
        return _way(h, rest[3:])
    if first == "path":
        return _ahead(h, rest[3:])
    if name == "since indexation":
        begins: list[float] = []
        for row, (number, time) in enumerate(zip(h.indexation, h.time, strict=True)):
            begins.append(begins[-1] if row and number == h.indexation[row - 1] else float(time))
        return np.asarray(h.time - np.array(begins))
    if name == "probe direction":
        return np.arctan2(h.normal_spindle[:, 1], h.normal_spindle[:, 0])
    if name == "probe direction along":
        return h.normal_spindle[:, 2]
    if rest in (f"{c}, {frame}" for c in "xyz" for frame in ("machine", "table")) and first == "normal":
        return (h.normal if rest.endswith("machine") else h.normal_table)[:, "xyz".index(rest[0])]
    if first == "place" and rest in ("x, table", "y, table", "z, table"):
        return h.point[:, "xyz".index(rest[0])]
    if name == "pause":
        waits = [later - earlier for earlier, later in pairwise(h.time)]
        return np.array([math.log(max(w, 1.0)) for w in (max(waits, default=1.0), *waits)][: len(h)])
    if name == "feed":
        return h.feed
    if first == "facet":
        return np.array([1.0 if one == rest else 0.0 for one in h.facet])
    raise InputError(f"factors: found the covariate {name!r}, which the simulated machine does not have")


def _way(h: History, letter: str) -> Array:
    """A linear axis: from contact to contact, in units of 20 mm, logarithmic beyond. A rotary one: the size of its last turn."""
    steps = np.diff(h.position[:, h.column(letter)], prepend=h.position[:1, h.column(letter)])
    if letter in h.machine.linear:
        return np.asarray(np.log(np.abs(steps) / 20 + np.hypot(1, steps / 20)) * np.sign(steps))
    last, found = 0.0, []
    for step in steps:
        last = abs(float(step)) if abs(step) > 1e-4 else last
        found.append(last)
    return np.array(found)


def _ahead(h: History, what: str) -> Array:
    """axis and play in degrees → how far it is ahead of what lies loosely in its play, and stays where nothing pushes it."""
    letter, _, play = what.partition(" ")
    if letter not in h.machine.names or not play.isdigit():
        raise InputError(
            f"factors: found the covariate 'path of {what}'; allowed: the letter of an axis and a play in whole degrees"
        )
    q = h.position[:, h.column(letter)]
    half = np.pi * int(play) / 360
    behind = np.empty(len(q))
    loose = float(q[0]) if len(q) else 0.0
    for row, place in enumerate(q):
        loose += max(place - half - loose, 0.0) - max(loose - place - half, 0.0)
        behind[row] = loose
    return np.asarray(q - behind)


def _directions(weight: str) -> Sequence[str]:
    kind, _, rest = weight.partition(" ")
    return "xyz" if kind in ("machine", "table", "spindle") and not rest else (rest or "-",)


def _moved(h: History, weight: str, size: Array) -> Disturbance:
    """what is moved, (n, d) mm or rad → disturbance."""
    kind, _, rest = weight.partition(" ")
    if weight == "none":
        return Disturbance(gap=size[:, 0])
    if weight == "across":
        return Disturbance(gap=size[:, 0] * np.hypot(h.normal_spindle[:, 0], h.normal_spindle[:, 1]))
    if kind in ("machine", "table", "spindle") and (not rest or rest in ("x", "y", "z")):
        vector = np.zeros((len(size), 3))
        vector[:, ["xyz".index(c) for c in rest] if rest else [0, 1, 2]] = size
        if kind == "spindle":
            return Disturbance(gap=np.sum(vector * h.normal_spindle, axis=1))
        return Disturbance(work=vector) if kind == "machine" else Disturbance(table=vector)
    if kind == "axis" and rest in h.machine.names:
        return Disturbance(errors={positioning(rest): size[:, 0]})
    if kind == "tilt" and len(rest) == 6 and rest[0] in "ABC" and rest[5] in h.machine.names:
        return Disturbance(errors={f"E{rest[0]}{rest[5]}0": size[:, 0]})
    raise InputError(f"weight: found {weight!r}; allowed: {WEIGHTS}")
