"""The touches scatter more than the stated repeatability of the probe."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient


def spread(touches: Touches) -> list[tuple[dict[str, Any], Array]]:
    """touches → equal variances (n,)."""
    return [({}, np.ones(len(touches)))]


def make(machine: Machine) -> list[Coefficient]:
    """machine → no coefficient: this is a spread, not a shift."""
    return []


TERM = Cause(
    text="single touches scatter more than the stated repeatability of the probe",
    source="ISO 230-10:2022, 6.2; JCGM 100:2008, 4.2",
    frame="probe",
    mistaken=("surface_form",),
    says="single touches scatter by {found} µm, the machine file says {stated} µm",
    meaning="every touch is worth less than assumed; the uncertainties of all parameters grow with it",
    advice="check probe, battery and mounting, and how often the control looks at it, or correct `repeatability` in machine.yaml",
    refine={},
    spread=spread,
    scatters="all",
    make=make,
)
