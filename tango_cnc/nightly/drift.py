"""A parameter that goes one way: since when, how fast, how far, and in how many days it comes to a limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..records import Array
from ..report.texts import texts
from ..report.tonight import WARMED
from ..state import State
from ..state.effect import alike
from ..texts import say
from .alarms import Known, effect_of, others
from .control import reached
from .course import (
    ALIKE,
    Place,
    cause_of,
    followed,
    is_steady,
    largest_step,
    name_of,
    names_of,
    now_of,
    only,
)
from .dates import date_of
from .words import a_day, as_recorded, changed, one_day, sizes_of, value, what_of

LEAST = 2.0  # µm at the worst pose of the volume: a smaller drift is for the trend, not for the morning
TOLD = 3.5  # standard deviations from which a drift is a sentence, though no alarm yet
YEAR = 365.0  # d: what reaches a limit later than that is for the table


@dataclass(frozen=True)
class Drift:
    """A parameter that has moved since a night: by how much (its unit), how sure, how fast, what it does."""

    parameter: str
    since: str
    size: float
    std: float
    unit: str
    rate_per_day: float
    sigmas: float
    p_value: float  # of all that was tried
    on_part_um: float
    on_part: str
    do: str
    steady: bool  # night after night; false: most of it in one night
    alarms: bool = True  # where it is sure enough; false: a sentence, however sure
    limit: str = ""  # what reaches its limit if it goes on so
    nights: float | None = None  # in how many days that is
    swings: tuple[str, int] | None = None  # how it swings with the temperature (µm/K), over how many nights (nightly/swings.py)
    alike: Mapping[str, float] = field(default_factory=dict)  # locations that no touch tells from it, by how much for 1 of it
    step: float | None = None  # that one night made by itself, where it is not steady and other nights have added to it
    stepped: str = ""  # date of that night
    mean_of: int = 0  # nights of two means that differ so, of what goes to and fro from night to night

    @property
    def text(self) -> str:
        """→ a sentence without its full stop."""
        size = value(self.size, self.unit, self.std)
        if self.parameter == ALIKE:
            moved = texts()("changed.scales", size=size, since=self.since)
        else:
            moved = changed(self.parameter, size, self.since, self.alike, sizes_of(self.alike, self.size, self.std))
        if self.swings:
            return say("night.sensors.swings", text=moved, name=self.parameter, rate=self.swings[0], count=self.swings[1])
        if self.mean_of:
            return texts()("changed.beside_sway", moved=moved, count=self.mean_of)
        if not self.steady:
            told = None if self.step is None else value(self.step, self.unit)
            return moved if told is None else texts()("changed.one_night", moved=moved, step=told, night=self.stepped)
        moved = a_day(moved, self.rate_per_day, self.unit, self.alike)
        if self.nights is None:
            return moved
        return texts()(f"changed.reaches{one_day(self.nights)}", moved=moved, what=what_of(self.limit), nights=f"{self.nights:.0f}")


def limited(k: Known, d: Drift, after: State, limits: Sequence[Mapping[str, Any]], gone: Array | None) -> Drift:
    """→ the same, with the limit that it reaches first and when; as it is where it reaches none within a year."""
    if not limits or not d.steady:
        return d
    place = next((i for i in followed(k) if name_of(k, i) == d.parameter), None)
    if place is None:
        return d
    first = first_limit(k, place, d.rate_per_day, after, limits, gone)
    return d if first is None else replace(d, nights=first[0], limit=first[1])


def first_limit(
    k: Known, i: Place, rate: float, after: State, limits: Sequence[Mapping[str, Any]], gone: Array | None
) -> tuple[float, str] | None:
    """what is known, a parameter, its rate a day, state after tonight, limits, what the control takes away → in how many days it
    reaches the first limit, and which; None where it reaches none within a year.
    """
    a_day, mean = only(k, i, rate), after.mean if gone is None else after.mean - gone
    found = ((reached(k.followed, k.lever, mean, a_day, x), str(x["what"])) for x in limits)
    return min(((float(days), what) for days, what in found if days < YEAR), default=None)


def drift_of(
    k: Known,
    i: Place,
    record: Mapping[str, Any],
    size: float,
    std: float,
    after: State,
    sigmas: float,
    p_value: float,
    records: Sequence[Mapping[str, Any]],
    alarms: bool = True,
) -> Drift:
    """what is known, a parameter, night since which, size ± std, state after tonight, how sure, records since → the drift."""
    name, one = name_of(k, i), i[0] if isinstance(i, tuple) else i
    unit, cause = k.followed.units[one], cause_of(k, i)
    effect, on_part, do = effect_of(k, cause, name, size, unit, only(k, i, size), record["night"])
    begun = float(record["state"]["day"])
    between = [r for r in records if r.get("state") and r.get("parameters") and r["state"]["day"] >= begun]
    known = [[r["parameters"].get(n, {}).get("value") for n in names_of(k, i)] for r in between]
    whole = [(r, float(np.mean(row))) for r, row in zip(between, known, strict=True) if None not in row]
    values = [now_of(i, after)[0], *(mean for _, mean in whole)]
    steady, made = is_steady(values, size), dict[str, Any]()
    if not steady and len(whole) > 1:
        place, step = largest_step(values)
        made = {"step": step, "stepped": str(whole[place - 1][0]["night"]) if place else date_of(after.day)}
    do = drift_do(cause, name) if steady and name != ALIKE else do
    rate, same = size / max(after.day - begun, 1e-3), alike(k.cell.machine, name)
    return Drift(
        name, record["night"], size, std, unit, rate, sigmas, p_value, effect, on_part, do, steady, alarms, alike=same, **made
    )


def drift_do(cause: str, name: str) -> str:
    """cause, parameter that goes one way → what is to be done about it, as on its page: no clamp makes a scale longer."""
    return texts()("night.drift_warm_do" if cause in WARMED else "night.drift_do", name=name)


def as_alarm(found: Drift, k: Known) -> dict[str, Any]:
    """drift → the alarm of the record."""
    place = next(i for i in followed(k) if name_of(k, i) == found.parameter)
    return {
        **{"id": "", "since": found.since, "rate_per_day": found.rate_per_day, "steady": found.steady},
        "instead": others(k, found.parameter),
        **as_recorded(found.alike),
        **{"cause": cause_of(k, place)},
        **{"parameter": found.parameter, "text": found.text, "size": found.size, "std": found.std, "unit": found.unit},
        **{"sigmas": found.sigmas, "on_part_um": found.on_part_um, "on_part": found.on_part, "do": found.do},
    }
