"""Whether to believe the readings of a night, and what the night says of a machine that warmed up while it was measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..records import Cell, Readings
from ..report.texts import texts
from ..state.changes import change
from ..state.naming import CLOSE
from ..terms import serving
from ..texts import unstopped
from .words import every

NEAR = 2 * CLOSE  # of the score: it pays for three ways and a bend, and a machine that warms up mostly goes one way
SMALL = 1.0  # µm: what residuals follow by less puts no night in doubt, however little a touch scatters


@dataclass(frozen=True)
class NightDoubt:
    """What is said of the readings of a night."""

    verdict: str  # trustworthy, doubtful, implausible
    reasons: tuple[str, ...] = ()
    incomplete: bool = False  # too little of what was asked for was measured
    wandered: str = ""  # why the machine counts as on the move while it was measured, as a sentence; empty: it does not
    walk: float = 0.0  # of the touches in time, over their white scatter
    crept: str = ""  # why nobody can tell whether the machine or the stylus in its holder moved, as a sentence; empty: they can
    believed: bool = True  # whether tonight teaches the state anything


def attempted(
    diagnosed: Callable[[Cell, Readings], Mapping[str, Any]], cell: Cell, readings: Readings
) -> tuple[dict[str, Any], str]:
    """how to diagnose, cell, readings → diagnosis and '', or {} and why it could not be made.

    Whatever stops it must not hide an alarm, which is known without it; the message says why no cause was looked for.
    """
    try:
        return dict(diagnosed(cell, readings)), ""
    except Exception as error:
        return {}, str(error) or type(error).__name__


def doubted(judged: NightDoubt, reason: str) -> NightDoubt:
    """judgement, a reason beside the touches → the same, in doubt for this reason first. It teaches what it taught before."""
    verdict = "doubtful" if judged.verdict == "trustworthy" else judged.verdict
    return replace(judged, verdict=verdict, reasons=(reason, *judged.reasons))


def left_over(diagnosis: Mapping[str, Any]) -> bool:
    """diagnosis ({} where none was made) → whether it leaves something over: neither what is named nor what does as well is it."""
    left = {u.get("shape") for u in diagnosis.get("unexplained", ())}
    return diagnosis.get("verdict") == "unexplained" and not (left and left <= {"undecided", "near"})


def is_small(diagnosis: Mapping[str, Any]) -> bool:
    """diagnosis → whether all that it leaves over follows something by less than a single touch scatters, or than `SMALL`.

    It asks about two thousand shapes, and a sound night may have one of them by chance: 0.4 µm was seen where touches scatter by
    0.7. As large as the scatter itself it is no chance.
    """
    left = [u for u in diagnosis.get("unexplained", ()) if u.get("shape") not in ("undecided", "near")]
    sizes = [float(u.get("amplitude_um") or 0.0) for u in left]
    least = max(float(diagnosis.get("noise_um") or 0.0), SMALL)
    return bool(sizes) and all(size > 0 for size in sizes) and math.hypot(*sizes) < least


def believed(
    judged: NightDoubt, diagnosis: Mapping[str, Any], alarms: Sequence[dict[str, Any]], first: bool, moves: float = -math.inf
) -> NightDoubt:
    """judgement, diagnosis ({} where none was made), alarms of the touches, whether nothing was known, by how much a machine that
    moves on while it is measured explains the touches better than what the alarms name (state/warming.py) → the judgement of the
    night.

    Not believed: implausible, incomplete, doubtful without an alarm, and a machine that warmed up while it was measured. Its
    reasons carry what such a night would have said by itself. An alarm that may be warm-up as well says so. What the diagnosis
    cannot explain makes a night doubtful, unless it is small; it is carried on, as every touch still tells the machine as it is.
    """
    t, warm_up = texts(), serving("warm-up")
    warm = next((f for f in (*diagnosis.get("findings", ()), *diagnosis.get("not_named", ())) if f.get("cause") == warm_up), None)
    blurred = bool(alarms) and change(alarms[0]["cause"]).blurred
    reasons = list(judged.reasons)
    restless = judged.walk > 1.0 and (blurred or judged.verdict == "doubtful")  # it moved while it was measured, whatever is named
    plain = bool(alarms) and moves > CLOSE
    warming = bool(judged.wandered) or restless or plain or (blurred and warm is not None)
    if warming:
        wandered = judged.wandered or t("night.moves_on" if plain else "night.warming")
        reasons = [wandered, *(r for r in reasons if r != judged.wandered)]
        if judged.crept:  # the touches do not show which of both it was
            reasons = [reasons[0], judged.crept, *reasons[1:]]
    if alarms and (warm is not None or moves > -NEAR):
        alarms[0]["instead"] = [t("night.warm_up"), *alarms[0]["instead"]]
    teaches = not (
        warming or judged.incomplete or judged.verdict == "implausible" or (judged.verdict == "doubtful" and (first or not alarms))
    )
    if not teaches and alarms:
        reasons.append(t("night.by_itself", text=every(alarms)))
    verdict = judged.verdict
    if teaches and left_over(diagnosis) and not is_small(diagnosis):
        what = next((u["text"] for u in diagnosis.get("unexplained", ())), t("night.unexplained"))
        reasons.append(t("night.unexplained_by", what=unstopped(what)))
        verdict = "doubtful"
    if not teaches and verdict == "trustworthy":
        verdict = "doubtful"
    return replace(judged, verdict=verdict, reasons=tuple(reasons), believed=teaches)
