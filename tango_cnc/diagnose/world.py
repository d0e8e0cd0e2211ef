"""A diagnosis → the machine that it describes, as the simulated machine takes it (world.yaml)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import terms as families
from ..records import World
from . import Diagnosis
from ._size import plain
from .words import effects


def world(d: Diagnosis) -> tuple[World, tuple[str, ...]]:
    """diagnosis → simulated machine with the errors, the table and the causes as estimated together; causes it does not have.

    Coefficients in mm and rad. Causes that were terms of the present model are in it like those that were found; the noise is
    the white one that is left. Where balls stand is a matter of the artefact file.
    """
    model = d.after.model
    value = dict(zip(model.names, map(float, d.after.values), strict=True))
    own = [item for item in d.terms if isinstance(item, Mapping)]
    stylus = {c.name: value[c.name] for c in model.coefficients if c.slot.axis == "t"}
    errors = {c.name: value[c.name] for c in model.coefficients if "[" not in c.name and c.slot.axis not in ("t", "w")}
    hidden: list[dict[str, Any]] = []
    missing = []
    for item in own:
        cause, setting = str(item["cause"]), {k: v for k, v in item.items() if k != "cause"}
        names = [c.name for c in families.cause(cause, model.touches.machine, setting)]
        if not any("[" in name for name in names):
            continue  # an ordinary coefficient, such as EYX2, or none
        same = families.effects(cause, model.touches.machine, setting, np.array([value.get(name, 0.0) for name in names]))
        hidden += [plain(effect) for effect in same]
        if not same:
            missing.append(cause)
    # What has no coefficients is a spread: that of all touches is the noise.
    spread = {f.cause for f in d.findings if not f.size.values.size} - {families.scattering("all")}
    hidden += [effect for effect in effects(d) if effect["cause"] in spread]
    facets = {name: p.value for name, p in d.after.facets.items()}
    return World(errors, stylus, facets, d.noise, tuple(hidden), 1), tuple(dict.fromkeys(missing))
