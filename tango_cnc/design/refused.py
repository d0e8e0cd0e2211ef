"""Plans that are not worth making: why, and how many minutes would do."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

from ..duration import spoken
from ..records import InputError
from . import how_long, least
from .enough import SPARE, believed, serves, to_spare
from .left_out import left_out, sentences
from .problem import Chosen

if TYPE_CHECKING:
    from .propose import Setting

MANY = 4  # indexations that are worth a word
SHORT = 4.0  # mm of stand-off from which a touch can be made shorter
MORE = 1.02  # times the time in which the touches that lack would be made


class InVain(InputError):
    """No plan of that time does: the one that was found, why it does not, minutes that no plan does without if known."""

    def __init__(self, found: Chosen, why: str, least: float = 0.0) -> None:
        super().__init__(why)
        self.found, self.why, self.least = found, why, least

    @cached_property
    def minutes(self) -> float | None:
        """→ minutes that would do, as a quick plan says; None where that does not find any."""
        minutes = how_long.needed(self.found, serves, self.least)
        if minutes is None or believed(self.found) or not serves(self.found.problem, self.found.information):
            return minutes
        touches = len(self.found.rows)
        more = MORE * (touches + SPARE - to_spare(self.found)) / touches
        return max(minutes, math.ceil(2 * more * self.found.seconds / 60) / 2)


def worth_making(found: Chosen) -> Chosen:
    """plan → the same. Raises InVain where it does not determine what it is for, or has too few touches to spare."""
    if not serves(found.problem, found.information):
        raise InVain(found, undetermined(found))
    if not believed(found):
        raise InVain(found, few(found))
    return found


def few(found: Chosen) -> str:
    """plan with too few touches to spare → why that is no plan."""
    return (
        f"its {len(found.rows)} touches are {to_spare(found)} more than the estimate has unknowns; with fewer than {SPARE} "
        "nothing shows whether the result may be believed"
    )


def undetermined(found: Chosen) -> str:
    """plan that does not serve → why."""
    if found.problem.choice.twice:
        return "such a check would see no change smaller than 0.1 mm"
    unknown = len(found.rows) - to_spare(found)
    why = f"; 'tango estimate' has {unknown} unknowns of them" if to_spare(found) < SPARE else ""
    return f"its {len(found.rows)} touches do not determine all that the goal asks for{why}"


def refused(ready: Setting, error: InVain) -> InputError:
    """setting, why no plan does → the error that names it, the minutes that would do, and what else does."""
    problem, minutes = error.found.problem, error.minutes
    long = f"more than {how_long.LONGEST:g} minutes"
    if minutes is not None:
        long = f"more than {error.least:g} minutes (about {minutes:g})" if error.least else f"about {minutes:g} minutes or more"
    said = [long]
    if ready.wish.approach.standoff > SHORT:
        said.append("shorter touches by --within MM, where it is known how far facets are from their places")
    if not problem.choice.twice and "S4" in ready.wish.terms:
        terms = ",".join("S3" if item == "S4" else item for item in ready.wish.terms if isinstance(item, str))
        named = ready.wish.typed and all(isinstance(item, str) for item in ready.wish.terms)
        said.append("--terms S3 instead of S4" + (f": {ready.wish.typed} --terms {terms}" if named else ""))
    lost = left_out(problem)
    return InputError(
        "; ".join(
            [
                f"--minutes: {'the usual' if ready.wish.minutes is None else 'found'} {problem.seconds / 60:.3g}",
                error.why,
                *_turns(error.found),
                *(sentences(lost) if lost else ()),
                "allowed: " + ", or ".join(said),
            ]
        )
    )


def _turns(found: Chosen) -> list[str]:
    """plan that does not do → how many indexations any plan takes, where that is several, and what their turns take."""
    count = least.visits(found.problem)
    if count < MANY:
        return []
    told = least.told(found.problem)
    return [
        f"the errors of the rotary axes alone take {count} indexations, as touches at one tell {told} numbers of them at most; "
        f"these turns take {spoken(count * found.costs[1])}"
    ]
