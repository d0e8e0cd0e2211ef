"""Temperature columns of readings: which are not believed, in which unit they would be right, and which contradict what is stated.

Files have °C. A logger that writes °F makes a machine 48 K warmer than it is, and every K of it 1.8 K. What a column says is
compared with temperature.yaml, else with 20 °C, by the distances from which a night doubts a sensor.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..records import Array
from .temperature import COLD, KELVIN, REFERENCE, Known, Thermal

STRANGE = 30.0  # K from what is expected: no column is believed so far away
LEAVES = 15.0  # K from which one is not believed where another unit explains it
NEAR = (4.0, 12.5)  # K from what is expected, stated and not: so near a value in another unit is that of a workshop
APART = {"bar": 1.0, "machine": 1.0, "table": 2.0, "air": 2.0}  # K by which a column may differ from the same thing stated
AROUND = 5.0  # K from everything that is stated: one column at least is nearer
UNITS = ("°F", "K")
HOT = {"spindle", "motor", "drive", "bearing", "oil", "coolant"}  # words in names of what is warm by habit
HOTTER = 70.0  # K from what is expected, of these


@dataclass(frozen=True)
class SensorColumn:
    """What one column says, °C as it is read."""

    sensor: str
    low: float
    high: float
    expected: float  # °C
    stated: bool  # whether temperature.yaml says what is expected
    unit: str  # in which it would be right; "" where none is
    believed: bool

    @property
    def text(self) -> str:
        """→ for people: that it is not believed, and in which unit it would be right."""
        by = f"temperature.yaml states {self.expected:g} °C" if self.stated else f"a workshop has about {self.expected:g} °C"
        one, two = (_from(self.unit, value) for value in (self.low, self.high))
        as_unit = f"; read in {self.unit} it would be {_span(one, two)} °C" if self.unit else ""
        return f"column T_{self.sensor} says {_span(self.low, self.high)} °C, and {by}{as_unit}"


def columns(sensors: Mapping[str, Array], thermal: Thermal | None) -> tuple[SensorColumn, ...]:
    """{sensor: (n,) °C, NaN where it is not known}, what temperature.yaml states → every column that says something."""
    found = []
    for sensor, values in sensors.items():
        known = values[np.isfinite(values)]
        if not len(known):
            continue
        at, stated = float(known.mean()), _stated(sensor, thermal)
        expected = REFERENCE if stated is None else stated.value
        near = NEAR[stated is None]
        hot = bool(HOT & set(_words(sensor)))
        leaves, strange = (HOTTER, HOTTER) if hot else (LEAVES, STRANGE)
        unit = next((u for u in UNITS if abs(_from(u, at) - expected) < near and abs(at - expected) >= leaves), "")
        believed = not unit and abs(at - expected) < strange and at > COLD
        found.append(SensorColumn(sensor, float(known.min()), float(known.max()), expected, stated is not None, unit, believed))
    return tuple(found)


def doubted(sensors: Mapping[str, Array], thermal: Thermal | None) -> tuple[SensorColumn, ...]:
    """as `columns` → those that are not believed."""
    return tuple(c for c in columns(sensors, thermal) if not c.believed)


def said(sensors: Mapping[str, Array], thermal: Thermal | None) -> tuple[str, ...]:
    """as `columns` → sentences on what is not believed, and on what temperature.yaml contradicts."""
    every = columns(sensors, thermal)
    found = [f"{c.text}: it is not believed. Write the column in °C" for c in every if not c.believed]
    if thermal is None:
        return tuple(found)
    believed = {c.sensor: float(np.nanmean(sensors[c.sensor])) for c in every if c.believed}
    named = {sensor: thing for sensor in believed if (thing := _thing(sensor, thermal)) is not None}
    for sensor, thing in named.items():
        told = _things(thermal)[thing]
        if abs(believed[sensor] - told.value) > APART[thing] + 3 * told.std:
            found.append(
                f"column T_{sensor} says {believed[sensor]:.1f} °C on average, and temperature.yaml states {told.value:g} ± "
                f"{told.std:.2g} °C of the {thing}: one of the two is wrong, or of another day"
            )
    others = [value for sensor, value in believed.items() if sensor not in named]
    around = [(t.value, 3 * t.std) for t in _things(thermal).values()]
    if others and not named and min(abs(v - t) - more for v in others for t, more in around) > AROUND:
        nearest = min(others, key=lambda v: min(abs(v - t) for t, _ in around))
        stated = ", ".join(f"{name} {t.value:g}" for name, t in _things(thermal).items())
        found.append(
            f"no temperature column of the readings is within {AROUND:g} K of temperature.yaml ({stated} °C; the nearest says "
            f"{nearest:.1f} °C on average): one of the two is wrong, or of another day"
        )
    return tuple(found)


def _from(unit: str, value: float) -> float:
    return (value - 32) / 1.8 if unit == "°F" else value - KELVIN


def _span(low: float, high: float) -> str:
    return f"{low:.1f}" if f"{low:.1f}" == f"{high:.1f}" else f"{low:.1f} to {high:.1f}"


def _things(thermal: Thermal) -> dict[str, Known]:
    """temperatures → those that somebody has stated, by name."""
    known = {"bar": thermal.bar, "machine": thermal.machine, "table": thermal.table, "air": thermal.air}
    return {name: t for name, t in known.items() if t is not None and name not in thermal.by_air}


def _thing(sensor: str, thermal: Thermal) -> str | None:
    """sensor, temperatures → the stated thing that its name contains as a word."""
    words = _words(sensor)
    return next((name for name in _things(thermal) if name in words), None)


def _words(sensor: str) -> list[str]:
    return re.split(r"[\W_\d]+", sensor.lower())


def _stated(sensor: str, thermal: Thermal | None) -> Known | None:
    """sensor, temperatures → what is expected of it; None where nobody has stated anything."""
    if thermal is None or thermal.assumed:
        return None
    thing, known = _thing(sensor, thermal), _things(thermal)
    if thing is not None:
        return known[thing]
    return Known(float(np.median([t.value for t in known.values()])), 0.0)
