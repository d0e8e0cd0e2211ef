"""Readings of a night against what was known: the state, the one decision, its cause, limits, and what the next night does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..estimate import Estimate
from ..files.nightly import Nightly
from ..history import Knowledge, Night
from ..history.records import merged
from ..loaded import Event
from ..records import Array, Cell, Readings
from ..report.tonight import is_gone
from ..state import (
    Frame,
    Named,
    State,
    Tonight,
    Within,
    choose,
    grown,
    hypotheses,
    judge,
    name_change,
    predicted,
    seen,
    start,
    stepped,
    updated,
    warmed,
)
from ..state.filter import as_numbers
from ..state.naming import SCALES
from ..state.volume import Aim, aim, levers, over_volume
from ..texts import say
from ..touches import from_readings
from . import again, answered, parts
from .alarms import Known, alarms_of
from .behind import behind
from .control import Given, InControl, limited
from .course import ALIKE
from .dates import clock_wrong, date_of, since
from .doubt import Judged, attempted, believed, doubted
from .drift import as_alarm
from .goes_on import anew, going_on
from .lag import lagging
from .lag import sentence as lag_told
from .learning import READ, Earlier
from .lengths import with_total
from .one_date import as_alarmed, begun
from .ports import Measured, Past
from .standing import since_full, standing, unheard
from .stylus import crept, tip_of
from .trend import SLOPE, drift, looking_ahead, slopes
from .within import as_json, moved_within

AT_ONCE = 2 / 3  # share of the false alarms that changes at once may have; the rest is for drifts
STYLUS = 0.1  # share of the false alarms of drifts that a stylus which creeps may have
RECENT = 40  # nights that are looked at first: nearly always as many as are needed
SET_APART = 7  # nights looked back over for one that measured


def _full(night: Night) -> bool:
    return night.kind == "full" and night.status == "complete"


@dataclass(frozen=True)
class Timed:
    """What the touches of the strategy cost: their rows in the strategy's order, indexation of each, s of a touch and of a turn."""

    numbers: NDArray[np.int64]  # (n,)
    indexation: NDArray[np.int64]  # (n,)
    touch: float
    turn: float
    first: tuple[int, ...] = ()  # numbers of touches that every night begins with: they prove the probe


@dataclass(frozen=True)
class Nights:
    """The analysis of one cell; frozen, so what one night computes another may use."""

    cell: Cell
    settings: Nightly
    followed: Frame
    times: Timed
    read: READ  # text of readings.csv → readings
    check: Cell | None = None  # the cell with the strategy of check.yaml
    judged: Callable[[Cell, Readings, Estimate, str, bool], Judged] | None = None  # the last: kind of night, as predicted
    diagnosed: Callable[[Cell, Readings], Mapping[str, Any]] | None = None
    written: Callable[[Estimate], Mapping[str, str]] | None = None
    control: InControl | None = None
    given: tuple[Given, ...] = ()  # when the control got or lost a compensation, oldest first
    old: bool = False  # nights of long ago, brought in by the hundred: only what is not plain is diagnosed
    happened: tuple[Event, ...] = ()  # all that happened to compensations, oldest first

    @cached_property
    def lever(self) -> Array:
        """→ (m, 3, p) of the volume that the strategy touches."""
        return levers(self.followed)

    @cached_property
    def aim(self) -> Aim:
        """→ what the volume takes from the unknowns."""
        return aim(self.lever)

    def _std_um(self, state: State, days: float) -> float:
        """state, days → µm, standard deviation of the volume that many days later when nothing is touched."""
        rates = np.diag(self.aim.matrix) @ state.rates * max(days, 0.0)
        return float(np.sqrt(np.sum(self.aim.matrix * state.covariance) + rates)) * 1e3

    @cached_property
    def offered(self) -> Array:
        """→ (n, p) what every touch of the strategy would tell."""
        from ..model import linearise

        model = self.followed.model
        _, jacobian = linearise(model, np.zeros(len(model.names)))
        rows = np.zeros((len(jacobian), len(self.followed.names)))
        rows[:, : jacobian.shape[1]] = jacobian
        return rows

    @cached_property
    def earlier(self) -> Earlier:
        """→ what the nights before teach."""
        return Earlier(self.cell.machine.name, self.followed, self.read, self.settings.sensor)

    @cached_property
    def known(self) -> Known:
        """→ what alarms are told by."""
        return Known(self.cell, self.followed, self.lever)

    # Before ---------------------------------------------------------------------------------------------------------

    def state(self, past: Past) -> State | None:
        """history → what was known after the last measured night; None when there is none, or a repair began anew."""
        machine = self.cell.machine.name
        found = past.latest_knowledge(machine)
        if found is None:
            return None
        last, knowledge = found
        if not self._newest or self._newest[-1][0] is not knowledge:
            self._newest[:] = [(knowledge, self.earlier.restored(knowledge, past.records_of([last.entry])[last.entry]))]
        return self._newest[-1][1]

    @cached_property
    def _newest(self) -> list[tuple[Knowledge, State | None]]:
        """→ what the last call of `state` was told by the history, and the state that it is: a night asks twice."""
        return []

    def choice(self, past: Past, day: float) -> tuple[str, str, tuple[int, ...]]:
        """history, day → full or check, why, numbers of the touches (empty: all of that strategy)."""
        state = self.state(past)
        kind, why = self._due(past, state, day)
        if kind == "full" or self.check is not None or state is None:
            return kind, why, ()
        ahead = predicted(state, day)
        found = choose(
            ahead,
            self.offered,
            self.times.indexation,
            self.aim,
            60 * self.settings.check_minutes,
            self.times.touch,
            self.times.turn,
            [
                int(row)
                for row in np.flatnonzero(np.isin(self.times.numbers, self.times.first) | self._apart(self._last_ones(past)))
            ],
        )
        return kind, why, tuple(int(self.times.numbers[row]) for row in found.rows)

    def _due(self, past: Past, state: State | None, day: float) -> tuple[str, str]:
        machine = self.cell.machine.name
        if state is None:
            return "full", say("night.analysis.nothing_known_this_machine_yet")
        nights = past.nights(machine, last=RECENT)
        full = next((n for n in nights if _full(n)), None) or next((n for n in past.nights(machine, last=400) if _full(n)), None)
        if full is None:
            return "full", say("night.analysis.no_full_run_history")
        age = day - datetime.fromisoformat(full.start_utc).timestamp() / 86_400
        if age > self.settings.full_every_days - 0.5:
            return "full", say(
                "night.analysis.last_full_run_days_old", age=f"{age:.0f}", full_every_days=f"{self.settings.full_every_days:g}"
            )
        measured = next((n for n in nights if n.status in ("complete", "partial") and n.touches), None)
        if measured is not None and (measured.verdict == "doubtful" or self._asked(past, measured)):
            return "full", say("night.analysis.night_asked_for", night=measured.night, headline=measured.headline)
        repaired = [
            d for d in past.decisions(machine) if d.action == "repaired" and (d.utc > full.start_utc or d.entry > full.entry)
        ]
        if repaired:
            return "full", say("night.analysis.repaired_since_last_full_run", value=repaired[-1].note or repaired[-1].alarm)
        std = self._std_um(state, day - state.day)
        if std > self.settings.volume_std_um:
            return "full", say(
                "night.analysis.volume_only_known_allowed", std=f"{std:.1f}", volume_std_um=f"{self.settings.volume_std_um:g}"
            )
        return "check", say("night.analysis.nothing_too_uncertain")

    def _asked(self, past: Past, measured: Night) -> bool:
        """history, last night that measured → whether it was a check with an alarm that has asked for no full run yet."""
        if not measured.alarms or measured.kind == "full":
            return False
        return anew(past.records_of([measured.entry])[measured.entry]["alarms"])

    # After ----------------------------------------------------------------------------------------------------------

    def analysed(
        self, past: Past, day: float, kind: str, measured: Measured
    ) -> tuple[dict[str, Any], Knowledge | None, dict[str, str]]:
        """history, day, kind, readings → members of the record, all unknowns, files of the night. Raises TangoError."""
        readings = measured.readings
        assert readings is not None
        before = self.state(past)
        warmth = parts.warmth(readings, self.settings.sensor)
        first = before is None
        ahead = start(self.followed, day, parts.mean(warmth)) if before is None else grown(before, day)
        if ahead.reference is None and warmth:
            ahead = replace(ahead, reference=parts.mean(warmth))
        what = seen(self.followed, readings, ahead.mean, ahead.reference, self.settings.sensor)
        machine, known = self.cell.machine.name, self.known
        recent = self._recent(past)
        tonight = judge(ahead, what) if first else judge(ahead, what, self.followed.points, self._again(recent))
        rate = 1 / self.settings.false_alarm_nights
        alarm = not first and tonight.alarm(rate * AT_ONCE)
        named, opened = None, ahead
        if alarm and tonight.p_machine <= tonight.p_noise:
            tried = hypotheses(self.followed, parts.warmer(ahead, warmth))
            done = answered.expected(past, machine)
            named = name_change(ahead, self.followed, tonight, tried, done)
            if (far := parts.far(named)) is not None:  # touches are linear near where the machine is, and it is not near any more
                what = seen(self.followed, readings, ahead.mean + far, ahead.reference, self.settings.sensor)
                tonight = judge(ahead, what, self.followed.points, self._again(recent))
                named = name_change(ahead, self.followed, tonight, tried, done)
            opened = parts.opened(ahead, self.followed, named)
        repaired = not first and bool(answered.repaired(past, machine))
        opened = answered.may_have_moved(past, machine, known, opened) if repaired else opened
        after = updated(opened, what, tonight, quiet=not (alarm or first or repaired))
        for _ in range(2 if first else 0):  # the first night begins far from the truth: linearise where it ended
            what = seen(self.followed, readings, after.mean, ahead.reference, self.settings.sensor)
            tonight = judge(ahead, what)
            after = updated(ahead, what, tonight, quiet=False)
        if measured.text is not None:  # learning asks for them again, in this program or in a later one
            self.earlier.keep(measured.text, ahead, what)
        lag = None if alarm or first or repaired else lagging(self.followed, recent, ahead, after)
        if lag is not None:
            after = self.earlier.anew(past, lag, recent, after, what.without(tonight.outliers))
        after, learned, since_learned = self.earlier.learned(past, recent, after)
        result = None if self.judged is None and self.written is None else parts.estimated(self.followed, readings, after, tonight)
        judged = Judged("trustworthy")
        if self.judged is not None and result is not None:
            judged = self.judged(*self._judgeable(kind, measured), result, kind, not first and not alarm)
        last = since(past, machine, day, self.settings.every_days)
        alarms = alarms_of(known, last, ahead, tonight, named) if alarm else []
        diagnosis, undiagnosed = dict[str, Any](), ""
        if self.diagnosed is not None and self.settings.diagnose and self._asks(kind, alarm, judged):
            diagnosis, undiagnosed = attempted(self.diagnosed, self._cell(kind), readings)
        inner = None if first or not (alarm or judged.verdict != "trustworthy") else self._within(ahead, readings, tonight)
        moves = -np.inf if first or not alarm or inner is not None else self._moves(ahead, readings, tonight, named)
        judged = believed(judged, diagnosis, alarms, first, moves) if inner is None else moved_within(known, inner, readings)
        judged = doubted(judged, say("night.clock_wrong")) if clock_wrong(past, machine) else judged
        helped, ignored = list[dict[str, Any]](), list[dict[str, Any]]()
        if not judged.believed:
            alarms = []
        elif not first:
            alarms = answered.undone(past, machine, known, after, alarms)
            alarms, helped = answered.after_repairs(past, machine, known, after, alarms)
            alarms = going_on(past, machine, known, after, alarms, last, self.given)
            alarms, ignored = answered.split(past, machine, known, after, alarms, day)
            alarms = again.after_a_repair(past, machine, alarms)
        quiet = judged.believed and not (first or alarm or repaired)
        gone = np.zeros_like(after.mean) if self.control is None else self.control.gone
        parts_have = replace(after, mean=after.mean - gone)
        chart = over_volume(self.lever, parts_have.mean, after.covariance)
        limits = limited(self.followed, self.settings.limits, parts_have, chart)
        moving = drift(known, recent, after, tonight.scale, limits, gone) if quiet else None
        moving = lag_told(known, lag, recent, after) if quiet and moving is None else moving
        beyond = [limit for limit in limits if limit["passed"] is False]
        parameters = parts.parameters(self.followed, ahead, after, None if first else slopes(recent))
        for i in self.followed.machine if gone.any() else ():
            parameters[self.followed.selection.label(self.followed.names[i])]["in_control"] = float(gone[i])
        alarms = [{**a, "was": parts.was(a, parameters, recent)} for a in alarms]
        alarms = [a | since_full(a, date_of(day) if kind == "full" else "") for a in alarms]
        if (newest := past.latest_knowledge(machine)) is not None:
            given = [g for g in self.given if g.utc >= newest[0].end_utc]
            alarms = [given[-1].told(a) for a in alarms] if given else alarms
        found = parameters if judged.believed else {}
        waiting = standing(past, machine, day, found, kind, self.happened, {a["id"] for a in alarms} | merged(alarms))
        if judged.believed:
            waiting = [looking_ahead(known, a, recent, after, limits, gone) for a in waiting]
            waiting = with_total(past, machine, known, after, waiting, kind)
        silent = unheard(past, machine, day, found, kind)
        alarms = [again.step_by_step(a, [*waiting, *silent], parameters) for a in alarms]
        gone_again = [{key: a[key] for key in ("alarm", "now", "total")} for a in silent if is_gone(a["now"])]
        moving = as_alarmed(known, moving, waiting, recent, after)
        if moving is not None:
            for name in SCALES if moving.parameter == ALIKE else (moving.parameter,):
                parameters[name]["rate_per_day"] = moving.rate_per_day
        goes_on = moving is not None and any(a["rate_per_day"] and a["parameter"] == moving.parameter for a in waiting)
        if moving is not None and moving.alarms and moving.p_value < rate * (1 - AT_ONCE) * (1 - STYLUS) and not goes_on:
            told_of = going_on(past, machine, known, after, [as_alarm(moving, known)], last, self.given)
            alarms, ignored = answered.split(past, machine, known, after, told_of, day)
            alarms = [{**a, "was": parts.was(told_of[0], parameters, ())} for a in alarms]
            waiting = [a for a in waiting if a["id"] not in {x["id"] for x in alarms}]
        loose = crept(known, recent, after, rate * (1 - AT_ONCE) * STYLUS) if quiet and not alarms else None
        if loose is not None and not any(a["cause"] == "stylus" for a in (*waiting, *silent)):
            alarms, ignored = answered.split(past, machine, known, after, [loose], day)
        doubtful = not judged.believed or (judged.verdict == "doubtful" and not alarms)
        since_then = begun([*alarms, *waiting], moving)
        crossed = beyond if judged.believed else []
        causes = [cause for limit in crossed for cause in behind(known, recent, after, limit, gone, since_then)]
        if self.control is not None and not self.control.measured:
            causes = [{**c, "do": self.control.instead(c["do"], changed=bool(c["since"]))} for c in causes]
            alarms = [{**a, "do": self.control.instead(a["do"], changed=True)} for a in alarms]
        told: dict[str, Any] = {
            "verdict": "doubtful"
            if doubtful
            else "out_of_limits"  # the worst first: what has changed is told with it
            if beyond
            else "changed"
            if alarms or waiting
            else "good",
            "change": None if first else parts.change(tonight, rate * AT_ONCE, rate),
            "alarms": alarms,
            "terms": list(self.cell.terms),
            "parameters": parameters,
            "stylus": tip_of(known, after),
            "volume": {"worst_um": chart.worst * 1e3, "rms_um": chart.rms * 1e3, "std_um": chart.std * 1e3},
            "limits": limits,
            "residual": parts.residual(what, after, tonight),
            "outliers": list(tonight.outliers),
            "plausible": {"verdict": judged.verdict, "reasons": list(judged.reasons)},
            "temperatures": {name: parts.told(values) for name, values in warmth.items()},
            "versions": {"tango_cnc": __version__},
            "state": as_numbers(after) | {"learned": learned, "since_learned": since_learned},
            "carried": judged.believed,
        }
        told |= ({"standing": waiting} if waiting else {}) | ({"unheard": silent} if silent else {})
        told |= {"in_control": self.control.as_json()} if self.control is not None else {}
        told |= ({"behind": causes} if causes else {}) | ({"ignored": ignored} if ignored else {})
        told |= ({"repaired": helped} if helped else {}) | ({"gone": gone_again} if gone_again else {})
        if lag is not None:
            told["opened"] = [self.followed.selection.label(self.followed.names[lag.place])]
        told |= {"diagnosis": diagnosis} if diagnosis else {"undiagnosed": undiagnosed} if undiagnosed else {}
        if moving is not None and not alarms:
            told["trend"] = vars(moving) | {"text": moving.text}
        if not judged.believed:  # what is not believed must not teach the state anything
            told.pop("parameters")
            told.pop("state")
            told |= {"within": as_json(known, inner)} if inner is not None else {}
            return told | {"next": {"kind": "full", "why": say("night.analysis.tonight_readings_doubt")}}, None, {}
        files = {} if self.written is None or result is None else dict(self.written(result))
        return told | {"next": self._next(past, after, day, anew(alarms), kind)}, parts.knowledge(after), files

    def _last_ones(self, past: Past) -> Sequence[Mapping[str, Any]]:
        machine = self.cell.machine.name
        return past.records(machine, SET_APART) if past.knows(machine) else ()

    def _recent(self, past: Past) -> Sequence[Mapping[str, Any]]:
        """history → records of the last nights, newest first: as many as what follows looks at."""
        machine = self.cell.machine.name
        if not past.knows(machine):
            return ()
        recent = past.records(machine, RECENT)
        enough = len(recent) < RECENT or sum("state" in r for r in recent) > SLOPE
        return recent if enough else past.records(machine, 2 * RECENT)

    def _apart(self, recent: Sequence[Mapping[str, Any]]) -> NDArray[np.bool_]:
        """records newest first → (n,) of the strategy: touches that the last measured night set apart, as they fitted nothing."""
        found = recent[:SET_APART] if self.check is None else ()
        last = next((r for r in found if r.get("touches") and r.get("carried", True)), None)
        return np.isin(self.times.numbers, () if last is None else last.get("outliers") or ())

    def _again(self, recent: Sequence[Mapping[str, Any]]) -> tuple[int, ...]:
        """records newest first → touches of the same points: a chip is gone the next time, a facet that has moved is not."""
        apart = self._apart(recent)
        if not apart.any():
            return ()
        points = np.abs(self.offered[:, self.followed.points]) > 0.5
        return tuple(int(n) for n in self.times.numbers[np.any(points @ points[apart].T, axis=1)])

    def _asks(self, kind: str, alarm: bool, judged: Judged) -> bool:
        """kind, whether there is an alarm, judgement → whether a diagnosis is made. Nobody waits for that of an old night that was
        good; one whose reasons say that the cause is looked for gets it.
        """
        if judged.verdict == "implausible":
            return False
        return alarm or (kind == "full" and (not self.old or judged.verdict != "trustworthy"))

    def _within(self, ahead: State, readings: Readings, tonight: Tonight) -> Within | None:
        """prediction, readings, their judgement → the step of the machine within this run, where that alone explains it."""
        what = seen(self.followed, readings, ahead.mean, ahead.reference, self.settings.sensor)
        return stepped(ahead, what, readings.time, hypotheses(self.followed, None), tonight.scale)

    def _moves(self, ahead: State, readings: Readings, tonight: Tonight, named: Named | None) -> float:
        """prediction, readings, their judgement, its best story → by how much a machine that moves on while it is measured explains
        them better.
        """
        what = seen(self.followed, readings, ahead.mean, ahead.reference, self.settings.sensor)
        normal = from_readings(self.cell.machine, self.cell.artefact, readings).machine_normal
        return warmed(ahead, what, readings.time, normal, tonight, named)

    def _cell(self, kind: str) -> Cell:
        return self.check if kind == "check" and self.check is not None else self.cell

    def _judgeable(self, kind: str, measured: Measured) -> tuple[Cell, Readings]:
        """→ a cell whose strategy is what was asked for tonight, and the readings with its numbers."""
        cell, readings = self._cell(kind), measured.readings
        assert readings is not None
        if not measured.asked:
            return cell, readings
        strategy, numbers = parts.part_of(cell.strategy, measured.asked)
        new = {old: i for i, old in enumerate(numbers, 1)}
        renumbered = replace(readings, touch=np.array([new.get(int(t), int(t)) for t in readings.touch], dtype=np.int64))
        return replace(cell, strategy=strategy), renumbered

    def _next(self, past: Past, after: State, day: float, alarmed: bool, kind: str) -> dict[str, str]:
        if alarmed and kind != "full":
            return {"kind": "full", "why": say("night.analysis.tonight_check_found_change")}
        std = self._std_um(after, day + self.settings.every_days - after.day)
        if std > self.settings.volume_std_um:
            return {"kind": "full", "why": say("night.analysis.volume_will_only_be_known", std=f"{std:.1f}")}
        return {"kind": "check", "why": say("night.analysis.nothing_too_uncertain")}
