"""The touches of a plan: held as arrays, used as a sequence of records."""

from __future__ import annotations

import tracemalloc
from dataclasses import FrozenInstanceError, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tango_cnc.files import read_cell
from tango_cnc.plan import part, plan, plan_hash, split
from tango_cnc.plan.touches import PLACES, Planned
from tango_cnc.records import Plan, Touch

GOLDEN = Path(__file__).parent / "golden" / "cell"


@cache
def made(times: int = 1) -> Plan:
    cell = read_cell(GOLDEN)
    return plan(replace(cell, strategy=replace(cell.strategy, indexations=cell.strategy.indexations * times)))


def test_they_are_indexed_iterated_and_cut_like_a_tuple() -> None:
    touches = made().touches
    one_by_one = tuple(touches)
    assert isinstance(touches, Planned) and all(isinstance(touch, Touch) for touch in one_by_one)
    assert len(touches) == len(one_by_one) and touches[-1] == one_by_one[-1] and tuple(touches[1:4]) == one_by_one[1:4]
    assert tuple(reversed(touches)) == one_by_one[::-1]
    assert [touch.number for touch in touches] == list(range(1, len(touches) + 1))
    with pytest.raises(IndexError):
        touches[len(touches)]


def test_they_equal_the_same_records_and_no_others() -> None:
    touches = made().touches
    same = tuple(touches)
    assert touches == same and touches == made().touches[:] and replace(made(), touches=same) == made()
    assert touches != same[:-1] and touches != (*same[:-1], replace(same[-1], facet="another")) and touches != "none"
    assert hash(touches) == hash(made().touches[:])


def test_numbers_are_plain_and_places_have_a_column_per_axis() -> None:
    touch = made().touches[0]
    assert type(touch.number) is int and type(touch.indexation) is int
    for name in PLACES:
        values = getattr(touch, name)
        assert len(values) == len(made().machine.names) and {type(value) for value in values} == {float}


def test_nobody_changes_them() -> None:
    touches = made().touches
    assert isinstance(touches, Planned)
    with pytest.raises(ValueError, match="read-only"):
        touches.places[0, 0, 0] = 1.0
    with pytest.raises(FrozenInstanceError):
        touches[0].number = 7  # type: ignore[misc]


def test_a_plan_of_records_made_by_hand_is_split_and_resumed_like_the_planner_s_own() -> None:
    by_hand = replace(made(3), touches=tuple(made(3).touches))
    assert plan_hash(by_hand) == plan_hash(made(3))
    assert split(by_hand, 8) == split(made(3), 8)
    some = [touch.number for touch in by_hand.touches][2::3]
    assert part(by_hand, some) == part(made(3), some)


def test_a_touch_takes_the_numbers_of_its_places_and_little_else() -> None:
    def taken(touches: Planned | tuple[Touch, ...]) -> float:
        copy = (lambda: touches[:]) if isinstance(touches, Planned) else (lambda: tuple(touches_again(touches)))
        tracemalloc.start()
        kept = copy()
        size = tracemalloc.get_traced_memory()[0] / len(kept)
        tracemalloc.stop()
        return size

    def touches_again(touches: tuple[Touch, ...]) -> list[Touch]:
        return [replace(t, **{name: tuple(v + 0.0 for v in getattr(t, name)) for name in PLACES}) for t in touches]

    touches = made(40).touches
    assert isinstance(touches, Planned)
    numbers = np.dtype(float).itemsize * len(PLACES) * len(made().machine.names)
    assert taken(touches) < numbers + 60
    assert taken(tuple(touches)) > 4 * numbers, "records take so much that this measures it"
