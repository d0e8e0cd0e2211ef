"""The sign of an axis was lost in some rows: a column that was typed in, or a control that prints numbers without it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ... import kinematics
from ...asked import asked
from ...texts import say
from ...touches import FAR
from ..columns import TURNED, turned
from ._case import Case, Hypothesis, moved_column

FEWEST = 3  # rows
NEARER = 1.0  # mm that the other sign takes a touch nearer, where the sign was lost elsewhere: near zero both are not far
MOST = 0.8  # share of all rows: more is an axis that goes the other way, unless some rows fit with this sign alone


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each axis with the other sign in those rows that are far from their facet with this one, and near with the other."""
    machine, readings = case.machine, case.readings
    facets = [case.artefact.facets[f] for f in readings.facet]
    contact = np.array([np.array(f.point) + machine.probe.tip_radius * np.array(f.normal) for f in facets])
    chain = kinematics.chain(machine)
    away = np.linalg.norm(kinematics.tip(chain, readings.position) - contact, axis=1)
    for name in (*machine.linear, *machine.rotary):
        column = machine.column(name)
        other = moved_column(readings, column, -readings.position[:, column])
        other_away = np.linalg.norm(kinematics.tip(chain, other.position) - contact, axis=1)
        near = other_away < FAR
        wrong, right = (away > FAR) & near, (away < FAR) & ~near
        if wrong.sum() < FEWEST or (wrong.sum() > MOST * len(readings) and right.sum() < FEWEST):
            continue
        wrong |= near & (other_away + NEARER < away)
        wrong |= _mirrored(case, name)
        touches = tuple(int(t) for t in readings.touch[wrong])
        signs = np.where(wrong, -1.0, 1.0)
        yield Hypothesis(
            say("mistake.lost_sign.fit", name=name, count=len(touches), first=touches[0], last=touches[-1]),
            "readings",
            name,
            say("mistake.lost_sign.see", name=name),
            readings=moved_column(readings, column, signs * readings.position[:, column]),
            price=4.0,
        )


def _mirrored(case: Case, name: str) -> NDArray[np.bool_]:
    """case, axis → (n,) rows where the program has the other sign: no contact shows a turn of the ball about itself."""
    readings, machine = case.readings, case.machine
    found = np.zeros(len(readings), dtype=np.bool_)
    if name in machine.linear:
        return found
    touches, column = asked(case.cell, None), machine.column(name)
    rows = np.flatnonzero((readings.touch >= 1) & (readings.touch <= len(touches)))
    made, meant = readings.position[rows, column], touches.position[readings.touch[rows] - 1, column]
    limit = np.radians(TURNED)
    found[rows] = (np.abs(turned(made, -meant)) < limit) & (np.abs(turned(made, meant)) > limit)
    return found
