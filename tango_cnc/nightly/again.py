"""An alarm of tonight beside older ones of its parameter: what was repaired and comes back, what goes on step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..history import Decision
from ..history.answers import of_machine
from ..report.tonight import is_gone
from ..texts import say
from .drift import drift_do
from .moved import found_by
from .ports import Past
from .standing import own_of

STOOD = 0.25  # of the smaller of two steps, by which it may have moved between them


def after_a_repair(past: Past, machine: str, alarms: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """history, machine, alarms of tonight → the same; what moves again as it did before its last repair says so (`again`)."""
    if not alarms or not past.knows(machine):
        return list(alarms)
    last = of_machine(past, machine).decided  # who has repaired a way back has repaired what went back
    closed = [key for key, d in last.items() if d.action in ("accept", "repaired")]
    older = [(last[key], a) for key, (_, a) in found_by(past, machine, closed).items()]
    return [_again(a, older) for a in alarms]


def _again(alarm: dict[str, Any], older: Sequence[tuple[Decision, Mapping[str, Any]]]) -> dict[str, Any]:
    same = [(d, a) for d, a in older if (a["cause"], a["parameter"]) == (alarm["cause"], alarm["parameter"])]
    if not same or alarm.get("repair") or alarm.get("undoes"):
        return alarm
    d, a = max(same, key=lambda one: one[0].utc)
    if d.action != "repaired" or not float(a["size"] or 0.0) * float(alarm["size"] or 0.0) > 0:  # accepted since, or the other way
        return alarm
    told = {"owner": d.owner, "date": d.utc[:10]}
    do = say("night.comes_back.repaired_do", do=alarm["do"], **told)
    return alarm | {
        "text": say("night.comes_back.repaired", text=alarm["text"], **told),
        "do": do,
        "again": {"alarm": d.alarm, **told},
    }


def _two_knocks_or_one(older: Mapping[str, Any], alarm: Mapping[str, Any]) -> bool:
    """alarm of an earlier night, alarm of tonight → whether both came at once, and it stood still between them (two knocks), or all
    of it is tonight's step (one knock).

    Two nights find one knock where a wrong clock keeps the night of the first out of what the second is compared with.
    """
    total = older.get("total")
    if total is None or older.get("rate_per_day") or alarm.get("rate_per_day"):
        return False
    first, step = float(older["size"]), float(alarm["size"])
    return min(abs(float(total) - step - first), abs(float(total) - step)) < STOOD * min(abs(first), abs(step))


def step_by_step(alarm: dict[str, Any], older: Sequence[Mapping[str, Any]], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """alarm of tonight, those of earlier nights that nobody has closed, what is known → the same.

    Where an older one of its parameter went the same way and is still there, what to do is what is to be done about a drift: a
    new location would be wrong tomorrow. Two knocks between which it stood still are two knocks.
    """
    same = [a for a in older if (a["cause"], a["parameter"]) == (alarm["cause"], alarm["parameter"]) and not is_gone(a["now"])]
    if own_of(parameters, alarm["parameter"]) is None or alarm.get("repair"):  # a length has no way
        return alarm
    onward = [a for a in same if float(a["size"] or 0.0) * float(alarm["size"] or 0.0) > 0]
    if not onward or (len(same) == 1 and _two_knocks_or_one(onward[0], alarm)):
        return alarm
    return alarm | {"do": drift_do(str(alarm["cause"]), str(alarm["parameter"]))}
