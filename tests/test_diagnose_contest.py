"""Names against shapes, by numbers alone: patterns that no machine made, so that nothing but the rule decides."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from tango_cnc.diagnose._candidates import Candidate
from tango_cnc.diagnose._catalogue import Chosen
from tango_cnc.diagnose._contest import Field, contest
from tango_cnc.diagnose._rows import Rows
from tango_cnc.diagnose._smooth import Kernel, scaled
from tango_cnc.records import Array

TOUCHES = 300


def told(y: Array, pattern: Array, shapes: list[Array]) -> tuple[bool, bool]:
    """data (n,), pattern of a name (n,), shapes (n, k) → whether it is named, whether a shape without a name is."""
    kernels = [scaled(Kernel(None, "shape", columns)) for columns in shapes]
    means = cast(Rows, SimpleNamespace(seen=None))
    field = Field(kernels, np.eye(TOUCHES), np.ones(TOUCHES), means)
    name = Chosen(Candidate("chip", {}, pattern[:, None]), pattern[:, None], 12.0)
    outcome = contest(field, y, [], [name])
    return bool(outcome.named), bool(outcome.shapes)


@pytest.mark.parametrize(("size", "named"), [(0.0, True), (0.4, True), (2.0, False)])
def test_a_name_beside_a_shape_stands_where_it_has_more_evidence(size: float, named: bool) -> None:
    rng = np.random.default_rng(3)
    name, *functions = rng.normal(size=(4, TOUCHES))
    shape = np.column_stack(functions)
    y = 0.7 * name + size * shape @ [1.0, -0.5, 0.7] + rng.normal(size=TOUCHES)
    assert told(y, name, [shape]) == (named, size > 0)
