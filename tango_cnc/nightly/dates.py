"""What the dates on record say of a night: how many nights are missing before it, and whether its clock went back."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date, datetime
from typing import Any

from .alarms import missing, night_of
from .ports import Past

MISSED = 14  # nights without a measurement that may lie between those that measured


def dated(before: Mapping[str, Any], past: Past, machine: str, begun: datetime, every_days: float) -> dict[str, Any]:
    """what is known of the nights before, history, machine, begin of this night, days from night to night → more of the same.

    `unmeasured_count`: nights missing since the last one that measured, where more are missing than are on record one by one;
    `clock_back`: date of the newest night on record, where the clock dates it in the future: one of both is wrong.
    """
    found: dict[str, Any] = {}
    tonight = night_of(begun)
    if before.get("unmeasured") and before.get("last_measured"):
        days = (date.fromisoformat(tonight) - date.fromisoformat(before["last_measured"])).days
        count = missing(days, every_days)
        found |= {"unmeasured_count": count} if count > len(before["unmeasured"]) else {}
    if ahead := past.ahead(machine):
        found["clock_back"] = ahead[0].night
    return found


def clock_wrong(past: Past, machine: str) -> bool:
    """history by the clock, machine → whether the clock itself is wrong: most of the nights that measured lie in its future."""
    future = [n for n in past.ahead(machine) if n.verdict != "not_measured"]
    return bool(future) and len(future) > sum(n.verdict != "not_measured" for n in past.nights(machine, 2 * len(future) + MISSED))
