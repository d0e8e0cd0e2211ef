"""uncertainty.yaml of a cell → what it adds to the intervals of ISO figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..estimate import Estimate
from ..iso230.seen import Budget
from ..records import Array
from ..uncertainty.inputs import Part, Scene, parts, read_budget

IN_SCATTER = ("repeatability", "form", "probe_latch")  # independent from touch to touch: the scatter shows them
KNOWN = ("scale_bar", "calibrated_facets")  # the fit has them as artefact.yaml states them
ASKED = ("repeatability", "form", "drift", "lobing")  # every machine and probe has them
TURNED = ("rotary_positioning", "indexation_seating")  # one of them: how well an indexation comes back


def budget_of(folder: Path, result: Estimate) -> Budget | None:
    """cell, estimate → its budget as factors over gaps and known distances; None without uncertainty.yaml.

    Raises InputError for a budget that does not fit the machine.
    """
    file = folder / "uncertainty.yaml"
    if not file.exists():
        return None
    lines = read_budget(file)
    scene = Scene(result.model, result.values)
    found = parts(scene, lines)
    beside = [(part.label, extra) for part in found if (extra := _beside(part, scene)) is not None]
    named = tuple(dict.fromkeys(line.source for line in lines))
    return Budget(tuple(p.factor for p in found), tuple(f for _, f in beside), named, tuple(label for label, _ in beside))


def _beside(part: Part, scene: Scene) -> Array | None:
    """line of the budget → what of it neither the scatter of the touches nor the fit contains; None where that is nothing."""
    source = part.label.split(" ")[0]
    if source in IN_SCATTER or not np.any(part.factor):
        return None
    if source not in KNOWN:
        return part.factor
    own = np.sqrt(np.sum(part.factor[-len(scene.stated) :] ** 2, axis=1))
    if np.all(own <= scene.stated * (1 + 1e-9)):
        return None
    more = np.zeros((len(part.factor), len(own)))
    more[-len(own) :] = np.diag(np.sqrt(np.clip(own**2 - scene.stated**2, 0.0, None)))
    return more


def absent(named: Sequence[str]) -> tuple[str, ...]:
    """sources that a budget names → those that every machine has and it does not name."""
    found = [source for source in ASKED if source not in named]
    return (*found, *(() if any(s in named for s in TURNED) else (" or ".join(TURNED),)))
