"""Exchanges for what is worst of many: directions of the tool tip at many poses, parameters by their limits.

A weighted mean of the many, with more weight on what is worst, leads most of the way. Swaps that are judged by the worst itself
lead on from there, and touches given up at random out of where none does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .criterion import Criterion, parts, value
from .exchange import Draft

LEVELS = 12  # choices with more weight on what is worst
UNSTICK = 80  # times that some is given up at random for what takes most out of what is worst
FEWER = 60  # unknowns; with more of them swaps are not judged by the worst itself
NEAR = 1.4  # times what is best so far; what is worse is not looked at more closely
GAINS = 1e-4  # of φ: a swap that gains less is not made
LOOKED = 6  # of the many, the worst without a touch: what these forbid is not worked out for the others


def worst_first(draft: Draft, seconds: float, many: Criterion, thorough: bool) -> NDArray[np.bool_]:
    """draft, s, criterion of the worst of many, whether to go on where no exchange leads → (n,) mask that is no worse."""
    small = draft.rows.shape[1] <= FEWER
    chosen = _levelled(draft, seconds, many)
    if not thorough:
        return chosen
    draft.chosen = chosen
    draft.renew()
    if small:
        sharpened(draft, seconds, many)
    return _unstuck(
        draft, seconds, many, draft.chosen.copy(), min(int(UNSTICK * (FEWER / draft.rows.shape[1])), 5 * len(draft.rows)), small
    )


def sharpened(draft: Draft, seconds: float, many: Criterion) -> None:
    """draft, s, criterion of the worst of many: swaps touches at the indexations that are visited while the worst gets better."""
    assert many.worst is not None
    aims, spare, longer = many.worst, seconds - draft.seconds, draft.costs.touch
    for _ in range(int(draft.chosen.sum())):
        leaving, entering = np.flatnonzero(draft.chosen & ~draft.needed), draft.offered()
        covariance, aimed = draft.state.covariance, draft.state.variances(aims)
        told = draft.rows[leaving] @ covariance
        left = 1 - np.einsum("ap,ap->a", told, draft.rows[leaving])
        leaving, told, left = leaving[left >= 1e-9], told[left >= 1e-9], left[left >= 1e-9]
        if not len(entering) or not len(leaving):
            break
        # a: a touch that leaves, b: one that enters. (a, k) variances without a; (b, k) covariances of b with the aims.
        lost, along = told @ aims.T, draft.rows[entering] @ covariance @ aims.T
        cross = told @ draft.rows[entering].T / left[:, None]
        without = aimed + lost**2 / left[:, None]
        own = np.einsum("bp,bp->b", draft.rows[entering] @ covariance, draft.rows[entering])
        size = 1 + own + cross**2 * left[:, None]
        at = np.argpartition(without, -min(LOOKED, len(aimed)), axis=1)[:, -LOOKED:]
        a = np.arange(len(leaving))[:, None]
        told_there = along.T[at] + lost[a, at][:, :, None] * cross[:, None, :]
        least = (without[a, at][:, :, None] - told_there**2 / size[:, None, :]).max(axis=1)
        least[longer[entering] - longer[leaving][:, None] > spare + 1e-9] = np.inf
        best: tuple[float, int, int] = (float(aimed.max()) * (1 - GAINS), -1, -1)
        for i in np.argsort(least.min(axis=1), kind="stable").tolist():
            some = np.flatnonzero(least[i] < best[0])
            if not len(some):
                break
            worst = (without[i] - (along[some] + np.outer(cross[i, some], lost[i])) ** 2 / size[i, some, None]).max(axis=1)
            k = int(np.argmin(worst))
            if worst[k] < best[0]:
                best = float(worst[k]), int(leaving[i]), int(entering[some[k]])
        if best[1] < 0:
            break
        spare -= float(longer[best[2]] - longer[best[1]])
        draft.chosen[best[1]], draft.chosen[best[2]] = False, True
        draft.renew()


def _levelled(draft: Draft, seconds: float, many: Criterion) -> NDArray[np.bool_]:
    """draft, s, criterion of the worst of many → (n,) mask: exchanges again and again with more weight on what is worst."""
    best, chosen = value(many, draft.information), draft.chosen.copy()
    assert many.worst is not None
    weights = np.full(len(many.worst), 1 / len(many.worst))
    for level in range(LEVELS):
        weights = weights * parts(many, draft.information)
        weights /= weights.sum()
        draft.criterion = many.with_weights(weights)
        draft.renew()
        draft.swap(seconds)
        if level % 4 == 3:
            draft.retouch(seconds)
        if (now := value(many, draft.information)) < best:
            best, chosen = now, draft.chosen.copy()
    return chosen


def _unstuck(
    draft: Draft, seconds: float, many: Criterion, chosen: NDArray[np.bool_], times: int, small: bool
) -> NDArray[np.bool_]:
    """draft, s, criterion of the worst of many, (n,) mask → (n,) mask that is no worse.

    Gives up visits or touches at random and fills the time with what takes most out of what is worst now.
    """
    rng = np.random.default_rng(len(chosen))
    assert many.worst is not None
    draft.chosen = chosen
    draft.renew()
    now = draft.state.variances(many.worst)
    best = now.max()
    for _ in range(times):
        draft.chosen = chosen.copy()
        weights = now ** float(rng.uniform(1, 6))
        draft.criterion = many.with_weights(weights / weights.sum())
        visited = np.unique(draft.pose[chosen])
        gone = rng.choice(visited, min(len(visited) - 1, int(rng.integers(0, 3))), replace=False)
        draft.chosen[np.isin(draft.pose, gone)] = False
        inside = np.flatnonzero(draft.chosen)
        if not len(gone):
            draft.chosen[rng.choice(inside, min(len(inside) - 1, int(rng.integers(2, 8))), replace=False)] = False
        draft.renew()
        draft.fill(seconds, frozenset(gone[:1].tolist()))
        draft.swap(seconds)
        if small and draft.state.variances(many.worst).max() < NEAR * best:
            sharpened(draft, seconds, many)
        if (reached := draft.state.variances(many.worst)).max() < best * (1 - 1e-9):
            best, now, chosen = reached.max(), reached, draft.chosen.copy()
    return chosen
