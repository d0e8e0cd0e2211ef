"""Causes that are the same to the touches in a part of their directions: where this part explains everything, both are named.

A table that moved along its own turning axis, and this axis that moved along itself on what carries it, differ in no touch. Each
of them has two more directions, which follow the noise of one run differently: evidence of all directions would tell these two
causes apart by chance. So another cause is compared in the directions that it shares with the name as well, at their price.

A name of one direction, such as a scale that grows, is cheaper than a body that may drift in any of three. A body that drifts along
one axis of its frame is as plain, and a machine is built so that most do. So it is compared so, too, at the price of one direction.

A tip that creeps has two directions, both across the spindle. A body that drifts in this plane alone does the same to all touches
of a spindle that does not turn. So it is compared along two axes of its frame, too, at the price of two directions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..records import InputError
from ._candidates import Candidate
from ._catalogue import FEWEST_TRIED, Catalogue, Chosen, cost, total
from ._space import Space, orthonormal

SAME = 0.99  # part (squared) of a direction of one cause that another one follows; evidence then decides what the touches tell
COURSE = ("shape", "sensor", "tau")  # how something grew: taken over as a whole


def alike(
    place: Space, cat: Catalogue, one: Chosen, others: Sequence[Chosen], best: float, known: Sequence[tuple[Chosen, float]]
) -> list[tuple[Chosen, float]]:
    """space, catalogue, a named one, those beside it, the score of all, other causes and how much less their score is → the same,
    every cause with how much less it is in the directions alone that it shares with the name, where that is not as much.
    """
    found = {o.candidate.cause: (o, behind) for o, behind in known}
    if one.columns.shape[1] == 1:
        for other in _along_one(place, cat, one.candidate):
            behind = best - total(place, [*others, other])
            if other.candidate.cause not in found or behind < found[other.candidate.cause][1]:
                found[other.candidate.cause] = other, behind
        return list(found.values())
    for other, planes in _along_two(place, cat, one.candidate):
        behind = best - max(total(place, [*others, plane]) for plane in planes)
        if other.candidate.cause not in found or behind < found[other.candidate.cause][1]:
            found[other.candidate.cause] = other, behind
    own = orthonormal(one.columns)
    for candidate in _variants(cat, one.candidate):
        columns = place.project(candidate.columns)
        theirs = orthonormal(columns)
        left, shared, right = np.linalg.svd(own.T @ theirs)
        count = int(np.sum(shared**2 > SAME))
        if not count:
            continue
        tried = int((cat.group == cat.causes.index(candidate.cause)).sum())
        whole = cost(candidate, tried, place.m)
        # Both save as many directions: one of the many that a table of an axis has is chosen to look like the name.
        spared = min(candidate.columns.shape[1], one.columns.shape[1]) - count
        if spared < 1:
            continue
        price, mine = (p - spared * float(np.log(place.m)) for p in (whole, one.price))
        value = total(place, [*others, Chosen(candidate, theirs @ right[:count].T, price)])
        reached = max(best, total(place, [*others, Chosen(one.candidate, own @ left[:, :count], mine)]))
        if candidate.cause not in found or reached - value < found[candidate.cause][1]:
            found[candidate.cause] = Chosen(candidate, columns, whole), reached - value
    return list(found.values())


def _along_one(place: Space, cat: Catalogue, one: Candidate) -> Iterator[Chosen]:
    """space, catalogue, a name of one direction → others with its moment and course, each along one axis of its frame."""
    for candidate in _variants(cat, one):
        tried = int((cat.group == cat.causes.index(candidate.cause)).sum())
        for axis in np.eye(3):
            try:
                single = cat.rebuild(candidate.cause, {**candidate.setting, "direction": axis.tolist()})
            except InputError:  # it has no direction of its own
                break
            if single.columns.shape[1] == 1:
                yield Chosen(single, place.project(single.columns), cost(single, len(axis) * max(tried, FEWEST_TRIED), place.m))


def _along_two(place: Space, cat: Catalogue, one: Candidate) -> Iterator[tuple[Chosen, list[Chosen]]]:
    """space, catalogue, a name of two directions → displacements with its moment and course; each along two axes of its frame."""
    for candidate in _variants(cat, one) if _axes(one) == "xy" else ():
        if _axes(candidate) == "xyz":
            tried = int((cat.group == cat.causes.index(candidate.cause)).sum())
            columns, whole = place.project(candidate.columns), cost(candidate, tried, place.m)
            price = cost(candidate, 3 * max(tried, FEWEST_TRIED), place.m) - float(np.log(place.m))
            planes = [Chosen(candidate, np.delete(columns, gone, axis=1), price) for gone in range(3)]
            yield Chosen(candidate, columns, whole), planes


def _axes(c: Candidate) -> str:
    return "".join(k.name[-1:] for k in c.coefficients)


def _variants(cat: Catalogue, one: Candidate) -> Iterator[Candidate]:
    """catalogue, a named one → other causes of several directions, in each frame and of each axis, with its moment and course."""
    known: dict[str, set[str]] = {}
    for c in cat.candidates:
        known.setdefault(c.cause, set()).update(c.setting)
    mine, seen = cat.refine.get(one.cause, {}), set()
    for c in cat.candidates:
        theirs = cat.refine.get(c.cause, {})
        ways = {*theirs, *COURSE} & known[c.cause]
        place = {k: v for k, v in c.setting.items() if k not in ways}
        key = c.cause, *((k, str(v)) for k, v in sorted(place.items()))
        if not c.named or c.cause == one.cause or c.columns.shape[1] < 2 or key in seen:
            continue
        seen.add(key)
        own = {k: v for k, v in one.setting.items() if k in ways and (k in COURSE or mine.get(k) == theirs[k])}
        missing = {k for k in c.setting if k in ways and k not in own and k not in COURSE}
        if missing or bool(ways & {*COURSE}) != bool({*COURSE} & one.setting.keys()):
            continue
        try:
            yield cat.rebuild(c.cause, {**place, **own})
        except (InputError, ValueError, IndexError):
            continue
