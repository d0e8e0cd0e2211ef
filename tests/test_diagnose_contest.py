"""Names against shapes, by numbers alone: patterns that no machine made, so that nothing but the rule decides."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from support.diagnosis_parts import ALONE, MARGIN, SURE, Candidate, Chosen, Field, Kernel, Rows, contest, once, scaled

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


def test_a_shape_that_a_few_touches_show_is_seen_although_these_were_set_aside() -> None:
    """Beside a name that only follows the rest of it, the far touches were taken for single ones: together they are the shape."""
    rng = np.random.default_rng(6)
    shape = rng.normal(size=(TOUCHES, 1)) * np.where(np.arange(TOUCHES) % 40 == 0, 8.0, 0.5)[:, None]
    far = [int(i) for i in np.argsort(-np.abs(shape[:, 0]))[:6]]
    y = shape[:, 0] + rng.normal(size=TOUCHES)
    singles = [Chosen(Candidate("outlier", {"touch": i}, np.eye(TOUCHES)[:, [i]]), np.eye(TOUCHES)[:, [i]], 17.0) for i in far]
    like = np.where(np.abs(shape[:, 0]) < 1.0, shape[:, 0], 0.0) + 0.3 * rng.normal(size=TOUCHES)
    name = Chosen(Candidate("chip", {}, like[:, None]), like[:, None], 12.0)
    field = Field([scaled(Kernel(None, "shape", shape))], np.eye(TOUCHES), np.ones(TOUCHES), cast(Rows, SimpleNamespace(seen=None)))
    for names in ([], [name]):
        outcome = contest(field, y, singles, names)
        assert not outcome.named and len(outcome.shapes) == 1
        assert len(outcome.needless) >= len(singles) - 1


def test_two_findings_are_the_same_only_where_they_are_one_object() -> None:
    """Two of one touch, found on two ways: to compare their columns is ambiguous, and ended a diagnosis."""
    one, other = (Chosen(Candidate("outlier", {"touch": 1}, np.eye(TOUCHES)[:, [1]]), np.eye(TOUCHES)[:, [1]], 17.0) for _ in "ab")
    assert one in [other, one] and one not in [other]


@pytest.mark.parametrize(("facets", "left"), [("12", 2), ("123", 0)])
def test_what_lies_on_three_facets_is_one_thing_and_no_three_chips(facets: str, left: int) -> None:
    patterns = np.random.default_rng(7).normal(size=(TOUCHES, len(facets), 1))
    chips = [Chosen(Candidate("chip", {"facet": f, "at": 100}, patterns[:, i]), patterns[:, i], 12.0) for i, f in enumerate(facets)]
    step = Chosen(Candidate("step", {"at": 100, "frame": "machine"}, patterns[:, 0]), patterns[:, 0], 12.0)
    assert [c.candidate.cause for c in once([*chips, step])] == ["chip"] * left + ["step"]


@pytest.mark.parametrize(("size", "least", "most"), [(0.36, np.inf, np.inf), (0.42, MARGIN, ALONE), (0.55, ALONE, SURE)])
def test_a_name_stands_where_it_is_strongly_better_than_a_shape_and_tells_by_how_much(
    size: float, least: float, most: float
) -> None:
    rng = np.random.default_rng(8)
    pattern, other, noise = rng.normal(size=(3, TOUCHES))
    shape = (0.9 * pattern + 0.45 * other)[:, None]
    field = Field([scaled(Kernel(None, "shape", shape))], np.eye(TOUCHES), np.ones(TOUCHES), cast(Rows, SimpleNamespace(seen=None)))
    name = Chosen(Candidate("step", {}, pattern[:, None]), pattern[:, None], 12.0)
    outcome = contest(field, size * pattern + noise, [], [name])
    assert bool(outcome.named) == (least < np.inf)
    assert all(least < above < most for above in outcome.above.values()) and len(outcome.above) == len(outcome.named)
