"""What cycles 7, 8, 10, 11 and 26 of a Klartext program leave active: a shift, mirrored axes, a rotation in the plane, a scale."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass
class Frame:
    """Coordinates of the program → those of the datum, in the order of the manual: scale, mirror, rotation, shift."""

    shift: dict[str, float] = field(default_factory=dict)  # mm
    mirrored: set[str] = field(default_factory=set)
    turned: float = 0.0  # deg
    scale: float = 1.0
    own: dict[str, float] = field(default_factory=dict)  # of cycle 26: a factor of an axis, which no program here cancels

    def along(self, way: Mapping[str, float], basic: float) -> dict[str, float]:
        """{X Y Z: mm} of a way, basic rotation in deg → the way that is gone."""
        x, y, z = (self.scale * self.own.get(name, 1.0) * (-way[name] if name in self.mirrored else way[name]) for name in "XYZ")
        angle = math.radians(self.turned + basic)
        return {"X": x * math.cos(angle) - y * math.sin(angle), "Y": x * math.sin(angle) + y * math.cos(angle), "Z": z}

    def place(self, name: str, value: float) -> float:
        """Axis, its word → mm or deg from the datum; the rotation turns probing directions alone here."""
        if name not in "XYZ":
            return value
        return self.scale * self.own.get(name, 1.0) * (-value if name in self.mirrored else value) + self.shift.get(name, 0.0)
