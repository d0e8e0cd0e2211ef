"""Shapes whose functions are adapted to the touches: covariates are compared, and not the functions that happened to be tried.

Each pair of covariates is compared with a few functions of each, because there are thousands of pairs. Where these functions fit
one pair better than another one, evidence tells the functions apart and not the covariates: a load that is alike to both sides of
a tilt is no polynomial of its angle, but nearly one of the time where the plan goes from flat to steep. So covariates that come
anywhere near are compared again, each with the functions and the frame that suit it best.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ..records import Array
from ..terms._shape import BEYOND, CYCLE, EVEN, LEGENDRE, ONE, SIDE, TURN, WAVES, Factor, Form, values, weights
from ..touches import Touches
from ._field import Field, State, score
from ._forms import CYCLES
from ._ground import HALF, WHOLE, between, moves
from ._smooth import Kernel, scaled

SETS = 10  # sets of covariates that are compared again
WIDER = 6  # sets that are tried of a covariate that a shape already has and any other one
NEAR = 0.4  # of the likelihood of the best: what has less comes no nearer by better functions
NEARER = 0.5  # the same once functions nearly suit
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
    choice: float  # what it costs that its place, its period or the pair itself was chosen among several


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
        self.drawn: dict[Factor, Array] = {}  # functions of a covariate at every touch
        self.frames = tuple(frames(self.touches))
        self.covariates = [n for n, v in self.known.items() if not n.startswith("facet ") and moves(self.touches, n, v)]
        self.place: tuple[State, Array] | None = None  # a state, and what it leaves of every row

    def _of(self, name: str) -> list[Factor]:
        if name not in self.options:
            self.options[name] = factors(self.touches, name, self.known[name])
        return self.options[name]

    def _tried(self, s: State, form: Form) -> tuple[float, float]:
        """state, shape → its likelihood, at its best τ."""
        if self.place is None or self.place[0] is not s:
            self.place = s, (s.seen(self.field.basis.T * self.field.weight)).astype(np.float32)
        columns = self._columns(form)[self.field.rows]
        size = float(np.sum(np.square(columns)))
        if not size:
            return -np.inf, 0.0
        own = self.place[1] @ (columns * np.sqrt(len(columns) / size)).astype(np.float32)
        return score(s.y, own.astype(float))

    def _columns(self, form: Form) -> Array:
        """shape → (r, k) features of the rows."""
        if form.weight not in self.felt:
            self.felt[form.weight] = weights(self.touches, form.weight)
        for f in form.factors:
            if f not in self.drawn:
                self.drawn[f] = f.functions(self.known[f.covariate])
        return self.field.means.of(form.product([self.drawn[f] for f in form.factors], self.felt[form.weight]))

    def near(self, s: State, best: Array, order: Sequence[int], told: Sequence[Kernel] = ()) -> list[Adapted]:
        """state, scores (b,) of the shapes of the field, numbers of those with a form, the best first, shapes that people
        read → covariates that come near, and others beside one of these shapes, each with the functions that suit it best.
        """
        felt: dict[tuple[str, ...], list[str]] = {}
        begun: dict[tuple[str, ...], float] = {}
        for i in order:
            form = self.field.kernels[i].form
            if form is None or best[i] < NEAR * best[order[0]]:
                break
            own = self._sorted(f.covariate for f in form.factors)
            if own not in felt and len(felt) == SETS:
                continue
            weight = felt.setdefault(own, [])
            begun.setdefault(own, float(best[i]))
            if form.weight not in weight and len(weight) < 2:
                weight.append(form.weight)
        for own in felt:
            begun[own] = max(begun[own], *(self._glance(s, own, frame) for frame in felt[own]))
        among: dict[tuple[str, ...], float] = {}
        for own, frame, likelihood, picked in self._wider(s, told):
            among |= {own: picked} if own not in felt else {}
            felt.setdefault(own, [frame])
            begun[own] = max(begun.get(own, -np.inf), likelihood)
        top = max(begun.values(), default=0.0)
        found: list[Adapted] = []
        for own in sorted((one for one in begun if begun[one] >= NEARER * top), key=lambda one: -begun[one])[:SETS]:
            one = self.adapt(s, own, felt[own], max((a.score for a in found), default=0.0))
            found.append(replace(one, choice=one.choice + among.get(own, 0.0)))
        return found

    def _wider(self, s: State, told: Sequence[Kernel]) -> list[tuple[tuple[str, ...], str, float, float]]:
        """state, shapes that people read → each of their covariates alone, and the pairs of one of them with any other one that
        come nearest: covariates, the frame in which they do, how near, and what it costs that they were picked among many.

        Two covariates act together in frames, and with functions, that the contest does not try for every pair.
        """
        each = [c for c in dict.fromkeys(c for k in told for c in k.covariate.split(" × ")) if c in self.known]
        felt = list(dict.fromkeys(frame for k in told for frame in self._felt(s, k)))
        pairs = (self._sorted((one, other)) for one in each for other in self.covariates if one != other)
        sets = [*((one,) for one in each), *(p for p in dict.fromkeys(pairs) if self._of(p[-1])[0].kind != SIDE)]
        every = []
        for names in sets if felt else ():
            likelihood, weight = max((self._glance(s, names, weight), weight) for weight in felt)
            every.append((names, weight, likelihood))
        picked = 2 * float(np.log(max(len(sets) - len(each), 1)))
        pairs_near = sorted(every[len(each) :], key=lambda one: -one[2])[:WIDER]
        return [*((*one, 0.0) for one in every[: len(each)]), *((*one, picked) for one in pairs_near)]

    def _felt(self, s: State, k: Kernel) -> list[str]:
        """state, shape that people read → the frame in which it is felt; of a name whose size changes, where its covariates are."""
        if k.form is not None:
            return [k.form.weight]
        names = self._sorted(c for c in k.covariate.split(" × ") if c in self.known)
        return [max(self.frames, key=lambda frame: self._glance(s, names, frame))] if names else []

    def _sorted(self, names: Iterable[str]) -> tuple[str, ...]:
        """covariates → in one order: a side before what it acts together with, an axis or the time last."""
        plain = ("time", *self.touches.machine.names)
        rank = {name: (self._of(name)[0].kind != SIDE, name in plain, i) for i, name in enumerate(self.known)}
        return tuple(sorted(names, key=lambda name: rank[name]))

    def _glance(self, s: State, names: Sequence[str], weight: str) -> float:
        """state, covariates, frame → likelihood with few or many functions of each, whichever comes nearer.

        Many functions follow most of what a covariate may do. Where few do as well, the others only dilute it.
        """
        sizes = [dict.fromkeys((self._many(name), self._few(name))) for name in names]
        return max(self._tried(s, Form(factors, weight))[0] for factors in product(*sizes))

    def _few(self, name: str) -> Factor:
        options = self._of(name)
        return options[min(1, len(options) - 1)]

    def _many(self, name: str) -> Factor:
        waves = [f for f in self._of(name) if f.kind == WAVES]
        return waves[-1 if name == "time" else 0] if waves else self._of(name)[0]

    def adapt(self, s: State, names: Sequence[str], felt: Sequence[str], reached: float = 0.0) -> Adapted:
        """state, covariates of a shape, frames in which it came nearest, the likelihood that others reached → the same with the
        best functions and frame; far below the others no other frame is tried.
        """
        names = self._sorted(names)
        every = [self._of(name) for name in names]
        known: dict[Form, tuple[float, float]] = {}

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

        first = tuple(self._few(name) for name in names)
        best = max((improved(Form(first, weight)) for weight in felt), key=worth)
        own = any(name.startswith(OWN) for name in names) or worth(best) < NEARER * reached
        other = max((Form(best.factors, weight) for weight in (best.weight, *(() if own else self.frames))), key=worth)
        if other != best:
            best = max((best, improved(other)), key=worth)
        likelihood, tau = known[best]
        alike = [sum(o.kind == f.kind for o in options) for f, options in zip(best.factors, every, strict=True) if f.kind in PLACED]
        return Adapted(scaled(Kernel(best, "shape", self._columns(best))), likelihood, tau, 2 * float(np.sum(np.log(alike))))


__all__ = ["Adapted", "Adapting", "factors", "frames"]
