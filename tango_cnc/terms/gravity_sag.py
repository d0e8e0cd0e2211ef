"""The table sags as it tilts: a displacement or a tilt that grows with the sine of the tilting axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..kinematics import Slot
from ..records import COMPONENTS, Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, displaced, early, label, need
from ._world import Effects, toward, vector


def variants(touches: Touches) -> Variants:
    """touches → displacements and tilts with every rotary axis that is not turned fully round."""
    for axis in touches.machine.rotary:
        if 0.3 < np.ptp(touches.axis(axis)) < 1.4 * np.pi:
            for component in (*COMPONENTS, "XYZ"):
                yield {"axis": axis, "component": component}


def make(machine: Machine, axis: str, component: str = "Y") -> list[Coefficient]:
    """machine, tilting axis, X Y Z or XYZ (displacement, mm), A B C (tilt, rad) → coefficients, times its sine."""
    need("gravity_sag", "axis", axis, machine.rotary)
    need("gravity_sag", "component", component, (*COMPONENTS, "XYZ"))
    stem = label("gravity_sag", axis, component)
    if component in "ABC":
        return [Coefficient(stem, "rad", Slot(axis, "inter", COMPONENTS.index(component)), lambda t: np.sin(t.axis(axis)))]
    if component == "XYZ":
        return displaced(stem, "machine", lambda t: np.sin(t.axis(axis)))
    i = COMPONENTS.index(component)
    return [early(stem, lambda t: t.machine_normal[:, i] * np.sin(t.axis(axis)))]


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the axis sinks or gives way; a tilt about another axis is a wave of order 1 (world.yaml)."""
    axis, component = str(setting["axis"]), str(setting.get("component", "Y"))
    sense = -1.0 if axis in machine.tool_branch else 1.0
    if component == "XYZ":
        return [{"cause": "gravity_sag", "axis": axis} | vector(sense * values)]
    if component in "XYZ":
        along = [float(c == component) for c in "XYZ"]
        return [{"cause": "gravity_sag", "axis": axis, "amplitude": sense * float(values[0]), "direction": along}]
    if component == axis:
        return [{"cause": "gravity_sag", "axis": axis, "amplitude": 0.0, "direction": [0.0, 0.0, 1.0], "tilt": float(values[0])}]
    about = {"direction": toward(machine, axis, component), "order": 1, "phase": -90.0, "frame": "fixed"}
    return [{"cause": "rotary_tilt", "axis": axis, "amplitude": float(values[0]), **about}]


TERM = Cause(
    text="the table sags under its own weight as it tilts",
    source="ISO 230-1:2012, 3.4.3 (compliance); sine of the tilt as for a beam",
    frame="machine",
    mistaken=("encoder_harmonic", "rotary_tilt"),
    says="the table sags as {axis} tilts, by {size}{toward}",
    meaning="parts that are machined tilted are off by this against parts that are machined level",
    advice="calibrate with the load that is machined, or keep the term",
    refine={},
    variants=variants,
    make=make,
    effects=effects,
)
