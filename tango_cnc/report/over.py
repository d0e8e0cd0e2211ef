"""What findings and covariates of a diagnosis are drawn over: places in the unit of people."""

from __future__ import annotations

import numpy as np

from ..diagnose import Diagnosis, Finding, Test
from ..records import Array
from .texts import texts


def shown_over(d: Diagnosis, t: Test) -> tuple[Array, str]:
    """diagnosis, one of its tests → places of the groups in the unit of people, and that unit."""
    machine = d.before.model.touches.machine
    name = t.covariate
    axis = name[-1] if name.startswith("way of ") else name
    if name == "time" or name.startswith("shift "):
        return t.centre / 60, "min"
    if name == "indexation":
        return t.centre + 1, texts()("picture.by_indexation")
    if axis in machine.linear:
        return t.centre, "mm"
    if axis in machine.names:
        return np.degrees(t.centre), "deg"
    if name.startswith("normal "):
        return t.centre, "cosine"
    units = {"order": "touch", "facet": texts()("picture.by_facet"), "feed": "mm/min"}
    return t.centre, units.get(name, "°C" if name.startswith("T_") else texts()("picture.by_motion"))


def covariate_of(d: Diagnosis, f: Finding) -> tuple[str, Array, str]:
    """diagnosis, one of its findings → what it belongs to: name, (n,) values in the unit of people, that unit."""
    touches = d.before.model.touches
    name = str(f.setting.get("by") or f.setting.get("axis") or "")
    if not name and "name" in f.setting:
        name = str(f.setting["name"])[2]
    if f.cause in ("scale_drift", "move_length_memory") or name not in touches.machine.names:
        if f.cause in ("probe_lobing", "pretravel_anisotropy", "spindle_orientation"):
            n = touches.spindle_normal
            return texts()("picture.by_probe"), np.degrees(np.arctan2(n[:, 1], n[:, 0])), "deg"
        return "time", touches.time / 60, "min"
    values = touches.axis(name)
    return (name, values, "mm") if name in touches.machine.linear else (name, np.degrees(values), "deg")
