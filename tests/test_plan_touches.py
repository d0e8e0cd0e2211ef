"""The touches of a plan: held as arrays, used as a sequence of records."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from functools import cache
from pathlib import Path

import pytest

from postprocessors import load, program
from tango_cnc.files import read_cell
from tango_cnc.plan import part, plan, plan_hash, split
from tango_cnc.plan.touches import PLACES, Planned
from tango_cnc.records import InputError, Plan, Touch
from tango_cnc.records.plan import LEAST

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
        touches.indexation[0] = 1
    with pytest.raises(FrozenInstanceError):
        touches[0].number = 7  # type: ignore[misc]


def test_a_plan_of_records_made_by_hand_is_split_and_resumed_like_the_planner_s_own() -> None:
    by_hand = replace(made(3), touches=tuple(made(3).touches))
    assert plan_hash(by_hand) == plan_hash(made(3))
    assert split(by_hand, 8) == split(made(3), 8)
    some = [touch.number for touch in by_hand.touches][2::3]
    assert part(by_hand, some) == part(made(3), some)


@pytest.mark.few(0)
def test_one_of_many_is_the_same_as_when_they_are_walked_through(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tango_cnc.plan.touches.BLOCK", 64)
    touches, some = made(100).touches, [599, 0, 63, 64, 300, 1, 127, 128, -1]
    one_by_one = tuple(touches)
    assert len(one_by_one) == 600 and [touches[row] for row in some] == [one_by_one[row] for row in some]


def test_what_is_done_with_a_plan_afterwards_does_not_move_its_touches() -> None:
    strategy = replace(made(3).strategy, approach=replace(made(3).strategy.approach, standoff=12.0, search=3.0))
    halves = split(replace(made(3), strategy=strategy), 9)
    assert len(halves) == 2
    assert [(touch.standoff, touch.end) for half in halves for touch in half.touches] == [
        (touch.standoff, touch.end) for touch in made(3).touches
    ]


def test_a_way_that_is_too_short_for_some_controls_is_made_with_the_next_motion() -> None:
    """Mach3 takes no search that begins nearer than 0.254 mm to its target."""
    whole = made()
    first, second, third = whole.touches[:3]
    x = whole.machine.column("X")
    left = second.leave or second.over
    near = tuple(value + 0.1 * (i == x) for i, value in enumerate(left))
    short = replace(whole, touches=(first, second, replace(third, enter=near)), turns=whole.turns[:1])
    places, at = [], dict[str, float]()
    for move in short.moves:
        way = [abs(value - at[name]) for name, value in move.target.items() if name in short.machine.linear and name in at]
        assert move.kind not in ("retract", "clear") or move.touch == first.number or sum(way) > LEAST / 2
        at.update(move.target)
        places.append((move.kind, *(at.get(name) for name in "XYZ")))
    kinds = [move.kind for move in short.moves if move.touch == third.number]
    assert kinds == ["approach", "probe", "back", "retract"]
    for kind, touch in (("approach", third.standoff), ("probe", third.end), ("back", third.standoff)):
        assert (kind, *(touch[short.machine.column(name)] for name in "XYZ")) in places


def test_a_first_way_that_mach3_cannot_make_is_refused_with_what_helps() -> None:
    whole = made()
    turn, z = whole.turns[0], whole.machine.column("Z")
    begun = turn.via or turn.after
    near = tuple(value - 0.1 * (i == z) for i, value in enumerate(begun))
    short = replace(whole, touches=(replace(whole.touches[0], enter=near), *whole.touches[1:]))
    with pytest.raises(InputError, match=r"mach3: found a way of 0\.100 mm before touch 1; .* begin with another indexation"):
        program(load("mach3"), short, {}, "0" * 12)
