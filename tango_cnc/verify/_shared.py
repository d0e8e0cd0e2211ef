"""What the checks have in common: figures of a set of residuals, and the chain as estimated, at any pose."""

from __future__ import annotations

from dataclasses import dataclass

from .. import kinematics
from ..estimate import Estimate
from ..kinematics import Slot
from ..model import Model, errors
from ..records import Array
from ..touches import Touches, of_facets


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


def at_poses(touches: Touches, position: Array, direction: Array) -> Touches:
    """touches of the same machine, (n, k) mm rad, (n, k) −1 0 1 → poses at which coefficients can be evaluated."""
    anywhere = next(iter(touches.artefact.facets))
    return of_facets(touches.machine, touches.artefact, [anywhere] * len(position), position, direction)


def acting(result: Estimate, poses: Touches, setup: bool) -> dict[Slot, Array]:
    """estimate, poses (n) → error at every slot of the chain (n,) mm or rad; stylus and table placement only with `setup`."""
    model = result.model
    found = errors(Model(poses, model.coefficients), result.values[: len(model.coefficients)])
    return {slot: value for slot, value in found.items() if slot.axis and (setup or not is_setup(slot))}


def is_setup(slot: Slot) -> bool:
    """slot → whether it belongs to stylus or table placement and not to the machine."""
    return slot.stage in ("stylus", "table")


def tips(result: Estimate, poses: Touches, setup: bool = True) -> Array:
    """estimate, poses (n) → (n, 3) mm, predicted tip centre in the table frame."""
    return kinematics.tip(poses.chain, poses.position, acting(result, poses, setup))
