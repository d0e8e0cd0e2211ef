"""Backlashes that something else may have made: a wrong tip radius, or touches that read late or early by their direction.

Where only the head turns, every facet is met from one side of the machine. A ball that reads too large on all sides then looks the
same as axes that all lose the same way. Touches that are late whenever an axis goes one way look like half as much backlash of that
axis and a spindle that stands elsewhere; late both ways is backlash altogether. So do touches that are early, where a tip was
calibrated too small on one side. Where the parameters take all of it, no reading of the same plan tells the two apart, and the
result says so.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..estimate import Estimate
from ..records import Array
from ..texts import joined, say
from .bounds import is_backlash
from .data import Remark

LARGE = 0.01  # mm
CERTAIN = 10.0  # standard deviations
ALIKE = 0.1  # of their mean, within which they are alike
LEAST = 0.001  # mm of backlash that is worth a word
MISLED = 0.003  # mm of backlash beyond which what it would have moved is not trusted
BIASED = 2.0  # standard deviations that it would have moved it
SEEN = 5.0  # standard deviations
TOWARD = 0.5  # cosine between a facet's normal and an axis from which on its touches go by that axis
TAKEN = 1.5  # times the scatter of a touch that late touches may leave, root mean square, before the readings show them
MOVED = 0.2  # of the lateness, by which a parameter that it moves is named


def alike(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark where backlashes of two linear axes or more are large and alike."""
    model = result.model
    rows = [i for i, c in enumerate(model.coefficients) if is_backlash(c) and c.slot.axis in model.touches.machine.linear]
    large = [i for i in rows if abs(result.values[i]) > max(LARGE, CERTAIN * result.std[i])]
    if len(large) < 2:
        return
    middle = float(np.median(result.values[large]))
    most = max((result.values[i] for i in large), key=abs)
    same = [i for i in large if abs(result.values[i] - most) < ALIKE * abs(most)]
    if len(same) < 2 or middle * most < 0:
        return
    yield Remark(
        "doubtful",
        say(
            "plausible.backlashes.alike",
            axes=joined(", ", [model.coefficients[i].slot.axis for i in same]),
            size=f"{abs(float(np.mean(result.values[same]))) * 1000.0:.0f}",
        ),
        (),
        "tip_radius",
        "probe.tip_radius",
        say("plausible.backlashes.change"),
        file="machine",
        sure=True,
        moves=tuple(model.names[i] for i in rows),
    )


def by_direction(result: Estimate) -> Iterator[Remark]:
    """estimate → a remark for each backlash of a linear axis that late touches, or early ones, would have made just as well."""
    model, touches = result.model, result.model.touches
    machine, used = touches.machine, ~result.out
    for i, c in enumerate(model.coefficients):
        if not is_backlash(c) or c.slot.axis not in machine.linear or abs(result.values[i]) < max(LEAST, SEEN * result.std[i]):
            continue
        word = "late" if result.values[i] < 0 else "early"
        along = touches.machine_normal @ np.array(machine.axis(c.slot.axis).direction)
        sides = {"+": -along, "-": along}
        found = _sides(result, i, {sign: np.where(way > TOWARD, 1.0, 0.0) * used for sign, way in sides.items()})
        if not found:  # late or early both ways is this backlash, by its definition; or one way, by the part that the axis has
            alone = np.where(np.arange(len(result.values)) == i, result.values[i], 0.0)
            found = {"±": (abs(float(result.values[i])), alone)}
            found |= _sides(result, i, {sign: np.clip(way, 0.0, None) * used for sign, way in sides.items()})
        yield _one(result, i, word, found)


def _one(result: Estimate, row: int, word: str, found: dict[str, tuple[float, Array]]) -> Remark:
    """estimate, its backlash, late or early, sides → (mm that the touches would be off, mm of it in each parameter) → one remark.

    What the tolerance of machine.yaml allows is less than a side asks for: then no more than that of the backlash is in doubt.
    """
    model, axis, known = result.model, result.model.coefficients[row].slot.axis, result.model.touches.machine.tolerances.direction
    ways, sizes, moves, excused = [], [], set[int](), True
    for sign, (asked, full) in found.items():
        share = 1.0 if known is None else min(1.0, known / asked)
        size, moved, most = asked * share, full * share, _most(result, full, asked)
        names = joined(", ", [f"{model.names[j]} {moved[j] * 1000.0:+.1f}" for j in most])
        what = "both_ways" if sign == "±" else "way"
        ways.append(say(f"plausible.backlashes.{what}", axis=axis, sign=sign, size=f"{size * 1000.0:.1f}", names=names))
        excused &= share < 1.0
        sizes.append(abs(moved[row]))
        if abs(moved[row]) > MISLED:
            moves |= set(np.flatnonzero(np.abs(moved) > BIASED * result.std).tolist())
        if abs(moved[row]) > LARGE:
            moves |= set(most)
    doubtful = any(size > LARGE for size in sizes)
    text = say(
        f"plausible.backlashes.{'stated' if excused else word}", axis=axis, ways=joined(say("plausible.backlashes.or"), ways)
    )
    named = tuple(model.names[j] for j in sorted(moves) if j < len(model.coefficients))
    if not doubtful:
        return Remark("trustworthy", text, moves=named)
    return Remark("doubtful", text, (), "late_touches", "touch", say("plausible.late.change"), moves=named)


def _sides(result: Estimate, row: int, felt: dict[str, Array]) -> dict[str, tuple[float, Array]]:
    return {sign: one for sign, share in felt.items() if (one := _as_late(result, row, share)) is not None}


def _as_late(result: Estimate, row: int, felt: Array) -> tuple[float, Array] | None:
    """estimate, its backlash, (n,) share of it that each touch feels → mm late or early, mm of it in each parameter; None where
    the readings tell it."""
    n, used = len(result.residuals), ~result.out
    if (felt > 0).sum() < 2:
        return None
    jacobian = np.array(result.jacobian)
    jacobian[:n][~used] = 0.0
    off = np.zeros(len(jacobian))
    off[:n] = felt * np.sign(result.values[row])  # late is beyond the surface
    moved, *_ = np.linalg.lstsq(jacobian, -off, rcond=None)
    if abs(moved[row]) < MOVED or (size := float(result.values[row] / moved[row])) < 0:
        return None
    left = size * (off + jacobian @ moved)[:n][used]
    white = result.noise.white if result.noise is not None else result.sigma
    return (size, np.asarray(size * moved, dtype=float)) if float(np.sqrt(np.mean(left**2))) < TAKEN * white else None


def _most(result: Estimate, moved: Array, size: float) -> list[int]:
    """→ parameters in mm that late touches would move most, those of the machine alone."""
    own = [j for j, c in enumerate(result.model.coefficients) if c.slot.component < 3 and c.slot.stage != "table"]
    return [j for j in own if abs(moved[j]) > MOVED * size]
