"""Findings of the judgement → sentences."""

from __future__ import annotations

from ..texts import say
from .bounds import Bound

SHOWN = {"mm": (1.0, "mm"), "rad": (180 / 3.141592653589793, "°"), "mm/mm": (1e6, "µm/m")}


def beyond_text(bound: Bound) -> str:
    """quantity beyond its tolerance → what it is, what would be plausible, and where that is stated."""
    factor, unit = SHOWN[bound.unit]
    most = say("plausible.bounds.at_most_plausible", tolerance=f"{bound.tolerance * factor:.4g}", unit=unit)
    return say("plausible.bounds.is", name=bound.name, value=f"{bound.value * factor:.4g}", unit=unit, most=most, key=bound.key)
