"""How much warmer a machine is than in the run that a compensation was made from: by temperatures, by touches, or not known.

A warm machine moves its axes by some µm per K, and its ways become longer. What it leaves then is not what was promised, however
well the control uses what was written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..loaded import AS_SEEN, HELPS
from ..records import InputError
from ..touches import Touches
from .outcome import Outcome
from .shares import Before, Shares

ALIKE = 1.0  # K: a smaller difference is no other machine, as for the nights
BLIND = 1.25  # K, standard deviation of a growth beyond which touches do not show it
MAYBE = 5.0  # K by which a machine of which nobody knows may be warmer or colder
MOVES = 3.0  # K by which it may have moved its axes besides, where it has grown
NOT_ALL = "not as promised"
SURE = 2.5  # standard deviations of a growth that is named
Fits = Callable[[Before], Shares]


@dataclass(frozen=True)
class Warmth:
    """K by which a machine is warmer than in the full run."""

    kelvin: float | None  # by temperatures; None: not known
    grown: tuple[float, float] | None = None  # by touches, with its standard deviation; None: they show no growth
    sees: float = 0.0  # K, standard deviation to which touches see a growth of all axes

    @property
    def another(self) -> bool:
        """→ whether it is another machine than the one of the full run."""
        return self.grown is not None or (self.kelvin is not None and abs(self.kelvin) >= ALIKE)

    @property
    def open(self) -> bool:
        """→ whether it may be, and nothing tells."""
        return self.kelvin is None and self.sees > BLIND

    def taken(self, before: Before) -> Before:
        """what was known → the same of a machine that may be as much warmer."""
        touched = 0.0 if self.grown is None else abs(self.grown[0]) + self.grown[1]
        by = max(abs(self.kelvin or 0.0), touched)
        return replace(before, warmer=by, grown=MOVES if self.kelvin is None and not by and not self.open else by)

    @property
    def text(self) -> str:
        """→ what is known of it, for people; nothing of a machine that is as warm as it was."""
        if self.kelvin is not None and abs(self.kelvin) >= ALIKE:
            return f"the machine was {_kelvin(self.kelvin)} than in the run that the compensation was made from"
        if self.grown is None:
            return ""
        size, std = self.grown
        more = "; its temperatures do not say so" if self.kelvin is not None else ""
        return (
            f"by the touches X, Y and Z have all become {'longer' if size > 0 else 'shorter'} alike since the run that the "
            f"compensation was made from, as if the machine had become {_kelvin(size)} (± {2 * std:.1f}) than its table, or the "
            f"table as much {'colder' if size > 0 else 'warmer'}{more}"
        )


def _kelvin(size: float) -> str:
    return f"{abs(size):.1f} K {'warmer' if size > 0 else 'colder'}"


def stated(then: Touches, now: Touches, sensor: str | None, given: float | None) -> float | None:
    """touches of the full run and of the check, the sensor that counts (None: the mean of all), K that a person states → K by which
    the machine is warmer. None where nobody knows.

    Raises InputError where both runs have temperatures and a person states another difference.
    """
    if given is not None and not np.isfinite(given):
        raise InputError(
            f"--warmer: found {given}; allowed: K by which the machine was warmer than in the full run, below 0 colder"
        )
    shared = [name for name in then.temperatures if name in now.temperatures]
    means = {name: tuple(_mean(run.temperatures[name]) for run in (then, now)) for name in shared}
    known = {name: pair for name, pair in means.items() if np.isfinite(pair).all()}
    used = [known[sensor]] if sensor in known else list(known.values())
    found = float(np.mean([b - a for a, b in used])) if used else None
    if found is not None and given is not None and abs(found - given) > ALIKE / 2:
        raise InputError(
            f"--warmer: found {given:g}, and by the temperatures of both runs it is {found:+.1f} K; allowed: those temperatures, "
            "without --warmer"
        )
    return given if found is None else found


def _mean(celsius: np.ndarray) -> float:
    finite = celsius[np.isfinite(celsius)]
    return float(np.mean(finite)) if len(finite) else np.nan


def warmth(before: Before, fits: Fits, kelvin: float | None) -> Warmth:
    """what was known, fit of the touches on it, K by which the machine is warmer (None: not known) → the same by the touches too.

    They show a growth where it is more than chance makes of a machine that is as warm as it was.
    """
    ways = [fits(replace(before, warmer=k, grown=MAYBE)) for k in (0.0, MOVES)]
    best = max(ways, key=lambda way: way.evidence)
    size, std = best.grown
    shows = abs(size) > max(SURE * std, ALIKE)
    return Warmth(kelvin, (size, std) if shows else None, ways[0].grown[1])


def as_warm(found: Outcome, warm: Warmth, *, missing: bool) -> Outcome:
    """outcome of a short check, warmth, whether parts do not act with all that warmth may have moved → the outcome that says so.

    What a warm machine leaves is no evidence for a compensation, nor against it.
    """
    if warm.another and missing:
        return replace(found, text=f"{found.text}. {_first(warm.text)}; what that moves is in the interval")
    return _undecided(found, warm) if warm.another else if_alike(found, warm)


def whole_as_warm(found: Outcome, warm: Warmth, *, missing: bool) -> Outcome:
    """outcome of a run that determines everything, warmth, as above → the same, of a machine that is as warm as it is now.

    A growth that no touch shows is in none of its numbers.
    """
    if not warm.another:
        return if_alike(found, warm)
    if missing or (found.verdict in HELPS and warm.sees <= BLIND):
        return replace(found, text=f"{found.text}. {_first(warm.text)}: what is left is what it leaves so warm")
    return _undecided(found, warm)


def if_alike(found: Outcome, warm: Warmth) -> Outcome:
    """outcome, warmth → the outcome that says that it holds for a machine as warm as it was, where nothing tells how warm it is,
    and that a promise that was not kept may be warmth.
    """
    if warm.kelvin is None and found.verdict == NOT_ALL:
        why = (
            "nothing says how warm the machine was, and one that was warmer or colder than in the run that the compensation was "
            "made from leaves more, too: state by how much with --warmer (0: it was as warm) before you look for a file"
        )
        return replace(found, text=f"{why}. {_first(found.text)}")
    if not warm.open or found.verdict == "undecided":
        return found
    text = (
        f"{found.text}. Nothing says how warm the machine was, and these touches do not show what all axes have grown alike: this "
        "holds where it was as warm as in the run that the compensation was made from. State the difference with --warmer (0: none)"
    )
    if found.verdict not in HELPS:
        return replace(found, text=text)
    none = found.measured.value if found.left_if_none is None else found.left_if_none
    return replace(found, verdict=AS_SEEN, text=text, left_if_none=none)


def _undecided(found: Outcome, warm: Warmth) -> Outcome:
    m = found.measured
    text = (
        f"{warm.text}: what warmth moves looks like a file that does not act. Measure again when it is as warm as in "
        f"that run; where it stays so, take the compensation out, run the whole strategy and propose anew. "
        f"{m.value:.2f} µm ({m.low:.2f} to {m.high:.2f}) are left of {found.before.value:.2f} µm, and {found.promised.low:.2f} to "
        f"{found.promised.high:.2f} µm were promised"
    )
    return replace(found, verdict="undecided", text=text, not_seen=(), left_if_none=None, unsure=())


def _first(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}"
