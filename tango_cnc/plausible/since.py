"""Touches that seem to be of a chip, of a dirty ball or of one wrong angle: whether a change at a moment explains them as well.

A robust fit agrees with the larger part of the touches. Where something moved early or late in the run, the smaller part is what
does not fit: it may be all on one facet, on one ball or in one indexation only because the others do not feel what moved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..kinematics import Slot
from ..records import Array
from ..terms._moment import between
from ..texts import joined, say
from ..touches import Touches
from .data import Remark, listed
from .lacking import Left, left_over, stretches, without

FITS = 5.0  # standard deviations within which a touch fits
MISFIT = 1.0  # part of a touch that may not fit for each of the displacement's numbers: so many it makes fit by itself
QUIET = 1.5  # times the scatter that all touches together may leave beside the change
ALIKE = 12.0  # χ² by which what moved may explain less than the best
FEWEST = 2  # touches more that a moment has to explain before the sentence names it alone
SHOWN = 4  # places that a sentence names
LARGEST = 1500  # touches of which a moment is looked for


@dataclass(frozen=True)
class Moment:
    """What may have moved, and when."""

    places: tuple[tuple[str, str], ...]  # frame and axis, as words have them
    before: int  # number of the last touch before it
    after: int  # number of the first touch that may be after it and shows it
    rows: NDArray[np.int64]  # touches without weight that fit then


def or_moment(result: Estimate, told: Sequence[Remark]) -> list[Remark]:
    """estimate by the noise of its residuals, remarks on touches that belong together → the remarks, and what else explains them.

    Where a change at a moment explains other touches without weight as well, or several remarks at once, the report names it alone.
    """
    accused = np.isin(result.model.touches.number, [number for r in told for number in r.touches]) & result.unused
    found = moment(result, accused) if told else None
    if found is None:
        return list(told)
    number = result.model.touches.number
    fits = tuple(int(i) for i in number[found.rows])
    places = [say(f"plausible.moved_{frame}", axis=axis).rstrip(",") for frame, axis in found.places[:SHOWN]]
    text = say(
        "plausible.since.fit_if_moved",
        count=len(fits),
        numbers=listed(fits),
        before=found.before,
        after=found.after,
        place=joined(say("plausible.or"), places),
    )
    change = say("plausible.groups.find_out_what_happened_then")
    more = len(set(fits) - {number for r in told for number in r.touches})
    if more >= FEWEST or (len(told) > 1 and told[0].kind):
        everything = tuple(c.name for c in result.model.coefficients)
        return [Remark("doubtful", text, fits, "step", "time_s", change, sure=True, moves=everything)]
    text = joined(". ", (text, say("plausible.since.or_else", other=joined("; ", [r.text for r in told]))))
    moves = tuple(dict.fromkeys(name for r in told for name in r.moves))
    return [Remark("doubtful", text, fits, "step", "time_s", change, moves=moves)]


def moment(result: Estimate, accused: NDArray[np.bool_]) -> Moment | None:
    """estimate by the noise of its residuals, (n,) touches without weight → the change at a moment that explains them."""
    touches = result.model.touches
    if result.noise is None or len(touches) > LARGEST:
        return None
    left = left_over(result, every=True)
    if left is None:
        return None
    out = result.unused[left.rows]
    found = [one for name, axis, columns in _movable(touches) for one in _tried(left, columns, accused[left.rows], out, name, axis)]
    if not found:
        return None
    best = max(one.worth for one in found)
    first = next(one for one in found if one.worth == best)
    same = [one for one in found if one.worth > best - ALIKE and one.first <= first.last and one.last >= first.first]
    number = touches.number[left.rows]
    places = tuple(dict.fromkeys((one.frame, one.axis) for one in same))
    return Moment(places, int(number[first.first - 1]), int(number[first.last]), left.rows[first.fits & out])


@dataclass(frozen=True)
class _Change:
    frame: str
    axis: str
    worth: float  # χ² that it takes out, its numbers paid for
    first: int  # place of the first touch after it: the earliest
    last: int  # and the latest that the touches allow
    fits: NDArray[np.bool_]  # (n,) touches that fit then


def _tried(
    left: Left, columns: Array, accused: NDArray[np.bool_], out: NDArray[np.bool_], frame: str, axis: str
) -> Iterator[_Change]:
    """→ the displacement from its best moment on, where it makes the accused touches fit and leaves the others as they are."""
    n, k = len(left.rows), columns.shape[1]
    order = np.arange(n)
    tried = stretches(left, order, columns, np.arange(1, n), np.full(n - 1, n))
    if tried is None:
        return
    best, first, last = between(tried.gain, 1.0)
    own = np.zeros_like(columns)
    after = left.rows[tried.begin[best] :]
    own[after] = columns[after]
    then = without(left, own)
    fits = np.abs(then.gaps) < FITS
    wrong = int((~fits[accused]).sum()) + int((~fits[~out]).sum())
    explained = int(accused.sum()) - wrong
    scatter = float(np.sqrt(np.sum(then.gaps[fits] ** 2) / max(then.spare, 1.0)))
    if explained > MISFIT * tried.free[best] / 2 and wrong <= 0.1 * accused.sum() and scatter < QUIET:
        worth = float(tried.gain[best]) - 2 * k
        yield _Change(frame, axis, worth, int(tried.begin[first]), int(tried.begin[last]), fits)


def _movable(touches: Touches) -> Iterator[tuple[str, str, Array]]:
    """touches → (frame, axis, (n, k) mm a unit) of what may be elsewhere from a moment on: shifted, or shifted and turned."""
    yield "machine", "", touches.machine_normal
    yield "table", "", touches.of_table
    yield "spindle", "", touches.spindle_normal
    slots = touches.seen.slots
    for axis in touches.machine.carried:  # what carries the others is shifted as everything is
        yield "axis", axis, np.stack([slots[Slot(axis, "inter", i)] for i in range(3)], axis=1)
    for axis in (*touches.machine.rotary, *touches.machine.linear):
        turned = [slots[s] for i in range(3, 6) if (s := Slot(axis, "inter", i)) in slots]
        if turned:
            yield "axis", axis, np.stack(turned, axis=1)
