"""Scales as they were read, and what they mean for a part: which part has its size at 20 °C, and by how much others have not."""

from __future__ import annotations

from pathlib import Path

from ..estimate import Estimate
from ..features import bar_left_out
from ..iso230.temperature import REFERENCE, USUAL, grows, read_thermal
from ..terms import SCALES
from ..texts import joined, say

ALUMINIUM = 23.0  # µm/m/K, of the part that differs most from steel in most shops


def said(folder: Path, result: Estimate) -> str:
    """cell, estimate → at what temperature its scales hold, for people; nothing where it has none.

    Nothing is taken to 20 °C, as `tango iso230` does. A command of a machine that was corrected by these scales is as long as the
    bar's millimeter was then. A part that expands as the bar does, and is as warm as it was, shrinks by the same on its way to
    20 °C, whatever the machine is made of.
    """
    if not any(name.startswith(SCALES) for name in result.model.names):
        return ""
    carrier = _carrier(result)
    if carrier == "nothing":
        names = ", ".join(relative(result))
        return (
            say("scales.relative") if not names else joined(". ", (say("scales.relative"), say("scales.by_no_length", names=names)))
        )
    file = folder / "temperature.yaml"
    what = say(f"scales.{carrier}")
    if not file.exists():
        other = f"{ALUMINIUM - 1e6 * USUAL.value:.0f}"
        return say("scales.not_stated", what=what, per_kelvin=f"{1e6 * USUAL.value:.1f}", other=other)
    thermal = read_thermal(file)
    own, cut = grows(thermal), thermal.bar.value - REFERENCE
    left = ALUMINIUM * cut - 1e6 * own.value
    return say(
        "scales.stated",
        what=what,
        warm=f"{thermal.bar.value:g}",
        growth=f"{abs(1e6 * own.value):.1f}",
        way=say("scales.farther" if own.value >= 0 else "scales.less_far"),
        long=say("scales.too_long" if own.value >= 0 else "scales.too_short"),
        short=say("scales.too_short" if left >= 0 else "scales.too_long"),
        sure=f"{2e6 * own.std:.1f}",
        expansion=f"{1e6 * thermal.bar_expansion.value:g}",
        other=f"{abs(left):.1f}",
        machine=f"{1e6 * thermal.machine_expansion.value:g}",
    )


def relative(result: Estimate) -> tuple[str, ...]:
    """estimate → names of its gains of linear axes that rest on no calibrated length: one number may be common to all of them.

    Where not even the ball's radius tells the scale, the names are differences already (EYY1-EXX1).
    """
    return tuple(name for name in result.parameters if name in SCALES) if _carrier(result) == "nothing" else ()


def _carrier(result: Estimate) -> str:
    """estimate → what its absolute scale rests on: bar, facets, or nothing."""
    touches = result.model.touches
    if touches.artefact.scale_bar is not None and bar_left_out(touches.artefact, touches.facet) is None:
        return "bar"
    return "facets" if result.model.calibrated else "nothing"
