"""What `tango commission` tries with a second program: a stylus that is held aside, the feed override turned down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._asking import answered

if TYPE_CHECKING:
    from ..program import Program

HELD_START = 60.0  # s for the start mark of the program for a held stylus: the right control stops it before that
SLOW = 60.0  # s that a move may take with the feed override turned down
START = b"TANGO START"
ASIDE = (
    "Now a program of its own, for a stylus that is held aside. It makes one guarded move at 60 mm/min, which ends 0.5 mm above "
    "where the moves in the air have ended, and no axis goes farther from there. Leave the axes where they stand. Hand on feed "
    "hold. Hold the stylus aside with the other one and start the program; let go if it moves more than 1 mm. What comes of it, "
    "you are asked a minute later, as a program that stops at once sends nothing. Do you hold it? (no: this is left open)"
)
LOAD = (
    "Bring {file} to the control and load it before you go on: the program that has just run has the same name. The first lines of "
    "this one show PROGRAM {mark}"
)
TURN = "Turn the feed override of the panel to {:.0f} % and leave it there. Is it? (no: this is left open)"


Ready = Callable[["Program", bool], None]


class _LeftOpen(Exception):
    """The person does not do what the program needs."""


def unasked(program: Program, brought: bool) -> None:
    """program, whether a person brings it → nothing: nobody is asked."""


def held_aside(at: Any, seen: Any, control: str) -> tuple[Any, str]:
    """control that is tried, what came of the moves in the air, its name → the same with whether a move stops whose stylus is held
    aside; nothing more where nobody holds it.
    """
    from .. import commission

    slight = commission.held(seen.plan)
    gentle: dict[str, Any] = {"gate": "none"}  # which would notice the hand by itself
    if any(option.name == "positioning_feed" for option in at.post.options):
        gentle["positioning_feed"] = commission.HELD_FEED
    programs = at.program(slight, gentle)
    try:
        once, control = at.tried(slight, programs, start=HELD_START, ready=_asking(ASIDE))
    except _LeftOpen:
        return seen, control
    return replace(seen, held=_stopped(once, programs[0])), control


def at_quarter(at: Any, seen: Any, control: str) -> tuple[Any, str]:
    """control that is tried, what came of the moves in the air, its name → the same with how long a few take with the feed override
    turned down; nothing more where nobody turns it.
    """
    from .. import commission
    from ..commission.above import flight

    few = flight(at.cell, 1, set(), at.moves.within).plan
    patience = SLOW * len(few.touches) if at.timeout is None else at.timeout
    asked = _asking(TURN.format(100 * commission.DIAL))
    try:
        once, control = at.tried(few, at.program(few, {"gate": "none"}), patience, ready=asked)
    except _LeftOpen:
        return seen, control
    click.echo("Turn it back to 100 %.", err=True)
    return replace(seen, dialled=once.times, kept=_kept(at.address, at.post, once.begun)), control


def _asking(text: str) -> Ready:
    """what the person has to do → asks for it, of one who brings the program first for that: the one before has the same name."""

    def asked(program: Program, brought: bool) -> None:
        if brought:
            click.echo(LOAD.format(file=program.file, mark=program.mark.upper()), err=True)
        if not click.confirm(text, err=True):
            raise _LeftOpen

    return asked


def file_of(address: str, post: Any) -> str | None:
    """port, post → what the control writes its records into: '' where it is not on this computer, None for a line."""
    from ..link.address import written_into

    return written_into(address) if post.filed else None


def _kept(address: str, post: Any, begun: bool) -> bool | None:
    """port, post, whether the second program has begun → whether its file holds what both programs have recorded; None: unknown."""
    file = file_of(address, post)
    if file is None or not begun:
        return None
    if file:
        return Path(file).read_bytes().count(START) >= 2
    text = "Look into the file of the records: does it hold both programs, two lines TANGO START?"
    return answered(text)


def _stopped(once: Any, program: Program) -> bool | None:
    """what came of the program while the stylus was held aside, the program → whether it stopped for that; None: nobody knows.

    A line that broke looks the same from here, and so does another program: the person at the machine has to say it.
    """
    if once.records or once.ended:
        return False
    what = f"It stopped: {once.said.rstrip('.')}." if once.said else "Nothing was recorded."
    asked = f"Was PROGRAM {program.mark.upper()} started, and did the control stop it by itself because of the stylus?"
    return True if answered(f"{what} {asked}") else None
