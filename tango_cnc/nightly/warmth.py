"""What a machine that is warmer or colder than in the night before may have done: an alarm of one error says so.

One error that follows the temperature is one direction, and explained best by that error itself. Whoever reads of it alone looks
for a knock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..records import Array
from ..state import Frame, State
from ..state.naming import WARMER
from ..texts import say
from .sensors import TEMPERATURE, by_how_much, celsius_of
from .standing import own_of
from .words import value

MOST = {"mm": 5e-3, "rad": 5e-6, "mm/mm": 2e-5}  # per K: what moves by more is no matter of temperature
LOOKED, ENOUGH = 14, 5  # nights
STIRRED = 0.5  # K, standard deviation of the temperature of those nights
FOLLOWS = 0.9  # share of its variance that the temperature explains, from which an error is said to go with it
UNKNOWN = 1e-8  # standard deviation of a coefficient per K that no night has opened


def with_warmth(
    alarm: dict[str, Any],
    parameters: Mapping[str, Any],
    sensors: Mapping[str, Any],
    now: float | None,
    recent: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """alarm, what is known tonight, member `sensors`, °C that count, records newest first → the same; where the machine is warmer
    or colder than in the night it is compared with, and that may be all, `warmer`, `instead` and what to do say so.
    """
    most, own = MOST.get(str(alarm["unit"])), own_of(parameters, str(alarm["parameter"]))
    then = next(((c, str(r["night"])) for r in recent if r.get("carried", True) and (c := celsius_of(r)) is not None), None)
    if most is None or own is None or now is None or then is None or alarm.get("repair") or abs(now - then[0]) < WARMER:
        return alarm
    last, night = then
    if abs(float(alarm["size"])) > most * abs(now - last):
        return alarm
    names, told = by_how_much(sensors, now, last, night)
    follows, rate = "", _rate(str(alarm["parameter"]), float(own["value"]), now, recent)
    if rate is not None:
        follows = say("night.sensors.follows", count=rate[1], rate=value(rate[0], f"{alarm['unit']}/K"))
    key = f"night.sensors.{'warmer' if now >= last else 'colder'}_do"
    warmer = {"sensors": names, "celsius": now, "kelvin": now - last, "then": last, "night": night}
    warmer |= {} if rate is None else {"per_kelvin": rate[0], "nights": rate[1]}
    instead = [TEMPERATURE, *(n for n in alarm["instead"] if n != TEMPERATURE)]
    return alarm | {"warmer": warmer, "instead": instead, "do": say(key, do=alarm["do"], follows=follows, **told)}


def unknown(followed: Frame, state: State) -> bool:
    """frame, predicted state → whether nothing is known yet of what the machine does for each K."""
    first = len(followed.model.names)
    own: Array = state.std[first : first + len(followed.warm)]
    return bool(len(own)) and bool(np.all(own < UNKNOWN))


def _rate(name: str, value_: float, now: float, recent: Sequence[Mapping[str, Any]]) -> tuple[float, int] | None:
    """parameter, its value and °C tonight, records newest first → per K, nights, where it goes with the temperature; else None."""
    points = [(now, value_)]
    for r in recent[:LOOKED]:
        own, celsius = own_of(r.get("parameters") or {}, name), celsius_of(r)
        if own is not None and celsius is not None:
            points.append((celsius, float(own["value"])))
    x, y = np.array(points).T
    if len(points) < ENOUGH or float(np.std(x)) < STIRRED or float(np.std(y)) == 0:
        return None
    share = float(np.corrcoef(x, y)[0, 1]) ** 2
    return (float(np.polyfit(x, y, 1)[0]), len(points)) if share >= FOLLOWS else None
