"""A stylus of another length, or a table that is higher? Touches at one indexation see the sum of both.

Theory. A stylus that is e longer than machine.yaml says ends e farther along the spindle at every touch. At one indexation the
direction d of the spindle is the same in the table frame for all of them, so that the table seems moved by −e d: exactly, whatever
the facets. Where rotary axes stand elsewhere d is another one, and a table that is placed with the wrong length is beside by
e |d' − d| there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from . import kinematics
from .records import Array, InputError, Machine

STEPS = 13  # places of each rotary axis over its travel
KNOWN = 0.5  # mm to which the length of a stylus is measured in a shop
WORDS = "from the reference point of the spindle to the centre of the ball"


@dataclass(frozen=True)
class OtherLength:
    """What a stylus of another length explains as well: by how much it would be longer, and how far the table is beside then."""

    longer: float  # mm; below 0: shorter
    beside: float  # mm, where the rotary axes stand worst

    def text(self, length: float) -> str:
        """mm that machine.yaml has → what it means, in a sentence."""
        way, other = ("nearer to", "longer") if self.longer > 0 else ("farther from", "shorter")
        size = f"{abs(self.longer):.2f} mm"
        return (
            f"they fit a table that is {size} {way} the spindle than its file says, and as well a stylus that is {size} {other} "
            f"than the {length:g} mm of machine.yaml. If it is the stylus, a table placed so is up to {self.beside:.1f} mm beside "
            "where the rotary axes stand elsewhere"
        )


def outward(machine: Machine, position: Array) -> Array:
    """machine, (n, axes) mm and rad → (n, 3) unit vectors in the table frame from the spindle to the tip."""
    longer = replace(machine, probe=replace(machine.probe, length=machine.probe.length + 1.0))
    return kinematics.tip(kinematics.chain(longer), position) - kinematics.tip(kinematics.chain(machine), position)


def of_length(machine: Machine, position: Array, points: Array, placed: Array) -> OtherLength:
    """machine, (n, axes) mm and rad of touches at one indexation, (m, 3) mm of facets in the file and in the place that was found →
    what a stylus of another length would explain of it.
    """
    (way,) = outward(machine, position[:1])
    longer = -float(np.mean(placed - points, axis=0) @ way)
    ways = outward(machine, _everywhere(machine))
    return OtherLength(longer, abs(longer) * float(np.linalg.norm(ways - way, axis=1).max()))


def _everywhere(machine: Machine) -> Array:
    """machine → (n, axes) positions of the rotary axes over their travels, linear axes at zero: a strategy of another day may
    go wherever the axes do.
    """
    places = []
    for axis in machine.axes:
        low, high = axis.travel or (-math.pi, math.pi)
        places.append(np.linspace(low, high, STEPS) if axis.name in machine.rotary else np.zeros(1))
    return np.stack([grid.ravel() for grid in np.meshgrid(*places, indexing="ij")], axis=1)


def agrees(machine: Machine, length: float) -> None:
    """Raises InputError where a length that somebody has measured is not that of machine.yaml."""
    if not math.isclose(length, machine.probe.length, abs_tol=KNOWN):
        raise InputError(
            f"--length: found {length:g} mm; allowed: {machine.probe.length:g} mm to {KNOWN:g} mm, as machine.yaml has it "
            f"(probe: length). Which is right? Measure {WORDS}. Correct machine.yaml, or put that stylus in. Nothing was moved"
        )
