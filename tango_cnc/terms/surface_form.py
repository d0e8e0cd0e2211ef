"""Rough, scratched or wet facets: every touch meets another spot; white, and larger on some facets."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient

TEXT = "some facets are rougher than the probe repeats"
SOURCE = "thesis Table 4-3, section 7.3, procedure III (surface irregularity)"
FRAME = "table"
MISTAKEN = ("noise_level",)
ADVICE = "clean or regrind these facets, touch others, or weight them less"
REFINE: dict[str, str] = {}


def spread(touches: Touches) -> list[tuple[dict[str, Any], Array]]:
    """touches → for every facet the variance (n,) that it adds."""
    facet = np.array(touches.facet)
    return [({"facet": f}, (facet == f).astype(float)) for f in dict.fromkeys(touches.facet) if (facet == f).sum() > 3]


def cause(machine: Machine, facets: tuple[str, ...] = ()) -> list[Coefficient]:
    """machine, rough facets → no coefficient: this is a spread, not a shift."""
    return []
