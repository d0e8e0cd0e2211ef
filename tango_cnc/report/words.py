"""Names of ISO 230-1 in words that a machinist uses."""

from __future__ import annotations

import re

from ..records import Machine

_INTER = re.compile(r"E([XYZABC])0([XYZABCS])")
_POWER = re.compile(r"E([XYZABC])([XYZABCS])(\d)")
_BACK = re.compile(r"E([XYZABC])\1b")
ABOUT = {"A": "X", "B": "Y", "C": "Z"}


def spoken(name: str, machine: Machine) -> str:
    """coefficient → what it is, in words; the name itself for one that is not geometry."""
    if "-" in name:
        first, second = (part[1] for part in name.split("-"))
        return f"scale of {first} against {second}"
    if match := _INTER.fullmatch(name):
        letter, axis = match[1], match[2]
        what = "spindle" if axis == "S" else f"axis {axis}"
        if letter in "XYZ":
            return f"{what} off in {letter}"
        if axis in machine.linear:
            return f"{what} out of square, turned about {ABOUT[letter]}"
        return f"{what} tilted about {ABOUT[letter]}"
    if match := _BACK.fullmatch(name):
        return f"backlash of {match[1]} (half the reversal value)"
    if match := _POWER.fullmatch(name):
        letter, axis, degree = match[1], match[2], int(match[3])
        ending = {0: "constant", 1: "linear", 2: "quadratic", 3: "cubic"}.get(degree, f"degree {degree}")
        if letter == axis:
            return f"scale of {axis}" if degree == 1 else f"positioning of {axis}, {ending} part"
        if letter in "XYZ":
            kind = "straightness" if axis in machine.linear else "run-out"
            return f"{kind} of {axis} in {letter}, {ending} part"
        return f"tilt of {axis} about {ABOUT[letter]} while it moves, {ending} part"
    return name
