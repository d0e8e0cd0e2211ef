"""What an indicator reads that turns with a rotary axis: about its own least-squares circle, over less than a turn, too.

Truth: bodies as 4 × 4 matrices of a second program; the circle is fitted to the points of the polar plot.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy import optimize

from tango_cnc.files import read_cell
from tango_cnc.iso230.onpart import Ask, asked
from tango_cnc.iso230.trajectory import reference
from tango_cnc.iso230.whole import motion_of, waves
from tango_cnc.records import Machine
from tests.support.iso_coverage import EXAMPLES
from tests.support.truth import AXES, Truth

OVER = {"B": (-90.0, 90.0), "A": (-90.0, 90.0), "C": (-160.0, 180.0)}
SIZE = 30e-3, 30e-6  # mm, rad


@cache
def machine_of(example: str) -> Machine:
    return read_cell(EXAMPLES / example).machine


def printed(example: str, motion: str, order: int, part: int) -> dict[str, float]:
    """example, error motion, its harmonic, cosine or sine → figures `rotating` of its axis by kind, µm and µrad."""
    machine, axis = machine_of(example), motion[2]
    over = {axis: tuple(np.radians(OVER[axis]).tolist())}
    chosen = [c for c in waves(machine, axis, order) if motion_of(c) == motion]
    assert len(chosen) == 2
    found: list[Ask] = asked(machine, chosen, over, reference(machine, over))
    size = SIZE[motion[1] in "ABC"]
    return {a.kind: float(np.ptp(a.curve[:, part] * size)) * a.factor for a in found if a.name == f"{axis} rotating"}


def plotted(example: str, motion: str, order: int, part: int, tilt: bool) -> float:
    """the same, read off a ball on the axis, or off two balls 1 m apart along it, by an indicator that turns → µm or µrad."""
    truth = Truth(EXAMPLES / example, 1, size=0.0)
    axis, size = motion[2], SIZE[motion[1] in "ABC"]
    truth.waves[axis] = np.zeros((6, order, 2))
    truth.waves[axis]["XYZABC".index(motion[1]), order - 1, part] = size
    q = np.radians(np.linspace(*OVER[axis], 5001))
    along, across = np.eye(4)[AXES[axis]], np.eye(3)[(AXES[axis] + 1) % 3]
    balls = [np.append(truth.point[axis], 1.0), np.append(truth.point[axis], 1.0) + 1000.0 * along]
    real, nominal = (truth.body(axis, q, np.zeros(len(q)), errors=of) for of in (True, False))
    reads = [np.einsum("ni,ni->n", nominal[:, :3, :3] @ across, ((real - nominal) @ ball)[:, :3]) for ball in balls]
    record = (reads[1] - reads[0]) / 1000.0 if tilt else reads[0]
    large = 1e5 * float(np.abs(record).max()) + 1e-9  # of the polar plot: the deviation is small beside it
    points = (large + record) * np.exp(1j * q)
    fit = optimize.least_squares(lambda c: np.abs(points - complex(c[0], c[1])) - c[2], (0.0, 0.0, large), x_scale=large)
    return float(np.ptp(fit.fun)) * (1e6 if tilt else 1e3)


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("example", "motion", "order", "part"),
    [
        ("hu40t", "EXB", 2, 0),
        ("hu40t", "EZB", 2, 0),
        ("hu40t", "EZB", 2, 1),
        ("hu40t", "EZB", 3, 0),
        ("hu40t", "EAB", 2, 0),
        ("hu40t", "ECB", 2, 0),
        ("trunnion", "EZA", 2, 0),
        ("trunnion", "EYA", 2, 1),
        ("trunnion", "EYC", 3, 1),
        ("trunnion", "EXC", 3, 1),
        ("trunnion", "EAC", 2, 1),
        ("trunnion", "EBC", 2, 1),
    ],
)
def test_the_range_is_that_of_a_polar_plot_less_its_circle(example: str, motion: str, order: int, part: int) -> None:
    told = printed(example, motion, order, part)
    for kind in ("radial", "tilt"):
        real = plotted(example, motion, order, part, kind == "tilt")
        assert told.get(kind, 0.0) == pytest.approx(real, abs=0.15), kind
