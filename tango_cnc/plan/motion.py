"""How each axis last moved before a touch triggers: backlash is decided by that, however many moves ago it was."""

from __future__ import annotations

import numpy as np

from ..records import Array, Plan

STEP = 1e-6  # mm or rad: less is rounding, not motion


def last_motion(plan: Plan) -> Array:
    """plan → (n, k) −1 0 1, sense of each axis' last motion when touch i triggers; 0 for an axis that has not moved yet.

    A measuring move counts as far as the nominal contact. Where an axis comes from before its first move nobody knows.
    """
    names = plan.machine.names
    contact = {touch.number: dict(zip(names, touch.contact, strict=True)) for touch in plan.touches}
    at: dict[str, float] = {}
    sense = dict.fromkeys(names, 0.0)
    rows = []
    for move in plan.moves:
        for name, target in move.target.items():
            goal = contact[move.touch][name] if move.kind == "probe" else target
            if abs(goal - at.get(name, goal)) > STEP:
                sense[name] = float(np.sign(goal - at[name]))
            at[name] = target
        if move.kind == "probe":
            rows.append([sense[name] for name in names])
    return np.array(rows)
