"""Shapes without a name: smooth functions of one or two covariates, each felt by a touch in its own way.

A shape is a Gaussian process of low rank (Rasmussen & Williams 2006, 2.7; Solin & Särkkä 2020): features φ with weights of
variance τσ². One number τ a shape is estimated, by the marginal likelihood, so that a shape pays for what it could do and
not only for what it does. Functions are polynomials, or waves with amplitudes that fall like 1/j, which follow steps as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..records import Array
from ..terms._shape import Form, values, weights
from ..touches import Touches
from ._forms import forms
from ._rows import Rows

WINDOWS = (6, 12, 24, 48, 80)  # touches
KEPT = (0.4, 0.6, 0.8, 0.9)  # correlation of neighbouring touches
REMEMBERED = 160  # waves of a noise with memory


@dataclass(frozen=True)
class Kernel:
    """A shape as numbers: features (n, k) in the unit of the residuals."""

    form: Form | None  # None for noise of a machine and for events
    kind: str  # shape; walk, seat, memory (noise); shift, turn, window (one moment)
    columns: Array
    scale: float = 1.0  # the features were divided by it
    setting: Mapping[str, Any] = field(default_factory=dict)  # of an event: indexation, axis, first and last row

    @property
    def covariate(self) -> str:
        """→ what it follows."""
        if self.form is not None:
            return self.form.covariate
        return str(self.setting.get("covariate", "time" if self.kind == "window" else "indexation" if self.event else "order"))

    @property
    def noise(self) -> bool:
        """→ whether it is a spread of the machine and no pattern."""
        return self.kind in ("walk", "seat", "memory")

    @property
    def event(self) -> bool:
        """→ whether it belongs to one moment or one pose."""
        return self.kind in ("shift", "turn", "window")


def kernels(means: Rows) -> list[Kernel]:
    """rows → shapes and noises that compete, features of mean variance 1; events where every touch is a row."""
    touches, seen = means.whole, means.seen
    known, felt = values(touches), {}
    found = []
    for form in forms(touches):
        if form.weight not in felt:
            felt[form.weight] = weights(touches, form.weight)
        found.append(Kernel(form, "shape", means.of(form.columns(touches, known, felt[form.weight]))))
    found += [Kernel(None, "walk", walk(seen)), Kernel(None, "seat", seats(seen)), *memories(len(seen))]
    found += events(touches) if means.all else ()
    return [scaled(k) for k in found if _size(k.columns) > 0]


def scaled(k: Kernel) -> Kernel:
    """kernel → with features of mean variance 1 over the touches."""
    size = _size(k.columns)
    return replace(k, columns=k.columns / size, scale=k.scale * size)


def events(touches: Touches) -> Iterator[Kernel]:
    """touches → what happens at one pose or for a while: an indexation beside its place or at a wrong angle, a window."""
    normal, n = touches.machine_normal, len(touches)
    for number in np.unique(touches.indexation):
        on = touches.indexation == number
        if on.sum() < 3:
            continue
        yield Kernel(None, "shift", normal * on[:, None], setting={"indexation": int(number)})
        for axis in touches.machine.rotary:
            yield Kernel(None, "turn", (touches.lever(axis) * on)[:, None], setting={"indexation": int(number), "axis": axis})
    for length in WINDOWS:
        for first in range(length // 2, n - length - 4, max(length // 2, 1)):
            yield window(touches, first, first + length)


def window(touches: Touches, first: int, last: int) -> Kernel:
    """touches, rows first … last − 1 → everything on the table sits elsewhere at these."""
    row = np.arange(len(touches))
    on = (row >= first) & (row < last)
    return Kernel(None, "window", touches.machine_normal * on[:, None], setting={"first": first, "last": last})


def _size(columns: Array) -> float:
    return float(np.sqrt(np.sum(columns**2) / len(columns)))


def walk(touches: Touches, count: int = 24) -> Array:
    """touches → (n, 3·count) a random walk of x y z, by its Karhunen–Loève waves."""
    u = (touches.time - touches.time.min()) / (np.ptp(touches.time) or 1.0)
    order = np.arange(1, count + 1) - 0.5
    waves = np.sin(np.pi * u[:, None] * order) / order
    return np.einsum("nf,nw->nfw", waves, touches.machine_normal).reshape(len(u), -1)


def memories(n: int) -> Iterator[Kernel]:
    """number of touches → noise of the probe that is like that of the touches before: first-order memory, and 1/f.

    The waves of such a noise over the order of the touches, with the power that it has beyond the white noise (Box, Jenkins and
    Reinsel 2008, 2.2 and 3.2).
    """
    count = min(n - 1, REMEMBERED)
    order = np.arange(1, count + 1)
    angle = np.pi * order / n
    waves = np.cos(angle * (np.arange(n)[:, None] + 0.5))

    def like(power: Array, last: float) -> Kernel:
        return Kernel(None, "memory", waves * np.sqrt(np.maximum(power - last, 0.0)))

    for kept in KEPT:
        yield like((1 - kept**2) / (1 + kept**2 - 2 * kept * np.cos(angle)), (1 - kept) / (1 + kept))
    yield like(1 / angle, 1 / np.pi)


def seats(touches: Touches) -> Array:
    """touches → (n, 3·indexations) a displacement of its own at every indexation."""
    number = touches.indexation
    on = number[:, None] == np.unique(number)[None, :]
    return np.einsum("nf,nw->nfw", on.astype(float), touches.machine_normal).reshape(len(number), -1)


def groups(sizes: Sequence[int]) -> dict[int, list[int]]:
    """(b,) numbers of features → number: blocks with so many."""
    found: dict[int, list[int]] = {}
    for i, k in enumerate(sizes):
        found.setdefault(int(k), []).append(i)
    return found
