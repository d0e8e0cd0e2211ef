"""Small steps of the analysis of a night: what is opened after a change, and numbers as a record has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..estimate import Estimate
from ..history import Knowledge
from ..model import Model, known, linearise
from ..records import Array, Indexation, Machine, Readings, Strategy
from ..state import Frame, Named, Seen, State, Tonight, reopened
from ..state.filter import sigma_of, unknown
from ..state.frame import PRETRAVEL
from ..state.naming import WARMER
from ..texts import say
from ..touches import from_readings
from .control import COVER
from .sensors import TEMPERATURE, celsius_of

LINEAR = 0.05  # mm: on a ball of 20 mm, a probe that is off by more meets it elsewhere by more than a tenth of a micrometre
UNMOVED = 1e-4  # of a variance: touches that take out less change nothing


def part_of(strategy: Strategy, touches: Sequence[int]) -> tuple[Strategy, list[int]]:
    """strategy, numbers of touches (empty: all) → the strategy of these alone, and their numbers."""
    wanted, number, kept, numbers = set(touches), 0, [], []
    for indexation in strategy.indexations:
        own = []
        for facet in indexation.facets:
            number += 1
            if not wanted or number in wanted:
                own.append(facet)
                numbers.append(number)
        if own:
            kept.append(Indexation(indexation.position, tuple(own)))
    return replace(strategy, indexations=tuple(kept)), numbers


def opened(ahead: State, followed: Frame, named: Named | None) -> State:
    """predicted state, what changed → the state that lets it."""
    warm = named is not None and any(one.hypothesis.cause == TEMPERATURE for one in named.all)
    learned = not unknown(followed, ahead)  # an error that goes on as it did for every K has moved by itself
    if named is None or named.remains < 1e-4:
        wide = reopened(ahead, followed, None)
    elif not (own := [one for one in named.all if learned or one.hypothesis.cause != TEMPERATURE]):
        wide = ahead
    else:
        wide = reopened(ahead, followed, np.hstack([_wide(one) for one in own]))
    return reopened(wide, followed, None, True) if warm else wide


def as_last_night(followed: Frame, ahead: State, now: float | None, recent: Sequence[Mapping[str, Any]]) -> State:
    """frame, predicted state, °C that count, records newest first → the state as it is known: before it is known what the machine
    does for each K, it is of the temperature of the last night, where that was clearly another one than tonight's.
    """
    then = next((c for r in recent if r.get("carried", True) and (c := celsius_of(r)) is not None), None)
    if now is None or then is None or not unknown(followed, ahead) or abs(now - then) < WARMER:
        return ahead
    return replace(ahead, reference=then)


def far(named: Named | None) -> Array | None:
    """what changed → (p,) change of the unknowns by the first cause, where it is so large that touches are not linear over it; else
    None. What is named beside it may be no more than that.
    """
    if named is None:
        return None
    moved: Array = named.hypothesis.directions @ named.size
    return moved if float(np.abs(moved).max()) > LINEAR else None


def _wide(named: Named) -> Array:
    """a cause → (p, m) its directions, as long as it may have moved along them."""
    spread = np.maximum(np.abs(named.size), 3 * np.where(np.isfinite(named.std), named.std, 0.0))
    return named.hypothesis.directions * (3 * np.maximum(spread, 1e-9))


def estimated(followed: Frame, readings: Readings, after: State, tonight: Tonight) -> Estimate:
    """frame, readings, state after tonight, its judgement → what is known now, as the estimate that every other stage reads."""
    whole = followed.model
    touches = from_readings(triggering(whole.touches.machine, followed, after), whole.touches.artefact, readings)
    model = Model(touches, whole.coefficients)
    places = [followed.place[name] for name in model.names]
    values = after.mean[places]
    gaps, jacobian = linearise(model, values)
    offsets, rows, uncertainty = known(model, values)
    sigma = float(np.sqrt(tonight.noise[0] / tonight.noise[1])) if tonight.noise[1] > 0 else sigma_of(after)
    selection = replace(followed.selection, model=model)
    return Estimate(
        selection,
        values,
        after.covariance[np.ix_(places, places)],
        gaps,
        max(sigma, 1e-6),
        max(int(tonight.noise[1]), 1),
        0,
        np.vstack([jacobian, rows]),
        offsets,
        np.asarray(max(sigma, 1e-6) / uncertainty),
    )


def triggering(machine: Machine, followed: Frame, state: State) -> Machine:
    """machine, frame, state → the machine with the radius by which its probe triggers: that of the tip, less the pretravel."""
    later = float(state.mean[followed.place[PRETRAVEL]])
    return machine if later == 0 else replace(machine, probe=replace(machine.probe, tip_radius=machine.probe.tip_radius - later))


def change(tonight: Tonight, limit: float, rate: float) -> dict[str, Any]:
    """test of the night, p-value below which it alarms, false alarms a night of all tests → member `change` of the record."""
    return {
        **{"p_value": tonight.p_value, "statistic": tonight.statistic / tonight.scale, "dof": tonight.dof, "limit": limit},
        **{"p_machine": tonight.p_machine, "p_noise": tonight.p_noise},
        "text": say("night.parts.one_false_alarm_nights_expected", rate=f"{1 / rate:.0f}"),
    }


def residual(what: Seen, after: State, tonight: Tonight) -> dict[str, Any]:
    """touches of tonight, state after them, their judgement → member `residual` of the record."""
    touches = what.touch > 0
    left = what.value[touches] - what.rows[touches] @ after.mean
    squares, dof = tonight.noise
    std = max(float(np.sqrt(squares / dof)) if dof > 0 else sigma_of(after), 1e-6)
    found = {"rms_um": float(np.sqrt(np.mean(left**2))) * 1e3, "std_um": std * 1e3, "dof": max(int(dof), 1)}
    return found | ({"wider": tonight.wider} if tonight.wider > 1 else {})


def wider(record: Mapping[str, Any]) -> float:
    """record of a night → times as much as stated that its touches scattered, where that was no chance; else 1."""
    return float((record.get("residual") or {}).get("wider") or 1.0)


def knowledge(state: State) -> Knowledge:
    """state → what the history keeps of it."""
    return Knowledge(state.names, state.mean, state.covariance)


def three(knowledge: Knowledge) -> tuple[tuple[str, ...], Array, Array]:
    """knowledge → names, values, covariance."""
    return knowledge.names, knowledge.values, knowledge.covariance


def warmth(readings: Readings, sensor: str | None) -> dict[str, Array]:
    """readings, sensor → {sensor: (n,) °C} that count."""
    found = {name: np.asarray(values) for name, values in readings.temperatures.items() if np.isfinite(values).all()}
    return {sensor: found[sensor]} if sensor in found else found


def mean(warmth: Mapping[str, Array]) -> float | None:
    """{sensor: °C} → their mean, None without one."""
    return float(np.mean([values.mean() for values in warmth.values()])) if warmth else None


def warmer(ahead: State, warmth: Mapping[str, Array]) -> float | None:
    """predicted state, {sensor: °C} → K above the reference."""
    now = mean(warmth)
    return None if now is None or ahead.reference is None else now - ahead.reference


def as_warm(followed: Frame, state: State, above: float | None) -> State:
    """frame, state, K of tonight above its reference (None: not known) → the machine as it stands at this temperature.

    A state is of its reference temperature, with what each unknown does for every K beside it.
    """
    if not above:
        return state
    first, warm = len(followed.model.names), followed.warm
    change = np.eye(len(state.mean))
    change[warm, first + np.arange(len(warm))] = above
    return replace(state, mean=change @ state.mean, root=change @ state.root)


def told(values: Sequence[float] | Array) -> dict[str, float]:
    """(n,) °C → mean, first and last."""
    return {"mean": float(np.mean(values)), "first": float(values[0]), "last": float(values[-1])}


def expected(before: float, after: float) -> float:
    """standard deviation before and after the touches of tonight → that of the change which they make to a quiet machine."""
    known = before**2 - after**2
    return 0.0 if abs(known) < UNMOVED * before**2 else float(np.sqrt(known)) if known > 0 else before  # opened for an alarm


def parameters(followed: Frame, ahead: State, after: State, moving: Mapping[str, float] | None) -> dict[str, dict[str, Any]]:
    """frame, state before and after tonight's touches, {parameter: its slope a day} (None: nothing was known before) → what is
    known of each after this night, as the record has it.
    """
    std, before, found = after.std, ahead.std, {}
    for i in followed.machine:
        name = followed.selection.label(followed.names[i])
        mean = float(after.mean[i])
        found[name] = {
            **{"value": mean, "unit": followed.units[i], "std": float(std[i])},
            **{"low": mean - COVER * float(std[i]), "high": mean + COVER * float(std[i])},
            "change": None if moving is None else mean - float(ahead.mean[i]),
            "change_std": None if moving is None else expected(float(before[i]), float(std[i])),
            "rate_per_day": (moving or {}).get(name),
            "seen": bool(std[i] < 0.98 * before[i]),
        }
    return found


def was(alarm: Mapping[str, Any], parameters: Mapping[str, Any], recent: Sequence[Mapping[str, Any]]) -> float | None:
    """alarm, what is known tonight, records newest first (none: what is in the control tonight was there all the time) → what
    parts had of its parameter before it, in its unit; None for what is no one parameter.
    """
    own = parameters.get(alarm["parameter"])
    step = None if own is None else alarm["size"] if alarm.get("rate_per_day") or alarm.get("repair") else own["change"]
    if own is None or step is None:
        return None
    last = next((r["parameters"] for r in recent if r.get("parameters")), parameters)
    return float(own["value"] - step - ((last.get(alarm["parameter"]) or own).get("in_control") or 0.0))
