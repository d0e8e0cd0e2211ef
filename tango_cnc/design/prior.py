"""How large errors of a machine usually are: what is known before the first touch, and of what a broken-off run is worth more.

Rules of thumb from acceptance limits of machining centres (ISO 10791-1 … -3, ISO 10791-6) and the tables of the thesis; they decide
the order of touches and nothing that is estimated.
"""

from __future__ import annotations

import numpy as np

from ..model import PLACEMENT, STYLUS
from ..records import Array, Machine
from ..terms import Coefficient, backlash, error_motion, inter_axis
from .candidates import Candidates
from .region import turn

SHIFT, TURN = 0.05, 1e-4  # mm, rad: axis locations
MOTION, TILT = 0.01, 3e-5  # mm, rad at the end of the travel: error motions
GAIN = 3e-5  # mm/mm
LOST = 0.003, 3e-5  # mm, rad: backlash
SETUP = 0.1  # mm: stylus, facets, ball centres
OTHER = 0.005  # mm at a touch: whatever else the terms may contain


def usual(choice: Candidates) -> Array:
    """candidates → (p,) standard deviation of each unknown before anything is measured, in its own unit."""
    machine, model = choice.cell.machine, choice.selection.model
    found = np.full(len(model.names), SETUP)
    for j, c in enumerate(model.coefficients):
        found[j] = _usual(c, machine, float(choice.scale[j]))
    return found


def _usual(coefficient: Coefficient, machine: Machine, scale: float) -> float:
    name, turns = coefficient.name, coefficient.unit.startswith("rad")
    if name in STYLUS or name in PLACEMENT:
        return SETUP if not turns else TURN
    if inter_axis.PATTERN.fullmatch(name):
        return TURN if turns else SHIFT
    if backlash.PATTERN.fullmatch(name):
        return LOST[turns]
    if found := error_motion.PATTERN.fullmatch(name):
        axis, degree = found[2], int(found[3])
        low, high = turn(machine, axis) if axis in machine.rotary else machine.axis(axis).travel or (-500.0, 500.0)
        reach = max(abs(low), abs(high), 1e-9)
        return GAIN if coefficient.unit == "mm/mm" and degree == 1 else (TILT if turns else MOTION) / reach**degree
    return OTHER * scale


def held(choice: Candidates) -> Array:
    """candidates → (p, p) what is known without a touch when errors are as usual, per squared scatter of a touch."""
    return choice.held + np.diag((choice.sigma * choice.scale / usual(choice)) ** 2)
