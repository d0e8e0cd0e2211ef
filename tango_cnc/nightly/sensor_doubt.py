"""Which temperature sensors of a night are not believed though they speak: one that leaves the others, or jumps as no shop does.

A sensor in degrees Fahrenheit without a unit is a machine 45 K warmer, one in kelvin 273 K; a cable that has come off is one of
0 °C. Whoever believes that reads of parts that differ by a tenth of a millimetre. What a sensor does by habit (a spindle that is
hot or cold) is known from the nights before, and is no doubt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..texts import Said, joined, say

DOUBTED = "doubted"
BELIEVED = ("heard", "partly")
LEAVES = 15.0  # K that a sensor goes away from another one of a machine, from which one of both is in doubt
JUMPS = 25.0  # K from what a sensor has said of late: no shop is so much warmer or colder within a month
STRANGE = 30.0  # K between two sensors of which nobody knows what they say by habit
HABIT = 3.0  # times as far as it goes in nine of ten nights: what lies within is its habit
OFTEN = 0.9
LOOKED, LATELY = 30, 7  # records
REFERENCE = 20.0  # °C (ISO 1): of two new sensors that contradict one is nearer to it
KELVIN = 273.15  # K at 0 °C
NEAR = 4.0  # K: a value in another unit that comes so near to what was expected has that unit

SHOP = {"°F": (55.0, 95.0), "K": (278.0, 318.0)}  # of a shop: a machine of which every sensor says so much in °C has that unit


def in_doubt(
    found: Mapping[str, Mapping[str, Any]], recent: Sequence[Mapping[str, Any]], *, soon: bool
) -> dict[str, dict[str, Any]]:
    """what each sensor did tonight, records newest first, whether the last of them is no month ago → {sensor that is not believed:
    `why` (`jumped`, `left`, `strange`, `unit`), `kelvin` that it went too far}.
    """
    said = {name: float(s["mean"]) for name, s in found.items() if s["state"] in BELIEVED}
    past = [_said(r) for r in recent[:LOOKED]]
    jumps = {name: _jump(value, [p[name] for p in past if name in p]) for name, value in said.items()}
    doubts: dict[str, dict[str, Any]] = {
        name: {"why": "jumped", "kelvin": j}
        for name, (j, habit) in jumps.items()
        if habit is not None and soon and abs(j) >= max(JUMPS, HABIT * habit)
    }
    if _other_unit(said):
        doubts |= {name: {"why": "unit", "kelvin": j} for name, (j, habit) in jumps.items() if habit is None}
    left = [name for name in said if name not in doubts]
    apart = {(a, b): _apart(a, b, said, past) for a in left for b in left if a != b}
    for name in left:
        against = [b for b in left if b != name and apart[name, b] is not None]
        agree = len(left) - len(against)
        if len(against) < agree or not against:
            continue
        if len(against) == agree and abs(jumps[name][0]) <= float(np.median([abs(jumps[b][0]) for b in against])):
            continue
        sizes = [d for b in against if (d := apart[name, b]) is not None]
        size, why = sorted(sizes, key=lambda x: abs(x[0]))[len(sizes) // 2]
        doubts[name] = {"why": why, "kelvin": size}
    return {name: d | {"kelvin": round(float(d["kelvin"]), 2)} for name, d in doubts.items()}


def _said(record: Mapping[str, Any]) -> dict[str, float]:
    """record → {sensor: °C} of those that were believed in that night; none where all have another unit: versions before believed
    them.
    """
    sensors = record.get("sensors") or {n: {"state": BELIEVED[0], **t} for n, t in (record.get("temperatures") or {}).items()}
    said = {n: float(s["mean"]) for n, s in sensors.items() if s.get("state") in BELIEVED and "mean" in s}
    return {} if _other_unit(said) else said


def _other_unit(said: Mapping[str, float]) -> str:
    """{sensor: °C} of a night → the unit in which every one of them is a shop, where none is a machine in °C; else ''."""
    return next((u for u, (low, high) in SHOP.items() if said and all(low <= value <= high for value in said.values())), "")


def _celsius(value: float, unit: str) -> float:
    """value, °F or K → °C."""
    return (value - 32) / 1.8 if unit == "°F" else value - KELVIN


def _jump(value: float, past: Sequence[float]) -> tuple[float, float | None]:
    """°C of tonight, of the nights before, newest first → K from what it has said of late, K that it goes by habit (None: it is
    new, and counted from 20 °C).
    """
    if not past:
        return value - REFERENCE, None
    return value - float(np.median(past[:LATELY])), _habit(past)


def _habit(values: Sequence[float]) -> float:
    """values of nights → how far they go from their middle in nine of ten."""
    return float(np.quantile(np.abs(np.array(values) - np.median(values)), OFTEN))


def _apart(a: str, b: str, said: Mapping[str, float], past: Sequence[Mapping[str, float]]) -> tuple[float, str] | None:
    """two sensors, °C of tonight, of the nights before → K by which the first has left the second, and how they contradict each
    other; None where they agree.
    """
    usual, now = [p[a] - p[b] for p in past if a in p and b in p], said[a] - said[b]
    if not usual:
        return (now, "strange") if abs(now) >= STRANGE else None
    gone = now - float(np.median(usual))
    return (gone, "left") if abs(gone) >= max(LEAVES, HABIT * _habit(usual)) else None


def sentence(name: str, s: Mapping[str, Any]) -> Said:
    """sensor, what it did → that it is not believed, and why, without a full stop."""
    told = {"name": name, "value": f"{s['mean']:.1f}", "kelvin": f"{s['kelvin']:+.1f}", "others": ", ".join(s.get("by") or ())}
    if s["why"] == "unit":
        unit = _other_unit({name: float(s["mean"])}) or "°F"
        return say("night.sensors.doubted_unit", unit=unit, celsius=f"{_celsius(s['mean'], unit):.1f}", **told)
    why = s["why"] if s.get("by") else "jumped" if s["why"] == "jumped" else "alone"
    return joined("", (say(f"night.sensors.doubted_{why}", **told), _unit(s)))


def _unit(s: Mapping[str, Any]) -> Said | str:
    """what a sensor did → the unit in which it would be right; '' where none is near."""
    if "counts" in s:
        for unit in SHOP:
            if abs((value := _celsius(s["mean"], unit)) - s["counts"]) < NEAR:
                return say("night.sensors.other_unit", unit=unit, value=f"{value:.1f}")
    return ""
