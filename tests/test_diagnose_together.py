"""Single touches that were set aside: spoilt by chance they stand anywhere; where they stand together they are no single ones."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
from support.diagnosis_parts import together

from tango_cnc.touches import Touches

COUNT = 300


class Plan(SimpleNamespace):
    """What is known of the touches."""

    def __len__(self) -> int:
        return COUNT


def plan() -> Touches:
    """→ 300 touches: thirty indexations of ten facets, X and Y anywhere, five sides."""
    rng = np.random.default_rng(4)
    places = {"X": rng.uniform(-200, 200, COUNT), "Y": rng.uniform(-200, 200, COUNT), "C": np.repeat(np.arange(30.0), 10)}
    sides = np.vstack([np.eye(3), -np.eye(3)[:2]])
    fake = Plan(
        machine=SimpleNamespace(linear=("X", "Y"), rotary=("C",)),
        axis=lambda a: places[a],
        facet=tuple(str(i % 10) for i in range(COUNT)),
        indexation=np.repeat(np.arange(30), 10),
        machine_normal=sides[rng.integers(0, 5, COUNT)],
        number=np.arange(1, COUNT + 1),
    )
    return cast(Touches, fake)


def told(rows: list[int]) -> list[str]:
    """rows that were set aside → in what they stand together."""
    return [r.covariate for r in together(plan(), dict.fromkeys(rows, 0.005))]


def test_touches_that_chance_spoilt_stand_together_in_nothing() -> None:
    rng = np.random.default_rng(5)
    found = [told(list(map(int, rng.choice(COUNT, count, replace=False)))) for count in (3, 6, 10) for _ in range(25)]
    assert sum(map(bool, found)) <= 2


def test_touches_at_one_place_of_an_axis_are_no_single_ones() -> None:
    x = plan().axis("X")
    near = [int(i) for i in np.argsort(np.abs(x - 50))[:5]]
    assert told([*near, 17]) == ["X"]
    found = together(plan(), {i: 0.001 * (2 + i % 3) for i in near})[0]
    assert found.shape == "apart" and 0.002 <= found.amplitude <= 0.004
    assert found.confirm == ", ".join(str(i + 1) for i in sorted(near))


def test_touches_one_after_the_other_and_touches_of_one_facet_are_no_single_ones() -> None:
    assert told([120, 121, 123, 124, 250]) == ["order"]
    assert told([7, 57, 107, 157, 207, 257]) == ["facet"]


def test_two_touches_stand_nowhere_together() -> None:
    assert told([120, 121]) == []
