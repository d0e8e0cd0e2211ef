"""Shapes whose functions are adapted to the touches: covariates are compared, and not the functions that happened to be tried.

Each pair of covariates is compared with a few functions of each, because there are thousands of pairs. Where these functions fit
one pair better than another one, evidence tells the functions apart and not the covariates: a load that is alike to both sides of
a tilt is no polynomial of its angle, but nearly one of the time where the plan goes from flat to steep. So covariates that come
anywhere near are compared again, each with the functions and the frame that suit it best.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..records import Array
from ..terms._shape import BEYOND, CYCLE, EVEN, LEGENDRE, ONE, SIDE, TURN, WAVES, Factor, Form, values, weights
from ..touches import Touches
from ._field import Field, State, score
from ._smooth import CYCLES, HALF, WHOLE, Kernel, between, scaled

SETS = 10  # sets of covariates that are compared again
NEAR = 0.4  # of the likelihood of the best: what has less comes no nearer by better functions
POLYNOMIALS, WAVY, EVENS, TURNS = (1, 2, 4, 6), (6, 14), (1, 2, 4), (4, 8)  # numbers of functions that are tried
LOBES = (4, 6, 12)
BREAKS = 12  # places from which on something is elsewhere
PLACED = (BEYOND, CYCLE)  # such functions differ by a place or a period alone
BEFORE = ("way", "path", "pause")  # what was before a touch
OWN = ("facet", "first", "normal", "probe")  # what is felt in a frame of its own
ROUNDS = 3  # of improving one factor after the other


@dataclass(frozen=True)
class Adapted:
    """A shape with the functions that suit its covariates best."""

    kernel: Kernel
    score: float  # twice the log likelihood ratio at its best τ
    tau: float
    choice: float  # what it costs that its place or period was chosen among several


def factors(touches: Touches, name: str, v: Array) -> list[Factor]:
    """touches, name and values (n,) of a covariate → the functions of it that are tried; few and smooth ones come first."""
    low, high = float(v.min()), float(v.max())
    if name.startswith(("facet", "first")):
        return [Factor(name, SIDE, 0.0, 1.0, 1)]
    if len(name) == 2 and name[0] == "d":
        return [Factor(name, SIDE, -1.0, 1.0, 1)]
    if name == "probe direction":
        return [Factor(name, TURN, -1e3, 1e3, count) for count in LOBES]
    used = len(np.unique(np.round(v, 5)))
    turns = name in (*touches.machine.rotary, "S")
    found = []
    if not (turns and np.ptp(v) > WHOLE):
        found += [Factor(name, LEGENDRE, low, high, count) for count in POLYNOMIALS if count < used]
    if turns and low < 0 < high:
        most = float(np.abs(v).max())
        found += [Factor(name, EVEN, 0.0, most, count) for count in EVENS]
    if turns and np.ptp(v) > HALF:
        found += [Factor(name, TURN, -1e3, 1e3, count) for count in TURNS]
    found += [Factor(name, WAVES, low, high, count) for count in dict.fromkeys(min(c, used - 1) for c in WAVY)]
    if name == "time":
        found += [Factor(name, CYCLE, low, high, 2, cycles=float(cycles)) for cycles in CYCLES[::2]]
    if not name.startswith(BEFORE):
        found += [Factor(name, BEYOND, place, high, 1) for place in between(v, BREAKS)]
    return found


def frames(touches: Touches) -> Iterator[str]:
    """touches → ways in which a touch may feel a shape, one number a touch each."""
    yield ONE
    moving = [a for a in (*touches.machine.linear, *touches.machine.rotary) if np.ptp(touches.axis(a)) > 0]
    yield from (f"{frame} {c}" for frame in ("machine", "table") for c in "xyz")
    yield from (f"axis {a}" for a in moving)
    for slot in touches.seen.slots:
        if slot.stage == "intra" and slot.component >= 3 and slot.axis in moving:
            yield f"tilt {'ABC'[slot.component - 3]} of {slot.axis}"


class Adapting:
    """What is the same for all shapes of some touches."""

    def __init__(self, field: Field) -> None:
        self.field, self.touches = field, field.means.whole
        self.known = values(self.touches)
        self.options: dict[str, list[Factor]] = {}
        self.felt: dict[str, Array] = {}
        self.frames = tuple(frames(self.touches))

    def _of(self, name: str) -> list[Factor]:
        if name not in self.options:
            self.options[name] = factors(self.touches, name, self.known[name])
        return self.options[name]

    def _tried(self, s: State, form: Form) -> tuple[float, float, Kernel]:
        if form.weight not in self.felt:
            self.felt[form.weight] = weights(self.touches, form.weight)
        columns = self.field.means.of(form.columns(self.touches, self.known, self.felt[form.weight]))
        if not np.any(columns):
            return -np.inf, 0.0, Kernel(form, "shape", columns)
        kernel = scaled(Kernel(form, "shape", columns))
        return *score(s.y, s.seen(self.field.project(kernel))), kernel

    def near(self, s: State, best: Array, order: Sequence[int]) -> list[Adapted]:
        """state, scores (b,) of the shapes of the field, numbers of those with a form, the best first → those covariates that come
        near, each with the functions that suit it best.
        """
        felt: dict[frozenset[str], list[str]] = {}
        names: dict[frozenset[str], tuple[str, ...]] = {}
        for i in order:
            form = self.field.kernels[i].form
            if form is None or best[i] < NEAR * best[order[0]]:
                break
            own = tuple(f.covariate for f in form.factors)
            key = frozenset(own)
            if key not in felt and len(felt) == SETS:
                continue
            names.setdefault(key, own)
            weight = felt.setdefault(key, [])
            if form.weight not in weight and len(weight) < 2:
                weight.append(form.weight)
        return [self.adapt(s, names[key], weight) for key, weight in felt.items()]

    def adapt(self, s: State, names: Sequence[str], felt: Sequence[str]) -> Adapted:
        """state, covariates of a shape, frames in which it came nearest → the same with the best functions and frame."""
        names = sorted(names, key=lambda name: self._of(name)[0].kind != SIDE)
        every = [self._of(name) for name in names]
        known: dict[Form, tuple[float, float, Kernel]] = {}

        def worth(form: Form) -> float:
            if form not in known:
                known[form] = self._tried(s, form)
            return known[form][0]

        def improved(form: Form) -> Form:
            for _ in range(ROUNDS):
                before = form
                for i, options in enumerate(every):
                    one = [Form((*form.factors[:i], f, *form.factors[i + 1 :]), form.weight) for f in options]
                    form = max(one, key=worth)
                if form == before:
                    break
            return form

        first = tuple(options[min(1, len(options) - 1)] for options in every)
        best = max((improved(Form(first, weight)) for weight in felt), key=worth)
        frame = () if any(name.startswith(OWN) for name in names) else self.frames
        other = max((Form(best.factors, weight) for weight in (best.weight, *frame)), key=worth)
        if other != best:
            best = max((best, improved(other)), key=worth)
        likelihood, tau, kernel = known[best]
        alike = [sum(o.kind == f.kind for o in options) for f, options in zip(best.factors, every, strict=True) if f.kind in PLACED]
        return Adapted(kernel, likelihood, tau, 2 * float(np.sum(np.log(alike))))


__all__ = ["Adapted", "Adapting", "factors", "frames"]
