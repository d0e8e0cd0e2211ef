"""A program and its features by the machines that the touches leave possible, as `tango iso230` and `accept` have them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..acceptance.further import possible
from ..acceptance.open_features import MEASURED, Left, undecided_by
from ..compensate.fit import Known
from ..estimate import Estimate
from ..iso230.doubt import UNDECIDED, VOLUME, lengths, nearest
from ..iso230.seen import seen
from ..iso230.whole import motion_of
from ..nc.features import Tool, cut
from ..nc.follow import Setup
from ..nc.predict import Way, levers, machinery
from ..records import Array, TangoError
from ._budget import budget_of

POINTS = 200  # of a program at which the machines are compared
FAINT = 0.05  # µm rms: less is no cause
BY_LENGTH = (
    "; the length of the tool is why: as long as the stylus ({stylus:g} mm) it would leave {std:.1f} µm. Touch again with a second "
    "stylus about as long as the tool (docs/verify.md, A second stylus)"
)
SIDE = 0.95  # of the machines have no larger deviation


@dataclass(frozen=True)
class Machines:
    """Every error motion: as machines that are possible, and as the touches leave it open."""

    known: Known
    wide: Known
    measured: Known  # as `wide`, with a tool that was measured against the probe
    lengths: tuple[float, ...]  # mm, of the styli that touched

    @property
    def left(self) -> Left:
        """→ what is left open of a feature."""
        return Left(self.wide, None, self.measured, self.lengths)


def machines(folder: Path, result: Estimate, tool: Tool | None = None) -> Machines | str:
    """cell, estimate, what is stated of the tool → machines that its touches allow, with the uncertainty that the cell states; a
    sentence with the reason where the touches allow none.
    """
    try:
        found = seen(result, budget_of(folder, result))
    except TangoError as error:
        return str(error)
    machine = result.model.touches.machine
    known, wide = (possible(w, machine, tool=tool) for w in (found.learned, found.wide))
    return Machines(known, wide, possible(found.wide, machine, tool=MEASURED), lengths(found.wide.touches))


def aligned(way: Way, setup: Setup, of: Machines, tool: Tool | None = None) -> dict[str, Any]:
    """way, set-up, machines, what is stated of the tool → how far the tip is at most, µm, of the part as it lies best on its
    program, and what makes it so; or why that is withheld.

    How a table lies is set up by the touches and by whoever clamps a part. What is left moves every axis, and may be as uncertain
    as a volume. `at_most_um` is a limit of one side, 95 %: scatter in many directions makes a largest deviation larger, and what
    it is at least cannot be told as well.
    """
    chosen = np.unique(np.linspace(0, len(way.at) - 1, min(POINTS, len(way.at))).astype(int))
    at, tool_lengths = np.array(way.at)[chosen], np.array(way.tool)[chosen]
    free, setup = _without_set_up(np.array(way.position)[chosen]), cut(setup, tool)
    if tool is not None and len(np.unique(tool_lengths)) > 1:
        return _withheld("the program has tools of several lengths, and nothing states how these stand against each other")

    def moved(known: Known, longer: float = 0.0) -> Array:
        """machine, mm by which every tool is longer and Z further up → (n, 3, p) µm per unit of every coefficient."""
        found = np.zeros((len(at), 3, len(known.coefficients)))
        for length in np.unique(tool_lengths):
            own = tool_lengths == length
            there = at[own].copy()
            there[:, setup.machine.column("Z")] += longer
            found[own] = levers(machinery(setup, known, float(length) + longer), there)
        return (free @ found.reshape(3 * len(at), -1)).reshape(found.shape) * 1e3

    def left(longer: float = 0.0) -> float:
        """→ µm, standard deviation of the place that is known worst, in its worst direction."""
        open_to = moved(of.wide, longer)
        spread = np.einsum("nip,pq,njq->nij", open_to, of.wide.covariance, open_to, optimize=True)
        return float(np.sqrt(np.clip(np.linalg.eigvalsh(spread)[:, -1], 0.0, None)).max())

    most = VOLUME * UNDECIDED["µm"]
    why = undecided_by(left(), most)
    if why:
        length = float(tool_lengths[0])
        near = nearest(length, of.lengths) if len(np.unique(tool_lengths)) == 1 else None
        std = np.inf if near is None else left(near - length)
        return _withheld(why if near is None or std > most else why + BY_LENGTH.format(stylus=near, std=std))
    curve, drawn = moved(of.known), of.known.drawn
    assert drawn is not None
    best, every = curve @ of.known.values, curve @ (of.known.values[:, None] + drawn)
    highest = float(np.quantile(np.linalg.norm(every, axis=1).max(axis=0), SIDE))
    largest, (causes, mixed) = float(np.linalg.norm(best, axis=1).max()), _causes(of.known, curve)
    return {"largest_um": round(largest, 4), "at_most_um": round(highest, 4), "why": "", "causes": causes, "mixed": mixed}


def _withheld(why: str) -> dict[str, Any]:
    return {"largest_um": None, "at_most_um": None, "why": why, "causes": [], "mixed": None}


def _causes(known: Known, curve: Array) -> tuple[list[dict[str, Any]], dict[str, Any] | None]:
    """machines, (n, 3, p) µm per unit of every coefficient → what each error motion does along the way, rms with its 95 %
    interval, the largest first; and those that the touches cannot tell from each other, with what these do together.
    """
    assert known.drawn is not None
    motions = np.array([motion_of(c) for c in known.coefficients])
    causes, mixed = [], []
    for name in dict.fromkeys(motions.tolist()):
        one, std = _done(known, curve, motions == name)
        if std > UNDECIDED["µm"]:
            mixed.append(name)
        elif one["high_um"] > FAINT:
            causes.append({"name": name, **one})
    together = {"names": mixed, **_done(known, curve, np.isin(motions, mixed))[0]} if mixed else None
    return sorted(causes, key=lambda c: -float(c["rms_um"])), together


def _done(known: Known, curve: Array, own: NDArray[np.bool_]) -> tuple[dict[str, float], float]:
    """machines, (n, 3, p) µm per unit, which coefficients → what these do, µm rms: the median of the machines, as of a range, and
    where 95 % of them lie; standard deviation of it at a place, µm.
    """
    assert known.drawn is not None
    around = np.tensordot(curve[..., own], known.drawn[own], axes=1)  # (n, 3, d)
    every = (curve[..., own] @ known.values[own])[..., None] + around
    low, middle, high = np.quantile(np.sqrt(np.mean(np.sum(every**2, axis=1), axis=0)), [0.025, 0.5, 0.975])
    found = {f"{k}_um": round(float(v), 4) for k, v in (("rms", middle), ("low", low), ("high", high))}
    return found, float(np.sqrt(np.mean(np.sum(around**2, axis=1))))


def _without_set_up(points: Array) -> Array:
    """(n, 3) mm, points of the table → (3n, 3n) deviations → what the best rigid motion of the part leaves of them."""
    arm = points - points.mean(axis=0)
    rigid = np.concatenate([np.stack([np.tile(e, (len(arm), 1)), np.cross(e, arm)]) for e in np.eye(3)]).reshape(6, -1).T
    return np.asarray(np.eye(len(rigid)) - rigid @ np.linalg.pinv(rigid, rcond=1e-9))
