"""Alarms as nights write them (docs/nightly.md), invented for pages and messages."""

from __future__ import annotations

from typing import Any

from support.nights import M, night
from tango_cnc.texts import say

SINCE_FAULT = "All that were made since Sun 25 Oct 2026, the last night without it."


def alarm(number: int, um: float, parameter: str = "EX0C", **more: Any) -> dict[str, Any]:
    """number of the night, µm that the C axis has moved that night → its alarm; it does twice as much to a part."""
    since, dated = (night(M, i)["night"] for i in (number - 1, number))
    return {
        **{"id": f"{dated}-020000-1", "cause": "axis_location", "parameter": parameter, "since": since, "unit": "mm", "now": ""},
        "text": say("changed.off", what="C axis", letter=parameter[1], size=f"{um:+.1f} ± 0.3 µm", since=since, name=parameter),
        **{"size": um / 1e3, "std": 0.0003, "rate_per_day": None, "instead": [], "owner": "Ann", "on_part_um": abs(2 * um)},
        **{"on_part": "A part is off.", "do": "Ask who was at the machine.", "night": dated, "decision": None},
        **more,
    }


def lasting(number: int, um: float, parameter: str = "EY0C", **more: Any) -> dict[str, Any]:
    """The same of a change of which all is still there."""
    return alarm(number, um, parameter, **{"total": um / 1e3, **more})


def warm(number: int, um: float, **more: Any) -> dict[str, Any]:
    """number of the night, µm → an alarm of the temperature."""
    before = night(M, number - 1)["night"]
    values = {"size": f"{um:.1f} µm", "kelvin": "6.1", "sensor": "bed", "now": "26.0", "then": "19.9", "night": before}
    told = {"cause": "temperature", "parameter": "temperature", "text": say("changed.warmer", **values), "on_part_um": um}
    return alarm(number, um, do=say("cause.temperature.do"), **told, **more)
