"""Which candidates are there: significance over all causes and shapes at once, selection forwards, backwards and by exchange."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from ..records import Array
from ._catalogue import (
    APART,
    EXPECTED_LEVEL,
    STRONG,
    Catalogue,
    Chosen,
    Limits,
    coefficients,
    columns_of,
    cost,
    kind,
    likelihood,
    refined,
    total,
)
from ._space import Space, below, best_noise, scan

TOLD = 0.05  # of a steady pattern that a wandering noise would explain as well, where patterns are preferred
MOST = 30  # candidates selected, single outliers included
MOST_NAMED = 6
PEAKS = 4  # waves of a cause that are refined before they are compared
TOP = 8  # variants of a cause that are looked at when the best one has an impossible size
UNDECIDED = 3.0  # score by which a rival must beat what is expected of every machine
FEW = 20  # rows of a cause that might be a few outliers instead
CLOSE = 12.0  # causes whose scores are no further apart are refined before they are compared


def scored(place: Space, cat: Catalogue, chosen: Sequence[Chosen]) -> tuple[Array, tuple[float, ...], float]:
    """chosen so far → (blocks,) score of everything beside them, their noise, the base log likelihood."""
    selected = columns_of(place, chosen)
    ratios, _ = best_noise(place, selected)
    ratio, base = scan(place, cat.library, selected, below(ratios))
    return 2 * ratio[:, 0] - cat.price, ratios, float(base[0])


def ranked(
    place: Space,
    cat: Catalogue,
    chosen: Sequence[Chosen],
    limits: Limits,
    usual: Array,
    scores: tuple[Array, tuple[float, ...], float] | None = None,
) -> tuple[list[tuple[float, int]], float]:
    """chosen so far, what `scored` says → (score, block) of the best significant block of every cause, best first; the base
    log likelihood.
    """
    selected = columns_of(place, chosen)
    score, ratios, base = scores or scored(place, cat, chosen)
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
    return sorted(found, reverse=True), base


def peaks(cat: Catalogue, score: Array, block: int) -> list[int]:
    """catalogue, scores (blocks,), the best block of a cause → it, and the tops of its other waves that come near, best first.

    Between two waves of the catalogue the score of the one that is there falls so far that an alias of it may stand higher.
    """
    cause = cat.candidates[block].cause
    name = next((n for n, way in cat.refine.get(cause, {}).items() if way == "wave"), None)
    if name is None:
        return [block]
    courses: dict[str, list[tuple[float, int]]] = {}
    for other in map(int, np.flatnonzero(cat.group == cat.causes.index(cause))):
        setting = cat.candidates[other].setting
        courses.setdefault(str({k: v for k, v in setting.items() if k != name}), []).append((float(setting[name]), other))
    tops = []
    for course in courses.values():
        own = [other for _, other in sorted(course)]
        height = np.concatenate([[-np.inf], score[own], [-np.inf]])
        tops += [o for o, before, at, after in zip(own, height, height[1:], height[2:], strict=False) if before <= at >= after]
    near = score[block] - nearness(float(score[block]))
    return [block, *sorted((o for o in tops if o != block and score[o] > near), key=lambda o: -score[o])[: PEAKS - 1]]


def nearness(score: float) -> float:
    """the best score → by how much less another may have and still be refined before they are compared."""
    return max(CLOSE, 0.35 * abs(score))


def best_addition(place: Space, cat: Catalogue, chosen: Sequence[Chosen], limits: Limits, usual: Array) -> Chosen | None:
    """chosen so far → the candidate that explains most of the rest, refined; None when nothing is significant."""
    scores = scored(place, cat, chosen)
    found, _ = ranked(place, cat, chosen, limits, usual, scores)
    if not found:
        return None
    selected = columns_of(place, chosen)
    settings = below(scores[1])
    near = [block for score, block in found if score > found[0][0] - nearness(found[0][0])][:6]
    others = [c.candidate for c in chosen]
    options = []
    for block in (b for first in near for b in peaks(cat, scores[0], first)):
        start = cat.candidates[block]
        if not cat.compatible(start, others):
            continue
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
    chosen = twinned(place, cat, plainest(place, cat, chosen))
    chosen = [*chosen, *happened(place, cat, chosen, limits, usual)]
    return [*chosen, *awaited(place, cat, chosen, usual)]


def plainest(place: Space, cat: Catalogue, chosen: Sequence[Chosen]) -> list[Chosen]:
    """chosen → chosen, where a plainer cause has the place of one with more settings that is no more than `STRONG` better, and one
    that is only more usual of one that is no more than `APART` better.

    More settings follow the noise of one run better by a few units; the other one stays among the alternatives.
    """
    best, found = total(place, chosen), list(chosen)
    for i, old in enumerate(found):
        others = [*found[:i], *found[i + 1 :]]
        selected = columns_of(place, others)
        options = []
        # With a place of its own (where a scale or a screw is held) it has as many settings: then evidence alone decides.
        placed = [k for k, way in cat.refine.get(old.candidate.cause, {}).items() if way == "linear" and k in old.candidate.setting]
        for cause in (*cat.plainer.get(old.candidate.cause, ()), old.candidate.cause):
            if not _without(cat, cause, placed) or (cause == old.candidate.cause and not placed):
                continue
            ratios, _ = best_noise(place, selected)
            new = rival(place, cat, cause, selected, ratios, placed)[1]
            if cause == old.candidate.cause and not new.candidate.setting.keys() < old.candidate.setting.keys():
                continue
            twice = any(c.candidate.cause == cause and _axis(c) == _axis(new) for c in others)
            if not twice and cat.plausible(new.candidate, coefficients(place, selected, new.columns, ratios)):
                if len(old.candidate.setting.keys() - {"shape"}) > len(new.candidate.setting.keys() - {"shape"}):
                    behind = best - total(place, [*others, new]) - STRONG
                else:  # a tip that creeps has fewer numbers than a body that drifts, but for one that drifts along one axis
                    behind = best - thrifty(place, others, new) - APART
                options.append((behind, new))
        behind, new = min(options, key=lambda one: one[0], default=(np.inf, old))
        if behind < 0:
            found[i] = new
    return found


def thrifty(place: Space, others: Sequence[Chosen], one: Chosen) -> float:
    """others, a cause beside them → the score of all, where it goes along one axis of its frame alone if that is better: most
    machines are built so that they do, and which axis was picked among three.
    """
    axes = [k.name[-1:] for k in one.candidate.coefficients]
    columns = [one.columns[:, [i]] for i in range(len(axes))] if axes == ["x", "y", "z"] else []
    price = one.price - (len(axes) - 1) * float(np.log(place.m)) + 2 * float(np.log(max(len(axes), 1)))
    single = [total(place, [*others, Chosen(one.candidate, own, price)]) for own in columns]
    return max([total(place, [*others, one]), *single])


def twinned(place: Space, cat: Catalogue, chosen: Sequence[Chosen]) -> list[Chosen]:
    """chosen → chosen, where one twin has the place of all that was found of a cause: it has to be `APART` better than one of
    them, and as good as several. What the wrong one of two leaves, another name may have followed: it goes where it is needless.
    """
    found = list(chosen)
    for cause, names in cat.twins.items():
        old = [c for c in found if c.candidate.cause == cause]
        rest = [c for c in found if c.candidate.cause != cause]
        least = total(place, found) + (APART if len(old) == 1 else 0.0)
        selected = columns_of(place, rest)
        for name in names if old else ():
            if name not in cat.causes:
                continue
            ratios, _ = best_noise(place, selected)
            new = rival(place, cat, name, selected, ratios)[1]
            trial = pruned(place, [*rest, new])
            value = total(place, trial)
            possible = cat.plausible(new.candidate, coefficients(place, selected, new.columns, ratios))
            if value > least and possible and any(c is new for c in trial):
                least, found = value, trial
    return found


def happened(place: Space, cat: Catalogue, chosen: Sequence[Chosen], limits: Limits, usual: Array) -> list[Chosen]:
    """chosen → a twin of a cause that was not found, where the twin is significant beside them.

    What the two do may be so different that the one that is searched for does not show where the other one happened. One alone is
    added: with twins in the search, what comes again and again is followed by several of them.
    """
    if any(not c.candidate.cause for c in chosen):
        return []
    score, ratios, _ = scored(place, cat, chosen)
    selected, there = columns_of(place, chosen), {c.candidate.cause for c in chosen}
    found: list[tuple[float, Chosen]] = []
    for cause, names in cat.twins.items():
        for name in names if there.isdisjoint((cause, *names)) else ():
            if name not in cat.causes:
                continue
            i = cat.causes.index(name)
            own = np.flatnonzero(cat.group == i)
            if float(score[own].max()) - usual[i] > limits.limit[kind(name)]:
                value, new = rival(place, cat, name, selected, ratios)
                if cat.plausible(new.candidate, coefficients(place, selected, new.columns, ratios)):
                    found.append((value, new))
    return [max(found, key=lambda one: one[0])[1]] if found else []


def _axis(c: Chosen) -> object:
    return c.candidate.setting.get("axis")


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


def _without(cat: Catalogue, cause: str, names: Collection[str]) -> bool:
    """catalogue, a cause, settings → whether one of its variants has none of them."""
    return any(c.cause == cause and c.setting.keys().isdisjoint(names) for c in cat.candidates)


def rival(
    place: Space, cat: Catalogue, cause: str, selected: Array, ratios: tuple[float, ...], without: Collection[str] = ()
) -> tuple[float, Chosen]:
    """cause, selected (m, s), their noise, settings that it is not to have → twice its best log likelihood less its price, and it;
    any smaller noise is tried.
    """
    near = below(ratios)
    ratio, _ = scan(place, cat.library, selected, near)
    own = cat.group == cat.causes.index(cause)
    if without:
        own = own & np.array([c.setting.keys().isdisjoint(without) for c in cat.candidates])
    score = np.where(own, 2 * ratio[:, 0] - cat.price, -np.inf)
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
