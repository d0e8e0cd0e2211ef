"""Shapes without a name: smooth functions of one or two covariates, each felt by a touch in its own way.

A shape is a Gaussian process of low rank (Rasmussen & Williams 2006, 2.7; Solin & Särkkä 2020): features φ with weights of
variance τσ². One number τ a shape is estimated, by the marginal likelihood, so that a shape pays for what it could do and
not only for what it does. Functions are polynomials, or waves with amplitudes that fall like 1/j, which follow steps as well.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..kinematics import Slot
from ..records import Array
from ..terms._shape import BEYOND, CYCLE, EVEN, LEGENDRE, ONE, SIDE, TURN, WAVES, Factor, Form, values, weights
from ..touches import Touches
from ._crossed import crossed
from ._rows import Rows

FAST, SLOW = 14, 4  # functions of a shape of one covariate, and of each one of two
STEEP = (6, 10)  # functions of time, for what grows ever faster towards the end
WINDOWS = (6, 12, 24, 48, 80)  # touches
CYCLES = (*np.arange(1.5, 6, 0.15), *np.arange(6, 12, 0.25))  # over the test, of what repeats in time
KEPT = (0.4, 0.6, 0.8, 0.9)  # correlation of neighbouring touches
REMEMBERED = 160  # waves of a noise with memory
WHOLE = 4.0  # rad: what an axis turns beyond this is a wave, and no polynomial of four functions
PLAIN = 1  # function of each covariate of a pair that is a product; two beside a side from which an axis came
CURVED = 2  # functions of each covariate of a pair that bends: four of each follow more, and pay for it
HALF = 2.0  # rad: what waves of an axis can do with a name, they can do without one
OFTEN = 6  # touches of a facet that show a course, and beyond a place
PLACES = 40  # of an axis beyond which something may rest elsewhere
JOINTS = 12  # places of a linear axis, among the touched ones, beyond which another axis may stand otherwise
LEAST = {"way": 1e-3, "pause": 0.2, "place": 1.0, "path": 0.05, "since": 1.0, "T": 0.05, "feed": 1e-6, "probe": 0.05, "time": 1.0}


def forms(touches: Touches) -> Iterator[Form]:
    """touches → every shape that is compared: each covariate as it may be felt, and pairs of them."""
    known = {name: v for name, v in values(touches).items() if not name.startswith("facet ") and moves(touches, name, v)}
    machine = touches.machine
    linear = [a for a in machine.linear if a in known]
    rotary = [a for a in machine.rotary if a in known]

    def line(name: str, kind: str, count: int) -> Factor:
        v = known[name]
        return Factor(name, kind, float(v.min()), float(v.max()), count)

    def slow(name: str) -> Factor:
        """A covariate of a pair; what turns by more than a turn is a wave, which a polynomial of four functions cannot follow."""
        turns = name in machine.rotary and np.ptp(known[name]) > WHOLE
        return Factor(name, TURN, -1e3, 1e3, SLOW) if turns else line(name, LEGENDRE, SLOW)

    def single(name: str, weight: str) -> Iterator[Form]:
        if name[0] == "d":
            yield Form((Factor(name, SIDE, -1.0, 1.0, 1),), weight)
            return
        few = len(np.unique(np.round(known[name], 6)))
        if name not in linear:  # a straight line; what a place does in proportion is a scale, or square
            yield Form((line(name, LEGENDRE, PLAIN),), weight)
        if few > 3:
            yield Form((line(name, LEGENDRE, 3),), weight)
        if name == "time" and weight == ONE:  # a probe that fails ever faster: a pair must not follow it better than time alone
            yield from (Form((line(name, LEGENDRE, count),), weight) for count in STEEP)
        yield Form((line(name, WAVES, min(FAST, few - 1)),), weight)
        if name in machine.rotary and np.ptp(known[name]) > HALF:
            yield Form((Factor(name, TURN, -1e3, 1e3, 8),), weight)

    felt = (ONE, *(f"machine {c}" for c in "xyz"), *(f"axis {a}" for a in (*linear, *rotary)))
    for name in known:
        if name.startswith(("probe", "normal", "path", "place")):
            continue
        for weight in (*felt, "machine"):
            yield from single(name, weight)
        if name == "time" or name in rotary:
            yield from single(name, "table")
        if name == "time":
            for cycles in CYCLES:
                for weight in ("machine", "table") if rotary else ("machine",):
                    yield Form((replace(line(name, CYCLE, 10), cycles=float(cycles)),), weight)
        if rotary and (name == "time" or name in rotary):
            yield from (f for c in "xyz" for f in single(name, f"table {c}"))
        if name in linear or name in rotary:
            for axis in (*linear, *rotary):
                for c in "ABC":
                    if Slot(axis, "intra", 3 + "ABC".index(c)) in touches.seen.slots and (name == axis or name in linear):
                        yield from single(name, f"tilt {c} of {axis}")
    for name in rotary:  # beyond an angle something rests on another pad: a knock to a plan that goes there once
        for place in between(known[name]):
            for weight in ("machine", "table", f"axis {name}"):
                yield Form((Factor(name, BEYOND, place, float(known[name].max()), 1),), weight)
    for name in (p for p in known if p.startswith("path")):
        for weight in (*felt, "machine", "table"):
            yield from (Form((line(name, LEGENDRE, count),), weight) for count in (1, 3))
    if "probe direction" in known:
        for count in (6, 12):
            yield Form((Factor("probe direction", TURN, -1e3, 1e3, count),), "across")
    if "probe direction along" in known:
        yield Form((line("probe direction along", LEGENDRE, 4),), ONE)
        yield Form((line("probe direction along", LEGENDRE, 2),), "across")
    sides = [name for name in known if name.startswith("normal") and name.endswith("machine")]
    for i, one in enumerate(sides):
        yield Form((line(one, LEGENDRE, SLOW),), ONE)
        for other in sides[i + 1 :]:
            yield Form((line(one, LEGENDRE, SLOW), line(other, LEGENDRE, SLOW)), ONE)
    places = [name for name in known if name in ("time", "S", *linear, *rotary) or name.startswith("T_")]
    for i, one in enumerate(places):
        for other in places[i + 1 :]:
            pair = (slow(one), slow(other))
            for weight in felt:
                yield Form(pair, weight)
                yield from (Form((line(one, LEGENDRE, n), line(other, LEGENDRE, n)), weight) for n in (PLAIN, CURVED))
    for one in linear:  # what a place does abruptly, such as a joint of the bed, may grow with another one
        for other in places:
            if other in (one, "S"):
                continue
            plain = line(other, LEGENDRE, PLAIN)
            for weight in (f"axis {one}", *(f"machine {c}" for c in "xyz")):
                yield Form((line(one, WAVES, FAST), plain), weight)
                if other in linear and weight != f"axis {one}":
                    for place in between(known[one], JOINTS):
                        yield Form((Factor(one, BEYOND, place, float(known[one].max()), 1), plain), weight)
    for name in (d for d in known if d[0] == "d"):
        for other in places:
            if other != name[1:] or other in linear:
                for weight in (f"axis {name[1:]}", *(f"machine {c}" for c in "xyz")):
                    yield Form((Factor(name, SIDE, -1.0, 1.0, 1), slow(other)), weight)
                    yield Form((Factor(name, SIDE, -1.0, 1.0, 1), line(other, LEGENDRE, 2 * PLAIN)), weight)
                    if other in rotary and known[other].min() < 0 < known[other].max():  # lost motion under a load that tilts
                        most = float(np.abs(known[other]).max())
                        yield Form((Factor(name, SIDE, -1.0, 1.0, 1), Factor(other, EVEN, 0.0, most, CURVED)), weight)
    if "time" in known:  # a face that is warm, or wears: its offset is known already, and no facet once touched tells a course
        for facet, often in Counter(touches.facet).items():
            if often >= OFTEN:
                for count in (PLAIN, SLOW):
                    yield Form((Factor(f"facet {facet}", SIDE, 0.0, 1.0, 1), line("time", LEGENDRE, count)), ONE)
    yield from crossed(known, linear, rotary)


def between(v: Array, most: int = PLACES, least: int = OFTEN) -> list[float]:
    """(n,) angles or places, how many at most, touches on each side → places between those that were used."""
    used = np.unique(np.round(v, 4))
    if len(used) > most:
        used = np.unique(np.quantile(used, np.linspace(0, 1, most)))
    middle = (used[1:] + used[:-1]) / 2
    return [float(m) for m in middle if min((v > m).sum(), (v < m).sum()) >= least]


def moves(touches: Touches, name: str, v: Array) -> bool:
    """touches, name and values (n,) of a covariate → whether it changes so much that it is no constant."""
    kind = name.split(" ")[0].split("_")[0]
    if len(name) == 2 and name[0] == "d":
        return len(set(v) - {0.0}) == 2
    least = LEAST.get(kind, 1.0 if name in touches.machine.linear else 0.05)
    return bool(np.ptp(v) > least)


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
