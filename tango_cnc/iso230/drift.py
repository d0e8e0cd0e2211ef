"""Drift while the touches are made: how the table goes against the tool, in the machine frame.

Every machine drifts, and touches come one after the other. A fit without drift takes it for error motions: a warm-up of 10 µm makes
squarenesses, gains and volumes that no machine has. So each fit has drift beside the error motions, and the touches say how large
it is. A random walk is written as sines that grow from zero at the start of a run; the same sines describe a warm-up. Between two
runs everything may sit elsewhere.
Source: Karhunen–Loève expansion of the random walk (Loève, Probability Theory II, 37.5); ISO 230-3:2020, 5 and 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ..terms import GAP, Coefficient
from ..touches import Touches

MODES, FEWEST = 8, 2  # sines of one run; of each of many runs
STEM = "drift"


def drifting(touches: Touches) -> tuple[Coefficient, ...]:
    """n touches → coefficients in x y z of the machine frame: mm, standard deviation of a walk at the end of a run.

    Positive: everything on the table goes along the base vector.
    """
    runs = _runs(touches)
    last = int(runs.max()) if len(runs) else -1
    modes = max(FEWEST, MODES // (last + 1)) if last >= 0 else 0
    found = []
    for run in range(last + 1):
        first = 0 if run else 1  # where the first run begins, the table is by its location
        for mode in range(first, modes + 1):
            found += [Coefficient(f"{STEM}{run}.{mode}.{c}", "mm", GAP, partial(_felt, run, mode, i)) for i, c in enumerate("xyz")]
    return tuple(found)


def is_drift(c: Coefficient) -> bool:
    """coefficient → whether it is one of `drifting`."""
    return c.slot == GAP and c.name.startswith(STEM)


def along(c: Coefficient) -> str:
    """coefficient of `drifting` → which of them are as large as each other: run and direction."""
    return f"{c.name.split('.')[0]}.{c.name[-1]}"


def path(touches: Touches, values: Mapping[str, float]) -> Array:
    """n touches, coefficients of `drifting` by name → (n, 3) mm, how far the table had gone in x y z of the machine frame."""
    found = np.zeros((len(touches), 3))
    for name, value in values.items():
        run, mode, letter = name.removeprefix(STEM).split(".")
        found[:, "xyz".index(letter)] += value * _shape(int(run), int(mode), touches)
    return found


def _felt(run: int, mode: int, component: int, touches: Touches) -> Array:
    return np.asarray(-touches.machine_normal[:, component] * _shape(run, mode, touches))


def _shape(run: int, mode: int, touches: Touches) -> Array:
    """run, number of the sine or 0 for where the run begins, n touches → (n,) share of the coefficient; 0 in other runs."""
    own, at = _runs(touches) == run, np.zeros(len(touches))
    if mode == 0:
        at[own] = 1.0
    elif own.any():
        time = touches.time[own]
        span = float(np.ptp(time))
        part = (time - time.min()) / span if span > 0 else np.linspace(0, 1, len(time))
        wave = (mode - 0.5) * np.pi
        at[own] = np.sqrt(2) * np.sin(wave * part) / wave
    return at


def _runs(touches: Touches) -> NDArray[np.int64]:
    """touches → (n,) number of the run: another day, or another stylus, is another one."""
    if not len(touches):
        return np.zeros(0, dtype=np.int64)
    stylus = np.ones(len(touches)) if touches.stylus is None else np.asarray(touches.stylus)
    begins = (np.diff(touches.day) != 0) | (np.diff(stylus) != 0)
    return np.concatenate([[0], np.cumsum(begins)]).astype(np.int64)
