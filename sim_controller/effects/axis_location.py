"""An axis is not where or not as square as it should be: a constant axis location error (ISO 230-1, ISO 10791-6)."""

from __future__ import annotations

import numpy as np

from . import Disturbance, History
from ._kinds import AxisLocation

EXAMPLE = {"name": "EX0C", "amplitude": 0.02}
OTHERWISE = "a constant of the machine, under `errors` in world.yaml; test_sim_effects.py"
UNDRAWN = "a constant of the machine, which S3 has"


def disturb(history: History, rng: np.random.Generator, *, name: AxisLocation, amplitude: float) -> Disturbance:
    """n touches → `amplitude` mm (X Y Z) or rad (A B C) added to the axis location error `name`: `EX0C`, `EA0B` …"""
    return Disturbance(errors={name: np.full(len(history), amplitude)})
