"""A shape without a name in few words: a product, a power, a step or a wave of its covariates, where one does as well."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np

from ..records import Array
from ..terms._shape import Form, values, weights
from ._rows import Rows

Function = Callable[[Array], Array]
AS_WELL = 0.9  # part of the shape's own pattern that a formula has to take
POWERS = {"": 1, "²": 2, "³": 3}


def closed(form: Form, means: Rows, pattern: Array, outside: Callable[[Array], Array]) -> str | None:
    """shape, rows, what is visible of it (r,), what the model leaves of columns (r, k) → formula, or None.

    The formula with the fewest numbers in it that takes AS_WELL of the shape; of equals the one that takes most.
    """
    known = values(means.whole)
    felt = weights(means.whole, form.weight)
    whole = float(pattern @ pattern)
    best: tuple[int, float, str] | None = None
    for text, free, function in _formulas([(f.covariate, known[f.covariate]) for f in form.factors]):
        left = outside(means.of(function[:, None] * felt))
        q = np.linalg.qr(left)[0]
        part = float(np.sum((q.T @ pattern) ** 2)) / whole if whole else 0.0
        if part > AS_WELL and (best is None or (free, -part) < (best[0], -best[1])):
            best = free, part, text
    return None if best is None else best[2]


def _formulas(covariates: list[tuple[str, Array]]) -> Iterator[tuple[str, int, Array]]:
    """covariates with their values → formula, how many numbers were searched for it, (n,) of it."""
    if len(covariates) == 1:
        yield from _single(*covariates[0])
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


def _single(name: str, x: Array) -> Iterator[tuple[str, int, Array]]:
    for text, power in POWERS.items():
        yield f"{name}{text}", 0, _unit(x) ** power
    if np.ptp(x) < 14 and np.abs(x).max() < 7:
        for order in range(1, 5):
            for word, f in (("sin", np.sin), ("cos", np.cos)):
                yield f"{word} {order if order > 1 else ''}{name}", 0, f(order * x)
    for place in np.quantile(x, np.linspace(0.05, 0.95, 37)):
        yield f"a step at {name} = {place:.4g}", 1, (x > place).astype(float)
        yield f"|{name} − {place:.4g}|", 1, np.abs(x - place)
        for width in np.array([0.03, 0.06, 0.12]) * np.ptp(x):
            yield f"a dip at {name} = {place:.4g}, {2 * width:.2g} wide", 2, np.exp(-(((x - place) / width) ** 2))
    for cycles in np.arange(0.5, 8, 0.1):
        for phase in np.arange(8) * np.pi / 8:
            wave = np.sin(2 * np.pi * cycles * (x - x.min()) / (np.ptp(x) or 1.0) + phase)
            yield f"a wave over {name} of period {np.ptp(x) / cycles:.3g}", 2, wave


def _unit(x: Array) -> Array:
    return x / (np.abs(x).max() or 1.0)
