"""A design leaves out what has no safe way past an obstacle; a time that is plainly too short is refused before the search."""

from __future__ import annotations

import itertools
import math
import random
import re
from dataclasses import replace
from pathlib import Path

import pytest

from tango_cnc.cli import guarded, tango
from tango_cnc.design import choose, how_long, order
from tango_cnc.design.ways import reason
from tango_cnc.files import read_cell
from tango_cnc.plan import attempt, plan
from tango_cnc.records import Cell, Indexation, InputError, Obstacle, Strategy

EXAMPLES = Path(__file__).parents[1] / "examples"
COLUMN = Obstacle("box", low=(230, -100, -300), high=(300, 100, 900), on="f", title="column")
POSES = ((0, 0), (-60, 0), (-60, 90), (0, 90), (30, 180))  # A, C in degrees


def trunnion(*obstacles: Obstacle) -> Cell:
    """The example with a short strategy that turns past a column beside the table."""
    cell = read_cell(EXAMPLES / "trunnion")
    facets = [next(f for f, each in cell.artefact.facets.items() if each.normal[2] > 0.9)]
    visits = [Indexation({"A": math.radians(a), "C": math.radians(c), "S": 0.0}, tuple(facets)) for a, c in POSES]
    strategy = Strategy("turns", cell.strategy.approach, tuple(visits))
    return replace(cell, machine=replace(cell.machine, obstacles=obstacles), strategy=strategy)


def test_without_anything_in_the_way_an_attempt_is_the_plan() -> None:
    cell = trunnion()
    made, faults = attempt(cell, "leave-out")
    assert not faults and list(made.moves) == list(plan(cell, "leave-out").moves)


@pytest.mark.parametrize("seed", range(20))
def test_a_walk_makes_every_turn_that_is_possible_in_a_possible_direction(seed: int) -> None:
    rng = random.Random(seed)
    count = rng.randint(2, 9)
    closed = {pair for pair in itertools.permutations(range(count), 2) if rng.random() < 0.4}
    walked = set(itertools.pairwise(order._walk(count, closed)))
    for pair in itertools.combinations(range(count), 2):
        open_ways = {pair, pair[::-1]} - closed
        assert not open_ways or open_ways & walked


@pytest.mark.long
def test_what_is_in_the_way_is_a_fault_of_one_turn_and_the_rest_of_the_plan_is_made() -> None:
    cell = trunnion(COLUMN)
    with pytest.raises(InputError, match=r"A -60 C 90 S 0\): the table would come within 5 mm of obstacle 1"):
        plan(cell, "leave-out")
    made, faults = attempt(cell, "leave-out")
    assert list(faults) == [3] and len(made.touches) == len(POSES)
    assert reason(faults[3]) == "the table would come within 5 mm of obstacle 1 of machine.yaml (column, on f) while the axes turn"


@pytest.mark.long
def test_a_turn_past_a_column_is_closed_and_the_others_are_timed() -> None:
    cell = trunnion(COLUMN)
    times, faults = order.turns(cell, cell.strategy.indexations, 6000.0)
    assert (1, 2) in faults and (times[0, 1:] > 0).all()
    again, none = order.turns(cell, cell.strategy.indexations[:2], 6000.0, {(0, 1), (1, 0)})
    assert not none and again[0, 1] != again[0, 1]  # looked at before: NaN


@pytest.mark.long
def test_a_time_for_fewer_touches_than_unknowns_is_refused_before_anything_is_searched(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def searched(*_: object) -> None:
        raise AssertionError("searched")

    monkeypatch.setattr(choose, "_tried", searched)
    monkeypatch.setattr(how_long, "needed", lambda *_: 30.0)  # a quick choice for longer and longer times
    asked = ["design", "-C", str(EXAMPLES / "split"), "--goal", "volume", "--minutes", "4"]
    assert guarded(tango.main, asked, standalone_mode=False) == 2
    said = capsys.readouterr().err
    assert re.search(
        r"--minutes: found 4; there is time for about \d+ touches, and the goal has \d+ unknowns besides those of the facets; ",
        said,
    )
    assert re.search(r"allowed: more than [\d.]+ minutes \(about 30\), or ", said)
    assert "--within MM" in said and f"--terms S3 instead of S4: tango {' '.join(asked)} --terms S3" in " ".join(said.split())


@pytest.mark.long
def test_what_a_quick_choice_of_more_time_does_not_determine_is_refused_before_the_long_search(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def searched(*_: object) -> None:
        raise AssertionError("searched")

    monkeypatch.setattr(choose, "_in_a_row", searched)
    monkeypatch.setattr(choose, "serves", lambda *_: False)
    monkeypatch.setattr(choose, "in_vain", lambda *_: True)
    monkeypatch.setattr(how_long, "needed", lambda *_: 30.0)
    asked = ["design", "-C", str(EXAMPLES / "three_axis_calibrated"), "--goal", "locations", "--minutes", "5", "--within", "0.3"]
    assert guarded(tango.main, asked, standalone_mode=False) == 2
    assert re.search(r"its \d+ touches do not determine all .* about 30 minutes or more", capsys.readouterr().err)
