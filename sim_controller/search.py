"""The first surface that a straight move meets, among all surfaces, without missing one that is only grazed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tango_cnc.records import Array

from . import surfaces
from .probing import Rig
from .roots import bracketed_zero
from .world import place

FINE = 0.05  # mm of tip travel: a graze shorter than this is not seen
SLACK = 1.01  # of a chord against its arc: pieces begin with at most 3° of rotation


def first_contact(r: Rig, start: Array, end: Array, direction: Array, after: float = 0.0) -> tuple[float, int] | None:
    """(k,) ends of a move in mm rad, (k,) directions, s to begin at → (s, surface) of the first contact, or None.

    An interval whose gaps at both ends together exceed its length cannot contain a contact; the others are cut in eight.
    """
    change = end - start
    nodes = np.linspace(after, 1.0, 1 + max(8, _pieces(r, start, change)))
    tips, gaps = _look(r, start, change, direction, nodes)
    if gaps[0].min() <= 0:
        return after, int(gaps[0].argmin())
    while True:
        length = np.linalg.norm(np.diff(tips, axis=0), axis=1) * SLACK
        low = gaps.min(axis=1)
        closed = np.flatnonzero(low <= 0)
        if closed.size:
            nodes, tips, gaps = nodes[: closed[0] + 1], tips[: closed[0] + 1], gaps[: closed[0] + 1]
            length, low = length[: closed[0]], low[: closed[0] + 1]
        suspect = np.flatnonzero((low[:-1] + low[1:] <= length) & (length > FINE))
        if not suspect.size:
            break
        inner = np.linspace(nodes[suspect], nodes[suspect + 1], 9)[1:-1].ravel()
        more_tips, more_gaps = _look(r, start, change, direction, inner)
        order = np.argsort(np.concatenate([nodes, inner]), kind="stable")
        nodes = np.concatenate([nodes, inner])[order]
        tips, gaps = np.concatenate([tips, more_tips])[order], np.concatenate([gaps, more_gaps])[order]
    if gaps[-1].min() > 0:
        return None
    hits = np.flatnonzero(gaps[-1] <= 0)
    low, high = np.full(len(hits), nodes[-2]), np.full(len(hits), nodes[-1])

    def gap(rows: NDArray[np.int64], s: Array) -> Array:
        return _look(r, start, change, direction, s)[1][np.arange(len(rows)), hits[rows]]

    s = bracketed_zero(gap, low, high, gaps[-2, hits], gaps[-1, hits])
    return float(s.min()), int(hits[s.argmin()])


def _pieces(r: Rig, start: Array, change: Array) -> int:
    turning = [r.machine.column(name) for name in (*r.machine.rotary, "S")]
    linear = [r.machine.column(name) for name in r.machine.linear]
    return int(np.ceil(max(np.abs(change[turning]).max() / np.radians(3), np.linalg.norm(change[linear]) / 20)))


def _look(r: Rig, start: Array, change: Array, direction: Array, s: Array) -> tuple[Array, Array]:
    """→ (n, 3) tips and (n, m) gaps at those s."""
    positions = start + s[:, None] * change
    tip = place(r.true, positions, np.broadcast_to(direction, positions.shape)).tip
    return tip, surfaces.gaps(r.surfaces, tip)
