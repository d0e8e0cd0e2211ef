"""What the nights before teach: rates of wandering that are learned from their touches, and a state that is followed once more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..history import Knowledge
from ..records import Array, Readings
from ..state import Frame, Seen, State, learn, reopened, seen
from ..state.filter import matched, restored, sigma_of, unknown
from . import parts
from .lag import Lag, followed_anew
from .ports import Past
from .sensors import counted

LEARNED_FROM = 60  # nights
LEARNED_EVERY = 10  # measured nights between two times that the rates are learned
FURTHER = 7  # nights looked back over for those that are followed once more
NEAR = {"mm": 0.05, "": 1e-4}  # mm, rad …: a machine that has moved less is linear to a few nm
READ = Callable[[str], Readings]


@dataclass(frozen=True)
class Earlier:
    """The nights before of one machine: its name, what is followed, text of readings.csv → readings, the sensor that counts."""

    machine: str
    followed: Frame
    read: READ
    sensor: str | None

    def restored(self, knowledge: Knowledge, record: Mapping[str, Any]) -> State | None:
        """what a night knew, its record → its state, as it is followed today; None where it left none."""
        if "state" not in record:
            return None
        try:
            state = restored(knowledge.names, knowledge.values, knowledge.covariance, record["state"])
        except (ValueError, KeyError, np.linalg.LinAlgError):
            return None
        return matched(state, self.followed)

    def learned(self, past: Past, recent: Sequence[Mapping[str, Any]], after: State) -> tuple[State, int, int]:
        """state → the same with rates learned from its history, how many nights they come from, measured nights since then."""
        machine = self.machine
        if not past.knows(machine):
            return after, 0, 0
        last: Mapping[str, Any] = next((r["state"] for r in recent if "state" in r), {})
        before, waited = last.get("learned", 0), last.get("since_learned", LEARNED_EVERY) + 1
        if waited < LEARNED_EVERY:
            return after, before, waited
        measured = [n for n in past.nights(machine, last=LEARNED_FROM) if n.status in ("complete", "partial") and n.touches]
        measured.reverse()
        readings, records = past.readings_of([n.entry for n in measured]), past.records_of([n.entry for n in measured])
        nights = [n for n in measured if n.status == "complete" and n.entry in readings and records[n.entry].get("state")]
        if len(nights) < LEARNED_EVERY or (knowledge := past.night(nights[0].entry).knowledge) is None:
            return after, before, waited
        begin = matched(restored(*parts.three(knowledge), records[nights[0].entry]["state"]), self.followed)
        begin = replace(begin, sigma=sigma_of(after), noise=(0.0, 0.0), agreement=(0.0, 0.0), rates=after.rates.copy())
        if unknown(self.followed, begin) and not unknown(self.followed, after):
            # A night that was warmer, and the way back from it, would teach a machine without temperature that it wanders as far.
            begin = reopened(begin, self.followed, None, temperature=True)
        seen_then: list[tuple[float, Seen]] = []
        noise, opened, changed = [], [], False
        for night in measured[measured.index(nights[0]) + 1 :]:
            record = records[night.entry]
            changed |= bool(night.alarms or record.get("ignored") or record.get("repaired"))
            if night not in nights:  # what changed in a night that broke off is first seen here in the next one
                continue
            wide = parts.wider(record)
            if changed:
                opened.append(len(seen_then))
            seen_then.append((record["state"]["day"], self._counted(readings[night.entry], record, after)))
            rest = record.get("residual") or {"std_um": 0.0, "dof": 0}
            noise.append(((rest["std_um"] / 1e3 / begin.sigma / wide) ** 2 * rest["dof"], float(rest["dof"])))
            changed = False
        found = learn(self.followed, begin, seen_then, opened)
        agreement = found.agreement([len(what.value) for _, what in seen_then], noise) or after.agreement
        return replace(after, rates=found.rates, agreement=agreement), len(nights), 0

    def anew(self, past: Past, lag: Lag, recent: Sequence[Mapping[str, Any]], after: State, what: Seen) -> State:
        """history, what the state lags behind, records newest first, state after tonight, tonight's touches → the state followed
        once more from before that on; as it was where the history lacks one of these nights.
        """
        entries = {n.start_utc: n.entry for n in past.nights(self.machine, last=lag.back + FURTHER)}
        wanted = [entries.get(r["start_utc"], 0) for r in recent[: lag.back + 1]]
        readings = past.readings_of(wanted)
        if not all(entry in readings for entry in wanted[:-1]) or (known := past.night(wanted[-1]).knowledge) is None:
            return after
        if (begin := self.restored(known, recent[lag.back])) is None:
            return after
        back = [(r, self._counted(readings[entry], r, after)) for entry, r in zip(wanted[:-1], recent, strict=False)]
        nights = [(float(r["state"]["day"]), then) for r, then in reversed(back)]
        return followed_anew(begin, lag, [*nights, (after.day, what)], after)

    def _counted(self, readings: str, record: Mapping[str, Any], after: State) -> Seen:
        """as `_then` → what those touches say, without single ones that were set apart, and by how much they scattered."""
        return self._then(readings, record, after).without(record.get("outliers", ())).wider(parts.wider(record))

    def _then(self, readings: str, record: Mapping[str, Any], after: State) -> Seen:
        """text of the readings of an earlier night, its record, state of tonight → what those touches say.

        Their rows are those of a machine near this one (`NEAR`), so many nights in one process linearise each of them once.
        """
        kept = self._kept.get(readings)
        if kept is None or kept[1] != after.reference or np.any(np.abs(kept[0] - after.mean) > self._near):
            then = counted(self.read(readings), record.get("sensors"))
            what = seen(self.followed, then, after.mean, after.reference, self.sensor)
            self.keep(readings, after, what)
            return what
        return kept[2]

    def keep(self, readings: str, state: State, what: Seen) -> None:
        """text of the readings of a night, state that they were linearised at, what they say → kept for the next time."""
        self._kept.pop(readings, None)
        if len(self._kept) >= LEARNED_FROM + LEARNED_EVERY:
            self._kept.pop(next(iter(self._kept)))
        self._kept[readings] = (state.mean, state.reference, what)

    @cached_property
    def _kept(self) -> dict[str, tuple[Array, float | None, Seen]]:
        return {}

    @cached_property
    def _near(self) -> Array:
        return np.array([NEAR.get(unit, NEAR[""]) for unit in self.followed.units])
