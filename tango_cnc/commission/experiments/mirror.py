"""Nothing mirrors or scales what a program says: a step along an axis goes as far, and the way, that it was sent."""

from __future__ import annotations

import re
from itertools import pairwise

from ...gate import MIRRORED
from ..digits import lost
from ..experiment import Experiment, Ruling, Seen

FAR = 0.5  # by which a factor has to be off one: frames says what is less


def judge(seen: Seen) -> Ruling:
    """→ the way that each axis went in the measuring moves that met nothing, by that which it was sent."""
    names, worst, which, clipped = seen.plan.machine.names, 1.0, "", lost(seen)
    went: dict[str, list[tuple[float, float]]] = {name: [] for name in seen.plan.machine.linear}
    touches = [touch for touch in seen.plan.touches if touch.number in seen.records and touch.number not in clipped]
    for before, after in pairwise(touches):
        for name, ways in went.items():
            column = names.index(name)
            sent = after.end[column] - before.end[column]
            if abs(sent) > 1:
                ways.append((sent, seen.records[after.number][1][name] - seen.records[before.number][1][name]))
    for name, ways in went.items():
        if ways:
            sent, gone = max(ways, key=lambda way: abs(way[0]))
            factor = gone / sent
            if abs(factor - 1) > abs(worst - 1):
                worst, which = factor, name
    if not any(went.values()):
        return Ruling("OPEN", "no two records of moves along an axis")
    if worst < 0 or abs(worst - 1) > FAR:
        return Ruling("FAIL", f"{which} went {worst:.3f} times as far as it was sent", worst, "of the way")
    return Ruling("PASS", f"axes went as far as they were sent, within a factor of {worst:.4f}", worst, "of the way")


EXPERIMENT = Experiment(
    "mirror",
    1,
    "no mirror image, scaling or dynamic offset changes what a program says",
    "send an axis by 1 mm and look at its machine position",
    "switch the mirror image or scaling off at the control, and state the words that do it in reset, e.g. G50 and G50.1",
    judge,
    re.compile(rf"{MIRRORED}|MIRROR|SCALING(?!_)|CANCEL G51|G51 IS ON"),
    re.compile(r"^scaling_check ="),  # what somebody may have left on before a run, no experiment proves for ever
    rests=("reset", "must_be_off", "scaling_check"),
)
