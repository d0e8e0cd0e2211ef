"""Facets on the way: what a way to one more facet takes, and a plan that is better for counting it."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from support.design_parts import longer

from tango_cnc.design import goals, order, propose, timed
from tango_cnc.design.on_the_way import Tour, on_the_way
from tango_cnc.design.propose import Wish
from tango_cnc.files import read_cell
from tango_cnc.plan import plan
from tango_cnc.records import Approach

EXAMPLES = Path(__file__).parents[1] / "examples"
LINE = np.array([0.0, 10.0, 4.0, 13.0, 2.0])  # s along a straight way


def tour(way: list[int]) -> Tour:
    return Tour(np.arange(5), np.abs(LINE[:, None] - LINE), way)


def test_a_facet_between_two_others_takes_no_way_and_one_beyond_them_takes_its_own() -> None:
    added, place = tour([0, 1]).more()
    assert added.tolist() == [0.0, 0.0, 0.0, 3.0, 0.0]
    assert place[2] == 1 and place[3] == 2


def test_the_first_facet_of_a_visit_takes_no_way_between_facets() -> None:
    assert tour([]).more()[0].tolist() == [0.0] * 5


@pytest.mark.parametrize("way", list(permutations(range(4), 3)))
def test_what_a_way_gets_longer_by_is_what_it_gets_shorter_by_without_that_facet(way: tuple[int, ...]) -> None:
    before = tour(list(way))
    added, place = before.more()
    after = tour([*way[: place[4]], 4, *way[place[4] :]])
    assert order.length(after.way, after.legs) == pytest.approx(order.length(before.way, before.legs) + added[4])
    assert after.less([4]) == pytest.approx(added[4])


@pytest.mark.long
def test_touches_exchanged_by_their_ways_make_a_plan_better_in_the_same_time() -> None:
    cell, aim = read_cell(EXAMPLES / "trunnion"), goals.read("locations")
    ready = propose.setting(cell, Wish(aim, 4, ("S3",), Approach(2.0, 0.5, 180.0), feed=6000.0))
    cell = ready.problem.choice.cell
    artefact, every = cell.artefact, cell.strategy.indexations
    some = [replace(i, facets=tuple(f for f in i.facets if artefact.facets[f].ball or int(f) % 3 == 0)) for i in every]
    few = tuple(i for i in some[:: len(some) // 6] if len(i.facets) > 2)
    cell = replace(cell, strategy=replace(cell.strategy, indexations=few))
    own = timed.judged(ready.problem, cell, plan(cell, "leave-out"))
    own = replace(own, problem=replace(ready.problem, seconds=own.seconds))
    found = on_the_way(own, order.again(ready.problem.choice.cell, 6000.0))
    assert found.value < 0.9 * own.value and found.seconds <= own.seconds
    assert [i.position for i in found.cell.strategy.indexations] == [i.position for i in few]
    # What it says is what the planner and the model say of the strategy that it made.
    again = timed.judged(found.problem, found.cell, plan(found.cell, "leave-out"))
    assert again.value == pytest.approx(found.value, rel=1e-9) and again.seconds == pytest.approx(found.seconds)
    # No ball is lost for it.
    touched = {t.facet for t in found.plan.touches}
    assert {t.facet for t in own.plan.touches if artefact.facets[t.facet].ball} <= touched


def test_a_check_that_takes_longer_than_its_full_run_says_so() -> None:
    assert "longer than the full run that it rests on (2 min 0 s)" in longer(150.0, 120.0)[0]
    assert longer(150.0, 151.0) == [] and longer(150.0, None) == []
