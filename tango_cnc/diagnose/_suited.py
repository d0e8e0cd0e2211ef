"""Names against shapes whose functions suit the touches, and names that follow one thing against one shape in their place.

The contest compares every name with shapes of a few functions each, and takes away one name at a time. Lost motion that turns with
the tilt is two waves of the tilting axis then: none of them alone is worse than a shape beside the other one. A kink of an axis
that was touched from one side only is its kink, or lost motion that changes along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..records import Array
from ..terms import causes
from ..texts import say
from ._adapted import Adapting
from ._catalogue import STRONG, Chosen
from ._changing import over
from ._contest import ALONE, SURE, Outcome, evidence
from ._field import Field, Picked, State, begin, columns_of, grown, price, score, scores, whiten
from ._names import akin, discounts
from ._plainer import beside, told_of
from ._smooth import Kernel
from ._space import orthonormal

LOST = STRONG - SURE  # evidence above a shape below which a name is lost: suited functions are chosen among hundreds


@dataclass(frozen=True)
class Suited:
    """What comes near to names, all of them in its place."""

    names: tuple[Chosen, ...]
    covariate: str
    above: float  # evidence that the names have more
    kernels: tuple[Kernel, ...] = ()  # shapes with suited functions in their place
    turned: bool = False  # whether it is the name itself, the other way when its axis comes from the other side

    @property
    def lost(self) -> bool:
        """→ whether it takes the place of the names: two names were chosen among hundreds as well."""
        return self.above < (0.0 if len(self.names) > 1 else LOST)


def suited(field: Field, y: Array, fixed: Sequence[Chosen], names: Sequence[Chosen], outcome: Outcome) -> list[Suited]:
    """field, data (m,), single touches set aside, names that stand, outcome of the contest → shapes in the place of names, the
    nearest first: of those that follow a thing in common, and of single ones that are not sure.
    """
    cheaper, adapting = discounts(y, [*fixed, *names], names), Adapting(field)

    def value(kept: Sequence[Chosen], away: Sequence[Chosen]) -> tuple[float, list[Picked], Array]:
        s = grown(field, y, fixed, kept, away=away)
        return evidence(field, s, kept) + sum(cheaper[id(c)] for c in kept), list(s.picked), columns_of(len(y), [*fixed, *kept])

    several = [g for n in range(len(names), 1, -1) for g in combinations(names, n) if _one_thing(g)]
    single = [(c,) for c in names if outcome.above.get(id(c), np.inf) < SURE]
    groups = [g for g in (*several, *single) if not any(c.candidate.learned for c in g)]
    if not groups:
        return []
    whole = value(names, ())[0]
    found = []
    for group in groups:
        best, picked, columns = value([c for c in names if not any(c is o for o in group)], group)
        gain, kernels = _better(adapting, begin(field, y, columns), picked)
        if kernels:
            found.append(Suited(group, kernels[0].covariate, whole - best - gain, tuple(kernels)))
    return sorted(found, key=lambda one: one.above)


def _one_thing(names: Sequence[Chosen]) -> bool:
    """names → whether each of them follows what another one follows."""
    each = [c.candidate for c in names]
    return all(any(akin(c, over(o)) or akin(o, over(c)) for o in each if o is not c) for c in each)


def _better(adapting: Adapting, s: State, picked: list[Picked]) -> tuple[float, list[Kernel]]:
    """what adapts shapes, state without shapes, shapes in it → evidence that suited functions add, these shapes, largest first."""
    field, gain, told = adapting.field, 0.0, []
    for p in sorted((p for p in picked if told_of(p)), key=lambda p: -p.score):
        there = beside(s, [o for o in picked if o is not p])
        m, best = len(there.y), scores(field, there)[0][:, 0]
        formed = [int(i) for i in np.argsort(-best) if field.kernels[int(i)].form is not None]
        near = adapting.near(there, best, formed, [p.kernel])
        worth = [score(there.y, there.seen(p.columns))[0] - price(field, m, p.kernel)]
        worth += [a.score - a.choice - price(field, m, a.kernel) for a in near]
        i = int(np.argmax(worth))
        if i:
            one = near[i - 1]
            better = Picked(one.kernel, field.project(one.kernel), one.tau, p.score + worth[i] - worth[0])
            picked = [better if o is p else o for o in picked]
        gain += worth[i] - worth[0]
        told.append(near[i - 1].kernel if i else p.kernel)
    return gain, told


def turned(field: Field, y: Array, fixed: Sequence[Chosen], names: Sequence[Chosen], noises: Sequence[Picked]) -> list[Suited]:
    """field, data (m,), single touches set aside, names that stand, noises beside them → names that a machine may have for one
    direction only, with the evidence that they have above themselves the other way when their axis comes from the other side.
    """
    found = []
    for c in names:
        axis = over(c.candidate)
        if not causes()[c.candidate.cause].both_ways or axis not in field.touches.machine.linear:
            continue
        s = begin(field, y, columns_of(len(y), [*fixed, *(o for o in names if o is not c)]))
        for p in noises:
            s = whiten(s, p.kernel, p.columns, s.seen(p.columns), p.tau, p.score)
        other = field.basis.T @ (c.candidate.columns * field.touches.sign(axis)[:, None])
        rest = []
        for columns in (c.columns, other):
            q = orthonormal(s.seen(columns))
            rest.append(max(1 - float(np.sum((q.T @ s.y) ** 2) / (s.y @ s.y)), 1e-9))
        found.append(Suited((c,), f"d{axis} × {axis}", len(y) * float(np.log(rest[1] / rest[0])), turned=True))
    return found


def nearer(outcome: Outcome, suited: Sequence[Suited]) -> Outcome:
    """outcome of the contest, what comes near to names that stand → the same, every name with what comes nearest to it."""
    above, nearest = dict(outcome.above), dict(outcome.nearest)
    for one in suited:
        for c in one.names:
            if one.above < above.get(id(c), np.inf):
                above[id(c)], nearest[id(c)] = max(one.above, 0.0), one.covariate
    return replace(outcome, above=above, nearest=nearest)


def telling(suited: Sequence[Suited], c: Chosen) -> tuple[str, ...]:
    """names the other way, a name → sentences: which touches would separate the two directions of its axis."""
    near = [one for one in suited if one.turned and one.names[0] is c and one.above < ALONE]
    return tuple(say("diagnosis_said.both_directions", axis=over(one.names[0].candidate)) for one in near)


__all__ = ["Suited", "nearer", "suited", "telling", "turned"]
