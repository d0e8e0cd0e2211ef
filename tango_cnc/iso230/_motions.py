"""Figures of one axis: positioning and reversal, and the ranges of its other error motions."""

from __future__ import annotations

import numpy as np

from ..texts import say
from ._figure import Figure, Tell
from ._line import Line, motions, range_of, straight


def positioning(line: Line, tell: Tell) -> list[Figure]:
    """axis → its positioning figures: mean bidirectional range M, gain, reversal value B, systematic deviation E."""
    name, unit = f"E{line.axis.name}{line.axis.name}", "µm" if line.axis.kind == "linear" else "µrad"
    factor = 1e3 if unit == "µm" else 1e6
    curve, over = line.along[line.base + (0 if unit == "µm" else 3)], range_of(line)
    found = []
    if curve.any():
        value, std = tell.spread(curve)
        found.append(
            Figure(
                "positioning", f"{name} M", value * factor, std * factor, unit, over, say("iso_said.line.mean_bidirectional_range")
            )
        )
        slope, _ = straight(line, curve)
        gain, std = tell.one(slope)
        found.append(Figure("positioning gain", name, gain * 1e6, std * 1e6, "µm/m" if unit == "µm" else "µrad/rad", over))
    if line.reversal.any():
        b, std_b = tell.one(2 * line.reversal)
        note = say("iso_said.motions.negative_lost_motion")
        found.append(Figure("reversal", f"{name} B", b * factor, std_b * factor, unit, over, note))
        if curve.any():
            whole = line.reversal * (2.0 if b > 0 else -2.0)
            y = curve @ tell.values
            both = curve[int(np.argmax(y))] - curve[int(np.argmin(y))] + whole
            value, std = tell.one(both)
            note = say("iso_said.motions.bidirectional_systematic_deviation_accuracy_needs")
            found.append(Figure("positioning", f"{name} E", value * factor, std * factor, unit, over, note))
    return found


def motion_figures(line: Line, tell: Tell) -> list[Figure]:
    """axis → figures of all its error motions."""
    found = positioning(line, tell)
    for motion in motions(line):
        if motion.kind != "positioning":
            value, std = tell.spread(motion.curve)
            factor = motion.factor
            found.append(Figure(motion.kind, motion.name, value * factor, std * factor, motion.unit, range_of(line), motion.note))
    return found
