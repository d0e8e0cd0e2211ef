"""Other routines of LAPACK give the same numbers: what is printed is no rounding of one of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import linalg

from tango_cnc import iso230
from tango_cnc.estimate import Estimate
from tango_cnc.iso230.onpart import asked
from tango_cnc.iso230.trajectory import reference
from tango_cnc.iso230.whole import whole, widths, with_all
from tango_cnc.model import known, linearise
from tango_cnc.records import Array
from tests.support.iso_coverage import measured

HUNDREDTH = 0.01  # of a standard uncertainty
DRIVERS = ("gelsd", "gelsy")


@cache
def fitted(example: str) -> Estimate:
    return measured(example, 1000)[1]


def solved(result: Estimate, driver: str) -> Array:
    """estimate, routine → its unknowns (p,), from zero on, by that routine."""
    model, values = result.model, np.zeros(len(result.values))
    used = np.where(result.unused, 0.0, 1 / result.sigma)
    for _ in range(12):
        gaps, jacobian = linearise(model, values)
        offsets, rows, uncertainty = known(model, values)
        matrix = np.vstack([jacobian * used[:, None], rows / uncertainty[:, None]])
        right = np.concatenate([gaps * used, offsets / uncertainty])
        size = np.linalg.norm(matrix, axis=0)
        values = values - linalg.lstsq(matrix / size, right, cond=1e-13, lapack_driver=driver)[0] / size
    return np.asarray(values)


@pytest.mark.few(1)
@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("example", ["hu40t", "trunnion"])
def test_parameters_and_figures_of_the_terms_are_those_of_another_routine(example: str, driver: str) -> None:
    result = fitted(example)
    other = replace(result, values=solved(result, driver))
    std = np.sqrt(np.diag(result.covariance))
    assert np.max(np.abs(other.values - result.values) / std) < HUNDREDTH
    assert np.max(np.abs(other.values - result.values)) > 0  # it was solved anew
    for one, two in zip(iso230.figures(result), iso230.figures(other), strict=True):
        assert abs(one.value - two.value) <= HUNDREDTH * one.std


@pytest.mark.few(0)
@pytest.mark.parametrize("driver", DRIVERS)
def test_figures_of_every_error_motion_are_those_of_another_routine(driver: str) -> None:
    """That fit inverts normal equations; an orthogonal routine sees the touches themselves, and the widths as rows."""
    result = fitted("hu40t")
    w = whole(result)
    assert w.gain is not None
    model, p = with_all(result.model)
    known_there = dict(zip(result.model.names, result.values.tolist(), strict=True))
    start, width = np.array([known_there.get(name, 0.0) for name in model.names]), widths(model)
    seen = width > 0
    gaps, jacobian = linearise(model, start)
    offsets, rows, uncertainty = known(model, start)
    matrix = np.vstack([jacobian / w.sigma, rows / uncertainty[:, None]])[:, seen] * width[seen]
    inputs = np.append(np.full(len(gaps), w.sigma), uncertainty)
    beside = np.zeros((matrix.shape[1], len(inputs)))
    right = np.vstack([np.diag(1 / inputs), beside])  # every touch and every known distance 1 mm off, one after the other
    gain = np.zeros((p, len(inputs)))
    found = linalg.lstsq(np.vstack([matrix, np.eye(matrix.shape[1])]), right, lapack_driver=driver)[0]
    gain[seen[:p]] = (width[seen, None] * found)[: int(seen[:p].sum())]
    moved = (gain - w.gain) @ np.append(gaps, offsets)
    assert np.max(np.abs(gain - w.gain)) > 0  # it was solved anew
    machine, over = w.touches.machine, iso230.ranges(w.touches)
    asks = asked(machine, w.coefficients, over, reference(machine, over))
    assert len(asks) > 50
    for ask in asks:
        curve = ask.curve.reshape(-1, p)
        std = np.sqrt(np.clip(np.sum(curve @ w.covariance * curve, axis=1), 1e-18, None))
        assert np.max(np.abs(curve @ moved) / std) < HUNDREDTH
