"""Which candidates are there: significance over all causes and shapes at once, selection forwards, backwards and by exchange.

A candidate is compared by twice its log likelihood less a price: log m for every free coefficient (Schwarz 1978), twice the log
of the number of variants that were tried for it (Chen & Chen 2008). What counts as significant is learnt from noise alone:
data drawn from the fitted noise go through the same search, and the largest score over the whole catalogue sets the limit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..records import Array, InputError
from ._candidates import Candidate
from ._space import Beside, Library, Space, below, best_noise, level, library, scan

LEVEL = 0.02  # of a false name anywhere in the catalogue, at every step: 5 % over the few steps that a search takes
EXPECTED_LEVEL = 0.01  # of a false name, for a cause that every machine has: it is not one of hundreds
TOLD = 0.05  # of a steady pattern that a wandering noise would explain as well, where patterns are preferred
SHAPE_LEVEL = 0.01  # of a false "something is there", outliers likewise
TRIALS = 200
MOST = 30  # candidates selected, single outliers included
MOST_NAMED = 6
FEWEST_TRIED = 90  # a cause with few variants has no advantage over one with as many as there are error motions
TOP = 8  # variants of a cause that are looked at when the best one has an impossible size
UNDECIDED = 3.0  # score by which a rival must beat what is expected of every machine
STRAIGHT = 1.0  # log likelihood by which a straight line must beat every exponential
SHAPELESS = 10.0  # score by which a shape without a name must beat every name (very strong evidence)
FEW = 20  # rows of a cause that might be a few outliers instead
CLOSE = 12.0  # causes whose scores are no further apart are refined before they are compared

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


@dataclass(frozen=True)
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
        raise InputError("readings: found no cause that they could show; allowed: touches on several facets at several indexations")
    tried = Counter(c.cause for c in kept)
    names = tuple(dict.fromkeys(c.cause for c in kept))
    price = np.array([cost(c, tried[c.cause], place.m) for c in kept])
    group = np.array([names.index(c.cause) for c in kept])
    length = [np.maximum(np.linalg.norm(projected[i], axis=0), 1e-300) for i in keep]
    blocks = library([projected[i] for i in keep])
    return Catalogue(
        kept, blocks, length, price, group, names, refine, rebuild, plausible, compatible, steady, expected=expected or {}
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
    for name, way in cat.refine.get(start.cause, {}).items():
        if name not in start.setting or not isinstance(start.setting[name], (int, float)):
            continue
        step = {"log": 0.25, "wave": 0.01, "linear": 16.0, "touch": 4.0, "order": 8.0}[way]
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
    if best.setting.get("shape") == "linear" and settings:
        # A straight line is the beginning of an exponential: the time constant is told where the data allow one.
        curved = [c for c in cat.candidates if c.cause == best.cause and _bends(c, best)]
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


def _bends(c: Candidate, line: Candidate) -> bool:
    """Whether a candidate is the exponential of the same place as a straight line."""
    place = [{k: v for k, v in x.setting.items() if k not in ("shape", "tau")} for x in (c, line)]
    return c.setting.get("shape") == "exponential" and "tau" in c.setting and place[0] == place[1]


def coefficients(place: Space, selected: Array, columns: Array, ratios: tuple[float, ...]) -> Array:
    """selected (m, s), columns (m, k), noise → (k,) generalised least-squares values of the columns beside the selected."""
    root = place.setting(ratios).root
    white = root @ np.hstack([selected, columns])
    values = np.linalg.lstsq(white, root @ place.y, rcond=1e-12)[0]
    return np.asarray(values[selected.shape[1] :], dtype=float)


def ranked(
    place: Space, cat: Catalogue, chosen: Sequence[Chosen], limits: Limits, usual: Array
) -> tuple[list[tuple[float, int]], float]:
    """chosen so far → (score, block) of the best significant block of every cause, best first; the base log likelihood."""
    selected = columns_of(place, chosen)
    ratios, _ = best_noise(place, selected)
    ratio, base = scan(place, cat.library, selected, below(ratios))
    score = 2 * ratio[:, 0] - cat.price
    found = []
    for i, cause in enumerate(cat.causes):
        if not (cause or cat.nameless):
            continue
        blocks = np.flatnonzero(cat.group == i)
        for block in blocks[np.argsort(-score[blocks])[:TOP]]:
            if score[block] <= 0 or score[block] - usual[i] <= limits.limit[kind(cause)]:
                break
            if not cat.compatible(cat.candidates[block], [c.candidate for c in chosen]):
                continue
            values = coefficients(place, selected, cat.library.of(block), ratios) / cat.length[block]
            if cat.plausible(cat.candidates[block], values):
                found.append((float(score[block]), int(block)))
                break
    return sorted(found, reverse=True), float(base[0])


def best_addition(place: Space, cat: Catalogue, chosen: Sequence[Chosen], limits: Limits, usual: Array) -> Chosen | None:
    """chosen so far → the candidate that explains most of the rest, refined; None when nothing is significant."""
    found, _ = ranked(place, cat, chosen, limits, usual)
    if not found:
        return None
    selected = columns_of(place, chosen)
    settings = below(best_noise(place, selected)[0])
    near = [block for score, block in found if score > found[0][0] - max(CLOSE, 0.35 * abs(found[0][0]))][:6]
    others = [c.candidate for c in chosen]
    options = []
    for block in near:
        start = cat.candidates[block]
        one = refined(place, cat, start, selected, settings)
        if not cat.compatible(one.candidate, others):  # its shape has run into that of one of them
            one = Chosen(start, place.project(start.columns), float(cat.price[block]))
        options.append(one)
    possible = [o for o in options if cat.plausible(o.candidate, coefficients(place, selected, o.columns, settings[-1]))]
    options = possible or options[:1]
    values = [2 * likelihood(place, np.hstack([selected, c.columns]), settings) - c.price for c in options]
    return options[int(np.argmax(values))]


def select(place: Space, cat: Catalogue, limits: Limits, usual: Array) -> list[Chosen]:
    """space, catalogue, limits → the candidates that together explain the residuals best.

    Two slow changes can hide in a wandering noise although neither of them beats it alone. Where the noise that is left
    wanders, the search is repeated as if it were white, and what it finds has to prove itself with the wandering allowed.
    """
    chosen = searched(place, cat, limits, usual, [])
    if cat.library.size.size and any(best_noise(place, columns_of(place, chosen))[0]):
        still = Space(place.basis, place.y, place.kernels, place.scales, place._settings, place._white, white=True)
        other = searched(still, cat, limits, usual, [])
        if cat.steady:
            plain = [
                2 * best_noise(place, columns_of(place, c))[1] - np.log(place.m) * columns_of(place, c).shape[1]
                for c in (other, chosen)
            ]
            better = plain[0] > plain[1] + limits.limit.get("names", 0.0)
            if better:
                other = proven(place, cat, other, limits, usual, TOLD)
        else:
            other = searched(place, cat, limits, usual, proven(place, cat, other, limits, usual))
            better = total(place, other) > total(place, chosen) + limits.limit.get("names", 0.0)
        if other and better:
            chosen = other
    if any(c.candidate.cause == "" for c in chosen):
        # A shape may have taken the place of two causes at once, which one by one could not compete with it.
        names = searched(place, replace(cat, nameless=False), limits, usual, [])
        if names and total(place, names) > total(place, chosen):
            chosen = names
    return [*chosen, *awaited(place, cat, chosen, usual)]


def awaited(place: Space, cat: Catalogue, chosen: Sequence[Chosen], usual: Array) -> list[Chosen]:
    """chosen → what is expected of every machine and significant by itself, beside them, its rivals not clearly better.

    A drift of a few micrometres in a noise that wanders is not significant among hundreds of patterns; alone it is.
    """
    found: list[Chosen] = []
    if any(not c.candidate.cause for c in chosen):
        return found
    for cause, rivals in cat.expected.items():
        if cause not in cat.causes or cause in [c.candidate.cause for c in chosen]:
            continue
        selected = columns_of(place, [*chosen, *found])
        ratios, base = best_noise(place, selected)
        mine, *others = [rival(place, cat, c, selected, ratios) for c in dict.fromkeys((cause, *rivals)) if c in cat.causes]
        if max((score for score, _ in others), default=-np.inf) > mine[0] + UNDECIDED:
            continue
        if mine[0] - 2 * base - usual[cat.causes.index(cause)] > 2 * float(np.log(0.1 / EXPECTED_LEVEL)):
            found.append(mine[1])
    return found


def rival(place: Space, cat: Catalogue, cause: str, selected: Array, ratios: tuple[float, ...]) -> tuple[float, Chosen]:
    """cause, selected (m, s), their noise → twice its best log likelihood less its price, and it; any smaller noise is tried."""
    near = below(ratios)
    ratio, _ = scan(place, cat.library, selected, near)
    score = np.where(cat.group == cat.causes.index(cause), 2 * ratio[:, 0] - cat.price, -np.inf)
    best = refined(place, cat, cat.candidates[int(np.argmax(score))], selected, near)
    smaller = [r for r in place.grid() if all(a <= b for a, b in zip(r, ratios, strict=True))]
    return 2 * likelihood(place, np.hstack([selected, best.columns]), smaller) - best.price, best


def searched(place: Space, cat: Catalogue, limits: Limits, usual: Array, start: list[Chosen]) -> list[Chosen]:
    """space, catalogue, limits, what to begin with → selected forwards, backwards and by exchange."""
    chosen = start
    known: dict[frozenset[int], tuple[Sequence[Chosen], Chosen | None]] = {}

    def addition(others: Sequence[Chosen]) -> Chosen | None:
        """What is best beside the others: exchanges ask for the same again and again. They are kept, so that no id comes twice."""
        key = frozenset(map(id, others))
        if key not in known:
            known[key] = others, best_addition(place, cat, others, limits, usual)
        return known[key][1]

    for _ in range(MOST):
        new = addition(chosen)
        if new is None or (new.candidate.named and sum(c.candidate.named for c in chosen) >= MOST_NAMED):
            break
        chosen = [*chosen, new]
        if new.candidate.cause != "outlier":
            chosen = exchanged(place, chosen, addition)
        chosen = pruned(place, chosen)
    return pruned(place, loosened(place, cat, pruned(place, exchanged(place, chosen, addition))))


def loosened(place: Space, cat: Catalogue, chosen: list[Chosen]) -> list[Chosen]:
    """chosen → chosen, where a cause that touches few rows gives way to single outliers among them that explain as much."""
    for old in list(chosen):
        rows = np.flatnonzero(np.abs(old.candidate.columns).sum(axis=1))
        if not old.candidate.named or len(rows) > FEW:
            continue
        trial = [c for c in chosen if c is not old]
        single = [c for c in cat.candidates if c.cause == "outlier" and np.abs(c.columns[rows]).sum() > 0]
        price = cost(single[0], len(place.basis), place.m) if single else 0.0
        value = total(place, trial)
        for _ in range(len(single)):
            options = [[*trial, Chosen(c, place.project(c.columns), price)] for c in single]
            scores = [total(place, option) for option in options]
            if max(scores) <= value:
                break
            trial, value = options[int(np.argmax(scores))], max(scores)
        trial = pruned(place, trial)
        if total(place, trial) > total(place, chosen) - CLOSE / 2:
            chosen = trial
    return chosen


def proven(
    place: Space, cat: Catalogue, chosen: list[Chosen], limits: Limits, usual: Array, chance: float | None = None
) -> list[Chosen]:
    """chosen → those that are significant beside the others, the noise free to wander: at the limit, or at a probability."""
    chosen = list(chosen)
    while chosen:
        value = total(place, chosen)
        beyond = []
        for old in chosen:
            cause = old.candidate.cause
            gain = value - total(place, [c for c in chosen if c is not old])
            least = limits.limit[kind(cause)] if chance is None else limits.usual[kind(cause)] + 2 * float(np.log(0.1 / chance))
            beyond.append(gain - usual[cat.causes.index(cause)] - least)
        if min(beyond) > 0:
            break
        del chosen[int(np.argmin(beyond))]
    return chosen


def exchanged(place: Space, chosen: list[Chosen], addition: Callable[[Sequence[Chosen]], Chosen | None]) -> list[Chosen]:
    """chosen, what is best beside some → chosen, each replaced by what does its work better, until nothing changes."""
    value = total(place, chosen)
    for _ in range(3):
        changed = False
        for i, old in enumerate(list(chosen)):
            if old.candidate.cause == "outlier" or len(chosen) < 2:
                continue
            others = [c for c in chosen if c is not old]
            new = addition(others)
            trial = others if new is None else [*others[:i], new, *others[i:]]
            score = total(place, trial)
            if score > value + 0.5:
                chosen, value, changed = trial, score, True
        if not changed:
            break
    return chosen


def pruned(place: Space, chosen: list[Chosen]) -> list[Chosen]:
    """chosen → chosen without those that no longer earn their price."""
    while len(chosen) > 1:
        value = total(place, chosen)
        without = [total(place, [c for c in chosen if c is not old]) for old in chosen]
        if max(without) <= value:
            break
        del chosen[int(np.argmax(without))]
    return chosen
