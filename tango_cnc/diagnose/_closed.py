"""A shape without a name in few words: a product, a power, a step or a wave of its covariates, where one does as well."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import product

import numpy as np

from ..records import Array, Machine
from ..terms._shape import Form, values, weights
from ._rows import Rows

FEW = 40  # places of an axis between which each is tried
AS_WELL = 0.9  # part of the shape's own pattern that a formula has to take
INSTEAD = 0.95  # the same, where the formula is kept in place of the shape
SAME = 1e-6  # of a formula, which the functions of the shape may lack
POWERS = {"": 1, "²": 2, "³": 3}


def closed(
    form: Form, means: Rows, pattern: Array, outside: Callable[[Array], Array], visible: Array
) -> tuple[str | None, Array | None]:
    """shape, rows, what is visible of it (r,), what the model leaves of columns (r, k), and of the shape's functions (r, w) →
    formula, or None; (w,) weights of the functions that make this formula, or None where they do not.

    The formula with the fewest numbers in it that takes AS_WELL of the shape; of equals the one that takes most. Functions of a
    shape hold what the terms of the model hold too, as a slope beside a product; nothing tells how much of it is the shape's. The
    formula has none of it.
    """
    known, machine = values(means.whole), means.whole.machine
    felt = weights(means.whole, form.weight)
    whole = float(pattern @ pattern)
    best: tuple[int, float, str, Array | None] | None = None
    units = {f.covariate: _unit_of(f.covariate, machine) for f in form.factors}
    for text, free, function in _formulas([(f.covariate, known[f.covariate]) for f in form.factors], units):
        columns = function[:, None] * felt
        left = outside(means.of(columns))
        q = np.linalg.qr(left)[0]
        part = float(np.sum((q.T @ pattern) ** 2)) / whole if whole else 0.0
        if part > AS_WELL and (best is None or (free, -part) < (best[0], -best[1])):
            found = _made_of(form, means, columns, pattern, visible) if part > INSTEAD else None
            best = free, part, text, found
    return (None, None) if best is None else best[2:]


def _made_of(form: Form, means: Rows, columns: Array, pattern: Array, visible: Array) -> Array | None:
    """shape, rows, columns of a formula (n, k), pattern (r,), what is visible of the functions (r, w) → their weights; None where
    they do not hold the formula.
    """
    own = form.columns(means.whole)
    whole = np.hstack([own, weights(means.whole, form.weight)])  # a shift of all is the set-up's, and in no shape
    made = np.linalg.lstsq(whole, columns, rcond=1e-12)[0]
    if np.linalg.norm(whole @ made - columns) > SAME * np.linalg.norm(columns):
        return None
    made = made[: own.shape[1]]
    return np.asarray(made @ np.linalg.lstsq(visible @ made, pattern, rcond=1e-9)[0])


def _unit_of(covariate: str, machine: Machine) -> tuple[float, str]:
    """covariate → by what its values are multiplied for a person, and the unit that follows."""
    if covariate in (*machine.rotary, "S"):
        return float(np.degrees(1.0)), "°"
    return 1.0, " mm" if covariate in machine.linear or covariate.startswith("place") else " s" if covariate == "time" else ""


def _formulas(covariates: list[tuple[str, Array]], units: Mapping[str, tuple[float, str]]) -> Iterator[tuple[str, int, Array]]:
    """covariates with their values, their units → formula, how many numbers were searched for it, (n,) of it."""
    if len(covariates) == 1:
        name, x = covariates[0]
        yield from _single(name, x, *units[name])
        return
    (one, x), (other, y) = covariates
    for (a, p), (b, q) in product(POWERS.items(), POWERS.items()):
        yield f"{one}{a} · {other}{b}", 0, _unit(x) ** p * _unit(y) ** q
    for turning, straight in (((one, x), (other, y)), ((other, y), (one, x))):
        if np.ptp(turning[1]) > 7:  # no angle
            continue
        for order, (b, q) in product((1, 2), POWERS.items()):
            for name, f in (("sin", np.sin), ("cos", np.cos)):
                angle = f"{order if order > 1 else ''}{turning[0]}"
                yield f"{name} {angle} · {straight[0]}{b}", 0, f(order * turning[1]) * _unit(straight[1]) ** q


def _single(name: str, x: Array, times: float, unit: str) -> Iterator[tuple[str, int, Array]]:
    def told(number: float, digits: int = 4) -> str:
        return f"{float(f'{number * times:.{digits}g}'):g}{unit}"

    for text, power in POWERS.items():
        yield f"{name}{text}", 0, _unit(x) ** power
    if np.ptp(x) < 14 and np.abs(x).max() < 7:
        for order in range(1, 5):
            for word, f in (("sin", np.sin), ("cos", np.cos)):
                yield f"{word} {order if order > 1 else ''}{name}", 0, f(order * x)
    used = np.unique(np.round(x, 4))  # a step is between places that were used
    places = (used[1:] + used[:-1]) / 2 if len(used) <= FEW else np.quantile(x, np.linspace(0.05, 0.95, 37))
    for place in places:
        yield f"a step at {name} = {told(place)}", 1, (x > place).astype(float)
        yield f"|{name} − {told(place)}|", 1, np.abs(x - place)
        for width in np.array([0.03, 0.06, 0.12]) * np.ptp(x):
            yield f"a dip at {name} = {told(place)}, {told(2 * width, 2)} wide", 2, np.exp(-(((x - place) / width) ** 2))
    for cycles in np.arange(0.5, 8, 0.1):
        for phase in np.arange(8) * np.pi / 8:
            wave = np.sin(2 * np.pi * cycles * (x - x.min()) / (np.ptp(x) or 1.0) + phase)
            yield f"a wave over {name} of period {told(float(np.ptp(x)) / cycles, 3)}", 2, wave


def _unit(x: Array) -> Array:
    return x / (np.abs(x).max() or 1.0)
