"""Rough, scratched or wet facets: every touch meets another spot; white, and larger on some facets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient, Detail
from ._world import Effects


def spread(touches: Touches) -> list[tuple[dict[str, Any], Array]]:
    """touches → for every facet the variance (n,) that it adds."""
    facet = np.array(touches.facet)
    return [({"facet": f}, (facet == f).astype(float)) for f in dict.fromkeys(touches.facet) if (facet == f).sum() > 3]


def words(detail: Detail) -> dict[str, str]:
    """detail of a finding → {scattering}: facet 3 scatters, facets 3, 4 scatter."""
    facets = [str(f) for f in detail.get("facets", ())]
    return {"scattering": f"facet {facets[0]} scatters" if len(facets) == 1 else f"facets {', '.join(facets)} scatter"}


def make(machine: Machine, facets: tuple[str, ...] = ()) -> list[Coefficient]:
    """machine, rough facets → no coefficient: this is a spread, not a shift."""
    return []


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the roughness of each facet, mm (world.yaml)."""
    facets = tuple(str(f) for f in setting.get("facets", ()))
    if len(values) == len(facets):
        return [{"cause": "surface_form", "amplitude": float(v), "facets": [f]} for f, v in zip(facets, values, strict=True)]
    return [{"cause": "surface_form", "amplitude": float(v), "facets": list(facets)} for v in values[:1]]


TERM = Cause(
    text="some facets are rougher than the probe repeats",
    source="thesis Table 4-3, section 7.3, procedure III (surface irregularity)",
    frame="table",
    mistaken=("noise_level",),
    says="{scattering} more than the others, the worst by {size} (one standard deviation)",
    meaning="a matter of the artefact, not of parts: touches on these facets are worth less",
    advice="clean or regrind these facets, touch others, or weight them less",
    refine={},
    words=words,
    spread=spread,
    scatters="facet",
    make=make,
    effects=effects,
)
