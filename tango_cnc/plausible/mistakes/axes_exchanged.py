"""Two axes are exchanged: their columns in all rows or in a part of them, or their directions in machine.yaml."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ... import kinematics
from ...records import Array
from ...texts import say
from ...touches import FAR
from ._case import Case, Hypothesis, with_axis, with_positions

FEWEST = 3  # rows
MOST = 0.8  # share of all rows: more are all of them, but for single mistakes


def hypotheses(case: Case) -> Iterator[Hypothesis]:
    """case → each pair of linear or of rotary axes, exchanged."""
    machine, position = case.machine, case.readings.position
    for group in (machine.linear, machine.rotary):
        for one, other in combinations(group, 2):
            i, j = machine.column(one), machine.column(other)
            swapped = np.array(position)
            swapped[:, [i, j]] = position[:, [j, i]]
            yield Hypothesis(
                say("mistake.axes_exchanged.readings_fit_exchanged", one=one, other=other),
                "readings",
                f"{one}, {other}",
                say("mistake.axes_exchanged.exchange_columns_directions_both_axes", one=one, other=other),
                readings=with_positions(case.readings, swapped),
            )
            a, b = machine.axis(one), machine.axis(other)
            changed = with_axis(machine, one, direction=b.direction)
            yield Hypothesis(
                say("mistake.axes_exchanged.readings_fit_exchanged_machine_yaml", one=one, other=other),
                "machine",
                f"axes.{one}.direction",
                say("mistake.axes_exchanged.exchange_directions_their_columns_readings", one=one, other=other),
                machine=with_axis(changed, other, direction=a.direction),
                price=0.5,
            )
            yield from _part(case, one, other, swapped)


def _part(case: Case, one: str, other: str, swapped: Array) -> Iterator[Hypothesis]:
    """case, two axes, positions with both exchanged → the same in those rows alone that are far from their facet without it."""
    readings, machine = case.readings, case.machine
    facets = [case.artefact.facets[f] for f in readings.facet]
    contact = np.array([np.array(f.point) + machine.probe.tip_radius * np.array(f.normal) for f in facets])
    chain = kinematics.chain(machine)
    away, near = (np.linalg.norm(kinematics.tip(chain, p) - contact, axis=1) for p in (readings.position, swapped))
    wrong = (away > FAR) & (near < FAR)
    if not FEWEST <= wrong.sum() <= MOST * len(readings):
        return
    first, last = np.flatnonzero(wrong)[[0, -1]]
    block = np.arange(len(readings))
    block = (block >= first) & (block <= last) & (near < away)
    if wrong[first : last + 1].mean() > MOST / 2:  # a block of rows: those in it that are near either way belong to it
        wrong = block
    touches = tuple(int(t) for t in readings.touch[wrong])
    yield Hypothesis(
        say("mistake.axes_exchanged.part", one=one, other=other, count=len(touches), first=touches[0], last=touches[-1]),
        "readings",
        f"{one}, {other}",
        say("mistake.axes_exchanged.exchange_in_rows", one=one, other=other),
        readings=with_positions(readings, np.where(wrong[:, None], swapped, readings.position)),
        price=4.0,
    )
