"""How far what an alarm named has gone since the night before it, by tonight: what a repair, an answer or a return is judged by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from ..history import Knowledge
from ..records import Array
from ..state import Hypothesis, State
from .alarms import Known
from .dates import LISTED
from .ports import Past

SURE = 3.0  # standard deviations by which what is left, or what was added, has to stand out
LEFT = 0.1  # share of what an alarm found that a repair may leave


@dataclass(frozen=True)
class Moved:
    """How far what an alarm named has gone, along each of its directions, since the night before it: then, and by tonight."""

    then: Array  # (m,) as the night of the alarm found it
    now: Array  # (m,)
    std: Array  # (m,) of the difference to the night before, tonight
    std_then: Array  # (m,)
    wander: Array  # (m,) standard deviation of what a sound machine has moved since
    what: Hypothesis

    @property
    def unit(self) -> str:
        """→ of its sizes."""
        return self.what.unit

    def along(self) -> tuple[float, float, float]:
        """→ size then, size now along the same direction, standard deviation of the latter: signed where it is one number."""
        if len(self.then) == 1:
            return float(self.then[0]), float(self.now[0]), float(self.std[0])
        size: float = float(np.linalg.norm(self.then))
        way: Array = self.then / (size if size > 0 else 1.0)
        return size, float(way @ self.now), float(np.linalg.norm(way * self.std))

    def seen(self) -> bool:
        """→ whether what is left of it is more than tonight's touches and the wander of a sound machine leave open."""
        return bool(np.any(np.abs(self.now) > SURE * np.hypot(self.std, self.wander)))

    def apart(self) -> bool:
        """→ whether what is left of it stands out: it is not as it was before the alarm."""
        return self.seen() and float(np.linalg.norm(self.now)) > LEFT * float(np.linalg.norm(self.then))

    def least(self) -> float:
        """→ the smallest size along its direction that tonight's touches tell from nothing."""
        size = float(np.linalg.norm(self.then))
        way: Array = self.then / size if size > 0 and len(self.then) > 1 else np.ones(1)
        return SURE * float(np.linalg.norm(way * np.hypot(self.std, self.wander)))

    def beyond(self, grown: float) -> bool:
        """factor that it may have grown by → whether it is farther from where it was, on any way, than what was seen."""
        whole = self.then * max(grown, 1.0)
        share = float(np.clip(self.now @ whole / max(float(whole @ whole), 1e-30), 0.0, 1.0))
        spread = np.hypot(np.hypot(self.std, self.wander), self.std_then * share * max(grown, 1.0))
        return bool(np.any(np.abs(self.now - share * whole) > SURE * spread))


def found_by(past: Past, machine: str, wanted: Sequence[str]) -> dict[str, tuple[Any, dict[str, Any]]]:
    """history, machine, ids of alarms → {id: the last night that told it, the alarm as it told it}."""
    if not wanted:
        return {}
    told = reversed(past.alarmed(machine))  # several nights report one that goes on
    return {a["id"]: (s, a) for s in told for a in s.record["alarms"] if a["id"] in wanted}


def moved(past: Past, machine: str, k: Known, after: State, stored: Any, alarm: Mapping[str, Any]) -> Moved | None:
    """history, machine, what is known, state after tonight, night of an alarm, the alarm → how far it has moved; None where the
    alarm has no direction, and where the history lacks the night before it.
    """
    found, before = past.night(stored.night.entry).knowledge, _before(past, machine, stored, alarm)
    if found is None or before is None or (h := hypothesis_of(k, alarm)) is None:
        return None
    names = k.followed.names
    known = [_aligned(one, names) for one in (before[0], found)]
    if known[0] is None or known[1] is None:
        return None
    (was, var_was), (then, var_then) = known[0], known[1]
    day = datetime.fromisoformat(before[1]).timestamp() / 86_400
    onto = np.linalg.pinv(h.directions)
    changed_, now = onto @ (then - was), onto @ (after.mean[: len(names)] - was)
    if alarm.get("repair"):  # what a repair left: its night found it, and did not make it
        changed_ = np.full(len(onto), float(alarm["size"])) if len(onto) == 1 else now
        was = then - h.directions @ changed_
        now = onto @ (after.mean[: len(names)] - was)
    p = len(names)
    std, std_then = (np.sqrt(np.diag(onto @ (var_was + var) @ onto.T)) for var in (after.covariance[:p, :p], var_then))
    wander = np.sqrt(onto**2 @ _sound(stored.record, after, p) * max(after.day - day, 0.0))
    return Moved(changed_, now, std, std_then, wander, h)


def _sound(record: Mapping[str, Any], after: State, p: int) -> Array:
    """record of the night of an alarm, state after tonight, number of unknowns → (p,) variance a day of a sound machine.

    What moves faster than it was learned to is followed with a rate of its own (lag.py). That is no wander of a sound machine.
    """
    then = np.array((record.get("state") or {}).get("rates") or (), dtype=float)
    return np.minimum(then[:p], after.rates[:p]) if len(then) == len(after.rates) else after.rates[:p]


def hypothesis_of(k: Known, alarm: Mapping[str, Any]) -> Hypothesis | None:
    """what is known, alarm → the directions that it names; None for one without."""
    tried = k.tried
    return next((h for h in tried if (h.cause, h.parameter) == (alarm["cause"], alarm["parameter"])), None)


def _before(past: Past, machine: str, stored: Any, alarm: Mapping[str, Any]) -> tuple[Knowledge, str] | None:
    """→ what was known before an alarm, and when: of a drift on the night that it is reckoned from, else on the last one before."""
    nights = [n for n in past.nights(machine) if n.start_utc < stored.night.start_utc and n.touches]
    if alarm.get("rate_per_day"):
        nights = [n for n in nights if n.night <= str(alarm["since"])]
    for n in nights[:LISTED]:
        if (known := past.night(n.entry).knowledge) is not None:
            return known, n.start_utc
    return None


def _aligned(known: Knowledge, names: Sequence[str]) -> tuple[Array, Array] | None:
    """unknowns of a night, names that are followed → (p,) values, (p, p) covariance; None where it does not have them all."""
    place = {name: i for i, name in enumerate(known.names)}
    if any(name not in place for name in names):
        return None
    rows = [place[name] for name in names]
    return np.asarray(known.values)[rows], np.asarray(known.covariance)[np.ix_(rows, rows)]
