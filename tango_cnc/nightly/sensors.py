"""Temperature sensors of a night that fall silent or freeze: which one, since when, and what temperature counts in its place.

An error of the machine is compared at the temperature of the night. The mean of other sensors is another temperature: where one
falls silent, a machine that has not warmed would seem to have, or the other way round.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np

from ..records import Array, Readings
from ..report.texts import texts
from ..state.naming import WARMER
from ..terms import SCALES
from ..texts import Said, joined, say
from .sensor_doubt import DOUBTED, in_doubt, sentence

TEMPERATURE = "temperature"  # cause of an alarm
ALIKE = {f"night.sensors.{key}": f"night.sensors.{key}_all" for key in ("silent", "gone", "never")}  # of one: of several
HEARD, PARTLY, SILENT, FROZEN = "heard", "partly", "silent", "frozen"
MOST = 0.5  # of the touches that have to have a value, for what was heard to stand for the others
FEW = 0.1  # of the touches that may be without one and nobody need know: the first message of a broker comes when it comes
RARE = 0.02  # chance of a sensor that lives, below which what it says again and again is no temperature
SAME = 1e-6  # K
MONTH = 30  # nights of one value before a sensor that says whole degrees is thought to hang
A_KELVIN = {"mm": 5e-3, "rad": 5e-6, "mm/mm": 2e-5}  # what moves by more for a kelvin is no matter of temperature
UNSEEN = 10.0  # K: a shop that nobody hears goes no farther from what it was last
TOLD = 14  # days for which a column that is there no more is told; somebody may have taken the sensor away


def states(
    readings: Readings, recent: Sequence[Mapping[str, Any]], night: str = "", strange: Mapping[str, str] | None = None
) -> dict[str, dict[str, Any]]:
    """readings, records newest first, date of the night ('': soon after), {sensor: what it said that is no temperature} → member
    `sensors` of the record: {sensor: state, since, values that it gave, `counts`: °C that counts in its place, `said`: what is no
    temperature}. Which sensor is believed is decided here alone.
    """
    before = next((r for r in recent if r.get("sensors") or r.get("temperatures")), {})
    known = {**{n: {"state": HEARD, **t} for n, t in (before.get("temperatures") or {}).items()}, **(before.get("sensors") or {})}
    found: dict[str, dict[str, Any]] = {}
    for name in dict.fromkeys((*readings.temperatures, *known)):
        own, values = known.get(name), readings.temperatures.get(name)
        if values is None and own is not None and own.get("gone") and _age(own.get("since"), before) > TOLD and not _counts(own):
            continue
        found[name] = _state(name, values, own, before, recent)
    soon = not night or not before or _age(before.get("night"), {"night": night}) <= MONTH
    for name, doubt in in_doubt(found, recent, soon=soon).items():
        own = known.get(name) or {}
        since = own.get("since") if own.get("state") == DOUBTED else str(before["night"]) if own and before else None
        said = {key: found[name][key] for key in ("mean", "first", "last")}
        found[name] = {"state": DOUBTED, "since": since, **doubt, **said}
    for name, text in (strange or {}).items():
        if found.get(name, {}).get("state") == SILENT:
            found[name] |= {"said": text}
    alive = {name for name, s in found.items() if s["state"] in (HEARD, PARTLY)}
    for name, s in found.items():
        last = _counts(known.get(name))
        if name in alive or last is None or s.get("why") == "unit":
            continue
        then = {n: v for n in alive if n != name and (v := _counts(known.get(n))) is not None}
        moved = float(np.mean([found[n]["mean"] - v for n, v in then.items()])) if then else 0.0
        s |= {"counts": round(last + moved, 4), "by": sorted(then)}
    return found


def _state(
    name: str, values: Array | None, own: Mapping[str, Any] | None, before: Mapping[str, Any], recent: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """→ what one sensor did tonight."""
    night = str(before.get("night") or "")
    quiet = own is not None and own["state"] == SILENT
    since = (own or {}).get("since") if quiet else night if own is not None else None
    if values is None:
        return {"state": SILENT, "since": since, "gone": True}
    heard = np.isfinite(values)
    if heard.sum() < max(MOST * len(values), 1):
        return {"state": SILENT, "since": since, "heard": int(heard.sum())}
    said = np.asarray(values)[heard]
    found = {"mean": float(np.mean(said)), "first": float(said[0]), "last": float(said[-1])}
    if (frozen := _frozen_since(name, found, recent)) is not None:
        return {"state": FROZEN, "since": frozen, **found}
    last = int(np.flatnonzero(heard)[-1])
    ends = last < len(values) - 1  # silent at the end of the run
    if heard.all() or (not ends and np.mean(~heard) <= FEW):
        return {"state": HEARD, **found}
    return {"state": PARTLY, "missing": int((~heard).sum()), **({"after": last + 1} if ends else {}), **found}


def _frozen_since(name: str, found: Mapping[str, float], recent: Sequence[Mapping[str, Any]]) -> str | None:
    """sensor, what it said tonight, records newest first → the night since which it says the same to the last digit, where chance
    would hardly do so with this sensor; else None.
    """
    said = [(str(r.get("night")), (r.get("sensors") or {}).get(name) or (r.get("temperatures") or {}).get(name)) for r in recent]
    own = [("", dict(found)), *((night, s) for night, s in said if s and "mean" in s)]
    again = [_again(now, then) for (_, now), (_, then) in pairwise(own)]
    run = next((i for i, same in enumerate(again) if not same), len(again))
    if not run:
        return None
    earlier = again[run:]
    usual = [(sum(earlier) + 0.5 + i) / (len(earlier) + 1 + i) for i in range(run)]  # Jeffreys
    coarse = all(
        _still(one) for _, one in own[run:]
    )  # never seen to move in a night: whole degrees, or it hung from the first one on
    if math.prod(usual) >= RARE or (coarse and run < MONTH):
        return None
    night, last = own[run]
    return str(last.get("since") or night) if last.get("state") == FROZEN else night


def _still(said: Mapping[str, Any]) -> bool:
    """what a sensor said in a night → whether it was the same at every touch."""
    return all(abs(float(said[key]) - float(said["last"])) < SAME for key in ("mean", "first"))


def _again(now: Mapping[str, Any], then: Mapping[str, Any]) -> bool:
    """what a sensor said in a night, in the one before → whether it said all the time what the other ended with."""
    return all(abs(float(now[key]) - float(then["last"])) < SAME for key in ("mean", "first", "last"))


def _counts(known: Mapping[str, Any] | None) -> float | None:
    """sensor in a record → °C of it that counted in that night; None where nothing is known."""
    if known is None:
        return None
    value = known.get("counts", known.get("mean") if known.get("state") in (HEARD, PARTLY) else None)
    return None if value is None else float(value)


def _age(since: str | None, record: Mapping[str, Any]) -> float:
    """date or None, record → days from one to the other."""
    try:
        return float((date.fromisoformat(str(record.get("night"))) - date.fromisoformat(str(since))).days)
    except ValueError:
        return math.inf


def counted(readings: Readings, sensors: Mapping[str, Mapping[str, Any]] | None) -> Readings:
    """readings of a night, member `sensors` of its record (None: of an older version) → the same with the temperatures that count.

    What was heard stands for the touches beside it. A sensor without a voice varies as the others do.
    """
    if not sensors or (not readings.temperatures and not any("counts" in s for s in sensors.values())):
        return readings
    place = np.arange(len(readings))
    found: dict[str, Array] = {}
    for name, s in sensors.items():
        values = readings.temperatures.get(name)
        if s["state"] in (HEARD, PARTLY) and values is not None and np.isfinite(values).any():
            heard = np.isfinite(values)
            found[name] = np.interp(place, place[heard], np.asarray(values)[heard])
    alive = dict(found)
    for name, s in sensors.items():
        if "counts" in s and name not in alive:
            others = [alive[n] - alive[n].mean() for n in s.get("by") or () if n in alive]
            found[name] = float(s["counts"]) + (np.mean(others, axis=0) if others else np.zeros(len(readings)))
    return replace(readings, temperatures=found)


def told(sensors: Mapping[str, Mapping[str, Any]], wanted: str | None, night: str) -> dict[str, Any]:
    """member `sensors`, the sensor that counts (None: all), date of the night → member `temperature` of the record: `text`, which
    sensors, since when, and what the verdict rests on; {} where every sensor speaks.
    """
    bad = {name: s for name, s in sensors.items() if s["state"] != HEARD and not _left(s, night)}
    if wanted is not None and wanted not in sensors and sensors:
        bad[wanted] = {"state": SILENT, "since": None}
    if not bad:
        return {}
    counting = [n for n in bad if wanted in (None, n) or wanted not in sensors]
    parts = _each(bad)
    lost = [n for n in counting if bad[n]["state"] != PARTLY]
    doubt = [n for n in lost if "counts" in bad[n] and not bad[n]["by"]]
    rests, text = "sensors", say("night.sensors.rests_heard")
    if not counting:
        text = say("night.sensors.rests_other", sensor=wanted)
    elif lost:
        rests, text = _rests(bad, lost, sensors)
    disbelieved = [n for n, s in bad.items() if s["state"] == DOUBTED or "said" in s]
    text = joined(" ", (text, say("night.sensors.doubted_do"))) if disbelieved else text
    whole = {"rests": rests, "sensors": list(bad), "doubt": bool(doubt), "text": joined("", (joined("; ", parts), ". ", text))}
    return whole | ({"doubted": disbelieved} if disbelieved else {})


def _left(s: Mapping[str, Any], night: str) -> bool:
    """sensor of a record, its night → whether its column is gone for so long that nobody waits for it."""
    return bool(s.get("gone")) and s.get("since") is not None and _age(s["since"], {"night": night}) > TOLD


def _rests(bad: Mapping[str, Any], lost: Sequence[str], sensors: Mapping[str, Any]) -> tuple[str, Said]:
    """sensors that do not speak, those of them that would count, all → what counts in their place, and the sentence on it."""
    by = sorted({n for name in lost for n in bad[name].get("by") or ()})
    if by:
        values = ", ".join(f"{name} {bad[name]['counts']:.1f} °C" for name in lost if "counts" in bad[name])
        return "others", say("night.sensors.rests_others", others=", ".join(by), values=values)
    last = next((bad[name]["counts"] for name in lost if "counts" in bad[name]), None)
    if last is not None:
        return "earlier", say("night.sensors.rests_earlier", value=f"{last:.1f}")
    alive = [n for n, s in sensors.items() if s["state"] in (HEARD, PARTLY)]
    if alive:
        return "others", say("night.sensors.rests_these", others=", ".join(alive))
    return "nothing", say("night.sensors.rests_nothing")


def _each(bad: Mapping[str, Mapping[str, Any]]) -> list[Said]:
    """sensors that do not speak → a sentence for each, without its full stop; those of which it is the same have one together."""
    found: dict[Said, tuple[Said, list[str]]] = {}
    for name, s in bad.items():
        own = _one(name, s)
        found.setdefault(own.but(name="") if own.key in ALIKE else own, (own, []))[1].append(name)
    return [
        own if len(names) == 1 else say(ALIKE[own.key], **{**own.values, "name": ", ".join(names)}) for own, names in found.values()
    ]


def _one(name: str, s: Mapping[str, Any]) -> Said:
    """sensor, what it did → a sentence without its full stop."""
    if s["state"] == PARTLY:
        if "after" in s:
            return say("night.sensors.fell", name=name, touch=s["after"], value=f"{s['last']:.1f}")
        return say("night.sensors.gaps", name=name, count=s["missing"])
    if s["state"] == DOUBTED:
        return sentence(name, s)
    if s["state"] == FROZEN:
        return say("night.sensors.frozen", name=name, since=s["since"], value=f"{s['last']:.3f}")
    if "said" in s:
        key = "night.sensors.strange" if s.get("since") else "night.sensors.strange_ever"
        return say(key, name=name, said=s["said"], since=s.get("since") or "")
    if s.get("since"):
        return say(f"night.sensors.{'gone' if s.get('gone') else 'silent'}", name=name, since=s["since"])
    return say("night.sensors.never", name=name)


def see_to_it_first(alarms: Sequence[dict[str, Any]], temperature: Mapping[str, Any]) -> list[dict[str, Any]]:
    """alarms of tonight, member `temperature` → the same; where what counts was not measured tonight and the alarm may be no more
    than a machine that is warmer or colder, that is what else it may be, and the sensor is the first thing to be seen to.
    """
    if temperature.get("rests", "sensors") == "sensors":
        return list(alarms)
    names = ", ".join(temperature["sensors"])
    key = "night.sensors.do_doubted" if temperature.get("doubted") else "night.sensors.do"
    found = []
    for a in alarms:
        doubt = bool(temperature["doubt"]) and _in_reach(a)
        if doubt and a["cause"] != TEMPERATURE:
            a = a | {"instead": [TEMPERATURE, *(n for n in a["instead"] if n != TEMPERATURE)]}
        if TEMPERATURE in (a["cause"], *a["instead"]):  # a sensor beside others that are believed has nothing to do with a knock
            a = a | {"do": say(key, do=a["do"], names=names)}
        found.append(a)
    return found


def _in_reach(alarm: Mapping[str, Any]) -> bool:
    """alarm → whether a shop that nobody hears may have made its size by its temperature alone."""
    size, most = alarm.get("size"), A_KELVIN.get(str(alarm.get("unit")))
    return size is None or most is None or abs(float(size)) <= most * UNSEEN


def by_how_much(
    sensors: Mapping[str, Any], now: float, then: float, night: str, sensor: str | None = None
) -> tuple[list[str], dict[str, Any]]:
    """member `sensors`, °C of tonight and of a night, that night, the sensor that counts (None: all) → the sensors whose °C these
    are, and what a sentence needs of it.
    """
    names = [sensor] if sensor is not None and sensor in sensors else [n for n in sensors if speaks(sensors, n)] or list(sensors)
    said: Said | str = names[0] if len(names) == 1 else say("night.sensors.mean_of", names=", ".join(names)) if names else ""
    if len(names) == 1 and not speaks(sensors, names[0]) and (by := sensors[names[0]].get("by")):
        said = say("night.sensors.by", name=names[0], others=", ".join(by))
    degrees = {"now": f"{now:.1f}", "then": f"{then:.1f}", "kelvin": f"{abs(now - then):.1f}"}
    return names, degrees | {"sensor": said, "night": night}


def how_warm(
    alarm: dict[str, Any],
    sensors: Mapping[str, Any],
    now: float | None,
    recent: Sequence[Mapping[str, Any]],
    sensor: str | None = None,
) -> dict[str, Any]:
    """alarm of a change with temperature, member `sensors`, °C that count, records newest first, the sensor that counts (None: all)
    → the same with how much warmer the machine is, by which sensors, and than in which night: the last one that was clearly warmer
    or colder; where a single error may be all of it, who was at the machine is asked first. Any other alarm as it is.
    """
    then = [(c, str(r["night"])) for r in recent if r.get("carried", True) and (c := celsius_of(r)) is not None]
    if alarm["cause"] != TEMPERATURE or now is None or not then:
        return alarm
    last, night = next(((c, n) for c, n in then if abs(now - c) >= WARMER), then[0])
    names, told = by_how_much(sensors, now, last, night, sensor)
    key = "changed.warmer" if now >= last else "changed.colder"
    text = say(key, size=alarm["text"].values["size"], **told)
    knocks = [name for name in alarm.get("instead") or () if name not in ("scales", *SCALES)]  # no knock moves a scale
    meant = joined(", ", map(_meant, knocks))
    asked = {"do": say("night.sensors.do_knock", do=alarm["do"], names=meant)} if meant else {}
    text = say("night.sensors.or_knock", text=text, names=meant) if meant else text
    warmer = {"sensors": names, "celsius": now, "kelvin": now - last, "then": last, "night": night}
    return alarm | {"text": text, "warmer": warmer} | asked


def _meant(name: str) -> str:
    """cause or parameter that may be meant → its word, which a page translates; the symbol of an error of an axis."""
    kind, _, place = name.partition(" ")
    if f"cause_name.{name}" in texts():
        return say(f"cause_name.{name}")
    return say(f"followed.{kind}", name=place) if f"followed.{kind}" in texts() else name


def speaks(sensors: Mapping[str, Mapping[str, Any]], name: str) -> bool:
    """member `sensors`, name → whether what it says is believed."""
    return sensors.get(name, {}).get("state") in (HEARD, PARTLY)


def celsius_of(record: Mapping[str, Any]) -> float | None:
    """record of a night → °C that counted; None where no sensor said any."""
    counted_then = (record.get("volume") or {}).get("celsius")
    if counted_then is not None and record.get("sensors"):
        return float(counted_then)
    values = [float(t["mean"]) for t in (record.get("temperatures") or {}).values()]
    return float(np.mean(values)) if values else None
