"""What several effects are made of: growth in time, waves of an angle, vectors in the frame of an axis, names of coefficients."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tango_cnc.records import Array, InputError, Vector

from ..transforms import axis_frame
from ._history import History, unit

Shape = Literal["exponential", "linear"]
ALONG = {"X": 0, "Y": 1, "Z": 2, "A": 0, "B": 1, "C": 2, "S": 2}  # axis → its base vector (model.md, Axis frame)


def growth(history: History, tau: float, shape: Shape) -> Array:
    """n touches, time constant s → (n,) 1 − exp(−t/tau), or t/tau (linear); t in s since that day's start."""
    return 1 - np.exp(-history.warm / tau) if shape == "exponential" else history.warm / tau


def wave(history: History, letter: str, order: int, phase: float) -> Array:
    """rotary axis or spindle, waves a turn, deg → (n,) cos(order·q + phase)."""
    return np.cos(order * history.position[:, history.column(letter)] + np.radians(phase))


def positioning(letter: str) -> str:
    """axis → its positioning error at degree 0, in units of its command: `EXX0`, `ECC0`."""
    return f"E{'C' if letter == 'S' else letter}{letter}0"


def displaced(ending: str, vector: Array, size: Array) -> dict[str, Array]:
    """`0C` before or `C0` after the motion of C, (3,) in its frame, (n,) mm → coefficients of a displacement size·vector."""
    return {f"E{letter}{ending}": part * size for letter, part in zip("XYZ", vector, strict=True) if part}


def turned(ending: str, vector: Array, size: Array) -> dict[str, Array]:
    """as `displaced`, (n,) rad → coefficients of a small rotation size·vector."""
    return {f"E{letter}{ending}": part * size for letter, part in zip("ABC", vector, strict=True) if part}


def in_axis_frame(history: History, letter: str, direction: Vector) -> Array:
    """axis, any vector in the machine frame at the zero pose → (3,) unit vector in the frame of that axis."""
    columns, _ = axis_frame(ALONG[letter], history.machine.axis(letter).direction)
    return np.asarray(columns.T @ unit(direction))


def across(history: History, letter: str, direction: Vector) -> Array:
    """axis, any vector in the machine frame at the zero pose → (3,) unit vector of its part across the axis, in the axis' frame.

    Raises InputError for a vector along the axis.
    """
    vector = in_axis_frame(history, letter, direction)
    vector[ALONG[letter]] = 0.0
    length = np.linalg.norm(vector)
    if length < 1e-6:
        raise InputError(f"direction: found {list(direction)}, which is along {letter}; allowed: a vector across that axis")
    return np.asarray(vector / length)


def in_units_of(history: History, letter: str, given: float) -> float:
    """axis, mm or deg as in files → mm or rad."""
    return given if history.machine.axis(letter).kind == "linear" else float(np.radians(given))


def span_of(history: History, letter: str, given: float) -> float:
    """axis, mm or deg (0: not given) → mm or rad at which an error has its full size; by default the far end of the travel.

    Raises InputError where the machine says nothing of the travel.
    """
    travel = history.machine.axis(letter).travel
    if given:
        return in_units_of(history, letter, given)
    if travel is None:
        raise InputError(
            f"found no key 'span'; required, because axis {letter} has no travel: where {letter} has the whole amplitude"
        )
    return max(map(abs, travel))
