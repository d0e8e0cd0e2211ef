"""What a short check says of a compensation (`Outcome`), resting on the run that it was made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..loaded import AS_SEEN, HELPS
from ..model import Model
from ..records import Array
from ..touches import Touches
from .fit import posed, rms
from .hidden import of_record, unseen
from .loop import Kept
from .outcome import (
    HELPED,
    KINEMATICS,
    NOT_WHOLE,
    TRY_KINEMATICS,
    Outcome,
    judged,
    less,
    listed,
    no_help,
    partly,
    promises,
    rolled_back,
    said_share,
    spans,
)
from .promise import DRAWS, Figure
from .seen import MISFIT, MISSING, Question, Seen
from .shares import Before, Part, Shares, growth, parts_of, shares
from .space import Held, Poses, sample
from .warmth import MOVES, Warmth, as_warm, stated, warmth, whole_as_warm

FEW = 0.6  # of the touches that a compensation was made from: with fewer it is a short check
WHOLE = "all of it together"


@dataclass(frozen=True)
class Short:
    """A short check made ready: what was known, its touches, what the target holds, the volume."""

    kept: Kept
    before: Before
    held: Sequence[Held]
    tcp: bool  # whether the check was made with tool center point control
    first_tcp: bool  # whether the full run was
    files: Mapping[str, str] = field(default_factory=dict)  # {place that changed: its file}, where that is known
    warmer: float | None = None  # K by which a person states that the machine is warmer than in the full run
    sensor: str | None = None  # temperature that counts; None: the mean of all

    @property
    def poses(self) -> Poses:
        """→ those of the volume of the compensation."""
        machine = self.before.result.model.touches.machine
        scale = {n: 1.0 if n in machine.linear else np.pi / 180 for n in self.kept.record["volume"]}
        return sample(machine, {n: (low * scale[n], high * scale[n]) for n, (low, high) in self.kept.record["volume"].items()})

    @property
    def parts(self) -> list[Part]:
        """→ what changed and a run like this sees."""
        return parts_of(self.held, changes(self.kept), tcp=self.tcp)

    def question(self, parts: Sequence[Part]) -> Question:
        """parts → what is asked."""
        loads = parts_of(self.held, changes(self.kept), tcp=self.tcp, files=self.files) if self.files else []
        return Question(self.before, parts, loads, self.files, self.poses, promises(self.kept.record)[0])

    def as_warm(self, touches: Touches) -> tuple[Short, Warmth]:
        """touches → the same resting on a machine that may be as much warmer as they and the temperatures say, and that."""
        parts, shifted = self.parts, self.shifted(touches)
        kelvin = stated(self.before.result.model.touches, touches, self.sensor, self.warmer)
        found = warmth(self.before, lambda before: shares(before, touches, parts, shifted), kelvin)
        return replace(self, before=found.taken(self.before)), found

    @property
    def calm(self) -> Before:
        """→ what was known, of a machine that is what it was."""
        return replace(self.before, moves=0.0, warmer=0.0, grown=0.0)

    def kinematics(self, at: Poses, *, new: bool) -> Array:
        """poses → (n, 3) mm that the control's kinematics take away, with the new numbers or with those before."""
        record = self.kept.record
        present = of_record(record)
        numbers = present.numbers if new else {v["place"]: float(v["present"]) for v in record["values"]}
        sizes = unseen(self.held, numbers, present.before(self.held))
        return np.asarray(sum((h.lever(at) * v for h, v in zip(self.held, sizes, strict=True) if v), np.zeros((len(at), 3))))

    def shifted(self, touches: Touches) -> Array:
        """touches → (n,) mm by which their gaps differ as the kinematics before acted in one of both runs alone."""
        gone = np.sum(self.kinematics(Poses(touches), new=False) * touches.normal, axis=1)
        return np.asarray(gone * (float(self.tcp) - float(self.first_tcp)))


def changes(kept: Kept) -> dict[str, float]:
    """compensation → {place: by how much its number changes}."""
    return {v["place"]: v["new"] - v["present"] for v in kept.record["values"] if v["new"] != v["present"]}


@dataclass(frozen=True)
class _Over:
    """What parts and unknowns do over the volume of a compensation, set-up taken out."""

    own: list[int]  # unknowns that act there
    levers: Array  # (3n, c) mm per unit of each
    moved: Array  # (3n, g) mm that each part takes away
    error: Array  # (3n,) mm by the full run, `told` taken off
    told: Array  # (3n,) mm that is taken off by calculation
    hidden: Array  # (3n,) mm of what was changed that the touches could not see
    grown: Array  # (3n, 1) mm per K that all axes have grown as by

    @classmethod
    def of(cls, asked: Short, parts: Sequence[Part]) -> _Over:
        """short check, its parts → the same over the volume."""
        at, model = asked.poses, asked.before.result.model
        own = [j for j, c in enumerate(model.coefficients) if posed(c, at.touches)]
        then, now = (asked.kinematics(at, new=new).ravel() for new in (False, True))
        hidden = np.zeros_like(now) if asked.tcp else now - then
        by_run = {(True, True): np.zeros_like(now), (True, False): then, (False, False): now, (False, True): hidden}
        told = by_run[asked.tcp, asked.first_tcp]
        levers, moved = at.free(levers_of(model, own, at)), at.free(np.stack([p.moved(at).ravel() for p in parts], axis=1))
        told, hidden, grown = at.free(np.stack([told, hidden, growth(at).ravel()], axis=1)).T
        return cls(own, levers, moved, levers @ asked.before.result.values[own] - told, told, hidden, grown[:, None])

    def drawn(self, told_by: Shares, *, kinematics: bool = True, grown: float = 0.0) -> tuple[Array, Array]:
        """shares → (m,) draws of what is gone of all, (m,) draws of what is left, µm rms; without `kinematics`: of those hidden.

        `grown`: K that all axes may have grown as by, of which touches and temperatures say nothing.
        """
        change, share = told_by.draws(DRAWS)
        left = (self.error + (0 if kinematics else self.hidden))[:, None] + self.levers @ change[self.own] - self.moved @ share
        left += self.grown * change[-1]
        whole = self.moved.sum(axis=1)
        gone = 1.0 - whole @ left / float(whole @ whole)
        left += self.grown * grown * np.random.default_rng(3).normal(size=DRAWS)
        return gone, np.sqrt(np.sum(left**2, axis=0) / (len(left) / 3)) * 1e3


def short_outcome(asked: Short, touches: Touches) -> Outcome:
    """short check, its touches → what became of the promise."""
    parts = asked.parts
    before, promised = promises(asked.kept.record)
    if not parts:
        text = (
            "nothing that these touches could see was changed: kinematics act with tool center point control only. Measure with it "
            "on, and state --tcp, or by hand, as steps.txt says (--turned)"
        )
        return Outcome(before, promised, before, "undecided", text)
    asked, warm = asked.as_warm(touches)
    shifted = asked.shifted(touches)
    found = shares(asked.before, touches, parts, shifted)
    over = _Over.of(asked, parts)
    known = asked.question(parts).answer(found, touches, shifted)
    calm = asked.calm
    gone, size = over.drawn(found, grown=MOVES if warm.open else 0.0)
    helped, most = _interval(gone), _interval(size)
    least = _interval(over.drawn(shares(calm, touches, parts, shifted, (*known.acting, *known.hidden)))[1])
    # What might have moved, and what might be missing unseen, make an error look larger than it is: the lower end is without.
    low, high = min(least.low, most.low), most.high
    measured = Figure(min(max((most.value + least.value) / 2, low), high), low, high)
    none = _none(calm, over, touches, parts, shifted, known)
    said = _said(asked, found, known, before, promised, measured, helped, over, none)
    return as_warm(said, warm, missing=found.p_value >= MISFIT and bool(known.missing))


def _none(calm: Before, over: _Over, touches: Touches, parts: Sequence[Part], shifted: Array, known: Seen) -> float:
    """what was known, over the volume, touches, parts, what is known of them → µm rms left, were nothing unseen in the control."""
    absent = [part.name for part in parts if part.name not in known.acting]
    told_by = shares(calm, touches, parts, shifted, known.acting, absent)
    return _interval(over.drawn(told_by, kinematics=False)[1]).value


def levers_of(model: Model, own: Sequence[int], at: Poses) -> Array:
    """model, which of its coefficients, poses → (3n, c) mm per unit of each."""
    coefficients = [model.coefficients[j] for j in own]
    return np.stack([(at.slots[c.slot] * c.regressor(at.touches)[:, None]).ravel() for c in coefficients], axis=1)


def _interval(draws: Array) -> Figure:
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975])
    return Figure(float(middle), float(low), float(high))


def by_part(asked: Short, touches: Touches) -> tuple[Seen, float] | None:
    """a run made ready, all its touches → what is known of its parts, µm rms left were none of the unseen ones in the control.

    None where the touches fit no share of them. By table, group and file first; where all of these may act, by single numbers: a
    reversal value of one axis was lost among all.
    """
    result: tuple[Seen, float] | None = None
    shifted = asked.shifted(touches)
    for singly in (False, True):
        parts = parts_of(asked.held, changes(asked.kept), tcp=asked.tcp, singly=singly)
        if not parts:
            return None
        found = shares(asked.before, touches, parts, shifted)
        if found.p_value < MISFIT:
            return None
        known = asked.question(parts).answer(found, touches, shifted, MISSING)
        if result is None or known.missing:
            result = known, _none(asked.calm, _Over.of(asked, parts), touches, parts, shifted, known)
        if known.missing:
            break
    return result


def whole_outcome(found: Outcome, asked: Short, touches: Touches) -> Outcome:
    """outcome of a run that determines everything, the same run made ready, all its touches → the same; not as promised where a
    part does not act, kept as far as seen where that is not known of one, undecided where the machine was warmer.
    """
    ready, warm = asked.as_warm(touches) if asked.parts else (asked, Warmth(0.0))
    asked = ready if warm.another or warm.kelvin is not None else asked
    parts = by_part(asked, touches) if found.verdict in HELPS or warm.another else None
    found = not_all(found, parts, asked.kept)
    model = asked.before.result.model
    if model.bar is not None or model.calibrated:  # such a run finds its scales anew
        warm = replace(warm, sees=0.0)
    return whole_as_warm(found, warm, missing=parts is not None and bool(parts[0].missing))


def not_all(found: Outcome, parts: tuple[Seen, float] | None, kept: Kept) -> Outcome:
    """outcome of a run that determines everything, what is known of its parts, compensation → the same; not as promised where one
    does not act, kept as far as seen where that is not known of one.

    What centers take away may hide what a table leaves.
    """
    if found.verdict not in HELPS or parts is None:
        return found
    known, none = parts
    if known.missing:
        text = (
            f"{found.measured.value:.2f} µm ({found.measured.low:.2f} to {found.measured.high:.2f}) are left of "
            f"{found.before.value:.2f} µm, which is near the promise; but not everything acts as it was written: "
            f"{_some(known.missing)}. Look whether its file was loaded; to go back, load the files of {kept.folder / 'undo'}"
        )
        return replace(found, verdict="not as promised", text=text, not_seen=(), left_if_none=None)
    names = (*found.not_seen, *known.unsure, *known.unseen)
    if not (found.not_seen or known.files or known.unsure or none > found.promised.high) or not names:
        return found
    return replace(found, verdict=AS_SEEN, not_seen=names, left_if_none=none)


def _said(
    asked: Short,
    found: Shares,
    parts: Seen,
    before: Figure,
    promised: Figure,
    measured: Figure,
    helped: Figure,
    over: _Over,
    none: float,
) -> Outcome:
    """short check, shares, what is known of the parts, figures, over the volume, µm if nothing unseen acts → the verdict."""
    verdict = _verdict(parts, before, promised, measured, helped)
    if verdict == "no help":  # nothing of it acts: then the kinematics do not, either
        measured = _interval(over.drawn(found, kinematics=False)[1])
    undo = f"load the files of {asked.kept.folder / 'undo'}"
    left = f"{measured.value:.2f} µm ({measured.low:.2f} to {measured.high:.2f}) are left of {before.value:.2f} µm"
    gone = f"{said_share(helped)}. A short check, which rests on the run that the compensation was made from"
    calculated = not asked.tcp and rms(over.told) > 0
    if calculated and verdict != "no help":
        gone += f"; what the kinematics hold ({rms(over.told):.2f} µm) is taken off by calculation, this run could not see it"
    if found.p_value < MISFIT:
        number, off = found.off[0]
        text = (
            f"the touches fit no share of what was written (p = {found.p_value:.1g}; touch {number} by {off:.0f} standard "
            "deviations): a chip, something that moved during the check, or a machine that is another one since the full run. "
            "Clean the facets and repeat the check; if that says the same, measure with the whole strategy"
        )
        return Outcome(before, promised, measured, "undecided", text)
    if verdict == "no help":
        text = (
            f"{no_help(before, promised, measured)}; {gone}. Now {undo}, and note it: "
            f"{rolled_back(asked.kept)}. "
            "The files were not loaded, or a sign is wrong, or the control does not use what was written: do a "
            "sign trial"
        )
    elif verdict == "kept":
        text = f"{left}, and {promised.low:.2f} to {promised.high:.2f} µm were promised: they agree; {gone}"
        names = (*((KINEMATICS,) if over.hidden.any() else ()), *parts.unseen)
        if calculated:
            text = f"{text}. {TRY_KINEMATICS}"
        if over.hidden.any() or parts.files or none > promised.high:
            return Outcome(before, promised, measured, AS_SEEN, text, names, none)
        if names:
            text = f"{text}. By themselves these are not seen: {listed(names)}; {none:.2f} µm would be left without them"
    elif verdict == "not as promised":
        what = (
            f"this does not act as it was written: {_some(parts.missing)}"
            if parts.missing
            else "look for what else has changed since"
        )
        text = f"{left}, but no more than {promised.high:.2f} µm were promised; {what}; {gone}. To go back, {undo}"
    else:
        what = f"whether {_some(parts.unsure)} is in the control" if parts.unsure else "whether it has helped"
        text = f"{left}; these touches cannot tell {what}; {gone}{f'. {NOT_WHOLE}' if partly(helped) else ''}"
        return Outcome(before, promised, measured, verdict, text, unsure=parts.unsure or (WHOLE,))
    return Outcome(before, promised, measured, verdict, text)


def _verdict(parts: Seen, before: Figure, promised: Figure, measured: Figure, helped: Figure) -> str:
    """what is known of the parts, figures → the verdict.

    Less than half is gone and some of it is in the control all the same: then it is in part, unless more is left than before.
    """
    found = judged(before, promised, measured, helped)
    if found == "no help" and parts.acting and less(measured, before):
        return "not as promised"
    if found == "no help" or spans(helped):
        return found
    if parts.missing and not parts.acting and not parts.unsure and helped.value < HELPED:
        return "no help"
    if parts.missing:
        return "not as promised"
    if parts.unsure:
        return "undecided"
    return found


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
