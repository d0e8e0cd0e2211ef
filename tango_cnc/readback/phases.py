"""Where a program is between its start mark and its end mark, and what it may do there.

A touch goes round once:

    FREE ─finds→ FOUND ─leaves→ FREE ─measures→ MET ─records→ NOTED ─leaves→ BACK ─moves→ FREE
                                                 └─leaves→ ASIDE ─records→ BACK

`NEXT` is the whole of it: a step that is not in the table is an error, and a state that is not in `Phase` cannot be written down.
"""

from __future__ import annotations

from enum import Enum

from ..records import InputError


class Phase(Enum):
    """How far the program is, in words."""

    HEAD = "before the start mark"
    FREE = "between two touches, the probe free"
    TOUCHED = "at a stylus that somebody touches"
    FOUND = "at a facet that was found and is still to be measured"
    MET = "at a facet that was measured, without a record"
    ASIDE = "off a facet that was measured, without a record"
    NOTED = "at a facet, its touch on record"
    BACK = "off a facet, its touch on record"
    ENDED = "after the end mark"


class Action(Enum):
    """What a program does next, as far as the phases are concerned."""

    STARTS = "the start mark"
    PROVES = "the slow move that proves the probe alive"
    RESTS = "no motion for as long as a hand needs to let go of the stylus"
    FINDS = "a move that finds a facet"
    MEASURES = "a measuring move"
    LEAVES = "an unprotected move off a facet"
    FREED = "the control itself takes the probe off the facet"
    GUARDED = "a guarded move that begins with the probe free"
    MOVES = "a move after which the probe is free"
    TURNS = "a rotary move"
    RECORDS = "a record"
    ENDS = "the end mark"


NEXT: dict[tuple[Phase, Action], Phase] = {
    (Phase.HEAD, Action.STARTS): Phase.FREE,
    (Phase.FREE, Action.GUARDED): Phase.FREE,
    (Phase.FREE, Action.MOVES): Phase.FREE,
    (Phase.FREE, Action.TURNS): Phase.FREE,
    (Phase.FREE, Action.PROVES): Phase.TOUCHED,
    (Phase.TOUCHED, Action.FREED): Phase.TOUCHED,
    (Phase.TOUCHED, Action.RESTS): Phase.FREE,
    (Phase.FREE, Action.FINDS): Phase.FOUND,
    (Phase.FREE, Action.MEASURES): Phase.MET,
    (Phase.FREE, Action.FREED): Phase.FREE,
    (Phase.FREE, Action.ENDS): Phase.ENDED,
    (Phase.FOUND, Action.LEAVES): Phase.FREE,
    (Phase.FOUND, Action.FREED): Phase.FREE,
    (Phase.FOUND, Action.MOVES): Phase.FREE,
    (Phase.MET, Action.LEAVES): Phase.ASIDE,
    (Phase.MET, Action.FREED): Phase.ASIDE,
    (Phase.MET, Action.MOVES): Phase.ASIDE,
    (Phase.MET, Action.RECORDS): Phase.NOTED,
    (Phase.ASIDE, Action.FREED): Phase.ASIDE,
    (Phase.ASIDE, Action.MOVES): Phase.ASIDE,
    (Phase.ASIDE, Action.RECORDS): Phase.BACK,
    (Phase.NOTED, Action.LEAVES): Phase.BACK,
    (Phase.NOTED, Action.FREED): Phase.BACK,
    (Phase.NOTED, Action.MOVES): Phase.FREE,
    (Phase.BACK, Action.FREED): Phase.BACK,
    (Phase.BACK, Action.GUARDED): Phase.FREE,
    (Phase.BACK, Action.MOVES): Phase.FREE,
}
OWED = (Phase.MET, Phase.ASIDE)  # a touch has been made that is not on record
TOLD = (Phase.NOTED, Phase.BACK)  # it is on record, and the probe is not back yet
BEGUN = tuple(phase for phase in Phase if phase not in (Phase.HEAD, Phase.ENDED))


def after(phase: Phase, step: Action) -> Phase:
    """phase, what the program does → its next phase. Raises InputError for what it may not do there."""
    found = NEXT.get((phase, step))
    if found is None:
        raise InputError(_refusal(phase, step))
    return found


def _refusal(phase: Phase, step: Action) -> str:
    if step is Action.STARTS:
        return "a second start mark"
    if step is Action.ENDS and phase not in BEGUN:
        return "a second end mark" if phase is Phase.ENDED else "an end mark before the start mark"
    if step is Action.TURNS and phase not in BEGUN:
        return "something turns outside of start mark and end mark"
    if step is Action.RECORDS:
        return "a record without a touch"
    if phase not in BEGUN:
        return "something moves outside of start mark and end mark"
    if step is Action.LEAVES:
        return "found an unprotected move; allowed: one off the facet, right after a measuring move"
    if phase in OWED:
        return "the touch before has no record"
    if phase in (Phase.FOUND, Phase.NOTED):
        return "the probe is at a facet, and this does not take it off first"
    return f"found {step.value} {phase.value}"
