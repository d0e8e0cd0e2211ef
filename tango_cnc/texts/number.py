"""A number in a sentence: its text is rounded for people, and it carries what it was rounded from.

Whoever shows the sentence in another unit, or with fewer digits, rounds that: 85.47 is "85.5 µm" in a message and 85 µm on a page,
where the text alone would make 86 of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

EXACT = ".exact"  # of a record: {"size": "+21.5 ± 0.4 µm", "size.exact": "21.4561 0.412"}
MORE = 9  # decimals that a page asks for before it rounds
ROUNDED = re.compile(r"([+\-−]?)(\d+(?:\.\d+)?)(?: ± (\d+(?:\.\d+)?))?(?: ([^\s\d]\S*))?")

MINUS_ZERO = re.compile(r"(?<![\w.])[-−](0(?:[.,]0*)?)(?![\w.,]*\d)")


def unsigned_zero(text: str) -> str:
    """text with rounded numbers → the same where nothing has no sign: 0.00 and not -0.00."""
    return MINUS_ZERO.sub(r"\1", text)


def shown(unit: str) -> tuple[float, str]:
    """unit of a coefficient (mm, rad, mm/mm², rad/mm …) → factor and unit for people (µm, µrad, µm/m², µrad/m …)."""
    if unit.endswith("/K"):
        factor, label = shown(unit.removesuffix("/K"))
        return factor, f"{label}/K"
    top, _, bottom = unit.partition("/")
    factor, label = {"mm": (1e3, "µm"), "rad": (1e6, "µrad"), "": (1.0, "")}.get(top, (1.0, top))
    if not bottom:
        return factor, label
    power = {"": 1, "²": 2, "³": 3}.get(bottom.strip("mrad"), None)
    if bottom.startswith("mm"):
        power = power or "⁴⁵⁶⁷⁸⁹".index(bottom[2:]) + 4
        return factor * 1000.0**power, f"{label}/m{bottom[2:]}"
    return factor, f"{label}/{bottom}"


class Number(str):
    """A rounded number with its unit, `+19.8 ± 0.4 µm`, and the value and standard deviation that it was rounded from."""

    value: float
    std: float | None

    def __new__(cls, text: str, value: float, std: float | None = None) -> Number:
        """text, value in the unit of the text, standard deviation → the number."""
        made = super().__new__(cls, text)
        made.value, made.std = float(value), None if std is None else float(std)
        return made

    def __str__(self) -> str:
        """→ itself: what it was rounded from is not lost by str()."""
        return self

    def __reduce__(self) -> tuple[type, tuple[str, float, float | None]]:
        """→ how to make it again in another process."""
        return Number, (self[:], self.value, self.std)

    @property
    def exact(self) -> str:
        """→ value and standard deviation as a record has them."""
        return f"{self.value:.10g}" if self.std is None else f"{self.value:.10g} {self.std:.10g}"

    def more(self, decimals: int) -> str:
        """decimals → the text with so many more."""
        found = ROUNDED.match(self)
        if not decimals or found is None or not math.isfinite(self.value):
            return self[:]
        value = f"{self.value if found[1] else abs(self.value):{'+' if found[1] else ''}z.{_decimals(found[2]) + decimals}f}"
        std = "" if found[3] is None or self.std is None else f" ± {self.std:.{_decimals(found[3]) + decimals}f}"
        return f"{value}{std}{self[found.end(3) if found[3] else found.end(2) :]}"


def number(value: float, unit: str = "", std: float | None = None, *, signed: bool = True, decimals: int = 1) -> Number:
    """value in a unit for people, the unit, standard deviation, whether a plus is shown → `+19.8 ± 0.4 µm`."""
    size = f"{value:{'+' if signed else ''}z.{decimals}f}"  # nothing has no minus
    spread = "" if std is None else f" ± {std:.{decimals}f}"
    return Number(f"{size}{spread} {unit}".rstrip(), value, std)


def kept(values: Mapping[str, str]) -> dict[str, str]:
    """what was filled into a sentence → the same as a record has it: beside a number what it was rounded from."""
    return {name: v[:] for name, v in values.items()} | {f"{n}{EXACT}": v.exact for n, v in values.items() if isinstance(v, Number)}


def again(values: Mapping[str, Any]) -> dict[str, Any]:
    """what a record has of a sentence → what was filled in. Raises ValueError where a number cannot be read."""
    found = {name: v for name, v in values.items() if not name.endswith(EXACT)}
    for name, text in found.items():
        if (exact := values.get(f"{name}{EXACT}")) is not None:
            value, *std = (float(x) for x in str(exact).split())
            found[name] = Number(str(text), value, *std)
    return found


def sizes(a: Mapping[str, Any]) -> Iterator[tuple[float, str]]:
    """alarm, trend, limit or volume of a record → sizes that it has, with their units for people."""
    unit = str(a.get("unit") or "")
    factor, name = shown(unit) if unit.partition("/")[0] in ("mm", "rad") else (1.0, unit)
    for key in ("size", "total", "rate_per_day", "size_before", "back", "least", "std", "value"):
        if type(a.get(key)) in (int, float):
            yield abs(float(a[key])) * factor, name
    for key in ("on_part_um", "worst_um"):
        if type(a.get(key)) in (int, float):
            yield abs(float(a[key])), "µm"


def rounded_from(text: str, known: Mapping[str, list[float]], unit: str = "") -> str:
    """rounded number as a text, {unit: sizes that the record has}, its unit where the text has none → the number that carries what
    it was rounded from; the text as it is where the record does not have that.
    """
    found = ROUNDED.fullmatch(text)
    if found is None or "." not in found[2]:
        return text
    every = known.get(found[4] or unit, [])

    def exact(digits: str) -> float | None:
        return next((x for x in every if f"{x:.{_decimals(digits)}f}" == digits), None)

    size = exact(found[2])
    if size is None:
        return text
    std = None if found[3] is None else exact(found[3])
    return Number(text, -size if found[1] in ("-", "−") else size, float(found[3]) if std is None and found[3] else std)


def _decimals(digits: str) -> int:
    return len(digits.partition(".")[2])
