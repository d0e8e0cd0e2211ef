"""What is known of a cell before a night, and what that night is to touch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..files.nightly import Nightly
from ..history import Knowledge, Night
from ..loaded import Event
from ..records import Array, Cell, Readings
from ..report.repeated import said_of_repair
from ..state import (
    Frame,
    State,
    choose,
    predicted,
)
from ..state.volume import Aim, aim, levers
from ..texts import say
from .alarms import Known
from .control import Given, InControl
from .doubt import NightDoubt
from .goes_on import anew
from .learning import READ, Earlier
from .ports import Past
from .trend import SLOPE

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
class BeforeNight:
    """What is known of one cell before a night, and what that night touches; frozen, so what one night computes another may use."""

    cell: Cell
    settings: Nightly
    followed: Frame
    times: Timed
    read: READ  # text of readings.csv → readings
    check: Cell | None = None  # the cell with the strategy of check.yaml
    judged: Callable[[Cell, Readings, Estimate, str, bool], NightDoubt] | None = None  # the last: kind of night, as predicted
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
        """→ what alarms are worded with."""
        return Known(self.cell, self.followed, self.lever)

    def state(self, past: Past) -> State | None:
        """history → what was known after the last measured night; None before the first one, and after a repair."""
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
        """→ what the history said to the last call of `state`, and the state that it is: a night asks twice."""
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
            return "full", say("night.analysis.repaired_since_last_full_run", value=said_of_repair(repaired[-1]))
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
