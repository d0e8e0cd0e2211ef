"""Whether a machine is as warm as its nights ask for: the sensors of sensors.yaml, asked before anything moves."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

from ..files.nightly import Nightly
from ..link.sensors import FILE, read_sensors
from ..link.transport._sensors import Watch
from ..nightly import PreflightPoint
from ..records import InputError
from ..texts import say

LOOK = 0.1  # s between two looks at what has come


class Warmth(NamedTuple):
    """What the sensors say now: °C, None where nobody has said anything; and whose words these are."""

    value: float | None
    words: str


def warmth(folder: Path, settings: Nightly) -> Warmth:
    """folder of a cell, settings → temperature of the sensor that counts, or the mean of all. Waits as long as a value may be old.

    Raises InputError for a cell that names no such sensor.
    """
    sensors = read_sensors(folder)
    known = tuple(sensor.name for sensor in sensors.sensors)
    wanted = known if settings.sensor is None else (settings.sensor,)
    if not known:
        raise InputError(f"temperature is asked for in nightly.yaml, and no sensor measures it: name one in {FILE} (docs/link.md)")
    if settings.sensor is not None and settings.sensor not in known:
        raise InputError(f"sensor {settings.sensor!r} of nightly.yaml is not in {FILE}; allowed: {', '.join(known)}")
    watch = Watch(sensors)
    watch.start()
    try:
        end = time.monotonic() + sensors.old
        while True:
            values = watch.values()
            found = [value for name in wanted if (value := values[name]) is not None]
            if len(found) == len(wanted) or time.monotonic() > end:
                break
            time.sleep(LOOK)
    finally:
        watch.close()
    name = ", ".join(wanted)
    if len(found) < len(wanted):
        silent = ", ".join(n for n in wanted if values[n] is None)
        return Warmth(None, say("preflight.warm.silent", silent=silent, old=f"{sensors.old:g}"))
    value = sum(found) / len(found)
    return Warmth(value, say(f"preflight.warm.{'one' if len(found) == 1 else 'mean'}", name=name, value=f"{value:.1f}"))


def warm(folder: Path, settings: Nightly) -> tuple[PreflightPoint, bool]:
    """folder of a cell, settings with a temperature → the point of the preflight, and whether a warm-up comes first.

    Raises InputError for a cell that names no such sensor.
    """
    assert settings.temperature is not None
    low, high = settings.temperature
    now = warmth(folder, settings)
    if now.value is None:
        return PreflightPoint("warm", False, now.words, say("preflight.warm.agent_do", file=FILE)), False
    asked = say("preflight.warm.asked", now=now.words, low=f"{low:g}", high=f"{high:g}")
    if now.value > high:
        return PreflightPoint("warm", False, asked, say("preflight.warm.hot_do")), False
    if now.value >= low:
        return PreflightPoint("warm", True, asked), False
    if settings.warm_up_minutes:
        first = say("preflight.warm.first", asked=asked, minutes=f"{settings.warm_up_minutes:g}")
        return PreflightPoint("warm", True, first), True
    return PreflightPoint("warm", False, say("preflight.warm.cold", asked=asked), say("preflight.warm.cold_do")), False
