"""An error that swings with the temperature from night to night: no drift, and nothing that a bearing or a clamp does.

A machine that is 2 K warmer moves by a few micrometres, and goes back with the shop. Counted in days that is a drift that stops,
turns and comes again. Counted in kelvins it is one number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import special

from ..records import Array
from ..state.changes import change
from ..texts import Said, say
from ..texts.number import number
from .drift import Drift
from .sensors import TEMPERATURE, celsius_of
from .standing import own_of
from .words import value

LEAST, MOST = 6, 60  # nights
BEFORE = 14  # nights looked at, at least, where there are so many
STIRRED = 0.5  # K, standard deviation of the temperature of these nights beside its own trend
FOLLOWS = 0.9  # share of the variance that the temperature explains
DRIFTS = 0.01  # chance of what goes one way beside it, below which it is a drift as well
SHARE = 0.25  # of what the temperature does, that a drift beside it has to make for it to be one
UNITS = ("mm", "rad", "mm/mm")


@dataclass(frozen=True)
class Swing:
    """How an error follows the temperature: so much per K (mm, rad … and its standard deviation), over how many nights, and how far
    it goes between the coldest and the warmest of them.
    """

    per_kelvin: float
    std: float
    nights: int
    whole: float
    unit: str

    @property
    def rate(self) -> str:
        """→ +2.0 ± 0.1 µm/K."""
        return value(self.per_kelvin, f"{self.unit}/K", self.std)


def swing(name: str, unit: str, points: Sequence[tuple[float, float, float]]) -> Swing | None:
    """parameter, its unit, (day, °C, value) of nights → how it follows the temperature; None for what does not, or drifts."""
    if len(points) < LEAST:
        return None
    day, warm, own = np.array(points[:MOST]).T
    trend = np.polyfit(day, warm, 1) if float(np.ptp(day)) else np.zeros(2)  # with the season anything goes along that drifts
    if (
        float(np.std(warm - np.polyval(trend, day))) < STIRRED
        or float(np.std(own)) == 0
        or float(np.corrcoef(warm, own)[0, 1]) ** 2 < FOLLOWS
    ):
        return None
    slope, std, _ = _fitted(np.column_stack([np.ones_like(day), warm - warm.mean()]), own)
    whole = abs(slope) * float(np.ptp(warm))
    drift, drift_std, dof = _fitted(np.column_stack([np.ones_like(day), day - day.mean(), warm - warm.mean()]), own)
    chance = 2 * float(special.stdtr(dof, -abs(drift) / drift_std)) if drift_std > 0 else 0.0
    if chance < DRIFTS and abs(drift) * float(np.ptp(day)) > SHARE * whole:
        return None
    return Swing(slope, std, len(day), whole, unit)


def _fitted(columns: Array, own: Array) -> tuple[float, float, int]:
    """(n, m) columns, (n,) values → coefficient of the second column, its standard deviation, degrees of freedom."""
    found, *_ = np.linalg.lstsq(columns, own, rcond=None)
    left, dof = own - columns @ found, max(len(own) - columns.shape[1], 1)
    spread = float(left @ left) / dof * np.linalg.inv(columns.T @ columns)
    return float(found[1]), float(np.sqrt(spread[1, 1])), dof


def points_of(
    name: str, since: str, recent: Sequence[Mapping[str, Any]], tonight: tuple[float, float, Mapping[str, Any]] | None
) -> list[tuple[float, float, float]]:
    """parameter, date since when it has moved, records newest first, day, °C and parameters of tonight (None: not believed, or
    not known) → (day, °C, value) of the nights since then and `BEFORE` in all; those before what the
    machine does for every K was known.
    """
    warmed = next((i for i, r in enumerate(recent) if any(a["cause"] == TEMPERATURE for a in r.get("alarms") or ())), -1)
    found = []
    if tonight is not None and warmed < 0 and (own := own_of(tonight[2], name)) is not None:
        found.append((tonight[0], tonight[1], float(own["value"])))
    for r in recent[warmed + 1 :]:
        own, celsius = own_of(r.get("parameters") or {}, name), celsius_of(r)
        if own is None or celsius is None or not r.get("state"):
            continue
        if len(found) >= BEFORE and str(r["night"]) < since:
            break
        found.append((float(r["state"]["day"]), celsius, float(own["value"])))
    return found


def as_swing(
    alarm: dict[str, Any],
    recent: Sequence[Mapping[str, Any]],
    tonight: tuple[float, float, Mapping[str, Any]] | None,
) -> dict[str, Any]:
    """alarm of another night, records newest first, day, °C and parameters of tonight (None: not believed, or not known) → the
    same; one whose parameter follows the temperature, its own night among them, says so, and is no drift.
    """
    if (
        alarm["unit"] not in UNITS
        or change(alarm["cause"]).of_the_probe
        or not alarm.get("size")
        or alarm.get("undoes")
        or alarm.get("repair")
    ):
        return alarm
    found = swing(alarm["parameter"], alarm["unit"], points_of(alarm["parameter"], str(alarm["since"]), recent, tonight))
    if found is None:
        return alarm
    words = {"name": alarm["parameter"], "rate": found.rate, "count": found.nights}
    part = abs(float(alarm["on_part_um"] or 0.0) * found.whole / float(alarm["size"]))
    told = {"swing": {"per_kelvin": found.per_kelvin, "std": found.std, "nights": found.nights}, "on_part_um": part}
    told |= {"on_part": say("cause.temperature.on_part", effect=number(part, "µm", signed=False))}
    told |= {"text": say("night.sensors.swings", text=_plain(alarm["text"]), **words)}
    told |= {"do": say("night.sensors.swings_do", name=alarm["parameter"]), "now": "", "total": None, "rate_per_day": None}
    told |= {"steady": False, "confirmed": None, "instead": [n for n in alarm.get("instead") or () if n != TEMPERATURE]}
    return {key: x for key, x in alarm.items() if key not in ("ahead", "stands", "slowed")} | told


def _plain(text: Any) -> Any:
    """sentence of an alarm → the same without its rate a day, and without that it goes with the temperature."""
    if not isinstance(text, Said):
        return text
    if text.key in ("changed.drift", "changed.drift_first", "changed.reaches", "changed.reaches_one"):
        return _plain(text.values["moved"])
    return _plain(text.values["text"]) if text.key == "night.sensors.goes_with" else text


def without_swing(
    moving: Drift | None, recent: Sequence[Mapping[str, Any]], tonight: tuple[float, float, Mapping[str, Any]] | None
) -> Drift | None:
    """drift of tonight, records newest first, day, °C and parameters of tonight → the same; what swings with the temperature is no
    alarm and goes on at no rate a day, and its sentence says so.
    """
    if moving is None or moving.unit not in UNITS:
        return moving
    found = swing(moving.parameter, moving.unit, points_of(moving.parameter, moving.since, recent, tonight))
    if found is None:
        return moving
    return replace(moving, swings=(found.rate, found.nights), steady=False, alarms=False, nights=None, limit="")
