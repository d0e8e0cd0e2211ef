"""A test, predicted: every reading and figure with its interval, out of the fit with every error motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import kinematics
from ..estimate import Estimate
from ..iso230.doubt import undecided
from ..iso230.expansion import expanded, stretches, with_column
from ..iso230.onpart import Ask
from ..iso230.poses import all_steady, at_poses
from ..iso230.seen import Budget, seen
from ..iso230.signed import OnPart, told
from ..iso230.temperature import NO_CHANGE, Thermal, scale, state_of
from ..iso230.whole import Whole
from ..kinematics import Slot
from ..records import Array
from ..terms import Coefficient
from .path import Path


@dataclass(frozen=True)
class Row:
    """One figure: the mean, or largest minus smallest, over some readings (or over `weights` of them)."""

    kind: str
    name: str
    weights: Array  # (r, q·n): a range over r combinations of readings; r = 1: a number


@dataclass(frozen=True)
class Predicted:
    """What an instrument should show, µm; readings are about what setting it up takes out."""

    path: Path
    figures: tuple[OnPart, ...]
    rows: tuple[Row, ...]
    value: Array  # (q, n)
    std: Array  # (q, n)
    covariance: Array  # (q·n, q·n) µm²
    free: Array  # (q·n, q·n): readings → readings without what setting it up takes out
    temperature: str
    budget: tuple[str, ...] = ()  # sources that the budget names; empty: the intervals have the scatter of the touches alone


def predict(
    result: Estimate, path: Path, thermal: Thermal | None = None, at_reference: bool = False, budget: Budget | None = None
) -> Predicted:
    """estimate, path, temperatures, whether the instrument gives lengths at 20 °C, budget → what it should show.

    Raises TangoError where there are too few touches.
    """
    machine, free, rows = seen(result, budget), _free(path), rows_of(path)
    q, n = path.ways.shape[:2]
    by_scale = path.name.split("-")[0] in ("laser", "circle")  # in the tests of rotary axes setting up takes scales out
    known = thermal if by_scale else None
    warm, state = NO_CHANGE if known is None else scale(known, at_reference), state_of(known, at_reference)

    def asks_of(w: Whole) -> tuple[Ask, list[Ask]]:
        curve = np.einsum("qni,nip->qnp", path.ways, _shift(path, w.coefficients))
        readings = free @ curve.reshape(q * n, -1)
        asks = [Ask(r.kind, r.name, "µm", 1e3, _weighed(r, readings), "") for r in rows]
        return Ask("", "", "µm", 1e3, readings, "", command=np.asarray(free @ np.tile(path.command, q))), asks

    wide, learned = machine.wide, machine.learned
    (_, asks), (every, owns) = asks_of(wide), asks_of(learned)
    stretched = free @ np.einsum("qni,nip->qn", path.ways, _shift(path, stretches(path.machine))).ravel()
    every, grown = with_column(every, stretched), expanded(learned, warm)
    covariance = every.curve @ grown.covariance @ every.curve.T * 1e6
    std = np.sqrt(np.clip(np.diag(covariance), 0.0, None)).reshape(q, n)
    value = (every.curve @ grown.values * 1e3).reshape(q, n)
    felt = [_weighed(r, stretched) for r in rows]
    figures = tuple(told(a, own, wide, learned, f, warm, undecided(a, wide)) for a, own, f in zip(asks, owns, felt, strict=True))
    return Predicted(path, figures, rows, value, std, covariance, free, state, () if budget is None else budget.named)


def _weighed(row: Row, readings: Array) -> Array:
    found = row.weights @ readings
    return found[0] if len(found) == 1 else found


def _shift(path: Path, coefficients: Sequence[Coefficient]) -> Array:
    """→ (n, 3, p) mm per unit of each coefficient: the tool relative to the workpiece, table frame."""
    poses, n = at_poses(path.machine, path.position, path.direction), len(path.command)
    run = kinematics.trace(poses.chain, path.position)
    found = np.zeros((n, 3, len(coefficients)))
    levers = [kinematics.sensitivity(poses.chain, run, np.tile(e, (n, 1))).slots for e in np.eye(3)]
    for j, value in zip(*all_steady(coefficients, poses), strict=True):
        found[:, :, j] = np.stack([lever[coefficients[j].slot] for lever in levers], axis=1) * value[:, None]
    return found


def _free(path: Path) -> Array:
    """→ (q·n, q·n): takes out where the ball or reflector was put on the table, and for a rotary axis the length of the tool.

    Touches cannot tell the length of the probe from where a rotary axis is along it, and the ball's own tool has its own length.
    """
    q, n = path.ways.shape[:2]
    along = []
    if path.name.split("-")[0] not in ("laser", "circle"):
        chain = kinematics.chain(path.machine)
        run, slot = kinematics.trace(chain, path.position), Slot("t", "stylus", 2)
        along = [np.stack([kinematics.sensitivity(chain, run, np.tile(e, (n, 1))).slots[slot] for e in np.eye(3)], axis=1)]
    placed = list(path.ways)
    if along:
        placed = [np.column_stack([p, np.sum(w * along[0], axis=1)]) for p, w in zip(placed, path.ways, strict=True)]
    groups = [list(range(q))] if path.joint else [[i] for i in range(q)]
    found = np.eye(q * n)
    for group in groups:
        rows = np.concatenate([np.arange(i * n, (i + 1) * n) for i in group])
        columns = np.vstack([placed[i] for i in group])
        found[np.ix_(rows, rows)] -= columns @ np.linalg.pinv(columns, rcond=1e-9)
    return found


def rows_of(path: Path) -> tuple[Row, ...]:
    """path → the figures that a person reads off such a test."""
    q, n = path.ways.shape[:2]
    every = np.eye(q * n).reshape(q * n, q, n)
    there, back = path.sense > 0, path.sense < 0
    if path.name.startswith("laser"):
        plus, minus = _by_command(path, there), _by_command(path, back)
        both = [c for c in plus if c in minus]
        found = []
        if both:
            mean = np.array([(plus[c] + minus[c]) / 2 for c in both])
            jump = np.array([plus[c] - minus[c] for c in both])
            found = [Row("ISO 230-2", "E, bidirectional systematic deviation", every[:, 0, :].T)]
            found += [Row("ISO 230-2", "M, range of mean bidirectional deviation", mean)] if len(both) > 1 else []
            found += [Row("ISO 230-2", "mean reversal value", jump.mean(axis=0)[None])]
        for sign, rows in (("+", plus), ("−", minus)):
            if len(rows) > 1:
                found.append(Row("ISO 230-2", f"E{sign}, unidirectional systematic deviation", np.array(list(rows.values()))))
        return tuple(found)
    found = []
    for i, channel in enumerate(path.channels):
        choices = (("both ways", there | back), ("positive", there), ("negative", back))
        kind = "ISO 230-4" if path.name.startswith("circle") else path.name
        word = "circular deviation" if kind == "ISO 230-4" else f"{channel} deviation"
        for way, chosen in choices:
            if chosen.sum() > 1 and (way == "both ways" or not chosen.all()):
                found.append(Row(kind, f"{word}, {way}", every[:, i, chosen].T))
        if kind == "ISO 230-4" and there.any() and back.any():
            found.append(Row(kind, "mean radial deviation", every[:, 0, :].mean(axis=1)[None]))
    return tuple(found)


def _by_command(path: Path, chosen: NDArray[np.bool_]) -> dict[float, Array]:
    """→ {command: weights (n,)} of the mean reading there."""
    found = {}
    for c in np.unique(np.round(path.command[chosen], 6)):
        at = (chosen & (np.abs(path.command - c) < 1e-6)).astype(float)
        found[float(c)] = at / at.sum()
    return found
