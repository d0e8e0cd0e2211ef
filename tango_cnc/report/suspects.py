"""Which parts are in question: those since the last night before a fault, or since the last one within the limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Suspected:
    """Parts in question: key of their sentence, its dates by name, and the names of those that are of a night within a limit."""

    key: str
    dates: Mapping[str, str]
    limits: frozenset[str] = frozenset()


def suspected(may: str, within: str, never: str, began: str) -> Suspected | None:
    """answer, date of the last night in limits, of the first where none was, of that before the first open fault → parts in
    question; None for none.
    """
    if may == "no" and never:
        return Suspected("morning.suspect_all", {"date": never}, frozenset({"date"}))
    if may == "no" and within:
        if began and began < within:
            return Suspected("morning.suspect_both", {"date": began, "within": within}, frozenset({"within"}))
        return Suspected("morning.suspect_beyond", {"date": within}, frozenset({"date"}))
    return Suspected("morning.suspect", {"date": began}) if may in ("no", "but") and began else None


def last_within(nights: Sequence[tuple[str, str]]) -> str:
    """(date, verdict) of nights, newest first → date of the last one within every limit, where the newest measured one is not."""
    measured = [(date, verdict) for date, verdict in nights if verdict not in ("not_measured", "doubtful")]
    if not measured or measured[0][1] != "out_of_limits":
        return ""
    return next((date for date, verdict in measured if verdict != "out_of_limits"), "")


def never_within(nights: Sequence[tuple[str, str]]) -> str:
    """(date, verdict) of nights, newest first → date of the first that measured, where every one was beyond a limit; else ''."""
    measured = [(date, verdict) for date, verdict in nights if verdict not in ("not_measured", "doubtful")]
    return measured[-1][0] if measured and all(verdict == "out_of_limits" for _, verdict in measured) else ""


def beyond_before(nights: Sequence[tuple[str, str]], date: str) -> str:
    """(date, verdict) of nights, newest first, a date from which on parts are in question → date of the first night of those
    beyond a limit that lead up to it without one within; '' where the one of that date was within.
    """
    first = ""
    for night, verdict in nights:
        if night > date or verdict in ("not_measured", "doubtful"):
            continue
        if verdict != "out_of_limits":
            return "" if night == date else first  # of two nights of one day the earlier one was within
        first = night
    return first


def as_limited(verdict: str, status: str, volume_um: float | None, limits: Mapping[str, float]) -> str:
    """verdict and status of a night, its error at the tool tip, {what: limit} (µm) → its verdict; changed and beyond its limit is
    out of limits, good and stopped is partial.
    """
    beyond = volume_um is not None and "volume" in limits and volume_um > limits["volume"]
    if beyond and verdict in ("good", "changed"):
        return "out_of_limits"
    return "partial" if status == "partial" and verdict == "good" else verdict
