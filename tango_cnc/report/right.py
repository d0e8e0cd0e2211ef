"""A change that has made an error nearly nothing: it is no reason to compensate anything, and nobody is asked to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..texts import Said, say
from .texts import Texts
from .together import SAME

ENTERED = {  # what to do that asks for a compensation, and what it is where the whole error is nearly nothing
    "cause.axis_location.do": "right.axis_location",
    "confirmed.axis_location": "right.confirmed.axis_location",
    "part.square_do": "right.square",
    "confirmed.square": "right.confirmed.square",
}
ONCE = {  # what to do that asks for a full measurement, and what it is where one has found the change
    "cause.axis_location.do": "cause.axis_location.do_found",
    "right.axis_location": "right.axis_location_found",
}
FOUND = ("changed", "out_of_limits")  # verdicts of nights whose alarms are of the machine


def whole_of(a: Mapping[str, Any], now: Mapping[str, Any], total: float) -> tuple[float, float, float]:
    """alarm, its parameter as it is known now, what has come together → the whole error now and before the change, as parts have
    it, and by how much both may differ from nothing (all in the unit of the alarm).
    """
    whole = float(now["value"]) - float(now.get("in_control") or 0.0)
    was = whole - total if a.get("was") is None else float(a["was"])  # what that night showed stays what it was
    return whole, was, max(2 * float(now.get("std") or 0.0), SAME * abs(total))


def is_right(whole: float, was: float, slack: float) -> bool:
    """whole error now, before the change, by how much it may differ from nothing → whether the change has taken it away."""
    return abs(whole) <= slack and abs(was) > slack


def without_compensation(todo: str, t: Texts) -> str:
    """what to do about a change, texts → the same where the whole error is nearly nothing: no compensation is asked for."""
    for usual, right in ENTERED.items():
        todo = todo.replace(t(usual), t(right))
    return todo


def without_full(do: str, a: Mapping[str, Any], record: Mapping[str, Any], t: Texts) -> str:
    """what to do about an alarm, the alarm, record of the night that raised it, texts → the same; of a location that a whole full
    measurement has found, which was believed, no other one is asked for.
    """
    whole = record.get("kind") == "full" and record.get("status") == "complete" and record.get("verdict") in FOUND
    if whole and not (a.get("rate_per_day") and a.get("steady", True)):
        for usual, found in ONCE.items():
            do = do.replace(t(usual), t(found))
    return do


def by_its_whole(a: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    """alarm as a record has it, the night that tells it → the same; where its whole error is nearly nothing by that night, what to
    do asks for no compensation.
    """
    now, there = (known.get("parameters") or {}).get(a.get("parameter")), known.get("in_control") or {}
    total = a.get("total") if a.get("total") is not None else a.get("size")
    drifts = a.get("rate_per_day") and a.get("steady", True)
    if not now or not total or drifts or known.get("verdict") == "doubtful" or (there and not there["measured"]):
        return dict(a)
    return {**a, "do": _without(a["do"], a)} if is_right(*whole_of(a, now, float(total))) else dict(a)


def _without(do: Any, a: Mapping[str, Any]) -> Any:
    """what to do, its alarm → the same without a compensation."""
    if not isinstance(do, Said):
        return do
    if do.key in ENTERED:
        confirmed = ".confirmed" if a.get("confirmed") else ""
        return say(ENTERED[do.key].replace("right.", f"right{confirmed}.", 1))
    return do.but(**{name: _without(x, a) for name, x in do.values.items() if isinstance(x, Said)})
