"""What a machine that is warmer or colder than in the night before may have done: an alarm of one error says so.

One error that follows the temperature is one direction, and explained best by that error itself. Whoever reads of it alone looks
for a knock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..report.tonight import is_gone
from ..state.naming import WARMER
from ..texts import Said, instead, say
from .dates import Since
from .sensors import A_KELVIN, TEMPERATURE, by_how_much, celsius_of
from .standing import own_of
from .words import value

LOOKED, ENOUGH = 14, 5  # nights
STIRRED = 0.5  # K, standard deviation of the temperature of those nights
FOLLOWS = 0.9  # share of its variance that the temperature explains, from which an error is said to go with it
BACK = 0.5  # of the kelvin of an alarm, below which the machine is as warm as before it
SHARE = 0.3  # of what the temperature would make: what an alarm may be beside it and still go with the temperature alone
SENSOR_FIRST = ("night.sensors.do", "night.sensors.do_doubted")  # keys of what to do where a sensor is to be seen to first


def with_warmth(
    alarm: dict[str, Any],
    parameters: Mapping[str, Any],
    sensors: Mapping[str, Any],
    now: float | None,
    recent: Sequence[Mapping[str, Any]],
    sensor: str | None = None,
) -> dict[str, Any]:
    """alarm, what is known tonight, member `sensors`, °C that count, records newest first, the sensor that counts (None: all) → the
    same; where the machine is warmer or colder than in the night it is compared with, and that may be all, `warmer`, `instead` and
    what to do say so.
    """
    most, own = A_KELVIN.get(str(alarm["unit"])), own_of(parameters, str(alarm["parameter"]))
    known = [(c, str(r["night"])) for r in recent if r.get("carried", True) and (c := celsius_of(r)) is not None]
    then = next((x for x in known if x[1] == alarm.get("since")), known[0] if known else None)  # the night of its size
    if most is None or own is None or now is None or then is None or alarm.get("repair") or abs(now - then[0]) < WARMER:
        return alarm
    last, night = then
    if abs(float(alarm["size"])) > most * abs(now - last):
        return alarm
    names, told = by_how_much(sensors, now, last, night, sensor)
    follows, name = "", str(alarm["parameter"])
    rate = _rate([*_points(name, recent), (now, float(own["value"]))])
    if rate is not None:
        follows = say("night.sensors.follows", count=rate[1], rate=value(rate[0], f"{alarm['unit']}/K"))
    key = f"night.sensors.{'warmer' if now >= last else 'colder'}_do"
    warmer = {"sensors": names, "celsius": now, "kelvin": now - last, "then": last, "night": night}
    warmer |= {} if rate is None else {"per_kelvin": rate[0], "nights": rate[1]}
    others = [TEMPERATURE, *(n for n in alarm["instead"] if n != TEMPERATURE)]
    alarm = alarm | {"warmer": warmer, "instead": others, "do": say(key, do=alarm["do"], follows=follows, **told)}
    before = _rate(_points(name, recent))
    if before is None or not _explained(float(alarm["size"]), float(alarm["std"]), before[0] * (now - last)):
        return alarm
    named = {"rate": value(before[0], f"{alarm['unit']}/K"), "count": before[1], "kelvin": f"{now - last:+.1f}"}
    return alarm | {"text": say("night.sensors.goes_with", text=alarm["text"], **named)}


def as_warm_as(
    alarms: Sequence[dict[str, Any]],
    now: float | None,
    believed: bool = True,
    night: str = "",
    recent: Sequence[Mapping[str, Any]] = (),
) -> list[dict[str, Any]]:
    """alarms of other nights, °C that count (None: not known tonight), whether a sensor that is believed says so tonight (else one
    said it last), date of tonight, records newest first → the same; one of a change with temperature with how warm the machine is
    by now: nearer to the night before the alarm than to the alarm, it has gone again (`gone_by`: by which night first), and with
    `total` what is left. One of an error that may have moved with the temperature, and has gone back with it, asks
    nobody who was at the machine (`went_with`).
    """
    if now is None:
        return list(alarms)
    told = [(_as_warm_as if a["cause"] == TEMPERATURE else _went_with)(a, now, believed) if a.get("warmer") else a for a in alarms]
    return [a | {"gone_by": _gone_by(a, night, recent)} if a["cause"] == TEMPERATURE and a.get("ended") else a for a in told]


def as_sure_as(alarms: Sequence[dict[str, Any]], now: float | None, recent: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """alarms of other nights, °C by a sensor that is believed tonight (None: there is none), records newest first → the same; where
    the machine is as warm as in the night before an alarm and what moved is still there, the alarm names no temperature beside
    its cause, and asks nobody to see to a sensor first.
    """
    then = {str(r["night"]): c for r in recent if (c := celsius_of(r)) is not None}

    def told(a: dict[str, Any]) -> dict[str, Any]:
        before = then.get(str(a.get("since")))
        asked = a["cause"] != TEMPERATURE and not a.get("warmer") and TEMPERATURE in (a.get("instead") or ())
        if now is None or before is None or abs(now - before) >= WARMER or not asked or not a["now"] or is_gone(a["now"]):
            return a
        do = a["do"].values["do"] if isinstance(a.get("do"), Said) and a["do"].key in SENSOR_FIRST else a.get("do")
        return a | {"instead": [n for n in a["instead"] if n != TEMPERATURE], "do": do}

    return [told(a) for a in alarms]


def as_early_as(
    alarms: Sequence[dict[str, Any]], older: Sequence[Mapping[str, Any]], recent: Sequence[Mapping[str, Any]], last: Since
) -> list[dict[str, Any]]:
    """alarms of tonight, those of other nights, records newest first, since when → the same; one of an error that may have been all
    of a change with temperature dates from the night before that, as long as no night since was as warm as then: it would have
    shown the error.
    """
    then = {str(r["night"]): c for r in recent if r.get("carried", True) and (c := celsius_of(r)) is not None}

    def may_be(a: Mapping[str, Any], w: Mapping[str, Any]) -> bool:
        known = w["cause"] == TEMPERATURE and w.get("warmer") and a["parameter"] in (w.get("instead") or ())
        if not known or a["since"] != last.date or not str(w.get("since") or last.date) < last.date:
            return False
        return all(abs(c - float(w["warmer"]["then"])) >= WARMER for night, c in then.items() if night > str(w["since"]))

    def told(a: dict[str, Any]) -> dict[str, Any]:
        meant = [w for w in older if may_be(a, w)]
        if not meant or any(a.get(key) for key in ("undoes", "repair", "rate_per_day")):
            return a
        first = min(meant, key=lambda w: str(w["since"]))
        since, night = str(first["since"]), str(first.get("night") or "")
        text = say("night.sensors.taken_for_warm", text=instead(a["text"], last.words, since), on=night)
        return a | {"text": text, "since": since, "on_part": instead(a["on_part"], last.date, since)}

    return [told(a) for a in alarms]


def _gone_by(alarm: Mapping[str, Any], night: str, recent: Sequence[Mapping[str, Any]]) -> str:
    """alarm that has gone again, date of tonight, records newest first → date of the first night that found it gone; '' where an
    earlier version has recorded that night.
    """
    last = [a for r in recent[:1] for key in ("standing", "unheard") for a in r.get(key) or ()]
    before: Mapping[str, Any] = next((a for a in last if alarm.get("id") in (a.get("id"), a.get("alarm"))), {})
    return str(before.get("gone_by") or "") if is_gone(before.get("now") or "") else night


def _as_warm_as(alarm: dict[str, Any], now: float, believed: bool) -> dict[str, Any]:
    """alarm of a change with temperature, °C that count, whether a sensor says so tonight → the same as it is by now: gone where
    the machine is about as warm as before, and not where it is as far off the other way.
    """
    then, kelvin = float(alarm["warmer"]["then"]), float(alarm["warmer"]["kelvin"])
    share = (now - then) / kelvin if kelvin else 1.0
    told = {"kelvin": f"{now - then:+.1f}", "now": f"{now:.1f}", "then": f"{then:.1f}"}
    if abs(share) >= BACK:  # as far off on the other side it is no machine as warm as before
        key = f"night.sensors.warm_{'still' if share > 0 else 'other'}{'' if believed else '_last'}"
        return alarm | {"now": say(key, **told), "confirmed": None}
    gone = say("night.sensors.warm_gone" if believed else "night.sensors.warm_gone_last", **told)
    left = {"now": gone, "total": float(alarm["size"]) * share}
    left |= {"confirmed": None, "ended": True}
    return alarm | left | ({"do": say("night.sensors.warm_gone_do")} if "do" in alarm else {})


def _went_with(alarm: dict[str, Any], now: float, believed: bool) -> dict[str, Any]:
    """alarm of an error on a machine that was warmer or colder, °C that count, whether a sensor says so tonight → the same; where
    both have gone back it says so.
    """
    then, kelvin = float(alarm["warmer"]["then"]), float(alarm["warmer"]["kelvin"])
    if not believed or not is_gone(alarm.get("now") or "") or abs(now - then) >= BACK * abs(kelvin) or "do" not in alarm:
        return alarm
    told = {"now": f"{now:.1f}", "then": f"{then:.1f}"}
    return alarm | {"went_with": told, "do": say("night.sensors.went_with_do", **told)}


def _explained(size: float, std: float, due: float) -> bool:
    """size of a change and its standard deviation, what the temperature would make → whether that is all of it."""
    return abs(size - due) < max(3 * std, SHARE * abs(due))


def _points(name: str, recent: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """parameter, records newest first → °C and value of the last nights that have both."""
    points = []
    for r in recent[:LOOKED]:
        own, celsius = own_of(r.get("parameters") or {}, name), celsius_of(r)
        if own is not None and celsius is not None:
            points.append((celsius, float(own["value"])))
    return points


def rates_shown(recent: Sequence[Mapping[str, Any]]) -> dict[str, tuple[float, float]]:
    """records newest first, of nights without an alarm of temperature → {parameter: what it did for each K, standard deviation of
    that}, by a straight line through its nights, of which none is known better than its own standard deviation.
    """
    found = {}
    for name in next((r["parameters"] for r in recent if r.get("parameters")), {}):
        points = _points(name, recent)
        stds = [float(own["std"]) for r in recent[:LOOKED] if (own := own_of(r.get("parameters") or {}, name)) is not None]
        if len(points) < ENOUGH:
            continue
        x, y = np.array(points).T
        apart = x - x.mean()
        width = float(apart @ apart)
        if width < STIRRED**2:
            continue
        rate = float(apart @ y) / width
        left = y - y.mean() - rate * apart
        spread = max(float(np.sqrt(left @ left / (len(points) - 2))), float(np.median(stds)))
        found[name] = rate, spread / float(np.sqrt(width))
    return found


def _rate(points: Sequence[tuple[float, float]]) -> tuple[float, int] | None:
    """°C and value of nights → per K, nights, where the parameter goes with the temperature; else None."""
    if len(points) < ENOUGH:
        return None
    x, y = np.array(points).T
    if float(np.std(x)) < STIRRED or float(np.std(y)) == 0:
        return None
    share = float(np.corrcoef(x, y)[0, 1]) ** 2
    return (float(np.polyfit(x, y, 1)[0]), len(points)) if share >= FOLLOWS else None
