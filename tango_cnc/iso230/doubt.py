"""What is withheld: figures that the touches leave undecided, with the error motions that they cannot be separated from.

Every error motion carries a width before the touches are looked at, far wider than any machine in service (`whole`), and nothing
that is given may rest on it. A volume sums the errors of all linear axes, and may be as uncertain as all three, place or turn.
A volume is judged at the usual order: a bow of degree 5 of 100 µm is in no machine, and would withhold it wherever an axis has a
little of it. Beyond the lengths that were touched with, a tool shows tilts that no touch has seen; there a place has the limit of
one axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..records import Array
from ..touches import Touches
from .onpart import Ask
from .whole import Block, Whole

UNDECIDED = {"µm": 5.0, "µrad": 15.0, "µm/m": 15.0, "µrad/rad": 15.0}  # standard deviation at which a figure is no figure
REVERSAL = 4.0  # µm, the same of a reversal: it is a few µm at most, and its interval rests on what is usual beyond that
ALIKE = 5.0  # mm: styli that differ by less move a tilt of 15 µrad by less than 0.1 µm, which no touch shows
SHARE = 0.15  # of the variance of a figure that an error motion must explain to be named with it
NAMED = 4
VOLUME = 3.0  # times as much of a position or an orientation over a volume
Doubt = tuple[tuple[str, ...], str]  # error motions, and the sentence


def most(ask: Ask, w: Whole) -> float:
    """figure, machine → standard deviation in its unit beyond which it is withheld."""
    # how a tool turns does not depend on its length
    touched = ask.length is not None and (ask.unit == "µrad" or nearest(ask.length, lengths(w.touches)) is None)
    if ask.kind == "reversal" and ask.unit == "µm":
        return REVERSAL
    return UNDECIDED[ask.unit] * (VOLUME if touched else 1.0)


def lengths(touches: Touches) -> tuple[float, ...]:
    """touches → lengths of the styli that made them, mm."""
    machine, used = touches.machine, touches.stylus
    numbers = () if used is None or not machine.styli else np.unique(used)
    return tuple(machine.styli[int(i) - 1].length for i in numbers) or (machine.probe.length,)


def nearest(length: float, touched: Sequence[float]) -> float | None:
    """length of a tool, lengths of styli, mm → the stylus that is nearest to a tool beyond them all; None: it is between them."""
    if not touched or min(touched) - 1e-6 <= length <= max(touched) + 1e-6:
        return None
    return min(touched, key=lambda own: abs(own - length))


def worst(ask: Ask, w: Whole) -> tuple[Array, float]:
    """→ weights (p,) of the part of a figure that is known worst, and its standard deviation in the figure's unit."""
    if not ask.is_range:
        return ask.curve, max(float(ask.curve @ w.covariance @ ask.curve), 0.0) ** 0.5 * ask.factor
    centred = (ask.curve - ask.curve.mean(axis=0) if ask.curve.ndim == 2 else ask.curve).reshape(-1, ask.curve.shape[-1])
    std = np.sqrt(np.clip(np.sum(centred @ w.covariance * centred, axis=1), 0.0, None))
    i = int(np.argmax(std))
    return centred[i], float(std[i]) * ask.factor


def undecided(ask: Ask, w: Whole) -> Doubt | None:
    """figure, machine → the error motions it cannot be separated from, and the sentence why it is withheld; None when it is not."""
    weights, std = worst(ask, w)
    if std <= most(ask, w):
        return None
    mixed = _mixed(ask, weights, w)
    others = f"cannot be separated from {listed(mixed)}" if mixed else "is not decided by these touches"
    blind = tuple(m for m in (ask.own, *mixed) if m in w.unfelt)
    why = f"; no touch feels {listed(blind)}" if blind else ""
    return mixed, f"{ask.name} ({ask.kind}) {others}: its standard deviation would be {std:.0f} {ask.unit} or more{why}"


def _mixed(ask: Ask, weights: Array, w: Whole) -> tuple[str, ...]:
    """→ error motions that explain most of what is undecided in a figure, the strongest first."""
    return strongest([b for b in w.blocks if b[0] != ask.own], w.covariance, weights)


def strongest(blocks: Sequence[Block], covariance: Array, weights: Array) -> tuple[str, ...]:
    """error motions, covariance (p, p), weights (p,) of a number → those that explain most of what is undecided in it, the
    strongest first.
    """
    along = covariance @ weights
    total = float(weights @ along)
    shares = {name: float(along[own] @ inverse @ along[own]) / total for name, own, inverse in blocks}
    found = {name: share for name, share in shares.items() if share > SHARE}
    return tuple(sorted(found, key=lambda m: -found[m])[:NAMED])


def listed(words: tuple[str, ...]) -> str:
    """words → a list of them for people."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
