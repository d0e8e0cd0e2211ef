"""What changed: every direction that has a name is tried on the innovation of the night, and the shortest story is told.

A hypothesis is a handful of directions of the state. What it explains is the generalised likelihood ratio of the innovation
along them (Willsky & Jones 1976); ln k a direction is the price, so that six directions do not win over the one that moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, special

from ..records import Array
from .changes import change_of
from .filter import State, Tonight
from .frame import Frame

CLOSE = 6.0  # of the score: hypotheses nearer than this fit nearly as well
UNSEEN = 1e-6  # standard deviations a mm or rad: what no touch of tonight sees is no story
WARMER = 1.0  # K: a smaller change of temperature is no cause


@dataclass(frozen=True)
class Hypothesis:
    """A cause, what it is called, and the (p, m) directions that it moves; unit: of a size along a direction."""

    cause: str
    parameter: str
    directions: Array
    unit: str
    axes: tuple[str, ...] = ()


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

    @property
    def sigmas(self) -> float:
        """→ how many standard deviations its largest direction is from nothing."""
        return float(np.sqrt(self.explained))

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
    stylus = [i for i in range(count) if model.coefficients[i].slot.axis == "t"]
    if stylus:
        found.append(Hypothesis("stylus", "stylus", np.eye(p)[:, stylus], "mm", tuple("XYZ"[: len(stylus)])))
    if (table := _table(followed)) is not None:
        found.append(Hypothesis("table", "table", table, "mm", ("X", "Y", "Z")))
    pretravel = np.zeros((p, 1))
    first = count
    pretravel[first : first + len(model.touches.facets)] = -1.0
    found.append(Hypothesis("pretravel", "probe", pretravel, "mm"))
    for j, facet in enumerate(model.touches.facets):
        found.append(Hypothesis("facet", f"facet {facet}", unit(first + j), "mm"))
    begin = first + len(model.touches.facets)
    for j, ball in enumerate(model.touches.balls):
        found.append(Hypothesis("ball", f"ball {ball}", np.eye(p)[:, begin + 3 * j : begin + 3 * j + 3], "mm", ("X", "Y", "Z")))
    if warmer is not None and abs(warmer) >= WARMER and len(followed.warm):
        directions = np.zeros((p, len(followed.warm)))
        for j, i in enumerate(followed.warm):
            directions[i, j] = 1.0
        found.append(Hypothesis("temperature", "temperature", directions, ""))
    return tuple(found)


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


def name_change(state: State, followed: Frame, tonight: Tonight, tried: Sequence[Hypothesis]) -> Named | None:
    """predicted state, frame, judgement, hypotheses → the one that explains the change best; None where none explains any."""
    k = len(tonight.innovation)
    if not k or not tried:
        return None
    root = np.linalg.cholesky(np.eye(k) + tonight.reduced @ tonight.reduced.T)
    white = linalg.solve_triangular(root, tonight.innovation, lower=True)
    every = np.hstack([h.directions for h in tried])
    inside = linalg.solve_triangular(state.root, every, lower=True)
    patterns = linalg.solve_triangular(root, tonight.reduced @ inside, lower=True)
    scored = []
    begin = 0
    for h in tried:
        m = h.directions.shape[1]
        pattern = patterns[:, begin : begin + m]
        begin += m
        norm = np.linalg.norm(pattern, axis=0)
        visible = norm > UNSEEN
        if not (np.any(visible) if h.cause == "ball" else np.all(visible)):
            continue
        if not np.all(visible):  # a ball is touched from some sides only
            axes = tuple(a for a, v in zip(h.axes, visible, strict=True) if v)
            h = replace(h, directions=h.directions[:, visible], axes=axes)
            pattern, norm, m = pattern[:, visible], norm[visible], len(axes)
        basis, triangle, order = linalg.qr(pattern / norm, mode="economic", pivoting=True)
        rank = int(np.sum(np.abs(np.diag(triangle)) > 1e-6))
        along = basis[:, :rank].T @ white
        explained = float(along @ along) / tonight.scale
        size, std = np.zeros(m), np.full(m, np.inf)
        inverse = linalg.inv(triangle[:rank, :rank])
        size[order[:rank]] = inverse @ along / norm[order[:rank]]
        std[order[:rank]] = np.linalg.norm(inverse, axis=1) * np.sqrt(tonight.scale) / norm[order[:rank]]
        price = np.log(k) * (2 + np.log(m) if h.cause == "temperature" else m)  # one cause, however many unknowns follow it
        rest = max(tonight.statistic / tonight.scale - explained, 0.0)
        remains = float(special.chdtrc(k - rank, rest)) if k > rank else 1.0
        scored.append((explained - price, Named(h, size, std, explained, explained - price, remains, ())))
    if not scored:
        return None
    scored.sort(key=lambda item: -item[0])
    best = scored[0][1]
    near = tuple(n.hypothesis.parameter for score, n in scored[1:] if _alike(best, n, scored[0][0] - score))[:4]
    return Named(best.hypothesis, best.size, best.std, best.explained, best.score, best.remains, near)


def _alike(best: Named, other: Named, behind: float) -> bool:
    """best story, another one, how far its score is behind → whether it fits nearly as well, be it a longer one."""
    if other.hypothesis.cause == "temperature" or best.hypothesis.cause == "temperature":
        return behind < CLOSE
    return best.explained - other.explained < CLOSE
