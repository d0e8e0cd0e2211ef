"""What the fit does not contain, and what that did to the parameters: a score test of many patterns at once.

A mistake that the noise does not explain leaves its pattern in the residuals, however little. Each pattern is one that something
can make: table, tip or an axis elsewhere from one touch on or for a while, an axis that errs with its own position, a drift, a
probe that reads by direction. What it would take out of the residuals, beside walk, seating and every unknown, is an F test (Rao
1973, 4b.2); the level is shared by all patterns (Bonferroni). Where one is found, the parameters that it would move are not to be
trusted, whatever it was. Everything is linear algebra on one factor of the normal matrix; nothing is fitted again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from ..estimate import Estimate
from ..model import known
from ..records import Array
from ..texts import joined, say
from ..touches import Touches
from .data import Remark
from .shapes import candidates, movable, periodic

LEVEL = 5e-4  # chance of a false find for each of the three kinds: on all touches, from a moment on, in a band of an axis
AGREED = 1e-4  # the same where the touches are as was predicted before: one night in 3000 at most
FAINT = 1e-3  # share of a pattern that the unknowns leave of it, below which they stand for it
FEWEST = 3  # touches that a pattern acts on
LARGEST = 1500  # touches of which patterns are looked for
SPARE = 20.0  # touches to spare, at least
MOVED = 2.0  # standard deviations by which a pattern moves a parameter before the result is doubtful
TOUCHED = 1.0  # the same before the parameter is not to be trusted
RIDGE = 1e-10
NOTHING = 1e-12  # of the largest square of a pattern's columns: a smaller one is rounding
NEAR_ANGLE, NEAR_PLACE = 1e-3, 0.01  # rad, mm between two places of an axis
MOST = 60  # places of an axis of which every stretch is tried
SHOWN = 4  # parameters that a sentence names


@dataclass(frozen=True)
class Pattern:
    """A pattern that the residuals show."""

    what: str  # key of its words
    axis: str
    first: int  # rows on which it acts, of the touches
    last: int
    score: float  # logarithm of how much better it explains the touches, its unknowns paid for
    moved: Array  # (p,) by which it moves every unknown, in standard deviations
    columns: Array  # (touches, k) mm a unit; 0 where it does not act


@dataclass(frozen=True)
class Left:
    """Touches that count, over their scatter, and what the unknowns leave of them."""

    rows: NDArray[np.int64]  # (n,) which touches
    weight: Array  # (n,) one over the scatter of each, 1/mm
    basis: Array  # (n, q) such that basis basisᵀ is what the unknowns take
    back: Array  # (q, p) from there to the unknowns, in mm, rad …
    gaps: Array  # (n,) what is left
    spare: float
    std: Array  # (p,)


def lacking(result: Estimate, level: float = LEVEL) -> Iterator[Remark]:
    """estimate by the noise of its residuals, level → a remark where the residuals show a pattern that moves parameters."""
    found = patterns(result, level)
    if not found:
        return
    p = len(result.model.coefficients)
    moved = np.max([np.abs(f.moved[:p]) for f in found], axis=0)
    if moved.max(initial=0.0) < MOVED:
        return
    best = max(found, key=lambda f: (round(f.score), f.what == "position"))  # an error motion of its own can stand for it
    names = [result.model.names[int(j)] for j in np.argsort(-moved) if moved[j] > TOUCHED]
    text = say(
        "plausible.lacking.found",
        what=place_words(result.model.touches, best),
        names=joined(", ", [result.selection.label(n) for n in names[:SHOWN]]),
        size=f"{float(moved.max()):.0f}",
    )
    if _any_shape(result, found) or _more(result, best, level):
        text = joined(". ", (text, say("plausible.lacking.any_shape")))
        yield Remark("doubtful", text, moves=tuple(result.model.names[:p]))
    else:
        yield Remark("doubtful", text, moves=tuple(names))


def place_words(touches: Touches, found: Pattern) -> str:
    """touches, pattern → what it looks like, with the touches or the places between which it lies."""
    number, between = touches.number, _between(touches, found)
    kind = "band_at" if found.what == "band" and between.get("low") == between.get("high") else found.what
    return say(f"plausible.lacking.{kind}", axis=found.axis, first=number[found.first], last=number[found.last], **between)


def _any_shape(result: Estimate, found: Sequence[Pattern]) -> bool:
    """→ whether what was found stands for a shape that nobody knows, so that what it moves is unknown, too.

    A compensation is a table of any numbers. Walk or seating beyond the scatter has taken up a part of what is no walk.
    """
    noise = result.noise
    wandered = noise is not None and max(noise.walk, noise.seating) > noise.white
    return wandered or any(f.what.startswith("compensation") for f in found)


def _more(result: Estimate, best: Pattern, level: float) -> bool:
    """→ whether the residuals show another pattern beside the best one: then that one only resembles what it was."""
    left = left_over(result)
    return left is not None and bool(found_in(result.model.touches, without(left, best.columns), level))


def without(left: Left, columns: Array) -> Left:
    """what the unknowns leave, (touches, k) mm a unit of a pattern → what they leave together with it."""
    seen = columns[left.rows] * left.weight[:, None]
    rest = seen - left.basis @ (left.basis.T @ seen)
    value, turn = np.linalg.eigh(seen.T @ rest)
    keep = value > FAINT * max(float(value.max(initial=0.0)), 1e-300)
    along = rest @ turn[:, keep] / np.sqrt(value[keep])
    pull = (seen @ turn[:, keep]).T @ left.gaps / np.sqrt(value[keep])
    back = np.vstack([left.back, np.zeros((int(keep.sum()), left.back.shape[1]))])
    basis = np.hstack([left.basis, along])
    return replace(left, basis=basis, back=back, gaps=left.gaps - along @ pull, spare=left.spare - int(keep.sum()))


def _between(touches: Touches, found: Pattern) -> dict[str, str]:
    """→ the places of its axis between which a pattern lies, for its words; none where it has no axis of its own."""
    if found.axis not in touches.machine.names:
        return {}
    at = touches.axis(found.axis)[[found.first, found.last]]
    low, high = np.degrees(at) if found.axis in touches.machine.rotary else at
    unit = "°" if found.axis in touches.machine.rotary else " mm"
    return {"low": f"{low:.6g}{unit}", "high": f"{high:.6g}{unit}"}


def patterns(result: Estimate, level: float = LEVEL) -> list[Pattern]:
    """estimate by the noise of its residuals, level → patterns that its residuals show, whatever they do to the parameters."""
    touches = result.model.touches
    if result.noise is None or len(touches) > LARGEST:
        return []
    left = left_over(result)
    if left is None or left.spare < SPARE:
        return []
    return found_in(touches, left, level)


def found_in(touches: Touches, left: Left, level: float) -> list[Pattern]:
    """touches, what some unknowns leave of them, level → patterns in it that chance makes no more often than the level says."""
    return [*_steady(touches, left, level), *_moments(touches, left, level), *_bands(touches, left, level)]


def left_over(result: Estimate, every: bool = False) -> Left | None:
    """estimate by the noise of its residuals, whether touches without weight count too → what the unknowns leave of its touches;
    None where nothing scatters."""
    noise, n = result.noise, len(result.residuals)
    assert noise is not None
    rows = np.flatnonzero(~result.unused | every)
    facets = result.model.touches.facet
    scatter = np.array([noise.facets.get(facets[i], noise.white) for i in rows])
    if not scatter.size or scatter.min() <= 0:
        return None
    offsets, jacobian, uncertainty = known(result.model, result.values)
    own = np.vstack([result.jacobian[:n][rows] / scatter[:, None], jacobian / uncertainty[:, None]])
    p, columns = own.shape[1], noise.columns
    size = np.linalg.norm(own, axis=0)
    size = np.where(size > 0, size, 1.0)
    full = own / size
    right = np.concatenate([result.residuals[rows] / scatter, offsets / uncertainty])
    penalty = np.zeros(p)
    if columns is not None:
        more = columns[rows] * (noise.white / scatter)[:, None]
        full = np.hstack([full, np.vstack([more, np.zeros((len(offsets), more.shape[1]))])])
        penalty = np.concatenate([penalty, np.ones(more.shape[1])])
    normal = full.T @ full
    normal[np.diag_indices_from(normal)] += penalty + RIDGE
    try:
        root = linalg.cholesky(normal, lower=True, check_finite=False)
    except linalg.LinAlgError:
        return None
    basis = linalg.solve_triangular(root, full.T, lower=True, check_finite=False).T
    back = linalg.solve_triangular(root, np.eye(len(root)), lower=True, check_finite=False)[:, :p] / size
    gaps = right - basis @ (basis.T @ right)
    touched = basis[: len(rows)]
    return Left(
        rows, 1 / scatter, touched, back, gaps[: len(rows)], len(rows) - float(np.sum(touched**2)), np.linalg.norm(back, axis=0)
    )


def _steady(touches: Touches, left: Left, level: float) -> Iterator[Pattern]:
    """Patterns on all touches: an axis that errs with its position, a drift, a probe that reads by direction, a screw."""
    for group in (list(candidates(touches)), list(periodic(touches))):
        for what, axis, columns in group:
            gain, free, moved = steady(left, columns)
            score = _score(np.array([gain]), np.array([free]), left.spare, level / len(group))
            if score[0] > 0:
                yield Pattern(what, axis, 0, len(touches) - 1, float(score[0]), moved / left.std, columns)


def steady(left: Left, columns: Array) -> tuple[float, float, Array]:
    """(touches, k) mm a unit of a pattern on all touches → χ² that it takes out, degrees of freedom, by how much unknowns move."""
    seen = columns[left.rows] * left.weight[:, None]
    gram = seen.T @ seen
    within = left.basis.T @ seen
    gain, free, beta = gained(gram[None], (gram - within.T @ within)[None], (seen.T @ left.gaps)[None])
    return float(gain[0]), float(free[0]), -(left.back.T @ (within @ beta[0]))


def _moments(touches: Touches, left: Left, level: float) -> Iterator[Pattern]:
    """Patterns that begin at one touch, or last from one indexation to another: the best of each kind."""
    n = len(left.rows)
    begin, end = moments(touches, left)
    kinds = list(movable(touches))
    for what, axis, columns in kinds:
        found = _stretch(left, np.arange(n), columns, begin, end, level / len(kinds))
        if found is not None:
            rows, score, moved = found
            last = int(rows[-1]) == int(left.rows[-1])
            word = what if last else f"{what}_while"
            yield Pattern(word, axis, int(rows[0]), int(rows[-1]), score, moved, _on(columns, rows))


def moments(touches: Touches, left: Left) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """→ first row and one past the last of what begins at a touch and stays, or lasts from one indexation to another."""
    index = touches.indexation[left.rows]
    n = len(index)
    turns = np.flatnonzero(np.diff(index, prepend=index[:1])) if n else np.empty(0, dtype=np.int64)
    edges = np.unique(np.concatenate([[0], turns, [n]])).astype(np.int64)
    i, j = np.triu_indices(len(edges), 1)
    later = np.arange(FEWEST, n - FEWEST + 1)
    return np.concatenate([later, edges[i]]), np.concatenate([np.full(len(later), n), edges[j]])


def _bands(touches: Touches, left: Left, level: float) -> Iterator[Pattern]:
    """An axis that is elsewhere in a part of its travel: a clamp that lets go there, a joint of its scale, a damaged tooth."""
    axes = (*touches.machine.rotary, *touches.machine.linear)
    for axis in axes:
        at = touches.axis(axis)[left.rows]
        order = np.argsort(at, kind="stable")
        apart = np.diff(at[order]) > (NEAR_ANGLE if axis in touches.machine.rotary else NEAR_PLACE)
        edges = np.concatenate([[0], np.flatnonzero(apart) + 1, [len(at)]]).astype(np.int64)
        i, j = np.triu_indices(len(edges), 1)
        if len(edges) > MOST:  # places of a linear axis: from one on only
            i, j = np.arange(len(edges) - 1), np.full(len(edges) - 1, len(edges) - 1)
        found = _stretch(left, order, touches.lever(axis)[:, None], edges[i], edges[j], level / len(axes))
        if found is not None:
            rows, score, moved = found
            own = _on(touches.lever(axis)[:, None], rows)
            yield Pattern("band", axis, int(rows[0]), int(rows[-1]), score, moved, own)


def _on(columns: Array, rows: NDArray[np.int64]) -> Array:
    """→ the same columns on these rows, 0 elsewhere."""
    result = np.zeros_like(columns)
    result[rows] = columns[rows]
    return result


@dataclass(frozen=True)
class Stretches:
    """Stretches of an order of the touches, and what one pattern takes out of each."""

    begin: NDArray[np.int64]  # (m,) first of the order
    end: NDArray[np.int64]  # (m,) one past the last
    gain: Array  # (m,) χ²
    free: Array  # (m,) its degrees of freedom
    inside: Array  # (m, q, k) what the unknowns take of the pattern
    beta: Array  # (m, k) its size


def stretches(
    left: Left, order: NDArray[np.int64], columns: Array, begin: NDArray[np.int64], end: NDArray[np.int64]
) -> Stretches | None:
    """rows in an order, (touches, k) mm a unit, first and one past the last of stretches of that order → what the pattern takes out
    of each; None where all are too short."""
    n = len(order)
    keep = (end - begin >= FEWEST) & (end - begin <= n - FEWEST)
    begin, end = begin[keep], end[keep]
    if not len(begin):
        return None
    basis, seen = left.basis[order], columns[left.rows[order]] * left.weight[order][:, None]

    def after(rows: Array) -> Array:
        return np.asarray(np.concatenate([np.cumsum(rows[::-1], axis=0)[::-1], np.zeros((1, *rows.shape[1:]))]))

    within = after(np.einsum("ij,ik->ijk", basis, seen))
    plain = after(np.einsum("ij,ik->ijk", seen, seen))
    pull = after(seen * left.gaps[order][:, None])
    inside = within[begin] - within[end]
    gram = plain[begin] - plain[end]
    gain, free, beta = gained(gram, gram - np.matmul(inside.transpose(0, 2, 1), inside), pull[begin] - pull[end])
    return Stretches(begin, end, gain, free, inside, beta)


def _stretch(
    left: Left, order: NDArray[np.int64], columns: Array, begin: NDArray[np.int64], end: NDArray[np.int64], level: float
) -> tuple[NDArray[np.int64], float, Array] | None:
    """→ the rows of the stretch in which the pattern explains most, its score, by how much it moves each unknown; None where it
    explains no more than chance."""
    tried = stretches(left, order, columns, begin, end)
    if tried is None:
        return None
    score = _score(tried.gain, tried.free, left.spare, level / len(tried.begin))
    best = int(np.argmax(score))
    if not score[best] > 0:
        return None
    rows = left.rows[order[tried.begin[best] : tried.end[best]]]
    return rows, float(score[best]), -(left.back.T @ (tried.inside[best] @ tried.beta[best])) / left.std


def gained(plain: Array, gram: Array, pull: Array) -> tuple[Array, Array, Array]:
    """(m, k, k) squares of patterns, the same of what the unknowns leave of them, (m, k) → χ² that each takes out, its degrees of
    freedom, (m, k) its size."""
    square = np.diagonal(plain, axis1=1, axis2=2)
    # A column that these touches do not see is rounding: made as long as the others it would explain anything.
    size = np.sqrt(np.maximum(square, NOTHING * square.max(axis=1, initial=0.0)[:, None] + 1e-30))
    scaled = gram / (size[:, :, None] * size[:, None, :])
    value, turn = np.linalg.eigh(scaled)
    along = np.einsum("mij,mi->mj", turn, pull / size)
    enough = value > FAINT
    weight = np.where(enough, along / np.where(enough, value, 1.0), 0.0)
    beta = np.einsum("mij,mj->mi", turn, weight) / size
    return (along * weight).sum(axis=1), enough.sum(axis=1), beta


def _score(gain: Array, free: Array, spare: float, level: float) -> Array:
    """χ² taken out, degrees of freedom of the pattern and of the touches, level → how much further than the level allows it is."""
    rest = np.maximum(spare - free, 1.0)
    ratio = gain / np.maximum(free, 1) / (np.maximum(spare - gain, 1e-3 * spare) / rest)
    chance = special.fdtrc(np.maximum(free, 1), rest, ratio)
    return np.where(free > 0, np.log(level) - np.log(np.maximum(chance, 1e-300)), -1.0)
