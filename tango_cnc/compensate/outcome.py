"""What a second measurement says of a compensation: kept, not as promised, undecided, rolled back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..estimate import Estimate
from .fit import known, rms
from .hidden import of_record, unseen
from .loop import Kept
from .promise import DRAWS, Figure, mean, sizes
from .space import Held, Poses, sample

SEEN = 0.9  # of what was changed, so that touches can decide
LEAST = 1e-4  # mm rms a coordinate: a change by less cannot be seen
HELPED = 0.5  # of what was changed: less is no help


@dataclass(frozen=True)
class Outcome:
    """What a second measurement says of a compensation; µm rms over its volume."""

    before: Figure
    promised: Figure
    measured: Figure
    verdict: str  # kept, not as promised, undecided, rolled back
    text: str


def outcome(kept: Kept, result: Estimate, proposal_held: list[Held], *, tcp: bool) -> Outcome:
    """compensation, estimate of readings made with it in the control, what its target holds → what became of the promise.

    `tcp`: the readings were made with tool center point control on. Without it a probing cycle sees the axes and not the
    control's kinematics: what the kinematics hold is then taken off the second estimate by calculation.
    """
    machine = result.model.touches.machine
    scale = {n: 1.0 if n in machine.linear else np.pi / 180 for n in kept.record["volume"]}
    limits = {n: (low * scale[n], high * scale[n]) for n, (low, high) in kept.record["volume"].items()}
    at = sample(machine, limits)
    now = known(result, at)
    told = _unseen(kept, proposal_held, at) if not tcp else np.zeros(3 * len(at))
    error = at.free((now.error(at).ravel() - told)[:, None])
    levers = at.free(now.levers(at))
    scatter = now.draws(DRAWS)
    drawn = error + levers @ scatter
    measured = mean(sizes(scatter.T, levers, -error[:, 0])[None])
    promise = kept.record["promise"]
    before, promised = (Figure(**promise[key]) for key in ("rms_before_um", "rms_after_um"))
    moved = at.free(_moved(kept, proposal_held, at, [tcp or not h.tcp for h in proposal_held])[:, None])[:, 0]
    helped = _helped(moved, levers, drawn)
    left = f"{measured.value:.2f} µm ({measured.low:.2f} to {measured.high:.2f}) are left of {before.value:.2f} µm"
    undo = f"load the files of {kept.folder / 'undo'}"
    calculated = ""
    if told.any():
        size = rms(at.free(told[:, None]))
        calculated = f". What the kinematics hold ({size:.2f} µm) is taken off by calculation: this run could not see it"
    share = f"of what it could see of the compensation, the run finds {_percent(helped)} gone" if helped is not None else ""
    if helped is None or helped.low <= 0 < 1 <= helped.high:
        verdict = "undecided"
        if helped is None and told.any():
            text = (
                "a run without tool center point control sees too little of what was changed to decide anything. Measure again "
                "with it on, and state --tcp"
            )
        else:
            why = "these touches see too little of what was changed" if helped is None else share
            text = f"{why}: that decides nothing. Measure again with the strategy and the terms that the compensation was made from"
    elif helped.high < HELPED or measured.low > 0.9 * before.low:
        verdict = "rolled back"
        text = (
            f"{left}: it has not helped; {share}{calculated}. Now {undo}: it is noted as taken out. "
            "The files were not loaded, or a sign is wrong, or the control does not use what was written: do a sign trial"
        )
    elif measured.low <= promised.high:
        verdict = "kept"
        text = f"{left}, and {promised.low:.2f} to {promised.high:.2f} µm were promised: they agree; {share}{calculated}"
    else:
        verdict = "not as promised"
        text = (
            f"{left}, but no more than {promised.high:.2f} µm were promised; {share}{calculated}. It has helped in part: look for "
            f"a table that the control does not use; to go back, {undo}"
        )
    return Outcome(before, promised, measured, verdict, text)


def asked_otherwise(found: Outcome, other: Outcome, *, tcp: bool) -> Outcome:
    """outcome with the answer that was given, outcome with the other answer → what to say of both.

    Where only the other answer agrees with the promise, a person has probably given the wrong one. Without tool center point
    control more than all of it would be gone, which cannot be: nothing is decided then. With it, the kinematics may really be
    unused: the verdict stays.
    """
    if found.verdict == "kept" or other.verdict != "kept":
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


def _percent(share: Figure) -> str:
    return f"{100 * share.value:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f})"


def _moved(kept: Kept, held: Sequence[Held], at: Poses, which: Sequence[bool]) -> np.ndarray:
    """→ (3n,) mm of tip error that these entries take away."""
    numbers = {v["place"]: v["new"] - v["present"] for v in kept.record["values"]}
    result = np.zeros(3 * len(at))
    for h, wanted in zip(held, which, strict=True):
        if wanted and numbers.get(h.place):
            result += h.lever(at).ravel() * numbers[h.place] * h.sign / h.factor
    return result


def _unseen(kept: Kept, held: Sequence[Held], at: Poses) -> np.ndarray:
    """→ (3n,) mm of tip error that the kinematics take away in all, by this compensation and those before it."""
    present = of_record(kept.record)
    sizes = unseen(held, present.numbers, present.before(held))
    return sum((h.lever(at).ravel() * v for h, v in zip(held, sizes, strict=True) if v), np.zeros(3 * len(at)))


def _helped(moved: np.ndarray, levers: np.ndarray, left: np.ndarray) -> Figure | None:
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
