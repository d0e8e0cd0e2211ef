"""What findings and covariates of a diagnosis are drawn over: places in the unit of people."""

from __future__ import annotations

import numpy as np

from ..diagnose import Diagnosis, Finding, Test
from ..records import Array
from ..terms import causes
from .texts import Texts, texts


def shown_over(d: Diagnosis, test: Test, t: Texts | None = None) -> tuple[Array, str]:
    """diagnosis, one of its tests, texts → places of the groups in the unit of people, and that unit."""
    t = t or texts()
    machine = d.before.model.touches.machine
    name = test.covariate
    axis = name[-1] if name.startswith("way of ") else name
    if name == "time" or name.startswith("shift "):
        return test.centre / 60, t("place.min")
    if name == "indexation":
        return test.centre + 1, t("picture.by_indexation")
    if axis in machine.linear:
        return test.centre, "mm"
    if axis in machine.names:
        return np.degrees(test.centre), "°"
    if name.startswith("normal "):
        return test.centre, t("place.cosine")
    units = {"order": t("place.touch"), "facet": t("picture.by_facet"), "feed": "mm/min"}
    return test.centre, units.get(name, "°C" if name.startswith("T_") else t("picture.by_motion"))


def covariate_of(d: Diagnosis, f: Finding, t: Texts | None = None) -> tuple[str, Array, str]:
    """diagnosis, one of its findings, texts → what it belongs to: name, (n,) values in the unit of people, that unit."""
    t = t or texts()
    touches = d.before.model.touches
    name = str(f.setting.get("by") or f.setting.get("axis") or "")
    if not name and "name" in f.setting:
        name = str(f.setting["name"])[2]
    over = causes()[f.cause].over
    if over == "time" or name not in touches.machine.names:
        if over == "probe":
            n = touches.spindle_normal
            return t("picture.by_probe"), np.degrees(np.arctan2(n[:, 1], n[:, 0])), "°"
        return t("place.time"), touches.time / 60, t("place.min")
    values = touches.axis(name)
    return (name, values, "mm") if name in touches.machine.linear else (name, np.degrees(values), "°")
