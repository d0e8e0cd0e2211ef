"""The sign of an axis was lost in some rows: a column that was typed in, or a control that prints numbers without it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ... import kinematics
from ...texts import say
from ...touches import FAR
from ._case import Case, Hypothesis, moved_column

FEWEST = 3  # rows
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
        near = np.linalg.norm(kinematics.tip(chain, other.position) - contact, axis=1) < FAR
        wrong, right = (away > FAR) & near, (away < FAR) & ~near
        if wrong.sum() < FEWEST or (wrong.sum() > MOST * len(readings) and right.sum() < FEWEST):
            continue
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
