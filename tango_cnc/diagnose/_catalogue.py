"""What is searched, and what counts: the catalogue of candidates, their price, and the scores that noise alone reaches.

A candidate is compared by twice its log likelihood less a price: log m for every free coefficient (Schwarz 1978), twice the log
of the number of variants that were tried for it (Chen & Chen 2008). What counts as significant is learnt from noise alone:
data drawn from the fitted noise go through the same search, and the largest score over the whole catalogue sets the limit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..records import Array, InputError
from ._candidates import Candidate
from ._space import Beside, Library, Space, below, best_noise, level, library, scan

LEVEL = 0.02  # of a false name anywhere in the catalogue, at every step: 5 % over the few steps that a search takes
EXPECTED_LEVEL = 0.01  # of a false name, for a cause that every machine has: it is not one of hundreds
SHAPE_LEVEL = 0.01  # of a false "something is there", outliers likewise
TRIALS = 200
FEWEST_TRIED = 90  # a cause with few variants has no advantage over one with as many as there are error motions
TURNS = 6  # in which two settings of one cause are refined by turns, at most
SETTLED = 0.05  # log likelihood that such a turn has to gain for another one
STRAIGHT = 1.0  # log likelihood by which a straight line must beat every exponential
APART = 4.0  # evidence by which one of two names must be ahead: the wrong one is in 2.3 % at most, 1 − Φ(√4), whatever both are
STRONG = 6.0  # evidence by which what has more settings, or follows more, must beat what is plainer (Kass & Raftery 1995)
SHAPELESS = 10.0  # score by which a shape without a name must beat every name (very strong evidence)

Rebuild = Callable[[str, Mapping[str, Any]], Candidate]
Plausible = Callable[[Candidate, Array], bool]
Compatible = Callable[[Candidate, Sequence[Candidate]], bool]  # may it stand beside those?


class Limits(NamedTuple):
    """Scores that noise alone reaches, by class of candidates: 90 % quantile, and the limit at the wanted level."""

    usual: Mapping[str, float]
    limit: Mapping[str, float]


@dataclass(frozen=True)
class Catalogue:
    """Candidates, their projected columns and prices."""

    candidates: Sequence[Candidate]
    library: Library
    length: Sequence[Array]  # of the projected columns of every block, before they were made unit columns
    price: Array  # (blocks,)
    group: NDArray[np.int64]  # (blocks,) cause of a block
    causes: tuple[str, ...]
    refine: Mapping[str, Mapping[str, str]]
    rebuild: Rebuild
    plausible: Plausible
    compatible: Compatible = lambda candidate, others: True
    steady: bool = False  # patterns are preferred to a wandering noise that would do as well
    nameless: bool = True  # whether shapes without a name are allowed
    expected: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # causes that every machine has: rivals of each
    plainer: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # by cause, what is named first where it comes near
    twins: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # by cause, what is tried in its place alone


@dataclass(frozen=True, eq=False)
class Chosen:
    """A candidate in the model of the residuals."""

    candidate: Candidate
    columns: Array  # (m, k) projected
    price: float


def catalogue(
    place: Space,
    candidates: Sequence[Candidate],
    refine: Mapping[str, Mapping[str, str]],
    rebuild: Rebuild,
    least: float,
    plausible: Plausible = lambda candidate, values: True,
    compatible: Compatible = lambda candidate, others: True,
    steady: bool = False,
    expected: Mapping[str, tuple[str, ...]] | None = None,
    plainer: Mapping[str, tuple[str, ...]] | None = None,
    twins: Mapping[str, tuple[str, ...]] | None = None,
) -> tuple[Catalogue, Array]:
    """space, candidates, parameters to refine → catalogue of those that can be seen, and the visibility (all candidates,).

    Raises InputError where none can be.
    """
    size = np.cumsum([c.columns.shape[1] for c in candidates])
    projected = np.split(place.project(np.hstack([c.columns for c in candidates])), size[:-1], axis=1)
    seen = np.array([_visibility(c.columns, p) for c, p in zip(candidates, projected, strict=True)])
    keep = [i for i in range(len(candidates)) if seen[i] > least and candidates[i].columns.shape[1] < place.m // 3]
    kept = [candidates[i] for i in keep]
    if not kept:
        raise InputError("the touches are too few or too much alike to show any cause; several facets and indexations show one")
    tried = Counter(c.cause for c in kept)
    names = tuple(dict.fromkeys(c.cause for c in kept))
    price = np.array([cost(c, tried[c.cause], place.m) for c in kept])
    group = np.array([names.index(c.cause) for c in kept])
    length = [np.maximum(np.linalg.norm(projected[i], axis=0), 1e-300) for i in keep]
    blocks = library([projected[i] for i in keep])
    rules = refine, rebuild, plausible, compatible, steady
    return Catalogue(
        kept, blocks, length, price, group, names, *rules, expected=expected or {}, plainer=plainer or {}, twins=twins or {}
    ), seen


def cost(c: Candidate, tried: int, m: int) -> float:
    """candidate, variants of its cause, degrees of freedom → its price; a shape must be clearly better than a name.

    A coefficient whose value is known beforehand costs nothing: it is not free to follow the noise. A shape that was learned is
    one of those that were learned, and no longer one of hundreds.
    """
    flexible = SHAPELESS if c.cause == "" else 0.0
    among = tried if c.learned else max(tried, FEWEST_TRIED)
    return float((c.columns.shape[1] - c.known) * np.log(m) + 2 * np.log(among) + flexible)


def _visibility(columns: Array, projected: Array) -> float:
    whole = float(np.linalg.norm(columns))
    return float(np.linalg.norm(projected)) / whole if whole else 0.0


def kind(cause: str) -> str:
    """cause → class of candidates with one limit: names, shapes, outliers."""
    return cause if cause in ("", "outlier") else "names"


def calibrate(place: Space, cat: Catalogue, seed: int = 0, trials: int = TRIALS) -> tuple[Limits, Array]:
    """space, catalogue → limits of the score, and the usual score of every cause under noise alone (causes,)."""
    ratios, _ = best_noise(place, np.empty((place.m, 0)))
    setting = place.setting(ratios)
    white = np.random.default_rng([seed, place.m]).standard_normal((place.m, trials))
    data: Array = np.asarray(np.linalg.solve(setting.root, white), dtype=float)
    ratio, _ = scan(place, cat.library, np.empty((place.m, 0)), below(ratios), data)
    score = 2 * ratio - cat.price[:, None]
    top = np.array([score[cat.group == i].max(axis=0) for i in range(len(cat.causes))])
    usual = np.quantile(top, 0.9, axis=1)
    classes = np.array([kind(c) for c in cat.causes])
    limit, typical = {}, {}
    for name in dict.fromkeys(classes):
        largest = (top[classes == name] - usual[classes == name, None]).max(axis=0)
        typical[name] = float(np.quantile(largest, 0.9))
        # Beyond its 90 % quantile the largest of many likelihood ratios falls like an exponential with a rate of a half.
        wanted = LEVEL if name == "names" else SHAPE_LEVEL
        limit[name] = typical[name] + 2 * float(np.log(0.1 / wanted))
    return Limits(typical, limit), usual


def p_value(limits: Limits, usual: float, cause: str, score: float, expected: bool = False) -> float:
    """score of a cause → probability that noise alone reaches as much anywhere in the catalogue (an upper tail: ≤ 0.1).

    An expected cause has a share of the level for itself (weighted Bonferroni, Genovese, Roeder & Wasserman 2006).
    """
    anywhere = 0.1 * np.exp(-0.5 * (score - usual - limits.usual[kind(cause)]))
    own = LEVEL / EXPECTED_LEVEL * 0.1 * np.exp(-0.5 * (score - usual)) if expected else 1.0
    return float(min(1.0, anywhere, own))


def columns_of(place: Space, chosen: Sequence[Chosen]) -> Array:
    """chosen → (m, s) all their columns."""
    return np.hstack([c.columns for c in chosen]) if chosen else np.empty((place.m, 0))


def total(place: Space, chosen: Sequence[Chosen]) -> float:
    """chosen → twice the log likelihood less the prices; the noise is chosen anew."""
    _, value = best_noise(place, columns_of(place, chosen))
    return 2 * value - sum(c.price for c in chosen)


def likelihood(place: Space, selected: Array, settings: Sequence[tuple[float, ...]]) -> float:
    """selected (m, s) → log likelihood at the best of some settings."""
    return max(float(level(place, ratios, place.y, selected)[2][0]) for ratios in settings)


def refined(place: Space, cat: Catalogue, start: Candidate, others: Array, settings: Sequence[tuple[float, ...]]) -> Chosen:
    """candidate, selected others (m, s) → it with its shape parameters where the likelihood is highest near by."""
    tried = int((cat.group == cat.causes.index(start.cause)).sum())

    inside = searched_range(cat, start.cause)
    beside = Beside(place, others, settings)

    def value(c: Candidate) -> float:
        return beside.likelihood(place.project(c.columns))

    best, score = start, value(start)
    ways = {n: w for n, w in cat.refine.get(start.cause, {}).items() if isinstance(start.setting.get(n), (int, float))}
    for turn in range(
        TURNS if len(ways) > 1 else 1
    ):  # where a scale is held says how fast it seems to grow, and the other way round
        begun = score
        for name, way in ways.items():
            step = {"log": 0.25, "wave": 0.01, "linear": 16.0, "touch": 4.0, "order": 8.0}[way] / 2**turn
            least = {"log": 0.01, "wave": 2e-4, "linear": 1.0, "touch": 0.9, "order": 0.9}[way]
            while step > least:
                moved = False
                for sign in (-1, 1):
                    at = float(best.setting[name])
                    new = at * np.exp(sign * step) if way in ("log", "wave") else at + sign * step
                    if not inside[name][0] <= new <= inside[name][1]:
                        continue
                    try:
                        c = cat.rebuild(best.cause, {**best.setting, name: int(new) if way in ("touch", "order") else float(new)})
                    except (ValueError, IndexError):
                        continue
                    if np.linalg.norm(place.project(c.columns)) < 1e-3 * np.linalg.norm(start.columns):
                        continue
                    found = value(c)
                    if found > score + 1e-3:
                        best, score, moved = c, found, True
                        break
                if not moved:
                    step /= 2
        if score < begun + SETTLED:
            break
    if best.setting.get("shape") == "linear" and settings:
        # A straight line is the beginning of an exponential: the time constant is named where the data allow one.
        curved = [c for c in cat.candidates if c.cause == best.cause and _bends(c, best, ways)]
        if curved:
            other = refined(place, cat, max(curved, key=value), others, settings)
            if value(other.candidate) > score - STRAIGHT:
                return other
    return Chosen(best, place.project(best.columns), cost(best, tried, place.m))


def searched_range(cat: Catalogue, cause: str) -> dict[str, tuple[float, float]]:
    """→ least and largest value of every number in the settings of a cause: beyond them it is another cause that looks alike."""
    found: dict[str, list[float]] = {}
    for c in cat.candidates:
        if c.cause == cause:
            for name, value in c.setting.items():
                if isinstance(value, (int, float)):
                    found.setdefault(name, []).append(float(value))
    return {name: (min(v), max(v)) for name, v in found.items()}


def _bends(c: Candidate, line: Candidate, refined: Collection[str]) -> bool:
    """Whether a candidate is the exponential of the same place as a straight line, but for what is refined."""
    own = ("shape", "tau", *refined)
    place = [{k: v for k, v in x.setting.items() if k not in own} for x in (c, line)]
    return (
        c.setting.get("shape") == "exponential"
        and "tau" in c.setting
        and place[0] == place[1]
        and c.setting.keys() == line.setting.keys()
    )


def coefficients(place: Space, selected: Array, columns: Array, ratios: tuple[float, ...]) -> Array:
    """selected (m, s), columns (m, k), noise → (k,) generalised least-squares values of the columns beside the selected."""
    root = place.setting(ratios).root
    white = root @ np.hstack([selected, columns])
    values = np.linalg.lstsq(white, root @ place.y, rcond=1e-12)[0]
    return np.asarray(values[selected.shape[1] :], dtype=float)
