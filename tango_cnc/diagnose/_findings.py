"""Names that stand, and names that do not, as records of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..estimate import Estimate
from . import _aliases, _explain, _seen, _suited
from ._candidates import candidate
from ._catalogue import Chosen
from ._contest import SURE
from ._grounds import Grounds
from ._records import Dropped, Finding
from ._refused import shift_of
from ._standing import Standing

Others = Sequence[tuple[Chosen, float]]  # with how much worse their score is
Shift = Mapping[str, tuple[float, float, float]]


def findings(g: Grounds, stand: Standing, before: Estimate, after: Estimate) -> list[Finding]:
    """what names were judged on, names that stand, estimates without and with them → one finding a name."""
    moved = shift_of(before, after)
    return [_finding(g, stand, c, _explain.alternatives(g.found, c), moved, _aliases.aliases(g.found, c)) for c in stand.accepted]


def dropped(g: Grounds, stand: Standing) -> tuple[Dropped, ...]:
    """what names were judged on, names that stand → the other ones, with the reason of each."""
    others = [c for c in g.whole.chosen if c.candidate.named and c not in stand.accepted and not c.candidate.learned]
    resembled = stand.outcome.resembled
    return tuple(
        Dropped(_finding(g, stand, c, (), {}), stand.why.get(id(c)) or ("shape" if c in resembled else "beside a shape"))
        for c in others
    )


def _finding(g: Grounds, stand: Standing, c: Chosen, like: Others, shift: Shift, other: Others = ()) -> Finding:
    """a name, causes that do nearly as well, parameters that move, other settings that do → finding."""
    s, touches, own = g.sizes[id(c)], g.means.whole, c.candidate
    telling = _seen.separate(g.found, touches, c, [o for o, _ in like])
    near = stand.outcome.nearest.get(id(c), ""), stand.outcome.above.get(id(c), np.inf)
    columns = candidate(touches, own.cause, own.setting).columns if not g.means.all else g.design.raw[id(c)]
    about: dict[str, Any] = {
        "separate_with": (
            *telling,
            *_aliases.where(g.found, touches, c, [o for o, _ in other]),
            *_suited.telling(stand.turned, c),
        ),
        "alternatives": tuple((o.candidate.cause, o.candidate.setting, behind) for o, behind in like),
        "aliases": tuple((o.candidate.setting, behind) for o, behind in other),
        "nearest": near if near[1] < SURE else None,
        "stability": g.back.get(id(c)),
    }
    return Finding(
        own.cause,
        own.setting,
        s.detail,
        s,
        _explain.significance(g.among(c), c),
        g.gains[id(c)],
        shift,
        effect=s.effect,
        pattern=columns @ s.values,
        **about,
    )


__all__ = ["dropped", "findings"]
