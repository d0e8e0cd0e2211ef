"""The moves in the air of `tango commission`: high enough for a table that may stand elsewhere than its file says."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from .. import locate
from ..plan import displaced, plan
from ..records import Cell, InputError, Plan
from .flight import air
from .rolling import rolling

NEARER = (locate.FARTHEST, 10.0, 5.0, 2.0, 0.0)  # mm: the first for which the travels leave room
LEFT = "leave-out"  # touches that a straight stylus cannot make: nothing is touched here


@dataclass(frozen=True)
class Flight:
    """Plan of the moves in the air, the largest number (mm, deg) of a record of the cell's plan, mm that the table may be off."""

    plan: Plan
    largest: float
    within: float


def flight(cell: Cell, most: int, wanted: Collection[str], within: float | None) -> Flight:
    """cell, indexations at most, beliefs to try, mm by which the table may stand elsewhere → the moves in the air.

    Without a number it is the most of `NEARER` for which the travels leave room. Raises InputError where they leave none.
    """
    complaints = []
    for off in NEARER if within is None else (within,):
        try:
            return _within(cell, most, wanted, off)
        except InputError as error:
            complaints.append(error)
    if within is None:
        raise complaints[-1]
    raise InputError(
        f"--within: found {within:g} mm, by which the table may stand elsewhere, and the moves in the air would be so high that: "
        f"{str(complaints[0]).rstrip('.')}. Measure the place of the table, correct it in artefact.yaml, and state less"
    )


def said(found: Flight) -> str:
    """moves in the air → a sentence about how far the table may be from its file, and what to do where that is not far."""
    if found.within == 0.0:
        return (
            "The travels leave no room for a table that stands elsewhere than artefact.yaml says: measure its place before you "
            "start, and correct that file."
        )
    turned = f"{found.within:g} mm and {locate.turned(found.within):g} deg"
    if found.within < locate.FARTHEST:
        return f"The travels leave room for a table within {turned} of artefact.yaml: measure its place, to {found.within:g} mm."
    return f"Nothing is met as long as the table stands within {turned} of artefact.yaml."


def _within(cell: Cell, most: int, wanted: Collection[str], within: float) -> Flight:
    """cell, indexations at most, beliefs to try, mm → the moves in the air above a table that is so far from its file."""
    off = 0.0
    if within:
        off = within + math.radians(locate.turned(within)) * displaced.farthest(cell)
    away = replace(cell, artefact=displaced.swollen(cell.artefact, off))
    away = replace(away, strategy=displaced.within_travels(away))
    own = len(away.strategy.indexations)
    try:
        whole = plan(rolling(away) if "rollover" in wanted and most > 1 else away, LEFT)
    except InputError:  # what was added cannot be reached here
        whole = plan(away, LEFT)
    linear = [whole.machine.column(name) for name in whole.machine.linear]
    rotary = [whole.machine.column(name) for name in whole.machine.rotary]
    places = np.abs([touch.end for touch in whole.touches if touch.indexation < own])
    largest = max(float(places[:, linear].max()), math.degrees(float(places[:, rotary].max(initial=0.0))))
    return Flight(air(whole, most, own), largest, within)
