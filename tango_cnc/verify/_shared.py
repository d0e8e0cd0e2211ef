"""What the checks have in common: figures of a set of residuals, and the chain as estimated, at any pose."""

from __future__ import annotations

from dataclasses import dataclass

from .. import kinematics
from ..estimate import Estimate
from ..kinematics import Slot
from ..model import RADIUS, Model, errors
from ..records import Array
from ..terms import GAP
from ..touches import Touches


@dataclass(frozen=True)
class Figures:
    """How large a set of residuals is, mm; `sd` about the mean, as the thesis prints it."""

    count: int
    max: float
    min: float
    mean: float
    sd: float

    @property
    def range(self) -> float:
        """→ mm, largest minus smallest."""
        return self.max - self.min

    @property
    def worst(self) -> float:
        """→ mm, largest size."""
        return max(abs(self.max), abs(self.min))


def figures(residuals: Array) -> Figures:
    """(n,) mm → their figures; all zero for none."""
    if not len(residuals):
        return Figures(0, 0.0, 0.0, 0.0, 0.0)
    sd = float(residuals.std(ddof=1)) if len(residuals) > 1 else 0.0
    return Figures(len(residuals), float(residuals.max()), float(residuals.min()), float(residuals.mean()), sd)


def acting(result: Estimate, touches: Touches) -> dict[Slot, Array]:
    """estimate, touches (n) → error at every slot of the chain (n,) mm or rad, and at GAP what acts on the touch itself, mm."""
    model = result.model
    return errors(Model(touches, model.coefficients), result.values[: len(model.coefficients)])


def tips(result: Estimate, touches: Touches) -> Array:
    """estimate, touches (n) → (n, 3) mm, predicted tip centre in the table frame, stylus included."""
    found = {slot: value for slot, value in acting(result, touches).items() if slot not in (GAP, RADIUS)}
    return kinematics.tip(touches.chain, touches.position, found)
