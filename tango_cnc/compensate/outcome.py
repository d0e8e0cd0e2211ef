"""What a second measurement says of a compensation: kept, kept as far as seen, not as promised, undecided, no help."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..estimate import Estimate
from ..loaded import AS_SEEN, HELPS
from ..records import Array, Machine
from . import unparted
from .fit import Known, known, rms
from .hidden import of_record, unseen
from .loop import Kept
from .promise import DRAWS, Figure, mean, there
from .space import Held, Poses, sample

SEEN = 0.9  # of what was changed, so that touches can decide
LEAST = 1e-4  # mm rms a coordinate: a change by less cannot be seen
HELPED = 0.5  # of what was changed: less is no help
ALL = 0.85  # of what was changed: an interval that ends below it is less than all of it
KINEMATICS = "the kinematics"
LISTED = 4  # tables whose rows are named
NOT_WHOLE = (
    "That is not all of it: look whether every file was loaded, and whether the machine was as warm as in the run that the "
    "compensation was made from"
)
TRY_KINEMATICS = (
    "Nothing proves yet that the control uses the kinematics: before a part relies on them, touch one facet at two indexations "
    "with tool center point control on (docs/compensate.md)"
)


@dataclass(frozen=True)
class Outcome:
    """What a second measurement says of a compensation; µm rms over its volume."""

    before: Figure
    promised: Figure
    measured: Figure
    verdict: str  # kept, kept as far as seen, not as promised, undecided, no help
    text: str
    not_seen: tuple[str, ...] = ()  # may be in the control or not: this run does not see it
    left_if_none: float | None = None  # µm rms that would be left, were none of that in the control
    unsure: tuple[str, ...] = ()  # what more touches would decide
    rows: tuple[str, ...] = ()  # of tables, that no touch of this run met

    @property
    def in_any_case(self) -> bool:
        """→ whether the promise is kept whatever is not seen."""
        if self.verdict == AS_SEEN and self.left_if_none is None:  # rows of tables alone were not met
            return bool(self.rows) and not self.not_seen
        return self.verdict == "kept" or (
            self.verdict == AS_SEEN and self.left_if_none is not None and self.left_if_none <= self.promised.high
        )

    @property
    def said(self) -> str:
        """→ all that a person reads; first what was not seen."""
        if not self.not_seen or self.left_if_none is None:
            return f"{self._rows()}{self.text}"
        p, it = self.promised, "it does not" if len(self.not_seen) == 1 else "it uses none of them"
        within = "within" if self.left_if_none <= p.high else "more than"
        return (
            f"this run does not see whether the control uses {listed(self.not_seen)}. If {it}, {self.left_if_none:.2f} µm would "
            f"be left, {within} the {p.low:.2f} to {p.high:.2f} µm that were promised; more where a sign is wrong. "
            f"{self._rows()}{self.text[0].upper()}{self.text[1:]}"
        )

    def _rows(self) -> str:
        """→ which rows of tables were not met, where it was kept otherwise."""
        if not self.rows or self.verdict not in HELPS:
            return ""
        more = f"; and of {len(self.rows) - LISTED} more tables" if len(self.rows) > LISTED else ""
        return (
            f"Rows of tables that no touch of this run met: {'; '.join(self.rows[:LISTED])}{more}. A wrong number there was "
            "not seen, and one in a row that few touches meet may not be, least on one facet. Read the files back from the "
            "control into a copy of the folder and compare them by --check. "
        )


@dataclass(frozen=True)
class Remeasured:
    """What a run with a compensation in the control finds, over its volume, set-up taken out."""

    levers: Array  # (3n, p) mm per unit of every coefficient
    error: Array  # (3n,) mm, `told` taken off
    told: Array  # (3n,) mm that the kinematics take away and the run did not see
    moved: Array  # (3n,) mm of what was changed that the run could see
    hidden: Array  # (3n,) mm of what was changed that it could not see
    now: Known

    def left(self, *, loaded: bool = True, kinematics: bool = True) -> Figure:
        """→ what is left, µm rms, as a proposal says it; not `loaded`: what would be, were it not in these readings; without
        `kinematics`: were those numbers not in the control that the run could not see."""
        gone = self.told if loaded else self.told + self.moved
        gone = gone if kinematics else gone - self.hidden
        return mean(there(self.now.values, self.now.covariance, self.levers, gone, self.now.freedom))


def ran(kept: Kept, result: Estimate, held: Sequence[Held], *, tcp: bool) -> Remeasured:
    """compensation, estimate of readings made with it in the control, what its target holds → what they find.

    `tcp`: the readings were made with tool center point control on. Without it a probing cycle sees the axes and not the
    control's kinematics: what the kinematics hold is then taken off the second estimate by calculation.
    """
    at = poses_of(kept, result.model.touches.machine)
    now = known(result, at)
    told = _unseen(kept, held, at) if not tcp else np.zeros(3 * len(at))
    sees = [tcp or not h.tcp for h in held]
    columns = [now.error(at).ravel() - told, told, _moved(kept, held, at, sees), _moved(kept, held, at, [not s for s in sees])]
    error, told, moved, hidden = at.free(np.stack(columns, axis=1)).T
    return Remeasured(at.free(now.levers(at)), error, told, moved, hidden, now)


def poses_of(kept: Kept, machine: Machine) -> Poses:
    """compensation, machine → poses of its volume."""
    scale = {n: 1.0 if n in machine.linear else np.pi / 180 for n in kept.record["volume"]}
    return sample(machine, {n: (low * scale[n], high * scale[n]) for n, (low, high) in kept.record["volume"].items()})


def outcome(kept: Kept, result: Estimate, proposal_held: list[Held], *, tcp: bool) -> Outcome:
    """compensation, estimate of readings made with it in the control, what its target holds → what became of the promise.

    `tcp`: the readings were made with tool center point control on.
    """
    run = ran(kept, result, proposal_held, tcp=tcp)
    measured = run.left()
    before, promised = promises(kept.record)
    helped = _helped(run.moved, run.levers, run.error[:, None] + run.levers @ run.now.draws(DRAWS))
    verdict = judged(before, promised, measured, helped)
    if verdict == "no help":  # nothing of it acts: then the kinematics do not, either
        measured = run.left(kinematics=False)
    left = f"{measured.value:.2f} µm ({measured.low:.2f} to {measured.high:.2f}) are left of {before.value:.2f} µm"
    undo = f"load the files of {kept.folder / 'undo'}"
    calculated = ""
    if run.told.any():
        calculated = f". What the kinematics hold ({rms(run.told):.2f} µm) is taken off by calculation: this run could not see it"
    share = said_share(helped) if helped is not None else ""
    again = "Measure again with the strategy and the terms that the compensation was made from"
    if helped is None and run.told.any():
        text = (
            "a run without tool center point control sees too little of what was changed to decide anything. Measure again "
            "with it on, and state --tcp; or where kinematics alone were changed, by hand, as steps.txt says (--turned)"
        )
    elif helped is None or spans(helped):
        why = "these touches see too little of what was changed" if helped is None else share
        text = f"{why}: that decides nothing. {again}"
    elif verdict == "undecided":
        why = NOT_WHOLE if partly(helped) else "The gain is too small for these touches"
        text = f"{left}; {share}{calculated}. {why}. {again}, or with more touches"
    elif verdict == "no help":
        text = (
            f"{no_help(before, promised, measured)}; {share}. Now {undo}, and note it: {rolled_back(kept)}. "
            "The files were not loaded, or a sign is wrong, or the control does not use what was written: do a sign trial"
        )
    elif verdict == "kept":
        text = f"{left}, and {promised.low:.2f} to {promised.high:.2f} µm were promised: they agree; {share}{calculated}"
        if run.told.any():
            text += f". {TRY_KINEMATICS}"
        if not less(measured, before):
            text += f". Whether less is left than before ({before.low:.2f} to {before.high:.2f} µm), these touches cannot tell"
    else:
        text = f"{left}, but no more than {promised.high:.2f} µm were promised; {share}{calculated}. "
        if less(measured, before):
            text += f"It has helped in part: look for a table that the control does not use; to go back, {undo}"
        else:
            text += f"The control uses what was written: look for what else has changed since (a knock, warmth); to go back, {undo}"
    if verdict == "kept" and run.hidden.any():
        return Outcome(before, promised, measured, AS_SEEN, text, (KINEMATICS,), run.left(kinematics=False).value)
    return Outcome(before, promised, measured, verdict, text)


def listed(names: Sequence[str]) -> str:
    """names → the same in a sentence; with semicolons where names have commas."""
    between = "; " if any("," in name for name in names) else ", "
    return names[0] if len(names) == 1 else f"{between.join(names[:-1])} and {names[-1]}"


def no_help(before: Figure, promised: Figure, found: Figure) -> str:
    """what was there before, promised, found to be left → that it has not helped, with the three of them."""
    return (
        f"it has not helped. Before it {before.value:.2f} µm of error were there (rms over the volume), {promised.low:.2f} to "
        f"{promised.high:.2f} µm were promised to be left, and {found.value:.2f} µm ({found.low:.2f} to {found.high:.2f}) are left"
    )


def rolled_back(kept: Kept) -> str:
    """compensation → the command that notes that it was taken out."""
    return f"tango compensate -C {shlex.quote(str(kept.folder.parent.parent))} --rolled-back {kept.number} --reason TEXT"


def promises(record: Mapping[str, Any]) -> tuple[Figure, Figure]:
    """record of a compensation → what was there before, and what it promised to leave, µm rms: of what its touches can see."""
    promise = record["promise"]
    # Other touches may see no more than those did that the promise rests on.
    keys = unparted.SEEN if unparted.SEEN[0] in promise else ("rms_before_um", "rms_after_um")
    before, promised = (Figure(**promise[key]) for key in keys)
    return before, promised


def judged(before: Figure, promised: Figure, measured: Figure, helped: Figure | None) -> str:
    """what was before, promised, is left; share of what the run could see that is gone → the verdict.

    No help is what has evidence against it: less than half is gone, or so much more than all that no less is left than
    before. A wide interval of what is left agrees with any promise: where less than all of it is gone, nothing is decided.
    The sizes alone prove nothing: where little was to be gained, their intervals overlap in any case.
    """
    if helped is None or spans(helped):
        return "undecided"
    too_much = helped.low > 2 - HELPED and measured.low > promised.high and not less(measured, before)
    if helped.high < HELPED or too_much:
        return "no help"
    if not (less(measured, before) or HELPED < helped.low < 2 - HELPED):
        return "undecided"
    if measured.low > promised.high:
        return "not as promised"
    return "undecided" if partly(helped) else "kept"


def partly(helped: Figure) -> bool:
    """share that is gone → whether it is decidedly more than half and decidedly less than all of it."""
    return HELPED < helped.high < ALL


def spans(helped: Figure) -> bool:
    """share that is gone → whether none of it and all of it are possible."""
    return helped.low <= 0 < 1 <= helped.high


def less(measured: Figure, before: Figure) -> bool:
    """→ whether less is left than before, beyond both intervals."""
    return measured.high < before.low


def asked_otherwise(found: Outcome, other: Outcome, *, tcp: bool) -> Outcome:
    """outcome with the answer that was given, outcome with the other answer → what to say of both.

    Where only the other answer agrees with the promise, a person has probably given the wrong one. Without tool center point
    control more than all of it would be gone, which cannot be: nothing is decided then. With it, the kinematics may really be
    unused: the verdict stays.
    """
    if found.verdict in HELPS or other.verdict not in HELPS:
        return found
    left = f"{other.measured.value:.2f} µm ({other.measured.low:.2f} to {other.measured.high:.2f})"
    if tcp:
        text = (
            f"{found.text}. If tool center point control was off in this run, {left} are left, as promised: then state --no-tcp. "
            "If it was on, the control does not use the kinematics that were written"
        )
        return replace(found, text=text)
    text = (
        f"made without tool center point control, this run would leave {found.measured.value:.2f} µm; made with it, {left}, as "
        "promised. Find out how it was made, and state --tcp if it was on"
    )
    return replace(found, verdict="undecided", text=text)


def said_share(helped: Figure) -> str:
    """share that is gone → the same for people."""
    if helped.high < 0:
        more = _percent(Figure(-helped.value, -helped.high, -helped.low))
        return f"of what it could see of the compensation, the run finds {more} added instead of taken away"
    return f"of what it could see of the compensation, the run finds {_percent(helped)} gone"


def _percent(share: Figure) -> str:
    value, low, high = (round(100 * v) + 0 for v in (share.value, share.low, share.high))  # a whole number has no minus before 0
    return f"{value} % ({low} to {high})"


def _moved(kept: Kept, held: Sequence[Held], at: Poses, which: Sequence[bool]) -> Array:
    """→ (3n,) mm of tip error that these entries take away."""
    numbers = {v["place"]: v["new"] - v["present"] for v in kept.record["values"]}
    result = np.zeros(3 * len(at))
    for h, wanted in zip(held, which, strict=True):
        if wanted and numbers.get(h.place):
            result += h.lever(at).ravel() * numbers[h.place] * h.sign / h.factor
    return result


def _unseen(kept: Kept, held: Sequence[Held], at: Poses) -> Array:
    """→ (3n,) mm of tip error that the kinematics take away in all, by this compensation and those before it."""
    present = of_record(kept.record)
    sizes = unseen(held, present.numbers, present.before(held))
    return sum((h.lever(at).ravel() * v for h, v in zip(held, sizes, strict=True) if v), np.zeros(3 * len(at)))


def _helped(moved: Array, levers: Array, left: Array) -> Figure | None:
    """(3n,) mm that a compensation takes away, (3n, p) what touches can tell, (3n, m) draws of what is left → share that is gone.

    What a fit leaves is at right angles to what it takes away: whatever of `moved` is found in the rest has not been taken.
    None where touches tell less than `SEEN` of it.
    """
    whole = float(moved @ moved)
    if whole < LEAST**2 * len(moved):
        return None
    rest = moved - levers @ np.linalg.lstsq(levers, moved, rcond=1e-9)[0]
    if 1.0 - np.sqrt(rest @ rest / whole) < SEEN:
        return None
    low, middle, high = np.quantile(1.0 - moved @ left / whole, [0.025, 0.5, 0.975])
    return Figure(float(middle), float(low), float(high))


def switched(record: Mapping[str, Any], held: Sequence[Held]) -> list[str]:
    """record, what its target holds → places that changed and act with tool center point control only."""
    changed = {v["place"] for v in record["values"] if v["new"] != v["present"]}
    return [h.place for h in held if h.tcp and h.place in changed]
