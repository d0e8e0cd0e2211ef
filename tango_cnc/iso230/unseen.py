"""Harmonics of rotary axes that the touches do not feel, or take for lower ones.

A rotary axis that is touched every 45° shows nothing of sin 4C, and its cos 5C looks like cos 3C. The machine has them all the
same, and a figure is read off the whole curve. The machines that are drawn have them (`sizes`); here they are named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model import Model, linearise
from ..records import Array
from ..terms import Coefficient
from ..texts import joined, say
from ..touches import Touches
from .whole import Whole, waves

HIGHEST = 6  # harmonic: no higher one is compared either
APART, FINE = 0.01, 0.1  # of the touched range, mm: nearer places of a linear axis count as one
TURNED = float(np.radians(1.0))  # rad, the same of a rotary axis
OPEN = 0.5  # of its size before the touches are looked at: a harmonic that keeps more is not seen


@dataclass(frozen=True)
class Unseen:
    """Harmonics beside those of a fit: each is 0 ± `std`, and independent of the others."""

    coefficients: tuple[Coefficient, ...]
    orders: tuple[int, ...]
    before: Array  # (k,) mm or rad, before the touches are looked at
    std: Array  # (k,) with them

    def said(self, touches: Touches) -> tuple[str, ...]:
        """touches → a sentence for every rotary axis of which they leave harmonics open."""
        found = []
        for axis in touches.machine.rotary:
            left: dict[int, set[str]] = {}
            for c, order, before, std in zip(self.coefficients, self.orders, self.before, self.std, strict=True):
                if c.slot.axis == axis and std > OPEN * before:
                    left.setdefault(order, set()).add(c.name[-3:])
            if left:
                words = [f"{o}" if len(parts) > 1 else f"{o} ({parts.pop()})" for o, parts in sorted(left.items())]
                known = {"axis": axis, "count": positions(touches, axis), "orders": joined(", ", words)}
                found.append(say("iso_said.unseen.harmonics", **known))
        return tuple(found)


def positions(touches: Touches, axis: str) -> int:
    """touches, axis → how many of its positions differ enough to tell more of a curve than one of them does.

    Counted are places of which each is `APART` of the touched range, or `TURNED`, from the one before. A rotary axis that has
    turned round once is where it was.
    """
    at, turns = touches.axis(axis), axis in touches.machine.rotary
    if not len(at):
        return 0
    near = TURNED if turns else max(APART * float(np.ptp(at)), FINE)
    ordered = np.sort(np.mod(at + near / 2, 2 * np.pi) if turns else at)
    places = [float(ordered[0])]
    for place in ordered.tolist():
        if place - places[-1] >= near:
            places.append(place)
    closed = turns and len(places) > 1 and places[0] + 2 * np.pi - places[-1] < near
    return len(places) - int(closed)


def unseen(wide: Whole, drawn: Whole) -> Unseen:
    """machine under the wide prior, machines that are possible → harmonics to `HIGHEST` that the first does not fit."""
    assert wide.leave is not None and wide.widths is not None and drawn.widths is not None
    machine = wide.touches.machine
    fitted = {c.name for c, width in zip(wide.coefficients, wide.widths, strict=True) if width > 0}
    size_of = {c.name: float(width) for c, width in zip(drawn.coefficients, drawn.widths, strict=True) if width > 0}
    every = [(c, order) for axis in machine.rotary for order in range(1, HIGHEST + 1) for c in waves(machine, axis, order)]
    found = [(c, order) for c, order in every if c.name in size_of and c.name not in fitted]
    chosen, size = tuple(c for c, _ in found), np.array([size_of[c.name] for c, _ in found])
    model = Model(wide.touches, chosen)
    _, jacobian = linearise(model, np.zeros(len(model.names)))
    moved = np.zeros((wide.leave.shape[1], len(chosen)))
    moved[: len(wide.touches)] = jacobian[:, : len(chosen)]
    shown = size * np.linalg.norm(wide.leave @ moved, axis=0) / wide.sigma
    return Unseen(chosen, tuple(order for _, order in found), size, size / np.sqrt(1 + shown**2))
