"""The stylus does not come back to where it was: the touch is off along the deflection of the touch before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, early, label, need, normals
from ._world import Effects


def variants(touches: Touches) -> Variants:
    """touches → remembered in the spindle frame, or in the machine frame."""
    yield {"frame": "spindle"}
    if np.ptp(touches.axis("S")) > 0.01:
        yield {"frame": "machine"}


def make(machine: Machine, frame: str = "spindle") -> list[Coefficient]:
    """machine, frame → coefficient in mm: how far the tip stays out along the last touch's outward normal."""
    need("probe_hysteresis", "frame", frame, ("spindle", "machine"))

    def pattern(t: Touches) -> Array:
        normal = normals(t, frame)
        result = np.zeros(len(t))
        # The tip stays out along the normal it was pushed along, and meets a like surface so much later.
        result[1:] = -np.sum(normal[1:] * normal[:-1], axis=1)
        return result

    return [early(label("probe_hysteresis", *(() if frame == "spindle" else (frame,))), pattern)]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the size (world.yaml); the simulated probe remembers in the spindle frame only."""
    if setting.get("frame", "spindle") != "spindle":
        return []
    return [{"cause": "probe_hysteresis", "amplitude": float(values[0])}]


TERM = Cause(
    text="the probe remembers the direction of the touch before",
    source="ISO 230-10:2022, 6.2 (probing repeatability); kinematic re-seating of the stylus",
    frame="spindle",
    mistaken=("backlash",),
    follows="previous touch",
    says="the tip rests {size} to the side of the touch before",
    meaning="a matter of the probe, not of parts; measured positions depend on what was touched before",
    advice="touch twice and use the second touch, have the probe serviced, or keep the term",
    refine={},
    variants=variants,
    make=make,
    effects=effects,
)
