"""Over what a figure holds: the part of each axis that was touched, of its travel, and how the figure is made."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..iso230 import ranges
from ..iso230.signed import OnPart, Sheet
from ..iso230.unseen import positions
from ..records import Machine

OF_AXES = re.compile(r"E.\(0(?P<one>.)\)(?P<two>.)|(?P<b>.) to (?P<a>.)|E.(?P<own>[XYZABC])|(?P<turning>[ABC]) ")
VOLUME, FITTED = "volumetric", ("parameter", "part")
SIGNED = ("squareness", "positioning gain", "reversal", "parameter")  # kinds of figures whose sign counts
KEYS = {"ranges": "other: touched ranges", "how": "other: how a figure is made"}


@dataclass(frozen=True)
class Covered:
    """One axis: what was touched of it and its travel, mm or degrees, and at how many different positions."""

    axis: str
    unit: str  # mm or °
    low: float
    high: float
    travel: tuple[float, float] | None  # None: endless
    positions: int

    @property
    def text(self) -> str:
        """→ the axis and its touched range, for a column."""
        return f"{self.axis} {self.low:.4g} … {self.high:.4g} {self.unit}"


def covered(sheet: Sheet, machine: Machine) -> dict[str, Covered]:
    """figures, machine → what was touched of every axis that moved; {} where the figures hold no touches."""
    if sheet.learned is None:
        return {}
    touches, found = sheet.learned.touches, {}
    for name, (low, high) in ranges(touches).items():
        linear = name in machine.linear
        one, travel = 1.0 if linear else float(180 / np.pi), machine.axis(name).travel
        ends = None if travel is None else (travel[0] * one, travel[1] * one)
        found[name] = Covered(name, "mm" if linear else "°", low * one, high * one, ends, positions(touches, name))
    return found


def of_figure(figure: OnPart, over: Mapping[str, Covered]) -> tuple[Covered, ...]:
    """figure, every axis that was touched → the axes that the figure is of."""
    if figure.kind in FITTED:
        return ()
    if figure.kind == VOLUME:
        return tuple(c for name, c in over.items() if name in "XYZ")
    names = [axis for part in re.split(" [−+] ", figure.name) for m in OF_AXES.finditer(f"{part} ") for axis in m.groups() if axis]
    return tuple(over[name] for name in sorted(dict.fromkeys(names)) if name in over)


def two_sided(figure: OnPart) -> bool:
    """figure → whether its sign counts, so that its limit holds on both sides of 0."""
    return figure.kind in SIGNED or (figure.kind == "part" and figure.value is not None and figure.bounds is None)


def column(over: Sequence[Covered]) -> str:
    """axes that a figure is of → what it holds over, for a column."""
    if len(over) > 2:
        return f"{' '.join(c.axis for c in over)} as touched"
    return "; ".join(c.text for c in over) or "–"


def made_how(rows: Sequence[tuple[str, str]], over: Mapping[str, Covered]) -> dict[str, str]:
    """figures and how each is made, every axis that was touched → rows for the page."""
    found, by = {}, dict.fromkeys(how for _, how in rows if how)
    if over:
        parts = [f"{c.text} of {_travel(c)}, {c.positions} positions" for c in over.values()]
        found[KEYS["ranges"]] = f"{'; '.join(parts)}. A figure holds over the range beside it and says nothing of the rest"
    if by:
        found[KEYS["how"]] = "; ".join(f"{', '.join(name for name, own in rows if own == how)}: {how}" for how in by)
    return found


def _travel(c: Covered) -> str:
    return "an endless axis" if c.travel is None else f"{c.travel[0]:.4g} … {c.travel[1]:.4g}"
