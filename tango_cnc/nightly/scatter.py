"""Single touches that scatter night after night: one alarm as long as it goes on; with the first sound night it is gone again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..history.answers import of_machine
from ..report.tonight import in_the_past, is_gone
from ..state.changes import change
from ..texts import say
from ..texts.number import number
from .dates import LISTED
from .goes_on import ended
from .ports import Past


def scatter_on(past: Past, machine: str, alarms: Sequence[dict[str, Any]], today: str) -> list[dict[str, Any]]:
    """history, machine, alarms of tonight, local date → the same; touches that scattered in the last night that was believed, too,
    are the alarm of that night, as long as nobody has decided about it.
    """
    if not any(change(a["cause"]).scatters for a in alarms) or (older := _last(past, machine, today)) is None:
        return list(alarms)
    return [_same(a, *older) if change(a["cause"]).scatters else a for a in alarms]


def with_scatter(
    past: Past, machine: str, alarms: Sequence[dict[str, Any]], tonight: Mapping[str, Any] | None, *, silent: bool = False
) -> list[dict[str, Any]]:
    """history, machine, alarms of other nights, `residual` of tonight (None: it is not believed), whether somebody ignores them →
    the same; those of touches that scatter with `now` and `total`: gone again, where a night since then was sound.
    """
    if not any(change(a["cause"]).scatters and not a.get("ended") for a in alarms):
        return list(alarms)
    now = None if silent and _scatters(tonight) else _sound(past, machine, tonight)
    return [_with(a, now, tonight) if change(a["cause"]).scatters and not a.get("ended") else a for a in alarms]


def _last(past: Past, machine: str, today: str) -> tuple[Mapping[str, Any], Any] | None:
    """→ the alarm of touches that scatter of the last believed night, and its answer; None for none, and where it is decided."""
    known = past.latest_knowledge(machine) if past.knows(machine) else None
    record: Mapping[str, Any] = {} if known is None else past.records_of([known[0].entry])[known[0].entry]
    older = next((a for a in record.get("alarms") or () if change(a["cause"]).scatters and a["id"]), None)
    if older is None:
        return None
    answer = of_machine(past, machine, last=LISTED).decided.get(str(older["id"]))
    return None if ended(answer, today) else (older, answer)


def _same(alarm: dict[str, Any], older: Mapping[str, Any], answer: Any) -> dict[str, Any]:
    """alarm of tonight, the one that it goes on from, its answer → the same under the id and with the date of the latter."""
    text = say("night.goes_on.scatter", night=str(older["id"])[:10])
    step = {"step": float(alarm["size"]) - float(older["size"]), "std": float(alarm["std"]), "text": text}
    held = {"owner": answer.owner, "decision": "acknowledge"} if answer is not None and answer.action == "acknowledge" else {}
    return alarm | {"id": older["id"], "since": older["since"], "goes_on": step} | held


def _scatters(residual: Mapping[str, Any] | None) -> bool:
    """`residual` of a night, None for none → whether its touches scattered, and that is no chance."""
    return float((residual or {}).get("wider") or 1.0) > 1.0


def _sound(past: Past, machine: str, tonight: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """history, machine, `residual` of tonight → that of the last believed night, tonight with them, where its touches did not
    scatter; else None. What scatters tonight, and did not the night before, is another event.
    """
    if tonight is not None and not _scatters(tonight):
        return tonight
    known = past.latest_knowledge(machine)
    residual = None if known is None else past.records_of([known[0].entry])[known[0].entry].get("residual")
    return None if _scatters(residual) else residual


def _with(alarm: dict[str, Any], sound: Mapping[str, Any] | None, tonight: Mapping[str, Any] | None) -> dict[str, Any]:
    """alarm, `residual` of a sound night since then or None, that of tonight → the alarm as it is by now."""
    found = tonight if sound is None else sound
    if found is None or found.get("std_um") is None:
        return alarm
    told = number(float(found["std_um"]), "µm", signed=False, decimals=2)
    now = say(f"night.alarms.{'still_there' if sound is None else 'scatter_gone'}", told=told)
    known = in_the_past(alarm | {"now": now, "total": float(found["std_um"]) / 1e3})
    return known | ({"do": say("night.gone_do")} if is_gone(now) and "do" in alarm else {})
