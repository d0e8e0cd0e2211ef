"""The order of the indexations of a plan: what a run that is broken off has determined."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from tango_cnc.design import broken_off, choose, goals, nested, order, propose, senses, timed
from tango_cnc.design.problem import Chosen
from tango_cnc.design.propose import Wish
from tango_cnc.design.weighed import Weighed, weighed
from tango_cnc.files import read_cell
from tango_cnc.records import Approach

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def made() -> Chosen:
    """A plan that was made quickly, in an order that is short."""
    cell, aim = read_cell(EXAMPLES / "trunnion"), goals.read("locations")
    ready = propose.setting(cell, Wish(aim, 6, ("S3",), Approach(2.0, 0.5, 180.0), feed=6000.0))
    problem = replace(ready.problem, senses=senses.senses_of(ready.problem.choice))
    return replace(choose.quick(problem), problem=problem)


def again(found: Chosen) -> float:
    return order.again(found.problem.choice.cell, found.problem.feed)


@pytest.mark.few(0)
def test_what_is_known_of_all_visits_is_what_the_plan_determines(made: Chosen) -> None:
    parts = broken_off.Parts.of(made)
    known, seconds = parts.known(range(len(parts.visits)), (0.5, 0.75))
    rows = made.rows[: sum(len(i.facets) for i in parts.visits)]
    assert seconds == pytest.approx(made.time[len(rows) - 1])
    assert np.allclose(known[2], made.problem.choice.held + rows.T @ rows, atol=1e-9 * np.abs(known[2]).max())
    assert np.linalg.eigvalsh(known[1] - known[0]).min() > -1e-9 < np.linalg.eigvalsh(known[2] - known[1]).min() + 1e-6


@pytest.mark.long
def test_a_run_that_is_broken_off_has_determined_more_and_the_whole_one_hardly_less(made: Chosen) -> None:
    found = broken_off.worth_when_broken_off(made, again(made))
    before, after = timed.broken_off(made), timed.broken_off(found)
    assert after[2] < before[2]
    assert found.value <= made.value * (1 + broken_off.LOSS) ** 2
    assert found.seconds <= made.problem.seconds
    assert {tuple(i.position.items()) for i in found.cell.strategy.indexations} == {
        tuple(i.position.items()) for i in made.cell.strategy.indexations
    }


@pytest.mark.few(0)
def test_no_order_of_three_visits_leaves_more_known_than_the_one_that_is_found(made: Chosen) -> None:
    parts = broken_off.Parts.of(made)
    few = replace(parts, visits=parts.visits[2:5], poses=parts.poses[2:5], touches=parts.touches[2:5], times=parts.times[2:5, 2:5])
    few.since = parts.since[2:5]
    few.turn = parts.turn
    few.first = parts.first[2:5]
    way = few.ordered([0.3], [0, 1, 2])
    worth = {other: float(few.worth(other, [0.3])[0][0]) for other in permutations(range(3))}
    whole = {other: float(few.worth(other, [])[0][0]) for other in worth}
    fair = [worth[other] for other in worth if whole[other] <= whole[0, 1, 2] * 1.02]
    assert worth[tuple(way)] <= min(fair) * 1.05


@pytest.mark.few(0)
def test_a_check_and_the_determinant_keep_their_order(made: Chosen) -> None:
    other = replace(made, problem=replace(made.problem, criterion=goals.of_limits(made.problem.choice, {})))
    assert broken_off.worth_when_broken_off(other, again(made)) is other


@pytest.mark.few(0)
def test_what_is_made_by_then_is_what_the_plan_has_made(made: Chosen) -> None:
    aims = {0.5: 1.0, 0.75: 1.0}
    exchange = Weighed(made, again(made), 0.0, aims)
    count = (made.time[:, None] <= np.array(list(aims)) * made.seconds).sum(axis=0)
    assert exchange.by_then()[0].sum(axis=1) == pytest.approx(count, abs=2)


@pytest.mark.long
def test_exchanges_that_look_at_a_part_make_it_better_and_keep_the_whole(made: Chosen) -> None:
    before = timed.broken_off(made, [0.75])[0]
    found = weighed(made, again(made), {0.75: before / 2})
    assert timed.broken_off(found, [0.75])[0] < before or found.value < made.value
    assert found.seconds <= made.problem.seconds


@pytest.mark.long
def test_a_plan_that_grows_from_a_shorter_one_is_worth_as_much_when_broken_off(made: Chosen) -> None:
    small = choose.quick(made.problem.of_time(0.75 * made.problem.seconds))
    found = nested.grown(small, made.problem, again(made))
    assert found is not None and found.seconds <= made.problem.seconds and found.value < small.value
    begin = [dict(i.position) for i in small.cell.strategy.indexations[:-1]]
    assert [dict(i.position) for i in found.cell.strategy.indexations[: len(begin)]] == begin


@pytest.mark.long
def test_a_plan_says_what_plans_of_its_parts_reach(made: Chosen) -> None:
    found = nested.with_parts(made, again(made), 0.03, lambda part: choose.quick(part) if part.seconds > 200 else None)
    assert list(found.designed) == [0.75]
    assert found.value <= made.value * 1.03**2 and found.seconds <= made.problem.seconds
