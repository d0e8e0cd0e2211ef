"""Figures of one axis: positioning and reversal, and the ranges of its other error motions."""

from __future__ import annotations

import numpy as np

from ..records import Array
from ..texts import say
from ._figure import Figure, Tell
from ._line import AxisLine, motions, range_of, straight


def positioning(line: AxisLine, tell: Tell) -> list[Figure]:
    """axis → its positioning figures: mean bidirectional range M, gain, reversal value B, systematic deviation E."""
    name, unit = f"E{line.axis.name}{line.axis.name}", "µm" if line.axis.kind == "linear" else "µrad"
    factor = 1e3 if unit == "µm" else 1e6
    curve, over = line.along[line.base + (0 if unit == "µm" else 3)], range_of(line)
    found = []
    if curve.any():
        found.append(
            _range("positioning", f"{name} M", tell, curve, factor, unit, over, say("iso_said.line.mean_bidirectional_range"))
        )
        slope, _ = straight(line, curve)
        gain, std = tell.one(slope)
        found.append(Figure("positioning gain", name, gain * 1e6, std * 1e6, "µm/m" if unit == "µm" else "µrad/rad", over))
    if line.reversal.any():
        b, std_b = tell.one(2 * line.reversal)
        note = say("iso_said.motions.negative_lost_motion")
        found.append(Figure("reversal", f"{name} B", b * factor, std_b * factor, unit, over, note))
        if curve.any():
            note = say("iso_said.motions.bidirectional_systematic_deviation_accuracy_needs")
            both = np.concatenate([curve + line.reversal, curve - line.reversal])
            found.append(_range("positioning", f"{name} E", tell, both, factor, unit, over, note))
    return found


def motion_figures(line: AxisLine, tell: Tell) -> list[Figure]:
    """axis → figures of all its error motions."""
    found = positioning(line, tell)
    for motion in motions(line):
        if motion.kind != "positioning":
            more = (motion.factor, motion.unit, range_of(line), motion.note)
            found.append(_range(motion.kind, motion.name, tell, motion.curve, *more))
    return found


def _range(
    kind: str, name: str, tell: Tell, curve: Array, factor: float, unit: str, over: tuple[float, float], note: str
) -> Figure:
    """curve (m, p) of a motion → the figure of its range."""
    value, std, (low, high) = tell.spread(curve)
    return Figure(kind, name, value * factor, std * factor, unit, over, note, (low * factor, high * factor))
