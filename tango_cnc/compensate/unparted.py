"""What a run with one orientation of the spindle cannot part: the runout of the stylus, and where the spindle is.

The tip is where both put it, and a control compensates the spindle's place alone. So a run that never turns S says nothing of how
much of the tip's place every tool has. It is as much as was found, less the runout of the stylus, which nobody knows better than
`tolerances.runout` of machine.yaml. None of it is written; all of it is in the promise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimate import Estimate
from ..kinematics import Slot
from ..records import Array
from .promise import Figure
from .space import Poses

SEEN = ("seen_before_um", "seen_after_um")  # of a promise that is wider: the figures of what its touches can see
LEAST = 1e-3  # mm of the tip over the volume per mm: less is the set-up's


@dataclass(frozen=True)
class Unparted:
    """A place of the spindle that the touches took for the stylus' own."""

    levers: Array  # (3n, 2) mm of the tip per mm of EX0S, EY0S, set-up taken out
    size: float  # mm in each direction, one standard deviation

    def with_own(self, values: Array, covariance: Array, levers: Array) -> tuple[Array, Array, Array]:
        """(p,) (p, p) (3n, p) of an estimate → the same with the place of the spindle: zero, as far as anybody knows."""
        p, k = len(values), self.levers.shape[1]
        spread = np.zeros((p + k, p + k))
        spread[:p, :p] = covariance
        spread[p:, p:] = self.size**2 * np.eye(k)
        return np.concatenate([values, np.zeros(k)]), spread, np.hstack([levers, self.levers])


@dataclass(frozen=True)
class Widened:
    """Figures of a `Fit` that contain what its touches could not part or show."""

    rms_before: Figure
    rms_after: Figure
    largest_before: Figure
    largest_after: Figure
    rms_program: Figure
    size: float = 0.0  # mm in each direction, of the spindle
    doubted: tuple[str, ...] = ()  # what no touch shows may move these, and the upper ends contain it
    either: float = 0.0  # µm rms that the answer about tool center point control decides, where nothing proves it; 0: proven


def unparted(result: Estimate, poses: Poses) -> Unparted | None:
    """estimate, poses → the place of the spindle that it cannot know; None where the spindle was turned, and where a set-up takes
    it out."""
    model, machine = result.model, result.model.touches.machine
    if not model.touches.one_orientation:
        return None
    levers = poses.free(np.stack([poses.slots[Slot("S", "inter", i)].ravel() for i in (0, 1)], axis=1))
    if np.linalg.norm(levers) < LEAST * np.sqrt(len(poses)):
        return None
    own = [float(result.values[model.names.index(name)]) for name in ("EXt", "EYt") if name in model.names]
    return Unparted(levers, float(np.sqrt(machine.tolerances.usual_runout**2 + np.sum(np.square(own)) / 2)))


def wider(seen: Figure, drawn: Figure) -> Figure:
    """figure of what touches show, of what may be there → one that holds both: the spindle may stand right, too."""
    return Figure(max(seen.value, drawn.value), min(seen.low, drawn.low), max(seen.high, drawn.high))


def no_less(seen: Figure, drawn: Figure) -> Figure:
    """figure of what touches show, the same with what none of them shows → how much may be, besides; it need not be there."""
    return Figure(seen.value, seen.low, max(seen.high, drawn.high))
