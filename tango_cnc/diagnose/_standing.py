"""Which names stand: of those that won against shapes, the ones that touches outside the fit confirm and no suited shape beats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import _rest, _seen, _suited
from ._catalogue import Chosen
from ._changing import over
from ._contest import SURE, Outcome, contest
from ._field import Field
from ._grounds import Grounds
from ._names import akin
from ._records import Remainder, Why
from ._refused import refused
from ._stable import lonely
from ._suited import Suited


@dataclass(frozen=True, eq=False)
class Standing:
    """Names that stand, and why others do not."""

    outcome: Outcome  # of the last contest
    accepted: Sequence[Chosen]
    why: Mapping[int, Why | None]  # by id of a name; None of one that is accepted
    near: Sequence[Suited] = ()  # shapes with suited functions that come near to names
    turned: Sequence[Suited] = ()  # names that a machine may have for one direction only

    def without(self, g: Grounds, field: Field, names: Sequence[Chosen], why: Mapping[int, Why | None]) -> Standing:
        """what to judge on, shapes, names that are left, why others went → what stands when the contest is held again: what the
        others explained is there all the same.
        """
        again = contest(field, g.y, g.alone, names)
        again = replace(again, resembled=(*self.outcome.resembled, *again.resembled))
        accepted = [c for c in names if any(c is o for o in again.named)]
        return replace(self, outcome=again, accepted=accepted, why={**self.why, **why})


def standing(g: Grounds, seed: int) -> Standing:
    """what to judge on → the names that stand."""
    stand = _shapes_suit(g, _sure(g, _confirmed(g), seed))
    noises = [p for p in stand.outcome.picked if p.kernel.noise]
    turned = _suited.turned(g.search.field, g.y, g.alone, stand.accepted, noises)
    near = [one for one in (*stand.near, *turned) if all(any(c is o for o in stand.accepted) for c in one.names)]
    return replace(stand, outcome=_suited.nearer(stand.outcome, near), turned=turned)


def resting(g: Grounds, names: Sequence[Chosen], outcome: Outcome, seed: int, anything: bool = True) -> list[Remainder]:
    """what to judge on, names that stay, the contest, whether anything was found → what the rest follows all the same."""
    if outcome.shapes or outcome.events:
        return []
    left = _seen.left_over(g.tests(names), anything, {over(c.candidate) for c in names}) if not outcome.picked else []
    return left or _rest.rest(g.search.field, outcome, g.y, [*g.alone, *names], anything, seed)


def _confirmed(g: Grounds) -> Standing:
    """Names that touches outside the fit confirm, that come back in subsets, and whose size is known."""
    named = g.search.outcome.named
    alone = {id(c): lonely(g.found, c, g.means.count) for c in named}
    why = {
        key: refused(c, g.sizes[key], g.gains[key], g.back[key], g.everywhere[key], g.few, alone[key])
        for key, c in ((id(c), c) for c in named)
    }
    accepted = [c for c in named if why[id(c)] is None]
    stand = Standing(g.search.outcome, accepted, why)
    return stand if len(accepted) == len(named) else stand.without(g, g.search.field.plain(), accepted, {})


def _sure(g: Grounds, stand: Standing, seed: int) -> Standing:
    """The same without names that are not sure while the rest follows what they follow."""
    weak = [c for c in stand.accepted if stand.outcome.above.get(id(c), np.inf) < SURE and not c.candidate.learned]
    left = [p.kernel.covariate for p in stand.outcome.shapes]
    if weak and len(stand.accepted) > 1:  # one of them may follow what another one leaves; of one alone, the verdict tells
        left = left or [r.covariate for r in resting(g, stand.accepted, stand.outcome, seed)]
    weak = [c for c in weak if any(akin(c.candidate, covariate) for covariate in left)]
    if not weak:
        return stand
    return stand.without(g, g.search.field, [c for c in stand.accepted if c not in weak], {id(c): "rest" for c in weak})


def _shapes_suit(g: Grounds, stand: Standing) -> Standing:
    """The same without the names that one shape with suited functions explains better."""
    near = _suited.suited(g.search.field, g.y, g.alone, stand.accepted, stand.outcome)
    beaten = next((one for one in near if one.lost), None)
    if beaten is not None:
        still = [c for c in stand.accepted if not any(c is o for o in beaten.names)]
        stand = stand.without(g, g.search.field.plain().more(beaten.kernels), still, {id(c): "shape" for c in beaten.names})
    return replace(stand, near=near)


__all__ = ["Standing", "resting", "standing"]
