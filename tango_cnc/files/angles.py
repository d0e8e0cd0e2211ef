"""Angles in files are degrees; one that was written in radians is found out and refused."""

from __future__ import annotations

import math

from .checked import Node

LARGEST = 2 * math.pi + 0.01
STEPS = {2: 90, 3: 15, 4: 5}  # decimals → multiples of which angle (deg) are looked for; with more decimals those of 1


def angle(node: Node) -> float:
    """scalar in degrees → rad. Raises InputError for anything else, and for what is a round angle written in radians."""
    value = node.position()
    written = str(node.raw.value).lstrip("+-")
    decimals = len(written.partition(".")[2])
    if decimals >= min(STEPS) and 0 < abs(value) <= LARGEST and written.replace(".", "").isdigit():
        step = STEPS.get(decimals, 1)
        meant = step * round(math.degrees(value) / step)
        if meant and abs(value - math.radians(meant)) < 10.0**-decimals:
            rounded = f"{value:.{1 if decimals < 4 else 2}f}"
            raise node.wrong(
                f"degrees. This is {meant:g}° in radians: write {meant:g}; or {rounded}, if nearly that many degrees are meant"
            )
    return math.radians(value)
