"""What a control holds already, and which of it a run cannot see: centers and directions act in tool center point control only.

Readings that were made with it on contain everything, so what they find is added to the present numbers. Readings that were made
without it contain the tables, and the rotary axes as they are built. What they find of those replaces the present numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..records import Array, InputError
from .space import Held

ZERO = 1.0  # mm: a center that is farther from machine.yaml is counted from another zero


@dataclass(frozen=True)
class Present:
    """The control's numbers by place, and those that would stand for the machine of machine.yaml, as far as they are on record."""

    numbers: Mapping[str, float]
    uncorrected: Mapping[str, float]
    open_end: bool = False  # whether the file of the numbers ends within a line: it may be cut off

    def before(self, held: Iterable[Held]) -> dict[str, float]:
        """entries → {place: number of a control that corrects nothing} of those that act in tool center point control only."""
        found = {}
        for h in held:
            if h.tcp:
                now = self.numbers.get(h.place, h.base)
                elsewhere = h.kind == "length" and abs(h.value(now) - h.value(h.base)) > ZERO
                found[h.place] = self.uncorrected.get(h.place, now if elsewhere else h.base)
        return found


def uncorrected(record: Mapping[str, Any]) -> dict[str, float]:
    """record of a compensation → {place: number of a control that corrects nothing}, as far as it is on record."""
    found = {v["place"]: float(v["uncorrected"]) for v in record["values"] if "uncorrected" in v}
    if not found and not record.get("present_given", True):  # an older record: it began with such a control
        found = {v["place"]: float(v["present"]) for v in record["values"]}
    return found


def of_record(record: Mapping[str, Any]) -> Present:
    """record of a compensation that is in the control → what the control holds."""
    return Present({v["place"]: float(v["new"]) for v in record["values"]}, uncorrected(record))


def unseen(held: Sequence[Held], numbers: Mapping[str, float], before: Mapping[str, float]) -> Array:
    """entries, the control's numbers, those of a control that corrects nothing → (h,) mm rad that a run without tool center point
    control does not see."""
    return np.array([h.value(numbers.get(h.place, h.base)) - h.value(before[h.place]) if h.tcp else 0.0 for h in held])


def asked(held: Sequence[Held], hidden: Array) -> None:
    """entries, (h,) what a run may not have seen → nothing. Raises InputError that asks how the readings were made."""
    places = [h.place for h, size in zip(held, hidden, strict=True) if size]
    if places:
        more = f" and {len(places) - 1} more" if len(places) > 1 else ""
        raise InputError(
            f"--present: found neither --tcp nor --no-tcp, and the control holds {places[0]}{more}, which act with tool center "
            "point control only; allowed: --no-tcp when the readings were made without it, as the probing programs of this project "
            "are: what they find replaces these numbers; --tcp when with it: what they find is added to them"
        )
