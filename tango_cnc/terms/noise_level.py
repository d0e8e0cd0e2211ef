"""The touches scatter more than the stated repeatability of the probe."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..records import Array, Machine
from ..touches import Touches
from . import Coefficient

TEXT = "single touches scatter more than the probe is said to"
SOURCE = "ISO 230-10:2022, 6.2; JCGM 100:2008, 4.2"
FRAME = "probe"
MISTAKEN = ("surface_form",)
SAYS = "single touches scatter by {found} µm, the machine file says {stated} µm"
MEANING = "every touch is worth less than assumed; the uncertainties of all parameters grow with it"
ADVICE = "check probe, battery and mounting, and how often the control looks at it, or correct `repeatability` in machine.yaml"
REFINE: dict[str, str] = {}


def spread(touches: Touches) -> list[tuple[dict[str, Any], Array]]:
    """touches → equal variances (n,)."""
    return [({}, np.ones(len(touches)))]


def cause(machine: Machine) -> list[Coefficient]:
    """machine → no coefficient: this is a spread, not a shift."""
    return []
