"""Rotary axes turn about the points that machine.yaml states: one facet is touched at two angles."""

from __future__ import annotations

from ..experiment import Experiment, Ruling, Seen

LIMIT = 0.5  # mm; the errors that are calibrated are tenths of it


def judge(seen: Seen) -> Ruling:
    """→ the axis whose point is farthest from where machine.yaml has it."""
    if not seen.plan.machine.rotary:
        return Ruling("PASS", "the machine has no rotary axis")
    if seen.pivots is None:
        return Ruling("OPEN", "the table was not touched: tango commission --touch")
    blind = [name for name in seen.plan.machine.rotary if name not in seen.pivots or seen.pivots[name].told == 0]
    off = {name: pivot.off for name, pivot in seen.pivots.items()}
    worst = max(off, key=lambda name: off[name], default="")
    if worst and off[worst] > LIMIT:
        return Ruling("FAIL", f"{worst} turns about a point {off[worst]:.2f} mm from where machine.yaml has it", off[worst], "mm")
    if blind:
        return Ruling("OPEN", f"no facet is touched at angles that show the point of {', '.join(blind)}")
    return Ruling("PASS", f"{worst} turns about a point {off[worst]:.3f} mm from where machine.yaml has it", off[worst], "mm")


EXPERIMENT = Experiment(
    "pivots",
    2,
    "rotary axes turn about the points that machine.yaml states",
    "touch one facet at two angles: it is found in the same place of the table",
    "first measure the probe in the spindle: where its length (probe: length) is wrong, an axis that tilts the table or the head "
    "shows it as a point that is elsewhere. If the length is right, correct the point of the axis that is named in machine.yaml",
    judge,
    on=("rotary", "points"),
    touches=True,
)
