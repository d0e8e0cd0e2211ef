"""Other settings of the same cause that this plan cannot tell from the one that is named: orders, periods, axes.

Touches at few angles or places see only the wave through these: an order 5 can look like an order 3 (Nyquist; Bendat & Piersol
2010, 10.3). Neighbours of a setting are no aliases: their difference is the uncertainty of the setting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..terms import causes
from ..texts import say
from ..touches import Touches
from ._candidates import Candidate, candidate
from ._catalogue import Chosen, columns_of, refined, total
from ._explain import DECISIVE, Explanation
from ._search import CLOSE
from ._seen import taken
from ._space import below, best_noise, scan

MOST = 3  # aliases of a cause that are named
TRIED = 12  # settings that are looked at closely
GRID = 181  # places of an axis where two settings are compared
PLACES = ("at", "until", "nodes")
UNITS = {"period": "mm", "at": "", "span": "mm"}
SAME = 0.01  # of a period: nearer is the same one
COURSE = ("shape", "sensor", "values", "factors")


def aliases(e: Explanation, one: Chosen) -> list[tuple[Chosen, float]]:
    """explanation, a named one → the same cause with other settings that explain nearly as much, and how much less (evidence)."""
    others = [c for c in e.chosen if c is not one]
    selected = columns_of(e.place, others)
    settings = below(best_noise(e.place, selected)[0])
    ratio, _ = scan(e.place, e.catalogue.library, selected, settings)
    score = 2 * ratio[:, 0] - e.catalogue.price
    cause = one.candidate.cause
    if cause not in e.catalogue.causes:
        return []
    blocks = np.flatnonzero(e.catalogue.group == e.catalogue.causes.index(cause))
    best = total(e.place, e.chosen)
    kept = [one.candidate, *(c.candidate for c in others if c.candidate.cause == cause)]
    found: list[tuple[Chosen, float]] = []
    tried = 0
    for block in blocks[np.argsort(-score[blocks])]:
        c = e.catalogue.candidates[block]
        if tried >= TRIED or len(found) >= MOST or score[block] < score[blocks].max() - DECISIVE - CLOSE:
            break
        if not all(apart(e, c, k) for k in kept):
            continue
        tried += 1
        other = refined(e.place, e.catalogue, c, selected, settings)
        behind = best - total(e.place, [*others, other])
        if behind < DECISIVE and all(apart(e, other.candidate, k) for k in kept):
            found.append((other, behind))
            kept.append(other.candidate)
    return sorted(found, key=lambda pair: pair[1])


def apart(e: Explanation, one: Candidate, other: Candidate) -> bool:
    """two settings of a cause → whether they are two, and no neighbours."""
    mine, theirs = discrete(e, one).items(), discrete(e, other).items()
    if mine != theirs:  # one component is part of all of them
        return not (mine <= theirs or theirs <= mine)
    if "period" not in one.setting or np.isclose(one.setting["period"], other.setting.get("period") or 0.0, rtol=SAME):
        return False
    return e.catalogue.compatible(one, [other])


def discrete(e: Explanation, c: Candidate) -> dict[str, Any]:
    """candidate → what of its setting is one of a few: axis, order, name, frame."""
    smooth = {*e.catalogue.refine.get(c.cause, {}), *PLACES, *COURSE}
    return {k: v for k, v in c.setting.items() if k not in smooth and v is not None}


def differing(cause: str, setting: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """cause, settings of an alias and of what is named → what is different in the alias, for a person."""
    parts = []
    units = {**UNITS, **(causes()[cause].units if cause in causes() else {})}
    for k, v in setting.items():
        if v is None or k in COURSE or other.get(k) == v or (isinstance(v, float) and k not in units):
            continue
        parts.append(f"{k} {v:.4g} {units[k]}".strip() if isinstance(v, float) else f"{k} {v}")
    return ", ".join(parts) or say("diagnosis_said.another_course")


def where(e: Explanation, touches: Touches, one: Chosen, others: Sequence[Chosen]) -> tuple[str, ...]:
    """explanation, touches (n,), a cause and its aliases → where a touch would tell each of them, in words."""
    result = []
    for other in others:
        axis = one.candidate.setting.get("axis")
        if axis not in touches.machine.names or other.candidate.setting.get("axis") != axis:
            continue
        told = _place(e, touches, one, other, str(axis))
        if told is not None:
            result.append(
                say(
                    "diagnosis_said.alias_tells",
                    told=told,
                    other=differing(one.candidate.cause, other.candidate.setting, one.candidate.setting),
                )
            )
    return tuple(result)


def _place(e: Explanation, touches: Touches, one: Chosen, other: Chosen, axis: str) -> str | None:
    """→ the place of the axis, between those that were touched, where the two waves differ most."""
    a = np.linalg.lstsq(one.columns, e.place.y, rcond=None)[0]
    b = np.linalg.lstsq(other.columns, one.columns @ a, rcond=None)[0]
    at = touches.axis(axis)
    mine = candidate(touches, one.candidate.cause, one.candidate.setting).columns @ a
    row = int(np.argmax(np.abs(mine)))
    grid = np.linspace(at.min(), at.max(), GRID)
    position = np.repeat(touches.position[[row]], GRID, axis=0)
    position[:, touches.machine.column(axis)] = grid
    n = len(touches)
    longer = taken(touches, np.concatenate([np.arange(n), np.full(GRID, row)]), position, 5.0)
    pair = [candidate(longer, c.candidate.cause, c.candidate.setting).columns[n:] @ v for c, v in ((one, a), (other, b))]
    differ = np.abs(pair[0] - pair[1])
    if differ.max() < np.abs(pair[0]).max() / 10:
        return None
    linear = axis in touches.machine.linear
    value = float(grid[int(np.argmax(differ))])
    told = f"{value:.0f} mm" if linear else f"{np.degrees(value):.0f}°"
    return say("diagnosis_said.alias_there", facet=touches.facet[row], axis=axis, place=told)


__all__ = ["aliases", "differing", "where"]
