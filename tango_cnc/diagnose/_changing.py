"""A name whose size changes: the pattern of a cause that grows along an axis, with time, or with the side of arrival.

A cause of the catalogue has one size. A pattern that grows, such as the waves of a screw that is bent, only resembles it. So
each name competes with itself, with a size that is a slow function of everything else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from .. import terms as families
from ..records import Array
from ..terms._shape import values
from ..touches import Touches
from ._candidates import Candidate, candidate
from ._catalogue import STRONG, Chosen
from ._field import CHANGES, Field, Picked, begin, price, score, whiten
from ._ground import HALF, moves
from ._names import discounts
from ._rows import Rows
from ._smooth import Kernel, scaled
from ._space import orthonormal

SLOW = 2  # functions of what the size depends on


def changing(means: Rows, names: Sequence[Chosen], slow: Sequence[tuple[str, Array]]) -> list[Kernel]:
    """rows, names that were found, slow functions → shapes: each name with a size that depends on one more thing.

    Two of one cause that differ in a number only, such as waves of nearly one period, may be one between them that grows.
    """
    found = []
    alone: list[tuple[Candidate, Candidate | None]] = [(c.candidate, c.candidate) for c in names if not c.candidate.learned]
    alone += [(middle, None) for one, other in combinations([c for c, _ in alone], 2) for middle in _between(means, one, other)]
    for like, name in alone:
        own = candidate(means.whole, like.cause, like.setting).columns
        own = own / np.maximum(np.sqrt(np.mean(own**2, axis=0)), 1e-300)
        for by, functions in slow:
            if by == like.setting.get("axis") and by in means.whole.machine.rotary:
                continue  # two orders of one axis are two names
            columns = (own[:, :, None] * functions[:, None, :]).reshape(len(own), -1)
            covariate = dict.fromkeys((over(like), by))
            setting = {"name": name, "like": like.cause, "covariate": " × ".join(covariate)}
            found.append(scaled(Kernel(None, "shape", means.of(columns), setting=setting)))
    return found


def unsteady(
    field: Field, y: Array, fixed: Sequence[Chosen], names: Sequence[Chosen], noises: Sequence[Picked]
) -> list[tuple[Chosen, str]]:
    """field, data (m,), single touches that are set aside, names that stand, noises beside them → names for which there is strong
    evidence of a size that changes, and the covariates that they follow then.

    To take the name away asks for `CHANGES`. Less is no proof against it, and none that it explains everything.
    """
    found = []
    m, cheaper = len(y), discounts(y, [*fixed, *names], names)
    for c in names:
        own = [i for i, k in enumerate(field.kernels) if k.setting.get("name") is c.candidate]
        if not own or c.candidate.learned:
            continue
        s = begin(field, y, np.hstack([np.empty((m, 0)), *(o.columns for o in (*fixed, *names) if o is not c)]))
        for p in noises:
            s = whiten(s, p.kernel, p.columns, s.seen(p.columns), p.tau, p.score)
        q = orthonormal(s.seen(c.columns))
        one = -m * float(np.log(max(1 - float(np.sum((q.T @ s.y) ** 2) / (s.y @ s.y)), 1e-9))) - c.price + cheaper[id(c)]
        each = [score(s.y, field.of(i, s.columns))[0] - price(field, m, field.kernels[i]) + CHANGES for i in own]
        if max(each) > one + STRONG:
            found.append((c, field.kernels[own[int(np.argmax(each))]].covariate))
    return found


def _between(means: Rows, one: Candidate, other: Candidate) -> Iterator[Candidate]:
    """two names → the cause between them, where they differ in one positive number only."""
    a, b = one.setting, other.setting
    differ = [key for key in a if a[key] != b.get(key)]
    if one.cause != other.cause or a.keys() != b.keys() or len(differ) != 1:
        return
    low, high = a[differ[0]], b[differ[0]]
    if isinstance(low, float) and isinstance(high, float) and min(low, high) > 0:
        yield candidate(means.whole, one.cause, {**a, differ[0]: float(np.sqrt(low * high))})


def over(c: Candidate) -> str:
    """name → the covariate that it follows itself."""
    setting, cause = c.setting, families.causes()[c.cause]
    if cause.follows:
        return cause.follows.format(**{"axis": "", **setting})
    drawn = cause.over
    if drawn:
        return {"probe": "probe direction"}.get(drawn, drawn)
    place = next(((str(setting[key]).rstrip("0123456789") or "?")[-1] for key in ("axis", "by", "name") if key in setting), "time")
    return "facet" if "facet" in setting else place


def slow(touches: Touches) -> list[tuple[str, Array]]:
    """touches → covariates, each with 1 and slow functions of it, (n, k).

    A rotary axis comes with as few functions as the others have, too, those of a load that is alike to both sides: where the plan
    goes through its angles in their order, its path or the time would be likelier only because they have fewer.
    """
    found: list[tuple[str, Array]] = []
    machine = touches.machine
    known = values(touches)
    one = np.ones(len(touches))
    for name, v in known.items():
        if name.startswith(("facet", "place", "normal", "probe")) or not moves(touches, name, v):
            continue
        if len(name) == 2 and name[0] == "d":
            found.append((name, np.column_stack([one, np.sign(v)])))
        elif name in machine.rotary and np.ptp(v) > HALF:
            # A load may be as large to either side: the second order follows it.
            even = [one, np.cos(v), np.cos(2 * v) / 2]
            found += [(name, np.column_stack(f)) for f in (even, [*even, np.sin(v), np.sin(2 * v) / 2])]
        else:
            found.append((name, np.polynomial.legendre.legvander(2 * (v - v.min()) / np.ptp(v) - 1, SLOW)))
    return found


__all__ = ["changing", "over", "slow", "unsteady"]
