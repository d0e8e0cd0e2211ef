"""What a budget adds to the intervals of ISO figures: against readings that were disturbed and fitted again."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tango_cnc.commands._budget import absent, budget_of
from tango_cnc.estimate import Estimate
from tango_cnc.iso230.signed import signed
from tango_cnc.iso230.whole import disturbed, whole
from tango_cnc.model import Model
from tests.support.iso_coverage import measured

LINES = """contributions:
- {source: repeatability, std: 0.0007}
- {source: form, std: 0}
- {source: drift, amplitude: 0.004}
- {source: lobing, amplitude: 0.002, order: 3}
- {source: indexation_seating, std: 0}
"""


@cache
def fitted() -> Estimate:
    return measured("hu40t", 1000)[1]


@pytest.mark.long
def test_a_disturbance_of_the_touches_moves_the_machine_as_the_gain_says() -> None:
    result = fitted()
    before = whole(result)
    assert before.gain is not None and before.leave is not None
    rng = np.random.default_rng(1)
    touches = result.model.touches
    planes = np.array([touches.artefact.facets[f].ball is None for f in touches.facet])
    off = 1e-5 * rng.standard_normal(len(touches)) * planes
    moved = replace(touches, point=touches.point - off[:, None] * touches.normal)  # every gap is larger by `off`
    after = whole(replace(result, selection=replace(result.selection, model=Model(moved, result.model.coefficients))))
    told, real = -before.gain[:, : len(off)] @ off, after.values - before.values
    size = np.sqrt(np.diag(before.covariance))
    told, real = told[size > 0] / size[size > 0], real[size > 0] / size[size > 0]
    assert np.max(np.abs(told)) > 1e-3
    # the scatter that is taken out changes with the disturbance, and with it what the prior weighs
    assert np.linalg.norm(told - real) < 0.1 * np.linalg.norm(told)


def test_white_noise_as_large_as_the_scatter_is_what_the_residuals_are_expected_to_show() -> None:
    w = whole(fitted())
    assert w.leave is not None
    white = np.zeros((w.leave.shape[1], len(w.leave)))
    white[: len(w.leave)] = w.sigma * np.eye(len(w.leave))
    _, expected = disturbed(w, (white,), ())
    assert expected == pytest.approx(w.sigma, rel=0.02)


@pytest.mark.long
def test_intervals_grow_by_what_the_scatter_does_not_show(tmp_path: Path) -> None:
    (tmp_path / "uncertainty.yaml").write_text(LINES, encoding="utf-8")
    budget = budget_of(tmp_path, fitted())
    assert budget is not None
    assert budget.beside == ("drift", "lobing")
    assert not absent(budget.named)
    alone, whole_budget = signed(fitted()), signed(fitted(), budget=budget)
    both = {(f.kind, f.name): f.interval for f in whole_budget.figures}
    numbers = [f for f in alone.figures if f.kind in ("squareness", "reversal", "positioning gain")]  # ranges go by Monte Carlo
    pairs = [(f.interval, w) for f in numbers if f.interval and (w := both[f.kind, f.name])]
    wider = [(w[1] - w[0]) / (a[1] - a[0]) for a, w in pairs]
    assert min(wider) >= 1
    assert max(wider) > 1.1
    assert whole_budget.expected is not None and whole_budget.expected > 0.0007


def test_a_budget_names_what_every_machine_has() -> None:
    assert absent(("repeatability",)) == ("form", "drift", "lobing", "rotary_positioning or indexation_seating")
    assert not absent(("repeatability", "form", "drift", "lobing", "rotary_positioning"))


def test_what_the_touches_decide_is_as_uncertain_as_their_scatter_makes_it() -> None:
    """The touches alone decide how two reversals differ: the prior has no part in it, and the scatter is that beside all error
    motions. What both have in common rests on the radius of the tip, too.
    """
    w = whole(fitted())
    assert w.gain is not None
    names = [c.name for c in w.coefficients]
    x, y = names.index("EXXb"), names.index("EYYb")

    def std(sign: int) -> tuple[float, float]:
        weights = np.zeros(len(names))
        weights[x], weights[y] = 1, sign
        return float(np.sqrt(weights @ w.covariance @ weights)), float(w.sigma * np.linalg.norm(weights @ w.gain))

    differ, scatter = std(-1)
    assert differ == pytest.approx(scatter, rel=0.03)
    alike, scatter = std(1)
    assert alike > 1.1 * scatter
