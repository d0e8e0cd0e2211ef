"""Readings of a locating cycle, made from where the table truly is: exact touches on planes."""

from __future__ import annotations

import numpy as np

from tango_cnc import kinematics, locate
from tango_cnc.plan import last_motion
from tango_cnc.records import Artefact, Plan, Readings

MOVED = np.array([4.0, -3.0, 0.3])  # mm; along the spindle less than a stylus of another length would be asked about


def touched(made: Plan, *missed: str, true: Artefact | None = None) -> Readings:
    """plan, facets at which nothing was met, the true table → its readings; without it of one that was moved."""
    true = true or locate.moved(made.artefact, MOVED, np.zeros(3))
    tip = np.array(
        [
            np.add(true.facets[t.facet].point, made.machine.probe.tip_radius * np.array(true.facets[t.facet].normal))
            for t in made.touches
        ]
    )
    chain, count = kinematics.chain(made.machine), len(made.touches)
    position = np.array([touch.contact for touch in made.touches])
    linear = [made.machine.column(name) for name in made.machine.linear]
    for row in range(count):
        for _ in range(5):  # axes of a chain that is nearly linear in them
            off_by = tip[row] - kinematics.tip(chain, position[row][None])[0]
            step = np.array(
                [
                    (kinematics.tip(chain, (position[row] + one)[None])[0] - kinematics.tip(chain, position[row][None])[0])
                    for one in np.eye(position.shape[1])[linear]
                ]
            )
            position[row, linear] += np.linalg.solve(step.T, off_by)
    status = tuple("miss" if t.facet in missed else "ok" for t in made.touches)
    one = np.ones(count, dtype=np.int64)
    facets = tuple(t.facet for t in made.touches)
    return Readings(
        made.machine.names,
        np.arange(1, count + 1),
        np.zeros(count),
        facets,
        position,
        last_motion(made),
        status,
        one,
        one,
        np.full(count, 600.0),
    )
