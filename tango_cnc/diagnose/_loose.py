"""Facets that scatter: rough, or loose.

A rough facet errs anew at every touch. A loose one is elsewhere at one tilt, from one side or later on, and is there again when the
same is done again. Both make the touches of one facet scatter. So a facet is called rough only where no function of what its
touches did explains them as well: both are compared as Gaussian processes of these touches with one variance each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..records import Array
from ..terms._shape import BEYOND, LEGENDRE, ONE, SIDE, TURN, Factor, Form, values
from ..texts import say
from ..touches import Touches
from ._contest import MARGIN
from ._explain import Rough
from ._field import Picked, score
from ._gain import rms
from ._ground import WHOLE, between, moves
from ._records import Finding, Remainder
from ._rows import Rows
from ._smooth import Kernel, scaled
from ._space import space

FEW = 2  # functions of an angle: with more, any few touches follow one
PLACES = 4  # of an angle or a side beyond which it may rest elsewhere
LEAST = 5  # touches of a facet: fewer follow anything
FOLLOWED = ("normal", "since", "pause")  # covariates beside the axes, their sides and time


@dataclass(frozen=True)
class Loose:
    """A facet that scatters, and the function of something that explains its touches best."""

    facet: str
    above: float  # evidence by which the function beats a variance
    remains: Remainder


def loose(
    means: Rows,
    weight: Array,
    base: Array,
    data: Array,
    picked: Sequence[Picked],
    rough: Sequence[Rough],
) -> list[Loose]:
    """rows, weight (n,), model with names (n + known, p) and data without weights, shapes, facets that scatter → those whose
    touches follow something so well that they may be loose: within MARGIN of a rough one.
    """
    found = []
    n = len(means.seen)
    facets = np.array(means.seen.facet)
    for one in rough:
        on = facets == one.key
        if on.sum() < LEAST or not means.all:
            continue
        own = np.where(on, 1.0, weight)
        certain = np.concatenate([own, np.ones(len(base) - n)])
        left = space(data * certain, base * certain[:, None], n, ())
        outside, y = left.basis, left.y
        covariance = np.eye(len(y))
        for p in picked:
            seen = outside.T @ (p.kernel.columns * own[:, None])
            covariance += p.tau * seen @ seen.T
        root = np.linalg.cholesky(covariance)
        back, white = outside @ np.linalg.inv(root).T, np.linalg.solve(root, y)
        spread = back[on].T
        by_chance = score(white, spread)[0]
        kernels = [scaled(Kernel(form, "shape", form.columns(means.seen))) for form in forms(means.seen, one.key, on)]
        if not kernels:
            continue
        tried = [score(white, back.T @ (k.columns * own[:, None])) for k in kernels]
        best = int(np.argmax([t[0] for t in tried]))
        above = tried[best][0] - 2 * float(np.log(len(kernels))) - by_chance
        if above > -MARGIN:
            found.append(Loose(one.key, above, _told(means, kernels[best], tried[best][1], white, back, on, outside)))
    return found


def parted(rough: Sequence[Rough], follows: Sequence[Loose]) -> tuple[list[Rough], list[Remainder]]:
    """facets that scatter, those that may be loose → facets that may be rough, and the functions of those that are not."""
    sure = {one.facet: one.remains for one in follows if one.above > MARGIN}
    return [r for r in rough if r.key not in sure], list(sure.values())


def beside(f: Finding, follows: Sequence[Loose]) -> Finding:
    """what is named, facets that may be loose → with the function that comes near, and with touches that would tell."""
    rough = f.setting.get("facets", ())
    near = sorted((one for one in follows if one.facet in rough and one.above <= MARGIN), key=lambda one: -one.above)
    if not near:
        return f
    telling = tuple(say("diagnosis_said.loose_or_rough", facet=one.facet) for one in near)
    return replace(f, nearest=(near[0].remains.covariate, -near[0].above), separate_with=(*f.separate_with, *telling))


def forms(touches: Touches, facet: str, on: Array) -> Iterator[Form]:
    """touches, a facet, which of them (n,) are on it → what they may follow."""
    known = values(touches)
    machine = touches.machine
    this = Factor(f"facet {facet}", SIDE, 0.0, 1.0, 1)

    def line(name: str, count: int) -> Factor:
        v = known[name][on]
        return Factor(name, LEGENDRE, float(v.min()), float(v.max()), count)

    sides = [f"d{axis}" for axis in (*machine.linear, *machine.rotary)]
    others = [name for name in known if name.startswith(FOLLOWED) and not name.endswith("table")]
    for name in ("time", *machine.rotary, *others, *sides):
        if name not in known or len(np.unique(np.round(known[name][on], 6))) < 2 or not moves(touches, name, known[name]):
            continue
        if name in sides:
            yield Form((this, Factor(name, SIDE, -1.0, 1.0, 1)), ONE)
            continue
        yield Form((this, line(name, 1)), ONE)
        if name in machine.rotary or name.startswith("normal"):  # it tips over
            for place in between(known[name][on], PLACES, 2):
                yield Form((this, Factor(name, BEYOND, place, float(known[name][on].max()), 1)), ONE)
        if name in machine.rotary and np.ptp(known[name][on]) > WHOLE:
            yield Form((this, Factor(name, TURN, -1e3, 1e3, 2)), ONE)
        elif name in ("time", *machine.rotary):
            yield Form((this, line(name, FEW)), ONE)


def _told(means: Rows, kernel: Kernel, tau: float, white: Array, back: Array, on: Array, outside: Array) -> Remainder:
    """rows, the function, its variance, whitened data (m,), how touches are seen in it (n, m), rows of the facet, space that is
    left (n, m) → what is said of it.
    """
    assert kernel.form is not None
    columns = back.T @ kernel.columns
    known = np.linalg.inv(np.eye(columns.shape[1]) / tau + columns.T @ columns)
    w = known @ columns.T @ white
    left = outside @ (outside.T @ kernel.columns)
    pattern = left @ w
    row = int(np.argmax(np.abs(pattern)))
    sigma2 = float(np.sum((white - columns @ w) * white)) / len(white)
    std = float(np.sqrt(max(left[row] @ known @ left[row], 0.0) * sigma2))

    def missed(part: Array) -> Array:
        """(m, k) of a covariance beside white noise → what each touch of the facet is away from where the others expect it."""
        inverse = np.eye(len(white)) - part @ np.linalg.solve(np.eye(part.shape[1]) + part.T @ part, part.T)
        precision = back[on] @ inverse @ back[on].T
        return np.asarray((back[on] @ inverse @ white) / np.maximum(np.diag(precision), 1e-9))

    share = 1 - (rms(missed(np.sqrt(tau) * columns)) / max(rms(missed(columns[:, :0])), 1e-12)) ** 2
    about = kernel.form.covariate, kernel.form.frame, kernel.form.factors[1].kind
    return Remainder(*about, float(np.abs(pattern[row])), share, pattern, std, kernel.form, w / kernel.scale, int(means.first[row]))


__all__ = ["Loose", "beside", "forms", "loose", "parted"]
