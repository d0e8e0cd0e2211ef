"""Cell and readings → everything that the report states, computed once; nothing is drawn and no file is read here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np
from scipy import special

from ..asked import asked
from ..diagnose import Diagnosis, diagnose
from ..estimate import Estimate, fit
from ..identify import select
from ..iso230 import figures
from ..iso230.signed import OnPart, Sheet
from ..judgement import Judgement
from ..model import linearise
from ..records import Array, Cell, Machine, Readings, TangoError, TermItem
from ..state.volume import Volume, of_estimate
from ..texts import Said
from ..uncertainty.analysis import prepare
from ..uncertainty.inputs import BudgetLine
from ..uncertainty.scatter import reached, with_rest
from ..uncertainty.study import study
from ..verify import held_out, volume
from ..verify.held_out import HeldOut
from ..verify.volume import VolumeMap
from . import slices
from .answer import Answer, answer, by_limit, renamed
from .pace import Ahead
from .texts import Texts, texts
from .units import Units

COVERAGE = 0.95


@dataclass(frozen=True)
class Paper:
    """What a report says of its own making; `files` are name, bytes and SHA-256 of all that was read."""

    made: datetime
    version: str
    versions: Mapping[str, str] = field(default_factory=dict)
    operator: str = ""
    owner: str = ""
    files: tuple[tuple[str, int, str], ...] = ()
    origin: Mapping[str, Any] | None = None  # readings.json
    simulated: bool = False  # the readings come from no machine
    readings: str = ""  # name of the readings file
    measured: str = ""  # when its readings were made
    plan: Mapping[str, Any] | None = None  # of readings.json, or of the simulation: what its plan left out


@dataclass(frozen=True)
class Wishes:
    """What the person asked for; `limit` is mm of the tool tip within what was touched."""

    terms: tuple[TermItem, ...]
    degree: int = 3
    limit: float | None = None
    stated: float | None = None  # that of nightly.yaml, where `limit` was asked for in its place
    units: Units = field(default_factory=Units)
    budget: tuple[BudgetLine, ...] | None = None
    diagnosis: bool = True
    pictures: bool = True


@dataclass(frozen=True)
class NewestNight:
    """What the history of the machine says of its newest night, and of alarms that nobody has decided about."""

    date: str
    verdict: str  # good, changed, out_of_limits, doubtful, not_measured
    headline: str
    waiting: int  # open alarms, each cause once, as on the page of the machine
    ended_utc: str = ""
    record: Mapping[str, Any] | None = None  # of this night
    before: Mapping[str, Any] | None = None  # where this one did not measure: of the last that did
    waits: str = ""  # date of the first alarm that nobody has answered, where it is not of this night
    has: str = ""  # who has what is open
    late: str = ""  # date since when a complete night is missing
    cause: str = ""  # what is wrong first, as a sentence
    ahead: Ahead | None = None  # how soon the machine is at its limit
    owner: str = ""  # who has what is wrong first, or is asked about it
    closed: str = ""  # by what every alarm of this night was closed since: accept, repaired
    todo: tuple[str, ...] = ()  # what to do, in the sentences of the page of the machine
    old: int = 0  # nights since the last measurement, where these are too many for an answer of today
    probe: str = ""  # what of the open ones is of the probe (faults.of_probe)
    answers_for: float = 7.0  # days for which a result is an answer
    former: tuple[Said, ...] = ()  # what is said of the cell beside its nights: one that was cut off
    brief: str = ""  # `cause` with the size that counts alone
    asks: str = ""  # whom to call, as one of `todo`
    parts: tuple[str, ...] = ()  # what to do about parts where newer readings say No
    repaired: Mapping[str, str] = field(default_factory=dict)  # {parameter: who says to have repaired it since that night}
    named: bool = False  # whether the last of `todo` says itself what it is about, which is not `cause`: that is to be ignored
    chain: tuple[int, str] | None = None  # number and hash of the newest entry of the history
    share: bool = False  # whether `cause` is the largest share of this night's error, and no change
    busy: bool = False  # whether a run or a night is at work in the cell

    def answer(self, u: Units, t: Texts, machine: Machine, limit: float | None = None) -> Answer:
        """units, texts, machine, limit of the tool tip in mm that is asked for → whether parts may be made, as on its page."""
        allowed = None if limit is None else 1e3 * limit
        record = by_limit(self.record or {"verdict": self.verdict, "night": self.date}, allowed)
        before = None if self.before is None else by_limit(self.before, allowed)
        more = self.late, self.has, self.ahead, self.closed, self.old, self.probe
        return renamed(answer(record, u, t, self.waits, before, machine, *more), self.former, t)

    @property
    def measured_on(self) -> str:
        """→ date of the last night that measured."""
        return str((self.before or {}).get("night") or self.date)

    def parameter(self, name: str) -> Mapping[str, Any] | None:
        """parameter → what the last night that measured has of it; None where nothing, or where it is not to be believed."""
        known = self.before or self.record or {}
        if known.get("verdict") == "doubtful":
            return None
        return (known.get("parameters") or {}).get(name)

    def beside(self, measured: str) -> str:
        """moment at which the readings were made → whether they are older or newer than this night, its own, or unknown."""
        try:
            made, ended = (datetime.fromisoformat(text) for text in (measured, self.ended_utc))
            began = datetime.fromisoformat(str((self.record or {}).get("start_utc") or self.ended_utc))
            return "newer" if made > ended else "own" if made >= began else "older"
        except (ValueError, TypeError):  # no moment, or one without a zone
            return "unknown"


@dataclass(frozen=True)
class LoadedCompensation:
    """A compensation that is in the control: readings older than it do not contain it, and probing may not see all of it."""

    number: int
    target: str
    older: bool
    gone: Array | None  # (p,) of every unknown: what parts do not have
    event: str = "kept"  # or kept as far as seen; after another one nobody knows that it acts
    beneath: int | None = None  # the one that was kept, and that it was made on top of: what is gone then


@dataclass(frozen=True)
class Facts:
    """Everything that goes on the page."""

    cell: Cell
    readings: Readings
    wishes: Wishes
    paper: Paper
    result: Estimate
    before: Array  # (n,) mm, what remains when only stylus and facets are adjusted
    std: Array  # (p,) standard uncertainties of the unknowns: of the budget where there is one
    factor: float  # of the intervals
    sheet: Sheet | str  # ISO figures beside every error motion of the machine; or the reason why there are no figures
    angles: tuple[OnPart, ...]  # between rotary axes and others, of the fitted terms alone
    tip: Volume | None  # over every corner of the touched ranges, as nights have it; None: nothing is known
    chart: VolumeMap | None
    cuts: tuple[slices.Slice, ...]
    held: HeldOut | None
    why_not_held: str
    diagnosis: Diagnosis | None
    why_no_diagnosis: str
    judgement: Judgement
    trend: Mapping[str, Any] | None
    compensations: tuple[Mapping[str, Any], ...]
    nights: NewestNight | None = None
    control: LoadedCompensation | None = None

    @property
    def used(self) -> int:
        """→ touches that the estimate used."""
        return len(self.result.residuals)

    @property
    def planned(self) -> int:
        """→ touches that the plan makes, in all cycles."""
        cycles = max(1, len({*zip(self.readings.cycle.tolist(), self.readings.day.tolist(), strict=True)}))
        return len(asked(self.cell, self.paper.plan or self.paper.origin).made) * cycles

    @property
    def ratio(self) -> float | None:
        """→ scatter of a touch over what the probe repeats to; None where that is not stated."""
        stated = self.cell.machine.probe.repeatability
        return self.result.sigma / stated if stated else None

    @property
    def within(self) -> tuple[float, float] | None:
        """→ mm, largest error of the tool tip between touched poses and its standard deviation; None: nothing is known."""
        if self.chart is None:
            return None
        inside = ~self.chart.extrapolated
        i = self.chart.worst(inside if inside.any() else np.ones_like(inside))
        assert i is not None
        return float(self.chart.size[i]), float(self.chart.std[i])


def gather(
    cell: Cell,
    readings: Readings,
    wishes: Wishes,
    paper: Paper,
    result: Estimate,
    judgement: Judgement,
    *,
    sheet: Sheet | str,
    trend: Mapping[str, Any] | None = None,
    compensations: Sequence[Mapping[str, Any]] = (),
    nights: NewestNight | None = None,
    control: LoadedCompensation | None = None,
) -> Facts:
    """cell, readings, wishes, what is on record, estimate and what is thought of it, ISO figures or why none → facts."""
    have = result if control is None or control.gone is None else replace(result, values=result.values - control.gone)
    chart, cuts = _volume(cell, have)
    held, why = None, ""
    try:
        # The touches that have no weight in the estimate are predicted by none either: they are counted as what does not fit.
        weighed = reached(readings, result)
        groups = held_out.leave_one_out(held_out.indexations(weighed, cell.machine))
        held = held_out.held_out(cell.machine, cell.artefact, weighed, wishes.terms, groups, wishes.degree)
    except TangoError as error:
        why = str(error)
    found, why_none = None, texts()("diagnosis.left_out")
    if judgement.verdict == "implausible":
        why_none = texts()("diagnosis.implausible")
    elif wishes.diagnosis:
        try:
            found, why_none = diagnose(cell.machine, cell.artefact, readings, wishes.terms, degree=wishes.degree), ""
        except TangoError as error:
            why_none = f": {error}"
    std, factor = _uncertainty(cell, readings, wishes, result)
    return Facts(
        cell,
        readings,
        wishes,
        paper,
        result,
        fit(select(result.model.touches, ("S1",))).residuals,
        std,
        factor,
        sheet,
        _angles(result, factor),
        of_estimate(have),
        chart,
        cuts,
        held,
        why,
        found,
        why_none,
        judgement,
        trend,
        tuple(compensations),
        nights,
        control,
    )


def _angles(result: Estimate, factor: float) -> tuple[OnPart, ...]:
    """estimate, factor of the intervals → figures of rotary axes that the sheet does not have."""
    linear, found = set(result.model.touches.machine.linear), []
    for f in figures(result):
        axes = {f.name[1]} if f.kind == "reversal" else set(f.name.split(" to "))
        if f.kind in ("parallelism", "squareness", "angle", "offset", "reversal") and not axes <= linear:
            ends = (f.value - factor * f.std, f.value + factor * f.std)
            found.append(OnPart(f.kind, f.name, f.unit, f.value, ends, f.range, f.note))
    return tuple(found)


def _volume(cell: Cell, result: Estimate) -> tuple[VolumeMap | None, tuple[slices.Slice, ...]]:
    if not result.parameters:
        return None, ()
    touches = result.model.touches
    own = np.array(touches.position)
    own[:, cell.machine.column("S")] = 0.0
    body = np.vstack([volume.grid(cell.machine, touches), own])
    chart = volume.volume(result, np.vstack([body, slices.poses(cell.machine, touches)]))
    return chart, tuple(slices.cut(chart, cell.machine, len(body)))


def _uncertainty(cell: Cell, readings: Readings, wishes: Wishes, result: Estimate) -> tuple[Array, float]:
    """→ (p,) standard uncertainties and the factor of the intervals."""
    if wishes.budget is None:
        return result.std, float(special.stdtrit(result.dof, 0.5 + COVERAGE / 2))
    found, parts = prepare(cell.machine, cell.artefact, readings, wishes.terms, wishes.degree, wishes.budget, result)
    std = dict(
        zip(found.model.names, study(found.model, found.values, found.sigma, with_rest(found, result, parts)).std, strict=True)
    )
    own = [std.get(name, s) for name, s in zip(result.model.names, result.std, strict=True)]
    return np.array(own), float(special.ndtri(0.5 + COVERAGE / 2))


def effects(result: Estimate) -> dict[str, float]:
    """estimate → µm, root mean square of what each parameter does to the touches; reported names, largest first."""
    _, jacobian = linearise(result.model, result.values)
    size = np.sqrt(np.mean((jacobian * result.values) ** 2, axis=0)) * 1e3
    own = result.parameters
    found = {
        result.selection.label(name): float(s)
        for name, s in zip(result.model.names, size, strict=True)
        if result.selection.label(name) in own
    }
    return dict(sorted(found.items(), key=lambda item: -item[1]))
