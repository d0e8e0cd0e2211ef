"""Numbers as people in the shop read them: µm, µrad, µm/m."""

from __future__ import annotations


def shown(unit: str) -> tuple[float, str]:
    """unit of a coefficient (mm, rad, mm/mm², rad/mm …) → factor and unit for people (µm, µrad, µm/m², µrad/m …)."""
    top, _, bottom = unit.partition("/")
    factor, label = {"mm": (1e3, "µm"), "rad": (1e6, "µrad"), "": (1.0, "")}.get(top, (1.0, top))
    if not bottom:
        return factor, label
    power = {"": 1, "²": 2, "³": 3}.get(bottom.strip("mrad"), None)
    if bottom.startswith("mm"):
        power = power or "⁴⁵⁶⁷⁸⁹".index(bottom[2:]) + 4
        return factor * 1000.0**power, f"{label}/m{bottom[2:]}"
    return factor, f"{label}/{bottom}"
