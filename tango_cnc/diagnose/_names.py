"""What names may be there together, and what they cost less than their coefficients."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from .. import terms as families
from ..records import Array
from ._candidates import Candidate
from ._catalogue import Chosen
from ._space import orthonormal

COURSE = ("time", "order", "indexation", "since", "pause", "previous", "first")  # what goes on while the test does
SIDE = ("facet", "normal", "place")
TWICE = 2  # times a cause of one axis, or of single facets, may be named


def once(names: Sequence[Chosen]) -> list[Chosen]:
    """names → without the second of a cause that a machine has once: two warm-ups, or kinks, or cycles follow any curve.

    Of every other cause of one axis it may have two. Something that lies on three facets is one thing that these facets share,
    and none of the three.
    """
    kept: list[Chosen] = []
    causes = families.causes()
    often = Counter(c.candidate.cause for c in names if "facet" in c.candidate.setting)
    for c in names:
        if often[c.candidate.cause] > TWICE:
            continue
        same = [k for k in kept if k.candidate.cause == c.candidate.cause and _axis(k) == _axis(c)]
        only = c.candidate.cause in causes and causes[c.candidate.cause].once
        if len(same) < (1 if only else TWICE):
            kept.append(c)
    return kept


def _axis(c: Chosen) -> tuple[object, ...]:
    return tuple(c.candidate.setting.get(k) for k in ("axis", "name", "by", "facet"))


def akin(c: Candidate, covariate: str) -> bool:
    """a name, covariates of a shape → whether one may be a part of what the other is a part of: they follow a thing in common."""
    return bool(_follows(c) & _things(covariate))


def foreign(c: Candidate, covariate: str) -> bool:
    """a name, covariates of a shape, "" for none → whether the shape follows something that the name does not: it is another cause,
    and not the same one with other functions.
    """
    return bool(covariate) and bool(_things(covariate) - _follows(c))


def _follows(c: Candidate) -> set[str]:
    own = {(str(c.setting[key]).rstrip("0123456789") or "?")[-1] for key in ("axis", "by", "name") if key in c.setting}
    drawn = families.causes()[c.cause].over if c.cause in families.causes() else None
    own |= _things(drawn) if drawn else set()
    return own | ({"facet"} if "facet" in c.setting or "facets" in c.setting else set()) or {"time"}


def _things(covariate: str) -> set[str]:
    found: set[str] = set()
    for part in covariate.split(" × "):
        first, *more = part.split(" ")
        if first in ("way", "path"):
            found |= {"time", more[1]}
        elif first in COURSE or first.startswith("T_"):
            found.add("time")
        elif first in SIDE:
            found.add("facet")
        else:
            found.add(first[-1] if len(first) == 2 and first[0] == "d" else first)
    return found


def discounts(y: Array, chosen: Sequence[Chosen], names: Sequence[Chosen]) -> dict[int, float]:
    """data, everything that is chosen, names → by id how much less a name costs that goes along one axis of its frame only.

    A vector has three numbers; one that is free in one direction has a third of them, and which one was picked among three.
    """
    found = {}
    m = len(y)

    def misfit(columns: Sequence[Array]) -> float:
        q = orthonormal(np.hstack(columns))
        return m * float(np.log(max(float(y @ y) - float(np.sum((q.T @ y) ** 2)), 1e-300)))

    for c in names:
        letters = [k.name[-1] for k in c.candidate.coefficients]
        found[id(c)] = 0.0
        if set(letters) != {"x", "y", "z"}:
            continue
        others = [o.columns for o in chosen if o is not c]
        whole = misfit([*others, c.columns])
        for letter in "xyz":
            own = [i for i, one in enumerate(letters) if one == letter]
            saved = (len(letters) - len(own)) * float(np.log(m)) - 2 * float(np.log(3))
            gain = saved - (misfit([*others, c.columns[:, own]]) - whole)
            found[id(c)] = max(found[id(c)], gain)
    return found


__all__ = ["akin", "discounts", "foreign", "once"]
