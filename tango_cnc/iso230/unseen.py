"""Harmonics of rotary axes that the touches do not feel, or take for lower ones.

A rotary axis that is touched every 45° shows nothing of sin 4C, and its cos 5C looks like cos 3C. The machine has them all the
same, and a figure is read off the whole curve. So each is allowed for: as large as the harmonics of its error motion that are
fitted, falling with its order, and less where the residuals would have shown it. What the fit takes it for is taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model import Model, linearise
from ..records import Array
from ..terms import Coefficient
from ..texts import joined, say
from ..touches import Touches
from .onpart import Ask
from .whole import Whole, motion_of, waves

HIGHEST = 6  # harmonic: no higher one is compared either
OPEN = 0.5  # of its size before the touches are looked at: a harmonic that keeps more is not seen


@dataclass(frozen=True)
class Unseen:
    """Harmonics beside those of a fit: each is 0 ± `std`, and independent of the others."""

    coefficients: tuple[Coefficient, ...]
    orders: tuple[int, ...]
    before: Array  # (k,) mm or rad, before the touches are looked at
    std: Array  # (k,) with them
    taken: Array  # (p, k) what the fit makes of one mm or rad of each

    def parts(self, asks: Sequence[Ask], beside: Sequence[Ask]) -> dict[tuple[str, str], tuple[Array, ...]]:
        """figures by the coefficients of the fit, the same by these → (kind, name): what each adds to it, in its unit."""
        own, found = {(a.kind, a.name): a.curve for a in beside}, {}
        for ask in asks:
            left = ask.factor * (own.get((ask.kind, ask.name), 0.0) - ask.curve @ self.taken) * self.std
            found[ask.kind, ask.name] = tuple(part for part in np.moveaxis(left, -1, 0) if np.any(part))
        return found

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
    """touches, axis → how many of its positions differ; a rotary axis that has turned round once is where it was."""
    at = touches.axis(axis)
    if axis in touches.machine.linear:
        return len(np.unique(np.round(at, 3)))
    return len(np.unique(np.round(np.column_stack([np.cos(at), np.sin(at)]), 3) + 0.0, axis=0))


def unseen(wide: Whole, learned: Whole) -> Unseen:
    """machine under the wide prior and under learned sizes → harmonics to `HIGHEST` that neither fits."""
    assert wide.leave is not None and learned.gain is not None and learned.widths is not None
    machine = wide.touches.machine
    size_of = {c.name: float(width) for c, width in zip(learned.coefficients, learned.widths, strict=True) if width > 0}
    found = []
    for axis in machine.rotary:
        usual: dict[str, float] = {}
        every = [(c, order) for order in range(1, HIGHEST + 1) for c in waves(machine, axis, order)]
        for c, _ in every:
            if c.name in size_of:
                usual[motion_of(c)] = min(size_of[c.name], usual.get(motion_of(c), np.inf))
        for c, order in every:
            if c.name not in size_of and motion_of(c) in usual:
                found.append((c, order, usual[motion_of(c)] * _falling(order, wide.order[1])))
    chosen, size = tuple(c for c, _, _ in found), np.array([s for _, _, s in found])
    model = Model(wide.touches, chosen)
    _, jacobian = linearise(model, np.zeros(len(model.names)))
    moved = np.zeros((wide.leave.shape[1], len(chosen)))
    moved[: len(wide.touches)] = jacobian[:, : len(chosen)]
    shown = size * np.linalg.norm(wide.leave @ moved, axis=0) / wide.sigma
    std = size / np.sqrt(1 + shown**2)
    return Unseen(chosen, tuple(order for _, order, _ in found), size, std, learned.gain @ moved)


def _falling(order: int, fitted: int) -> float:
    """order, highest harmonic of the fit → its size by the root mean square of those fitted, where sizes fall as 1 / order."""
    return float(1 / order / np.sqrt(np.mean(1 / np.arange(1, fitted + 1) ** 2)))
