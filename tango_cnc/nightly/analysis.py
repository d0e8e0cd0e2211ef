"""Readings of a night against what was known: the state, the one decision, its cause, limits, and what the next night does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import __version__
from ..estimate import Estimate
from ..history import Knowledge
from ..history.records import merged
from ..records import Array, Cell, Readings
from ..report.tonight import is_gone
from ..state import (
    NOISY,
    Alone,
    Named,
    Seen,
    State,
    Tonight,
    Within,
    as_scattered,
    grown,
    hypotheses,
    judge,
    name_change,
    seen,
    start,
    stepped,
    updated,
    warmed,
)
from ..state.filter import as_numbers, unknown
from ..state.naming import SCALES
from ..state.volume import Volume, over_volume
from ..texts import say
from ..touches import from_readings
from . import again, answered, parts
from .alarms import alarms_of
from .before import BeforeNight
from .behind import behind
from .control import limited
from .course import ALIKE
from .dates import Since, clock_wrong, date_of, since
from .doubt import NightDoubt, attempted, believed, doubted
from .drift import Drift, as_alarm
from .goes_on import anew, going_on
from .lag import Lag, lagging
from .lag import sentence as lag_told
from .lengths import as_seen_last, with_total
from .one_date import as_alarmed, begun
from .ports import Measured, Past
from .scatter import scatter_on, with_scatter
from .sensors import counted, how_warm, see_to_it_first, speaks, states
from .sensors import told as told_of_sensors
from .standing import by_urgency, since_full, standing, unheard
from .stylus import crept, tip_of
from .swings import as_swing, without_swing
from .trend import UNLEARNED, drift, looking_ahead, slopes
from .warmth import as_early_as, as_sure_as, as_warm_as, rates_shown, with_warmth
from .within import as_json, moved_within

AT_ONCE = 2 / 3  # share of the false alarms that changes at once may have; the rest is for drifts
STYLUS = 0.1  # share of the false alarms of drifts that a stylus which creeps may have


@dataclass(frozen=True)
class Update:
    """What the readings of one night did to what was known."""

    recent: Sequence[Mapping[str, Any]]  # records of the nights before, newest first
    readings: Readings  # with the temperatures that count
    sensors: Mapping[str, Mapping[str, Any]]  # what each did (nightly/sensors.py)
    warmth: Mapping[str, Array]  # °C at every touch
    ahead: State  # what was expected
    what: Seen
    tonight: Tonight
    stated: Tonight  # the same by the stated scatter: another one where touches scatter more, and that is no chance
    named: Named | None  # what explains an alarm of the machine best
    after: State
    first: bool  # nothing was known before
    alarm: bool
    repaired: bool
    lag: Lag | None
    learned: int  # nights that its rates come from
    since_learned: int  # measured nights since then

    @property
    def quiet(self) -> bool:
        """→ whether nothing has happened but a night."""
        return not (self.alarm or self.first or self.repaired)


@dataclass(frozen=True)
class Place:
    """Where the machine stands after a night."""

    gone: Array  # (p,) what the control takes away
    chart: Volume
    limits: Sequence[Mapping[str, Any]]
    parameters: dict[str, dict[str, Any]]
    moving: Drift | None


@dataclass(frozen=True)
class Heard:
    """Alarms of a night, by what is to be done about them."""

    alarms: Sequence[dict[str, Any]]
    helped: Sequence[dict[str, Any]] = ()  # repairs that helped
    ignored: Sequence[dict[str, Any]] = ()
    waiting: Sequence[dict[str, Any]] = ()  # of nights before, not answered
    silent: Sequence[dict[str, Any]] = ()  # of nights before, that somebody ignores


class Nights(BeforeNight):
    """The analysis of one cell: readings against what was known."""

    def analysed(
        self, past: Past, day: float, kind: str, measured: Measured
    ) -> tuple[dict[str, Any], Knowledge | None, dict[str, str]]:
        """history, day, kind, readings → members of the record, all unknowns, files of the night. Raises TangoError."""
        assert measured.readings is not None
        u = self._updated(past, day, measured)
        asked = self.judged is not None or self.written is not None
        result = parts.estimated(self.followed, measured.readings, u.after, u.tonight) if asked else None
        last = since(past, self.cell.machine.name, day, self.settings.every_days)
        alarms = alarms_of(self.known, last, u.ahead, u.tonight, u.named) if u.alarm else []
        alarms = [how_warm(a, u.sensors, parts.mean(u.warmth), u.recent, self.settings.sensor) for a in alarms]
        warm = told_of_sensors(u.sensors, self.settings.sensor, date_of(day))
        judged, inner, diagnosis = self._judged(past, kind, measured, u, result, alarms)
        heard = Heard([]) if not judged.believed else Heard(alarms) if u.first else self._answered(past, day, u, alarms, last)
        place = self._place(u, judged.believed and u.quiet)
        heard = replace(heard, alarms=self._dated(past, day, kind, u, place, heard.alarms))
        heard = self._with_others(past, day, kind, u, place, judged.believed, heard)
        heard = replace(heard, alarms=as_early_as(heard.alarms, heard.waiting, u.recent, last))
        moving = as_alarmed(self.known, place.moving, heard.waiting, u.recent, u.after)
        moving = without_swing(moving, u.recent, self._tonight(u, place, judged.believed))
        if moving is not None and not moving.swings:
            for name in SCALES if moving.parameter == ALIKE else (moving.parameter,):
                place.parameters[name]["rate_per_day"] = moving.rate_per_day
            heard = self._drifted(past, day, u, place, moving, last, heard)
        if judged.believed and u.quiet:
            heard = self._crept(past, day, u, heard)
        now = parts.mean(u.warmth) if unknown(self.followed, u.ahead) and not warm.get("doubt") else None
        told_warm = [with_warmth(a, place.parameters, u.sensors, now, u.recent, self.settings.sensor) for a in heard.alarms]
        heard = replace(heard, alarms=see_to_it_first(told_warm, warm))
        told = self._told(u, place, judged, moving, heard, diagnosis)
        told |= {"temperature": warm} if warm else {}
        if not judged.believed:  # what is not believed must not teach the state anything
            told = {key: value for key, value in told.items() if key not in ("parameters", "state")}
            told |= {"within": as_json(self.known, inner)} if inner is not None else {}
            return told | {"next": {"kind": "full", "why": say("night.analysis.tonight_readings_doubt")}}, None, {}
        files = {} if self.written is None or result is None else dict(self.written(result))
        return told | {"next": self._next(u.after, day, anew(heard.alarms), kind)}, parts.knowledge(u.after), files

    def _updated(self, past: Past, day: float, measured: Measured) -> Update:
        """history, day, readings → what they did to what was known."""
        assert measured.readings is not None
        before, recent = self.state(past), self._recent(past)
        sensors, first = states(measured.readings, recent, date_of(day), measured.strange), before is None
        readings = counted(measured.readings, sensors)
        warmth = parts.warmth(readings, self.settings.sensor)
        ahead = start(self.followed, day, parts.mean(warmth)) if before is None else grown(before, day)
        if ahead.reference is None and warmth:
            ahead = replace(ahead, reference=parts.mean(warmth))
        what = self._seen(readings, ahead, ahead.mean)
        tonight = judge(ahead, what) if first else self._judge(ahead, what, recent)
        alarm = not first and tonight.alarm(1 / self.settings.false_alarm_nights * AT_ONCE)
        named, opened, stated = None, ahead, tonight
        tonight = as_scattered(ahead, what, stated)
        if alarm and (tonight.p_machine <= tonight.p_noise or (stated.wider > 1 and tonight.p_machine < NOISY)):
            ahead = parts.as_last_night(self.followed, ahead, parts.mean(warmth), recent)
            what = self._seen(readings, ahead, ahead.mean)
            named, what, stated, tonight = self._named(past, readings, recent, ahead, warmth, what, stated)
            opened = parts.opened(ahead, self.followed, named)
        machine = self.cell.machine.name
        repaired = not first and bool(answered.repaired(past, machine))
        opened = answered.may_have_moved(past, machine, self.known, opened) if repaired else opened
        quiet = not (alarm or first or repaired)
        after = updated(opened, what, tonight, quiet=quiet)
        for _ in range(2 if first else 0):  # the first night begins far from the truth: linearise where it ended
            what = self._seen(readings, ahead, after.mean)
            stated = judge(ahead, what)
            tonight = as_scattered(ahead, what, stated)
            after = updated(ahead, what, tonight, quiet=False)
        if measured.text is not None:  # learning asks for them again, in this program or in a later one
            self.earlier.keep(measured.text, ahead, what)
        lag = lagging(self.followed, recent, ahead, after) if quiet else None
        if lag is not None:
            after = self.earlier.anew(past, lag, recent, after, what.without(tonight.outliers).wider(tonight.wider))
        after, learned, since_learned = self.earlier.learned(past, recent, after)
        which = recent, readings, sensors, warmth
        return Update(*which, ahead, what, tonight, stated, named, after, first, alarm, repaired, lag, learned, since_learned)

    def _seen(self, readings: Readings, ahead: State, at: Array) -> Seen:
        """readings, what was expected, (p,) where touches are linear → what they say."""
        return seen(self.followed, readings, at, ahead.reference, self.settings.sensor)

    def _judge(self, ahead: State, what: Seen, recent: Sequence[Mapping[str, Any]]) -> Tonight:
        """what was expected, what the touches say, records newest first → the one test of the night."""
        learned = next((r["state"].get("learned") for r in recent if r.get("state")), None)
        alone = Alone(self.followed.machine, float(learned or UNLEARNED))
        return judge(ahead, what, self.followed.points, self._again(recent), alone)

    def _named(
        self,
        past: Past,
        readings: Readings,
        recent: Sequence[Mapping[str, Any]],
        ahead: State,
        warmth: Mapping[str, Array],
        what: Seen,
        stated: Tonight,
    ) -> tuple[Named | None, Seen, Tonight, Tonight]:
        """→ what explains the alarm best; what the readings say where the machine is then, and their judgement: by the stated
        scatter, and by that of tonight.
        """
        tried = hypotheses(self.followed, parts.warmer(ahead, warmth))
        done, shown = answered.expected(past, self.cell.machine.name), rates_shown(recent)
        tonight = as_scattered(ahead, what, stated)
        named = name_change(ahead, self.followed, tonight, tried, done, shown)
        if (far := parts.far(named)) is None:
            return named, what, stated, tonight
        what = self._seen(readings, ahead, ahead.mean + far)
        stated = self._judge(ahead, what, recent)
        tonight = as_scattered(ahead, what, stated)
        return name_change(ahead, self.followed, tonight, tried, done, shown), what, stated, tonight

    def _judged(
        self, past: Past, kind: str, measured: Measured, u: Update, result: Estimate | None, alarms: Sequence[dict[str, Any]]
    ) -> tuple[NightDoubt, Within | None, dict[str, Any]]:
        """→ how far the readings are to be believed; a step of the machine within this run that explains them; their diagnosis."""
        readings = measured.readings
        assert readings is not None
        judged = NightDoubt("trustworthy")
        if self.judged is not None and result is not None:
            judged = self.judged(*self._judgeable(kind, measured, u.after), result, kind, not u.first and not u.alarm)
        diagnosis, undiagnosed = dict[str, Any](), ""
        if self.diagnosed is not None and self.settings.diagnose and self._asks(kind, u.alarm, judged):
            diagnosis, undiagnosed = attempted(self.diagnosed, self._triggering(self._cell(kind), u.after), readings)
        odd = not u.first and (u.alarm or judged.verdict != "trustworthy")
        inner = self._within(u.ahead, u.readings, u.tonight) if odd else None
        moves = -np.inf if u.first or not u.alarm or inner is not None else self._moves(u)
        judged = believed(judged, diagnosis, alarms, u.first, moves) if inner is None else moved_within(self.known, inner, readings)
        judged = doubted(judged, say("night.clock_wrong")) if clock_wrong(past, self.cell.machine.name) else judged
        return judged, inner, {"diagnosis": diagnosis} if diagnosis else {"undiagnosed": undiagnosed} if undiagnosed else {}

    def _answered(self, past: Past, day: float, u: Update, alarms: Sequence[dict[str, Any]], last: Since) -> Heard:
        """alarms of the night, since when → the same by what was answered before: undone, repaired, going on, ignored."""
        machine, known = self.cell.machine.name, self.known
        alarms = answered.undone(past, machine, known, u.after, alarms)
        alarms, helped = answered.after_repairs(past, machine, known, u.after, alarms)
        alarms = going_on(past, machine, known, u.after, alarms, last, self.given)
        alarms = scatter_on(past, machine, alarms, date_of(day))
        alarms, ignored = answered.split(past, machine, known, u.after, alarms, day)
        return Heard(again.after_a_repair(past, machine, alarms), helped, ignored)

    def _place(self, u: Update, quiet: bool) -> Place:
        """what the night did, whether nothing else has happened → where the machine stands, and whether it moves on."""
        gone = np.zeros_like(u.after.mean) if self.control is None else self.control.gone
        warm = parts.as_warm(self.followed, u.after, parts.warmer(u.after, u.warmth))
        left = replace(warm, mean=warm.mean - gone)  # what parts have
        chart = over_volume(self.lever, left.mean, left.covariance)
        limits = limited(self.followed, self.settings.limits, left, chart)
        moving = drift(self.known, u.recent, u.after, u.tonight.scale, limits, gone) if quiet else None
        moving = lag_told(self.known, u.lag, u.recent, u.after) if quiet and moving is None else moving
        parameters = parts.parameters(self.followed, u.ahead, u.after, None if u.first else slopes(u.recent))
        for i in self.followed.machine if gone.any() else ():
            parameters[self.followed.selection.label(self.followed.names[i])]["in_control"] = float(gone[i])
        return Place(gone, chart, limits, parameters, moving)

    def _dated(
        self, past: Past, day: float, kind: str, u: Update, place: Place, alarms: Sequence[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """alarms → the same with what the number was, the full run before, and a compensation given since the last night."""
        dated = [{**a, "was": parts.was(a, place.parameters, u.recent)} for a in alarms]
        dated = [a | since_full(a, date_of(day) if kind == "full" else "") for a in dated]
        if (newest := past.latest_knowledge(self.cell.machine.name)) is not None:
            given = [g for g in self.given if g.utc >= newest[0].end_utc]
            dated = [given[-1].told(a) for a in dated] if given else dated
        return dated

    def _with_others(self, past: Past, day: float, kind: str, u: Update, place: Place, trusted: bool, heard: Heard) -> Heard:
        """alarms of the night → with them those of nights before: those without an answer, and those that somebody ignores."""
        machine, known = self.cell.machine.name, self.known
        found = place.parameters if trusted else {}
        waiting = standing(past, machine, day, found, kind, self.happened, {a["id"] for a in heard.alarms} | merged(heard.alarms))
        if trusted:
            waiting = [looking_ahead(known, a, u.recent, u.after, place.limits, place.gone) for a in waiting]
            waiting = with_total(past, machine, known, u.after, waiting, kind)
        else:
            waiting = as_seen_last(waiting, u.recent)
        residual = parts.residual(u.what, u.after, u.tonight) if trusted else None
        waiting = with_scatter(past, machine, waiting, residual)
        silent = with_scatter(past, machine, unheard(past, machine, day, found, kind), residual, silent=True)
        tonight, now = self._tonight(u, place, trusted), parts.mean(u.warmth)
        heard_tonight = not told_of_sensors(u.sensors, self.settings.sensor, date_of(day)).get("doubt")
        waiting, silent = (as_warm_as(of, now, heard_tonight, date_of(day), u.recent) for of in (waiting, silent))
        waiting = as_sure_as(waiting, None if tonight is None else now, u.recent)
        waiting = by_urgency([as_swing(a, u.recent, tonight) for a in waiting])
        alarms = [again.step_by_step(a, [*waiting, *silent], place.parameters) for a in heard.alarms]
        return replace(heard, alarms=alarms, waiting=waiting, silent=silent)

    def _tonight(self, u: Update, place: Place, trusted: bool) -> tuple[float, float, Mapping[str, Any]] | None:
        """→ day, °C that count, and parameters of tonight; None where the night or its temperature is not believed."""
        doubt = told_of_sensors(u.sensors, self.settings.sensor, date_of(u.after.day)).get("doubt")
        now = parts.mean(u.warmth)
        return None if not trusted or doubt or now is None else (u.after.day, now, place.parameters)

    def _drifted(self, past: Past, day: float, u: Update, place: Place, moving: Drift, last: Since, heard: Heard) -> Heard:
        """a drift, alarms → the drift is one of them where it is certain and none of those that wait goes on with it."""
        rate = 1 / self.settings.false_alarm_nights * (1 - AT_ONCE)
        goes_on = any(a["rate_per_day"] and a["parameter"] == moving.parameter for a in heard.waiting)
        if goes_on or not (moving.alarms and moving.p_value < rate * (1 - STYLUS)):
            return heard
        machine, known = self.cell.machine.name, self.known
        told_of = going_on(past, machine, known, u.after, [as_alarm(moving, known)], last, self.given)
        alarms, ignored = answered.split(past, machine, known, u.after, told_of, day)
        alarms = [{**a, "was": parts.was(told_of[0], place.parameters, ())} for a in alarms]
        waiting = [a for a in heard.waiting if a["id"] not in {x["id"] for x in alarms}]
        return replace(heard, alarms=alarms, ignored=ignored, waiting=waiting)

    def _crept(self, past: Past, day: float, u: Update, heard: Heard) -> Heard:
        """alarms of a quiet night → a stylus that creeps is one of them where no other alarm is new and none is of the stylus."""
        rate = 1 / self.settings.false_alarm_nights * (1 - AT_ONCE)
        loose = None if heard.alarms else crept(self.known, u.recent, u.after, rate * STYLUS)
        if loose is None or any(a["cause"] == "stylus" for a in (*heard.waiting, *heard.silent)):
            return heard
        alarms, ignored = answered.split(past, self.cell.machine.name, self.known, u.after, [loose], day)
        return replace(heard, alarms=alarms, ignored=ignored)

    def _told(
        self, u: Update, place: Place, judged: NightDoubt, moving: Drift | None, heard: Heard, diagnosis: Mapping[str, Any]
    ) -> dict[str, Any]:
        """→ members of the record."""
        rate = 1 / self.settings.false_alarm_nights
        alarms, waiting = list(heard.alarms), list(heard.waiting)
        beyond = [limit for limit in place.limits if limit["passed"] is False]
        since_then = begun([*alarms, *waiting], moving)
        crossed = beyond if judged.believed else []
        causes = [c for limit in crossed for c in behind(self.known, u.recent, u.after, limit, place.gone, since_then)]
        if self.control is not None and not self.control.measured:
            causes = [{**c, "do": self.control.instead(c["do"], changed=bool(c["since"]))} for c in causes]
            alarms = [{**a, "do": self.control.instead(a["do"], changed=True)} for a in alarms]
        doubtful = not judged.believed or (judged.verdict == "doubtful" and not alarms)
        changed = bool(alarms or waiting)  # the worst first: it names what has changed, too
        told: dict[str, Any] = {
            "verdict": "doubtful" if doubtful else "out_of_limits" if beyond else "changed" if changed else "good",
            "change": None if u.first else parts.change(u.tonight, rate * AT_ONCE, rate),
            "alarms": alarms,
            "terms": list(self.cell.terms),
            "parameters": place.parameters,
            "stylus": tip_of(self.known, u.after),
            "volume": {
                **{"worst_um": place.chart.worst * 1e3, "rms_um": place.chart.rms * 1e3, "std_um": place.chart.std * 1e3},
                **({} if (celsius := parts.mean(u.warmth)) is None else {"celsius": round(celsius, 2)}),
            },
            "limits": place.limits,
            "residual": parts.residual(u.what, u.after, u.tonight),
            "outliers": list(u.tonight.outliers),
            "plausible": {"verdict": judged.verdict, "reasons": list(judged.reasons)},
            "temperatures": {name: parts.told(values) for name, values in u.warmth.items() if speaks(u.sensors, name)},
            "versions": {"tango_cnc": __version__},
            "state": as_numbers(u.after) | {"learned": u.learned, "since_learned": u.since_learned},
            "carried": judged.believed,
        }
        again_gone = [{key: a[key] for key in ("alarm", "now", "total")} for a in heard.silent if is_gone(a["now"])]
        more = {
            "standing": waiting,
            "unheard": heard.silent,
            "sensors": u.sensors,
            "in_control": None if self.control is None else self.control.as_json(),
            "behind": causes,
            "ignored": heard.ignored,
            "repaired": heard.helped,
            "gone": again_gone,
        }
        told |= {key: value for key, value in more.items() if value}
        if u.lag is not None:
            told["opened"] = [self.followed.selection.label(self.followed.names[u.lag.place])]
        told |= diagnosis
        if moving is not None and not alarms:
            told["trend"] = vars(moving) | {"text": moving.text}
        return told

    def _asks(self, kind: str, alarm: bool, judged: NightDoubt) -> bool:
        """kind, whether there is an alarm, judgement → whether a diagnosis is made. Nobody waits for that of an old night that was
        good; one whose reasons say that the cause is looked for gets it.
        """
        if judged.verdict == "implausible":
            return False
        return alarm or (kind == "full" and (not self.old or judged.verdict != "trustworthy"))

    def _within(self, ahead: State, readings: Readings, tonight: Tonight) -> Within | None:
        """prediction, readings, their judgement → the step of the machine within this run, where that alone explains it."""
        what = seen(self.followed, readings, ahead.mean, ahead.reference, self.settings.sensor)
        return stepped(ahead, what, readings.time, self.known.tried, tonight.scale)

    def _moves(self, u: Update) -> float:
        """what the readings did → by how much a machine that moves on while it is measured explains them better than the best
        story, both by the stated scatter: a machine that moves on makes touches scatter, too.
        """
        ahead, readings, named = u.ahead, u.readings, u.named
        if u.stated.wider > 1:
            tried = hypotheses(self.followed, parts.warmer(ahead, u.warmth))
            named = name_change(ahead, self.followed, u.stated, tried)
        what = seen(self.followed, readings, ahead.mean, ahead.reference, self.settings.sensor)
        normal = from_readings(self.cell.machine, self.cell.artefact, readings).machine_normal
        return warmed(ahead, what, readings.time, normal, u.stated, named)

    def _cell(self, kind: str) -> Cell:
        return self.check if kind == "check" and self.check is not None else self.cell

    def _triggering(self, cell: Cell, after: State) -> Cell:
        """cell, state after tonight → the cell with the probe as it triggers now: a change that was named explains its touches."""
        return replace(cell, machine=parts.triggering(cell.machine, self.followed, after))

    def _judgeable(self, kind: str, measured: Measured, after: State) -> tuple[Cell, Readings]:
        """→ a cell whose strategy is what was asked for tonight, and the readings with its numbers."""
        cell, readings = self._triggering(self._cell(kind), after), measured.readings
        assert readings is not None
        if not measured.asked:
            return cell, readings
        strategy, numbers = parts.part_of(cell.strategy, measured.asked)
        new = {old: i for i, old in enumerate(numbers, 1)}
        renumbered = replace(readings, touch=np.array([new.get(int(t), int(t)) for t in readings.touch], dtype=np.int64))
        return replace(cell, strategy=strategy), renumbered

    def _next(self, after: State, day: float, alarmed: bool, kind: str) -> dict[str, str]:
        if alarmed and kind != "full":
            return {"kind": "full", "why": say("night.analysis.tonight_check_found_change")}
        std = self._std_um(after, day + self.settings.every_days - after.day)
        if std > self.settings.volume_std_um:
            return {"kind": "full", "why": say("night.analysis.volume_will_only_be_known", std=f"{std:.1f}")}
        return {"kind": "check", "why": say("night.analysis.nothing_too_uncertain")}
