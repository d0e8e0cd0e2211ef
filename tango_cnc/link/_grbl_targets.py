"""Targets that a grbl control confirms before it moves: parameters are set, printed by the control, and only then moved to.

    {axis: mm or deg}, F, G ─▶ #<qxx>=[…]… ─▶ (PRINT,…) ─▶ [MSG:…] compared ─▶ X#<qxx>Y#<qyy>…F#<qff>G#<qgg>

What is sent moves nothing, or to the confirmed place, whatever becomes of one of its characters:

* a line that sets has no letter outside names and brackets, and a letter in brackets is a syntax error. A line that moves has no
  digit;
* every axis of the control stands in every motion, so that a letter turned into another axis comes twice, which is an error;
* no name becomes another one, or one of the control's own (`_x`), by one character lost, doubled or replaced;
* `##<qxx>` is the parameter whose number is the target, 0 where nobody set it: grblHAL refuses it when that is no whole number,
  so no target is one. That shifts a whole one by 0.2 µm, or by 0.001°, which the control shows: readings have the angle that was;
* behind G or M a target would be a code. Two places count there, so those that would change a mode (`HARMFUL`) are kept 6 µm or
  0.006° away, and then are no code; all others are unknown codes or clash with the search.

What remains: an axis word that becomes N, S or T, or the end of a line that becomes a remark, leaves out axes: these stay where
they are, and the others stay between their place and their target, guarded by the probe.

The word of a clamp is the M of a rapid to where everything stands. Its M may become N, S or T as well, which nobody sees: so the
driver says it twice.

Facts: ngc_expr.c, ngc_params.c, gcode.c of grblHAL core of August 2026; Parameters.cpp, GCode.cpp of FluidNC.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from ..records import InputError

SEARCH, FEED, RAPID, ORIENT = 38.3, 1.003, 0.003, 19.003  # codes, no whole numbers either: two places count behind G and M
LINE = 100  # characters: FluidNC takes 127
SWITCHED = 0.003  # beyond the whole number of an M code
CODE = 0.006  # mm or deg that a target keeps from the codes below
WHOLE, TURNED = 0.0002, 0.001  # mm and deg that it keeps from whole numbers; an angle by the last place that is shown
HARMFUL = {2, 3, 4, 6, 7, 8, *range(17, 22), 30, *range(40, 44), *range(48, 62), *range(64, 68), *range(70, 74), *range(91, 94)}
HARMFUL |= {*range(95, 100), 7.1, 8.1, 28.1, 30.1, 41.1, 42.1, 43.1, 43.2, 59.1, 59.2, 59.3, 66.1, 91.1, 92.1, 92.2, 92.3}
CANNOT = (
    "the control does not confirm a target before it moves: {}. The line has no check sums: a wrong digit could drive the probe's "
    "body into the table, which nothing guards. Nothing has moved. Allowed: grblHAL built with expressions (a tick in its web "
    "builder: NGC_EXPRESSIONS_ENABLE, EXPR in $I), a newer FluidNC, or targets=plain in the port's URL with a short shielded "
    "cable or the network, and a hand on feed hold. Where $I says EXPR, look at the line instead"
)


def apart(value: float, least: float = WHOLE, travel: tuple[float, float] = (-math.inf, math.inf)) -> float:
    """mm, deg or mm/min, what it keeps from whole ones, ends of its travel → the nearest that does no harm behind another letter.

    Nor as `##`. What stands at an end of its travel keeps to the other side.
    """
    value = round(value, 4)
    tenth = round(value, 1)
    grid, least = (tenth, CODE) if tenth in HARMFUL else (round(value), least)
    if abs(value - grid) >= least:
        return value
    away = math.copysign(least, value - grid)
    found, other = round(grid + away, 4), round(grid - away, 4)
    return found if travel[0] <= found <= travel[1] else other


def switch(number: int) -> float:
    """M code of a plugin → its value behind M, no whole number. Raises InputError for one that is another code behind G."""
    if number in HARMFUL:
        raise InputError(
            f"grbl: found M{number} for a clamp; allowed: M codes that behind a G mean nothing, e.g. M10 (one character of the "
            f"line makes it G{number}), or targets=plain in the port's URL"
        )
    return number + SWITCHED


def assignments(values: Mapping[str, float]) -> list[str]:
    """{letter: number} → the lines that set its parameters; none for none."""
    lines = [""]
    for letter, value in values.items():
        text = f"#<{_name(letter)}>=[{value:.4f}]"
        if len(lines[-1]) + len(text) > LINE:
            lines.append("")
        lines[-1] += text
    return [line for line in lines if line]


def question(letters: Sequence[str]) -> str:
    """letters → the line that makes the control print them. FluidNC swallows a character behind each."""
    return "(PRINT,%.4f" + "  ".join(f"#<{_name(letter)}>" for letter in letters) + ")"


WAIT = "G4P[.01]"  # until the motion before has ended
FED = "(PRINT,%.4f#<_feed>)"  # the feed of the last move


def said(lines: Sequence[str]) -> list[float]:
    """lines of an answer → the numbers that were printed; none when it is not exactly one message."""
    found = [line for line in lines if line.startswith("[MSG:")]
    return [float(number) for number in re.findall(r"-?\d+\.\d{4}", found[0])] if len(found) == 1 else []


def confirmed(wanted: Sequence[float], lines: Sequence[str]) -> bool:
    """numbers, lines of the answer → whether these were printed, to the last place that single precision has."""
    numbers = said(lines)
    return len(numbers) == len(wanted) and all(
        abs(number - value) <= 1.5e-4 + abs(value) * 2**-23 for number, value in zip(numbers, wanted, strict=True)
    )


def motion(letters: Sequence[str], searching: bool) -> str:
    """letters with G, whether the last motion was a search → the line that moves.

    What is left of a line goes by the motion that is modal: G comes last where that is a search, first where it is not.
    """
    order = [letter for letter in letters if letter != "G"]
    return "".join(f"{letter}#<{_name(letter)}>" for letter in ([*order, "G"] if searching else ["G", *order]))


def _name(letter: str) -> str:
    return f"q{letter.lower() * 2}"
