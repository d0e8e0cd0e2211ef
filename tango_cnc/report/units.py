"""Numbers as people in the shop read them: µm, µrad, µm/m; in a shop that works in inches 0.0012 in, and µin for the engineer."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from ..texts.number import MORE
from ..texts.number import shown as shown

INCH = 25.4  # mm
AMOUNT = re.compile(r"([+\-−]?\d+(?:\.\d+)?)((?: ± \d+(?:\.\d+)?)?)([ \u00a0])(µm|mm)(?![\w/²³])")


def inches(value: float, signed: bool = False) -> str:
    """number in inches, whether a plus is shown → 0.0056 in: to the tenth of a thousandth; below a thousandth one digit more."""
    decimals = 4 if abs(value) >= 0.00095 else 5
    return f"{value:{'+' if signed else ''}.{decimals}f} in".replace("-", "−")


@dataclass(frozen=True)
class Units:
    """How lengths are shown: `mm` (errors in µm) or `inch` (errors in inches in the shop, in µin for the engineer); angles are the
    same in both.
    """

    system: Literal["mm", "inch"] = "mm"

    @property
    def small(self) -> str:
        """→ unit of errors."""
        return "µm" if self.system == "mm" else "µin"

    @property
    def plain(self) -> tuple[float, str]:
        """→ shown number of one µm, unit, for people who make parts: a micro-inch is no size that they know."""
        return (1.0, "µm") if self.system == "mm" else (1e-3 / INCH, "in")

    @property
    def more(self) -> int:
        """→ decimals beyond those that were said, of a number that is converted: it is not rounded before."""
        return 0 if self.system == "mm" else MORE

    @property
    def large(self) -> str:
        """→ unit of positions."""
        return "mm" if self.system == "mm" else "in"

    @property
    def per_micron(self) -> float:
        """→ shown number of one µm."""
        return 1.0 if self.system == "mm" else 1000.0 / INCH

    @property
    def per_mm(self) -> float:
        """→ shown number of one mm of position."""
        return 1.0 if self.system == "mm" else 1.0 / INCH

    def sentence(self, text: str) -> str:
        """a sentence with lengths in µm and mm → the same in the units of this system; the name of a unit follows each length."""
        if self.system == "mm":
            return text

        def converted(match: re.Match[str]) -> str:
            small = match[4] == "µm"
            factor, label, digits = (1000.0 / INCH, self.small, -1) if small else (1 / INCH, self.large, 2)

            def number(found: str) -> str:
                sign = found[0] if found[0] in "+-−" else ""
                said = len(found.partition(".")[2])
                decimals = said - MORE if said > MORE else max(said + digits, 0)  # what is exact is rounded here for the first time
                return f"{sign}{float(found.lstrip('+-−')) * factor:.{decimals}f}"

            spread = f" ± {number(match[2][3:])}" if match[2] else ""
            return f"{number(match[1])}{spread}{match[3]}{label}"

        return AMOUNT.sub(converted, text).replace("µm/m", "µin/in")

    def coefficient(self, unit: str) -> tuple[float, str]:
        """unit of a coefficient (mm, rad, mm/mm …) → factor and unit for people."""
        factor, label = shown(unit)
        return (factor * self.of(label)[0], self.of(label)[1])

    def of(self, unit: str) -> tuple[float, str]:
        """unit for people (µm, µrad, µm/m …) → factor from it, and the unit of this system; ratios keep their number."""
        if self.system == "mm":
            return 1.0, unit
        top, _, bottom = unit.partition("/")
        factor, over = (1000.0 / INCH, "µin") if top == "µm" else (1.0, top)
        if not bottom:
            return factor, over
        if bottom[0] == "m":
            power = {"": 1, "²": 2, "³": 3}.get(bottom[1:], None) or "⁴⁵⁶⁷⁸⁹".index(bottom[1:]) + 4
            return factor * (INCH / 1000.0) ** power, f"{over}/in{bottom[1:]}"
        return factor, f"{over}/{bottom}"
