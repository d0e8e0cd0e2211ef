"""How each axis last moved before a touch triggers: backlash is decided by that, however many moves ago it was."""

from __future__ import annotations

import numpy as np

from ..records import Array, Plan
from .preload import turned

STEP = 1e-6  # mm or rad: less is rounding, not motion


def last_motion(plan: Plan) -> Array:
    """plan → (n, k) −1 0 1, sense of each axis' last motion when touch i triggers; 0 for an axis that has not moved yet."""
    return np.sign(last_moves(plan))


def last_moves(plan: Plan) -> Array:
    """plan → (n, k) mm rad, size and sense of each axis' last motion when touch i triggers; 0 for one that has not moved yet.

    A measuring move counts as far as the nominal contact. An endless axis takes the shorter way. Only an axis without room
    for a preload, or a spindle that always stands one way, comes to its first place nobody knows how.
    """
    names = plan.machine.names
    axes = {axis.name: axis for axis in plan.machine.axes}
    at: dict[str, float] = {}
    last = dict.fromkeys(names, 0.0)
    found, row = np.empty((len(plan.touches), len(names))), 0
    for move, touch in plan.served:
        for name, target in move.target.items():
            goal = touch.contact[plan.machine.column(name)] if move.kind in ("find", "probe") else target
            change = turned(axes[name], goal - at.get(name, goal))
            if abs(change) > STEP:
                last[name] = change
            at[name] = target
        if move.kind == "probe":
            found[row] = [last[name] for name in names]
            row += 1
    return found[:row]
