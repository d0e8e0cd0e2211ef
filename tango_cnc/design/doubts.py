"""What `tango design` says of parameters that a plan determines, and that nobody should act on all the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..identify import select
from ..plan import last_motion
from ..plausible.planned import foreseen, hidden
from ..touches import of_facets
from . import prior, propose
from .problem import Chosen
from .propose import Setting

NAMED = 8  # parameters that a line names


def untrusted(ready: Setting, found: Chosen) -> dict[str, Any]:
    """setting, plan → `untrusted`: names that `tango estimate` will list so, whatever is read; `why`: its notes. Empty for a check.

    A bend, drift or step that no touch shows moves them: that depends on the plan alone.
    """
    if ready.problem.choice.twice:
        return {"untrusted": [], "untrusted_why": []}
    cell, made = found.cell, found.plan
    position, facets = np.array([touch.contact for touch in made.touches]), [touch.facet for touch in made.touches]
    touches = of_facets(cell.machine, cell.artefact, facets, position, last_motion(made))
    selection = select(replace(touches, time=found.time), ready.wish.terms, ready.wish.degree)
    result = foreseen(selection, ready.problem.choice.sigma)
    notes = list(hidden(result))
    moved = {name for note in notes for name in note.moves}
    names = [selection.label(c.name) for c in selection.model.coefficients if c.name in moved]
    return {"untrusted": names, "untrusted_why": [str(note.text) for note in notes]}


def weak(ready: Setting, found: Chosen, widens: float) -> dict[str, dict[str, Any]]:
    """setting, plan, factor of standard deviations → parameters that stay more uncertain than such an error usually is large."""
    choice = ready.problem.choice
    if choice.twice:
        return {}
    stated = propose.std_of(ready, found.information, widens)
    usual = dict(zip((choice.selection.label(n) for n in choice.selection.model.names), prior.usual(choice).tolist(), strict=True))
    machine = [choice.selection.label(c.name) for c in choice.selection.model.coefficients if c.slot.axis not in ("t", "w")]
    return {n: {"std": stated[n][0], "usual": usual[n], "unit": stated[n][1]} for n in machine if stated[n][0] > usual[n]}


def lines(data: dict[str, Any]) -> list[str]:
    """result of `as_json` → what a person reads of it."""
    said = []
    if names := data["untrusted"]:
        said.append(f"'tango estimate' will not trust {_some(names)} of this plan, whatever it reads: act on none of them. Why:")
        said += [f"  {why}" for why in data["untrusted_why"]]
    if names := list(data["weak"]):
        said.append(f"hardly seen, as uncertain as such an error is usually large, or more: {_some(names)}")
    return said


def _some(names: list[str]) -> str:
    more = f" and {len(names) - NAMED} more (--json lists all)" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more
