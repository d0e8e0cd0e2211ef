"""A compensation in the control that probing does not see: parts have less error than the nights measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..records import Array


@dataclass(frozen=True)
class InControl:
    """What a kept compensation takes away with tool center point control only."""

    number: int
    target: str
    date: str  # on which it was found to help
    gone: Array  # (p,) of every unknown that is followed: what parts do not have

    def as_json(self) -> dict[str, Any]:
        """→ member `in_control` of the record."""
        return {"number": self.number, "target": self.target, "date": self.date}
