"""A ball that a short check touches from nearly one side moves along that side, and nobody knows how far across it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from tango_cnc.state import naming


def test_a_ball_that_is_touched_from_nearly_one_side_has_no_size_across_it() -> None:
    """Two directions that were seen, but not apart, were millions of µm: a sound night after it was in doubt."""
    k = 6
    one = np.zeros((k, 3))
    one[:, 0] = 3000.0
    one[:, 1], one[:, 2] = 0.3 * one[:, 0], -0.2 * one[:, 0]
    one[0, 1] += 0.04
    one[1, 2] += 0.05
    white = np.random.default_rng(3).standard_normal(k) - 15.0
    h = naming.Hypothesis("ball", "ball 2", np.eye(3), "mm", ("X", "Y", "Z"))
    state = cast(Any, SimpleNamespace(root=1e-3 * np.eye(3)))
    tonight = cast(Any, SimpleNamespace(innovation=white, reduced=1e-3 * one, statistic=1e3, scale=1.0, dof=k))
    named = naming.name_change(state, cast(Any, None), tonight, [h])
    assert named is not None and len(named.size) == 1 and float(np.abs(named.size).max()) < 1.0
