"""Numbers of a control that a person has read back: a file that lost rows, was cut off, or has one row that stands alone."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.compensated import first

from tango_cnc.compensate import Proposal, propose, targets
from tango_cnc.compensate.hidden import Present
from tango_cnc.compensate.targets import COMPARE
from tango_cnc.records import InputError

TABLES = [name for name in targets.names() if name not in ("haas", "grblhal", "fagor")]  # those have centers alone


def given(target: str, numbers: dict[str, float], open_end: bool = False) -> Proposal:
    return propose(first("trunnion"), target, (), Present(numbers, {}, open_end), poses=64, tcp=True)


def stored(target: str) -> Proposal:
    return propose(first("trunnion"), target, poses=64)


@pytest.mark.few(1)
@pytest.mark.parametrize("target", TABLES)
def test_a_table_that_lost_a_row_is_refused(target: str) -> None:
    """Its row was taken as 0, which is a step in the table that is written."""
    proposal = stored(target)
    rows = [h for h in proposal.held if h.at is not None]
    if not rows:
        assert target == "iso230"
        return
    numbers = dict(proposal.numbers)
    lost = [h for h in rows if h.table == rows[0].table][1]
    del numbers[lost.place]
    with pytest.raises(InputError) as refused:
        given(target, numbers)
    said = str(refused.value)
    assert lost.place in said and "allowed: every row of a table, or none of it" in said and "read back from the control" in said


def test_a_file_that_was_cut_within_a_number_is_refused_and_a_whole_one_may_end_as_it_likes() -> None:
    numbers = dict(stored("siemens").numbers)
    assert not given("siemens", numbers, open_end=True).doubts
    with pytest.raises(InputError, match=r"found 2 of the \d+ numbers .* last line without an end; allowed: a whole file"):
        given("siemens", dict(list(numbers.items())[:2]), open_end=True)


@pytest.mark.few(0)
@pytest.mark.parametrize("target", ["siemens", "fanuc", "heidenhain", "value_sheet", "linuxcnc", "centroid"])
def test_a_row_that_stands_alone_and_a_table_of_other_increments_are_doubts(target: str) -> None:
    """0.9 mm among rows of 1 µm; all rows ten and a hundred times as large."""
    proposal = stored(target)
    numbers = dict(proposal.numbers)
    assert not given(target, numbers).doubts
    rows = [h for h in proposal.held if h.at is not None and h.kind == "length"]
    table = [h for h in rows if h.table == rows[0].table and h.sense == rows[0].sense]
    alone = table[len(table) // 2]
    doubts = given(target, numbers | {alone.place: alone.number(0.9)}).doubts
    assert any(f"{alone.place} is more than 3 times as far" in doubt for doubt in doubts), doubts
    assert any(f"{alone.place} takes away 0.9 mm; few machines need more than 0.2 mm" in doubt for doubt in doubts), doubts
    largest = max(abs(h.value(numbers[h.place])) for h in rows)
    larger = numbers | {h.place: h.number(h.value(numbers[h.place]) * 0.5 / largest) for h in rows}
    assert any("it may count other increments" in doubt for doubt in given(target, larger).doubts)


@pytest.mark.long
def test_points_of_a_table_that_was_made_for_other_touches_are_its_points() -> None:
    """The touches of every run end elsewhere by some micrometers, and the control still has the points of the run before."""
    proposal = stored("siemens")
    moved = {}
    for h in proposal.held:
        place, cut = h.place, h.place.rpartition(" at ")
        if h.at is not None:
            axis, at, unit = cut[2].split()
            place = f"{cut[0]} at {axis} {float(at) + 0.004:g} {unit}"
        moved[place] = proposal.numbers[h.place]
    assert set(moved) != set(proposal.numbers)
    assert given("siemens", moved).present == given("siemens", dict(proposal.numbers)).present
    far = {place.replace(" mm", "5 mm"): number for place, number in moved.items()}
    with pytest.raises(InputError, match=r"points? (at|from)"):
        given("siemens", {**far, **{"ENC_COMP X at X 17.5 mm": 0.001}})


@pytest.mark.long
def test_whoever_loads_the_files_compares_first() -> None:
    """Numbers that nobody can recognise as wrong, a turned sign say, are met there."""
    for target in TABLES:
        steps = targets.load(target).steps(replace(stored(target).request))
        assert COMPARE in steps or any("Compare" in step for step in steps), target
