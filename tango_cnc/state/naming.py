"""What changed: every direction that has a name is tried on the innovation of the night, and the shortest story counts.

A hypothesis is a handful of directions of the state. What it explains is the generalised likelihood ratio of the innovation
along them (Willsky & Jones 1976); ln k a direction is the price, so that six directions do not win over the one that moved.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import linalg, special

from ..records import Array
from ..terms import SCALES
from .by_warmth import BesideWarmth, PerKelvin, rival, what_kelvins_do
from .changes import change_of
from .filter import OFF, SURE, State, Tonight
from .frame import PRETRAVEL, WARM, Frame

FAR = 1e-5  # p-value of what another cause explains, over all that are tried, below which it is named beside the first
ALIKE = 0.05  # share of a direction that the first cause cannot make, below which another one is the same
MANY = 4  # causes of one night that are named
CLOSE = 6.0  # of the score: hypotheses nearer than this fit nearly as well
UNSEEN = 1e-6  # standard deviations a mm or rad: what no touch of tonight sees is no story
HARDLY = 1.0  # the same of a ball or a facet: touches without weight leave next to nothing of it, and its size is anything then
WARMER = 1.0  # K: a smaller change of temperature is no cause

A_KELVIN = 5 / 3  # times what machines do for a K: more is no temperature where nothing else is known


@dataclass(frozen=True)
class Hypothesis:
    """A cause, what it is called, and the (p, m) directions that it moves; unit: of a size along a direction."""

    cause: str
    parameter: str
    directions: Array
    unit: str
    axes: tuple[str, ...] = ()
    kelvin: float = 0.0  # by which the machine is warmer, where that is the cause


@dataclass(frozen=True)
class Named:
    """One cause of a change: how large along each direction, how sure, what it leaves."""

    hypothesis: Hypothesis
    size: Array  # (m,)
    std: Array  # (m,)
    explained: float  # of the statistic
    score: float
    remains: float  # p-value of what it leaves
    instead: tuple[str, ...]  # other hypotheses that fit nearly as well
    besides: Named | None = None  # another cause that explains most of what is left, with its own besides; sizes are of one fit
    more: tuple[Named, ...] = ()  # of the first: what would explain most of what all of them leave, the best one first

    @property
    def sigmas(self) -> float:
        """→ how many standard deviations its largest direction is from nothing."""
        return float(np.sqrt(self.explained))

    @property
    def all(self) -> tuple[Named, ...]:
        """→ itself and the causes beside it."""
        return (self, *(() if self.besides is None else self.besides.all))

    @property
    def told(self) -> float:
        """→ how much of the statistic it explains together with the causes beside it."""
        return sum(one.explained for one in self.all)

    @property
    def length(self) -> float:
        """→ the size of the change along all directions together."""
        return float(np.linalg.norm(self.size))


def hypotheses(followed: Frame, warmer: float | None) -> tuple[Hypothesis, ...]:
    """frame, K by which tonight differs from the reference (None: not known) → every cause that is tried."""
    p, model = len(followed.names), followed.model
    count = len(model.coefficients)

    def unit(i: int) -> Array:
        column = np.zeros((p, 1))
        column[i] = 1.0
        return column

    found = []
    for i in followed.machine:
        name, slot = followed.selection.label(model.names[i]), model.coefficients[i].slot
        found.append(Hypothesis(change_of(name, followed.families[i]), name, unit(i), followed.units[i], (slot.axis,)))
    scales = [i for i in followed.machine if model.names[i] in SCALES]
    if len(scales) > 1 and not followed.selection.mismatch:  # a machine that is warmer than before, where no sensor says so
        found.append(Hypothesis("scales", "scales", np.eye(p)[:, scales].sum(axis=1, keepdims=True), followed.units[scales[0]]))
    stylus = [i for i in range(count) if model.coefficients[i].slot.axis == "t"]
    if stylus:
        found.append(Hypothesis("stylus", "stylus", np.eye(p)[:, stylus], "mm", tuple("XYZ"[: len(stylus)])))
    if (table := _table(followed)) is not None:
        found.append(Hypothesis("table", "table", table, "mm", ("X", "Y", "Z")))
    found.append(Hypothesis("pretravel", "probe", unit(followed.place[PRETRAVEL]), "mm"))
    first = count
    for j, facet in enumerate(model.touches.facets):
        found.append(Hypothesis("facet", f"facet {facet}", unit(first + j), "mm"))
    begin = first + len(model.touches.facets)
    for j, ball in enumerate(model.touches.balls):
        found.append(Hypothesis("ball", f"ball {ball}", np.eye(p)[:, begin + 3 * j : begin + 3 * j + 3], "mm", ("X", "Y", "Z")))
    if warmer is not None and abs(warmer) >= WARMER and len(followed.warm):
        directions = np.zeros((p, len(followed.warm)))
        for j, i in enumerate(followed.warm):
            directions[i, j] = 1.0
        found.append(Hypothesis("temperature", "temperature", directions, "", (), warmer))
    return tuple(found)


def alike_scales(size: Array, covariance: Array) -> int | None:
    """(m,) changes of scales, (m, m) covariance → which one of them explains the changes better alone than all of them alike do;
    None: alike. By the generalised likelihood ratio along each direction.
    """
    weighted = np.linalg.pinv(covariance)
    ways = np.vstack([np.ones(len(size)), np.eye(len(size))])
    explained = (ways @ weighted @ size) ** 2 / np.einsum("ij,jk,ik->i", ways, weighted, ways)
    best = int(np.argmax(explained))
    return None if best == 0 else best - 1


def _table(followed: Frame) -> Array | None:
    """→ (p, 3) what a displacement of the table along X, Y, Z of its own frame does to facets and balls."""
    model, p = followed.model, len(followed.names)
    first = len(model.coefficients)
    columns = np.zeros((p, 3))
    facets = model.touches.artefact.facets
    for j, facet in enumerate(model.touches.facets):
        columns[first + j] = facets[facet].normal
    start = first + len(model.touches.facets)
    for j in range(len(model.touches.balls)):
        columns[start + 3 * j : start + 3 * j + 3] = np.eye(3)
    return columns if np.linalg.matrix_rank(columns) == 3 else None


def name_change(
    state: State,
    followed: Frame,
    tonight: Tonight,
    tried: Sequence[Hypothesis],
    expected: Collection[tuple[str, str]] = (),
    shown: Mapping[str, tuple[float, float]] | None = None,
) -> Named | None:
    """predicted state, frame, judgement, hypotheses → the one that explains the change best, with those beside it; None where none
    explains any.

    `expected`: (cause, parameter) of what somebody has worked at; where it fits as well as the best one, it is that.
    `shown`: {parameter: per K, its standard deviation} that nights have shown, though no alarm has opened any coefficient yet.
    """
    k = len(tonight.innovation)
    if not k or not tried:
        return None
    root = np.linalg.cholesky(np.eye(k) + tonight.reduced @ tonight.reduced.T)
    white = linalg.solve_triangular(root, tonight.innovation, lower=True)
    every = np.hstack([h.directions for h in tried])
    inside = linalg.solve_triangular(state.root, every, lower=True)
    patterns = linalg.solve_triangular(root, tonight.reduced @ inside, lower=True)
    seen = []
    begin = 0
    for h in tried:
        m = h.directions.shape[1]
        if (story := _seen(h, patterns[:, begin : begin + m])) is not None:
            seen.append(story)
        begin += m
    found = _best(seen, white, tonight, expected)
    if found is None:
        return None
    tells = any(h.cause == "temperature" for h in tried)
    warm = what_kelvins_do(state, followed, shown or {}) if tells else PerKelvin(np.zeros(0), np.zeros(0), False, {})
    if "temperature" in (found[0].hypothesis.cause, *found[0].instead):
        found = _but_for_warmth(found, seen, white, tonight, warm)
    return _shorter(_with_others(*found, seen, white, tonight, warm), seen, white, tonight)


def _shorter(story: Named, seen: Sequence[tuple[Hypothesis, Array]], white: Array, tonight: Tonight) -> Named:
    """story, hypotheses with their patterns, innovation, judgement → that of two backlashes where it is as whole and shorter.

    Backlashes of X and Y of one size are a pretravel and a table beside it: of the causes one by one the pretravel is the best.
    """
    whole = len(story.all) == 1 and story.remains >= FAR
    pairs = list(combinations([item for item in seen if item[0].cause == "backlash"], 2))
    if whole or not pairs or all(one.hypothesis.cause != "pretravel" for one in story.all):
        return story
    other = max((_both(*pair, white, tonight) for pair in pairs), key=lambda two: two.told)
    gain = _worth(other, len(white)) - _worth(story, len(white))
    if gain > CLOSE:
        return other
    near = [one.hypothesis.parameter for one in other.all]
    return replace(story, instead=(*story.instead, *near)[:4]) if gain > -CLOSE else story


def _both(one: tuple[Hypothesis, Array], other: tuple[Hypothesis, Array], white: Array, tonight: Tonight) -> Named:
    """two hypotheses of one direction with their patterns, innovation, judgement → the story of both."""
    together = np.hstack([one[1], other[1]])
    explained, size, std, rank = _fitted(together, white, tonight.scale)
    alone = _fitted(one[1], white, tonight.scale)[0]
    left = max(tonight.statistic / tonight.scale - explained, 0.0)
    remains = float(special.chdtrc(len(white) - rank, left)) if len(white) > rank else 1.0
    second = Named(other[0], size[1:], std[1:], explained - alone, explained - alone, remains, ())
    return Named(one[0], size[:1], std[:1], alone, alone, remains, (), second)


def _worth(story: Named, k: int) -> float:
    """story, directions that the touches tell → what its causes explain, less the price of their directions."""
    return story.told - float(np.log(k)) * sum(len(one.size) for one in story.all)


def _but_for_warmth(
    found: tuple[Named, Array],
    seen: Sequence[tuple[Hypothesis, Array]],
    white: Array,
    tonight: Tonight,
    told: PerKelvin,
) -> tuple[Named, Array]:
    """best story, its pattern, hypotheses with theirs, (k,) white innovation, judgement, what kelvins do → the same, where
    temperature is it or fits nearly as well; another cause before it, or beside it, where so few kelvins do not do that.
    """
    best, _ = found
    (warm,) = (item for item in seen if item[0].cause == "temperature")
    others = [item for item in seen if item[0].cause != "temperature"]
    other = _rival(warm, others, white, tonight, told, np.ones(len(told.most), dtype=bool))
    if best.hypothesis.cause != "temperature":
        knock = other is not None and other.first and not other.near
        return (replace(best, instead=tuple(n for n in best.instead if n != "temperature")) if knock else best), found[1]
    if other is None:
        return found
    place = other.place
    if not other.first:
        near = (others[place][0].parameter, *best.instead)
        return replace(best, instead=tuple(dict.fromkeys(near))[:4]), found[1]
    one, every = _best([others[place]], white, tonight, ()), _best(others, white, tonight, ())
    assert one is not None and every is not None
    alike = every[0].instead if every[0].hypothesis is one[0].hypothesis else (every[0].hypothesis.parameter,)
    near = ("temperature", *alike) if other.near else alike
    return replace(one[0], instead=near[:4]), one[1]


def _rival(
    warm: tuple[Hypothesis, Array],
    others: Sequence[tuple[Hypothesis, Array]],
    white: Array,
    tonight: Tonight,
    told: PerKelvin,
    free: Array,
) -> BesideWarmth | None:
    """temperature with its pattern, other hypotheses with theirs, (k,) innovation, judgement, what kelvins do, which of the errors
    are meant → the cause that says more than temperature does, or as much; None where none does.
    """
    steps = [_fitted(own, white, tonight.scale)[1:3] for _, own in others]
    sized = [(h, x, std) for (h, _), (x, std) in zip(others, steps, strict=True)]
    far = [len(x) == 1 and _beyond(h, x[0], std[0], warm[0].kelvin, told.shown) for h, x, std in sized]
    due, most = warm[1] @ told.mean[free] * warm[0].kelvin, warm[1] * told.most[free] * warm[0].kelvin
    return rival(due, most, [own for _, own in others], white, tonight.scale, told.learned, np.array(far))


def _beyond(h: Hypothesis, size: float, std: float, kelvin: float, shown: Mapping[str, tuple[float, float]]) -> bool:
    """hypothesis, its size and standard deviation, K, what nights have shown → whether no machine does so much for so few, or this
    one does not, by what it has shown.
    """
    if abs(size) > A_KELVIN * _most(h) * abs(kelvin):
        return True
    if h.parameter not in shown:
        return False
    rate, unsure = shown[h.parameter]
    return bool(abs(size - rate * kelvin) > SURE * np.hypot(std, np.hypot(unsure, OFF * _most(h)) * kelvin))


def _most(h: Hypothesis) -> float:
    """hypothesis → mm, rad … that machines do for each K."""
    return WARM.get(h.unit, WARM[""])


def _seen(h: Hypothesis, pattern: Array) -> tuple[Hypothesis, Array] | None:
    """hypothesis, (k, m) what its directions do to the innovation → the same without directions that no touch of tonight sees;
    None where that is not the same story any more.
    """
    visible = _determined(pattern) if h.cause in ("ball", "facet") else np.linalg.norm(pattern, axis=0) > UNSEEN
    if not (np.any(visible) if h.cause == "ball" else np.all(visible)):
        return None
    if np.all(visible):
        return h, pattern
    axes = tuple(a for a, v in zip(h.axes, visible, strict=True) if v)  # a ball is touched from some sides only
    return replace(h, directions=h.directions[:, visible], axes=axes), pattern[:, visible]


def _determined(pattern: Array) -> Array:
    """(k, m) what directions of a ball or a facet do to the innovation → (m,) which of them tonight's touches determine.

    Touches from one side leave some of a ball, and what is left of the second direction beside the first may be next to nothing.
    """
    triangle, order = linalg.qr(pattern, mode="r", pivoting=True)
    found = np.zeros(pattern.shape[1], dtype=bool)
    own = np.abs(np.diag(triangle))
    found[order[: len(own)]] = own > HARDLY
    return found


def _best(
    seen: Sequence[tuple[Hypothesis, Array]], white: Array, tonight: Tonight, expected: Collection[tuple[str, str]]
) -> tuple[Named, Array] | None:
    """hypotheses with their patterns, (k,) white innovation, judgement, what is expected → the one of the best score, and its
    pattern.
    """
    k, scored = len(white), []
    for h, pattern in seen:
        m = pattern.shape[1]
        explained, size, std, rank = _fitted(pattern, white, tonight.scale)
        price = np.log(k) * (2 + np.log(m) if h.cause == "temperature" else m)  # one cause, however many unknowns follow it
        rest = max(tonight.statistic / tonight.scale - explained, 0.0)
        remains = float(special.chdtrc(k - rank, rest)) if k > rank else 1.0
        scored.append((explained - price, Named(h, size, std, explained, explained - price, remains, ()), pattern))
    if not scored:
        return None
    scored.sort(key=lambda item: -item[0])
    own = (item for item in scored if (item[1].hypothesis.cause, item[1].hypothesis.parameter) in expected)
    score, best, pattern = next((item for item in own if scored[0][0] - item[0] < CLOSE), scored[0])
    near = tuple(n.hypothesis.parameter for other, n, _ in scored if n is not best and _alike(best, n, score - other))[:4]
    return replace(best, instead=near), pattern


def _fitted(pattern: Array, white: Array, scale: float) -> tuple[float, Array, Array, int]:
    """(k, m) pattern, (k,) white innovation, its variance → what it explains, (m,) sizes, (m,) standard deviations, rank."""
    norm, m = np.linalg.norm(pattern, axis=0), pattern.shape[1]
    basis, triangle, order = linalg.qr(pattern / norm, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(triangle)) > 1e-6))
    along = basis[:, :rank].T @ white
    size, std = np.zeros(m), np.full(m, np.inf)
    inverse = linalg.inv(triangle[:rank, :rank])
    size[order[:rank]] = inverse @ along / norm[order[:rank]]
    std[order[:rank]] = np.linalg.norm(inverse, axis=1) * np.sqrt(scale) / norm[order[:rank]]
    return float(along @ along) / scale, size, std, rank


def _with_others(
    best: Named, its: Array, seen: Sequence[tuple[Hypothesis, Array]], white: Array, tonight: Tonight, warm: PerKelvin
) -> Named:
    """best story, its (k, m) pattern, every hypothesis with its pattern, innovation, judgement, what kelvins do → the same
    with the causes beside it, sizes and standard deviations of all from one fit, and with what would explain what is left then.
    """
    causes, patterns, more = [best], [its], list[Named]()
    while True:
        found = _next(causes, patterns, seen, white, tonight, warm)
        more = [one for one, _, _ in found][:MANY]
        if not found or not found[0][2] or len(causes) == MANY:
            break
        causes.append(found[0][0])
        patterns.append(found[0][1])
        _, size, std, rank = _fitted(np.hstack(patterns), white, tonight.scale)
        left = max(tonight.statistic / tonight.scale - sum(c.explained for c in causes), 0.0)
        remains = float(special.chdtrc(len(white) - rank, left)) if len(white) > rank else 1.0
        begin, again = 0, []
        for cause, pattern in zip(causes, patterns, strict=True):
            part = slice(begin, begin := begin + pattern.shape[1])
            again.append(replace(cause, size=size[part], std=std[part], remains=remains))
        causes = again
    chain: Named | None = None
    for cause in reversed(causes[1:]):
        chain = replace(cause, besides=chain)
    return replace(causes[0], besides=chain, more=tuple(more))


def _next(
    causes: Sequence[Named],
    patterns: Sequence[Array],
    seen: Sequence[tuple[Hypothesis, Array]],
    white: Array,
    tonight: Tonight,
    warm: PerKelvin,
) -> list[tuple[Named, Array, bool]]:
    """causes, their (k, m) patterns, every hypothesis with its pattern, innovation, judgement, what kelvins do → what explains more
    of what they leave than chance, with its pattern and whether it is a name: the best one first.

    A name explains more than half of what is left above chance, and more than any other by `CLOSE`: where another one does as
    well, neither is a name. Beside temperature it is one where so few kelvins do not do what is left.
    """
    k, m = len(white), sum(p.shape[1] for p in patterns)
    if causes[0].hypothesis.cause == "temperature":
        return []
    basis = linalg.orth(np.hstack(patterns))
    left = white - basis @ (basis.T @ white)
    others, beside, free = [], list[tuple[Hypothesis, Array]](), np.zeros(0, dtype=bool)
    for h, pattern in seen:
        own = pattern - basis @ (basis.T @ pattern)
        if h.cause == "temperature":  # an error that has moved by itself may have moved with it, too: no night says how far
            free = np.linalg.norm(own, axis=0) > ALIKE * np.linalg.norm(pattern, axis=0)
            h, own, pattern = replace(h, directions=h.directions[:, free]), own[:, free], pattern[:, free]
        if own.size and np.all(np.linalg.norm(own, axis=0) > ALIKE * np.linalg.norm(pattern, axis=0)):
            gain, size, std, _ = _fitted(own, left, tonight.scale)
            score = gain - np.log(k) * pattern.shape[1]
            others.append((Named(h, size, std, gain, score, causes[-1].remains, ()), pattern))
            beside.append((h, own))
    knock = _knock([one for one, _ in others], beside, left, tonight, warm, free)
    others.sort(key=lambda item: (item[0].hypothesis is not knock, -item[0].score))
    rest = max(tonight.statistic / tonight.scale - sum(c.explained for c in causes), 0.0) - (k - m)
    found = []
    for place, (one, pattern) in enumerate(others):
        by_chance = float(special.chdtrc(pattern.shape[1], one.explained)) * len(others)
        alone = place == 0 and (len(others) == 1 or one.score - others[1][0].score >= CLOSE)
        if by_chance <= FAR:
            found.append((one, pattern, one.hypothesis is knock or (alone and one.explained >= 0.5 * rest)))
    return found


def _knock(
    scored: Sequence[Named], beside: Sequence[tuple[Hypothesis, Array]], left: Array, tonight: Tonight, warm: PerKelvin, free: Array
) -> Hypothesis | None:
    """what may be beside the first causes, the same with (k, m) patterns without them, (k,) what they leave, judgement, what
    kelvins do, which errors may follow the temperature → the one that so few kelvins do not make, where temperature would be named,
    or as well; else None.
    """
    (place, own), *_ = [*((i, item) for i, item in enumerate(beside) if item[0].cause == "temperature"), (-1, None)]
    if own is None or scored[place].score <= max(one.score for one in scored) - CLOSE:
        return None
    others = [item for item in beside if item is not own]
    found = _rival(own, others, left, tonight, warm, free)
    return others[found.place][0] if found is not None and found.first else None


def _alike(best: Named, other: Named, behind: float) -> bool:
    """best story, another one, how far its score is behind → whether it fits nearly as well, be it a longer one."""
    if other.hypothesis.cause == "temperature" or best.hypothesis.cause == "temperature":
        return behind < CLOSE
    return best.explained - other.explained < CLOSE
