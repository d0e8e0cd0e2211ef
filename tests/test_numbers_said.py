"""Numbers within messages of plan and link: which touch, which column, how many more, how far. A person acts on them."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from support.blockcell import block, cell, machine

from tango_cnc.check import outside
from tango_cnc.check.travel import travel_text
from tango_cnc.link.entries import Reading
from tango_cnc.link.session import Session
from tango_cnc.link.trust import Distrust, next_in_order
from tango_cnc.link.words import words
from tango_cnc.plan import plan
from tango_cnc.records import InputError


@pytest.mark.parametrize(
    ("number", "done", "said"),
    [
        (7, 0, "touch 7 is not in the program"),
        (3, 1, "touch 3 is repeated or out of order: touch 3 was the last one"),
        (3, 3, "touch 3 is repeated or out of order: touch 5 was the last one"),
        (9, 0, "touch 9 came where touch 3 was due"),
    ],
)
def test_a_touch_out_of_order_is_named_with_the_one_before_or_the_one_that_was_due(number: int, done: int, said: str) -> None:
    with pytest.raises(Distrust, match=f"^{re.escape(said)}$"):
        next_in_order(number, (3, 4, 5, 8, 9), done)


@pytest.mark.parametrize(("line", "column"), [("?", 1), ("X1.0 ?", 6), ("X1.0 Y", 6)])
def test_where_a_line_is_no_list_of_words_the_column_is_counted_from_one(line: str, column: int) -> None:
    with pytest.raises(ValueError, match=rf"^no letter and number at column {column}$"):
        words(line)


@pytest.mark.parametrize(
    ("got", "said"),
    [
        (range(1, 15), ""),
        (range(1, 14), "the record of touch 14 was"),
        (range(1, 13), "the records of touch 13, 14 were"),
        (range(1, 5), "the records of touch 5, 6, 7, 8, 9, 10, 11, 12, 13, 14 were"),
        (range(1, 4), "the records of touch 4, 5, 6, 7, 8, 9, 10, 11, 12, 13 and 1 more were"),
        (range(1, 2), "the records of touch 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 3 more were"),
    ],
)
def test_records_that_are_missing_are_named_up_to_ten_and_the_others_counted(got: range, said: str) -> None:
    entries = [Reading(touch, "1", (0.0,), 1.0, "ok", None, None, (0,), "P1") for touch in got]
    session = SimpleNamespace(_journal=SimpleNamespace(entries=entries), _task=SimpleNamespace(original=tuple(range(1, 15))))
    assert Session._missing(cast(Any, session)) == said


def test_how_far_an_axis_would_have_to_go_is_said_in_its_unit_with_its_travel() -> None:
    made = machine("wCBXfZY(S)t")
    assert travel_text(made, "X", 4000.5) == "X 4000.500 mm, travel -4000 … 4000 mm"
    assert travel_text(made, "B", math.radians(721.5)) == "B 721.500 deg, travel -720 … 720 deg"


@pytest.mark.parametrize(("count", "more"), [(8, ""), (9, "  … and 1 more"), (18, "  … and 10 more")])
def test_touches_that_cannot_be_made_are_named_up_to_eight_and_the_others_counted(count: int, more: str) -> None:
    """The spindle comes from below: no touch of the top can be made there."""
    poses = [{"B": 180.0, "C": float(i)} for i in range(count)]
    with pytest.raises(InputError) as refused:
        plan(cell(machine("wCBXfZY(S)t"), block(), poses, facets=["5"]))
    lines = str(refused.value).split("\n")
    assert lines[0].endswith(f"no touch is left: a straight probe can make none of {count}:")
    assert re.match(r"  touch 1 \(facet 5, indexation 1: B 180 C 0", lines[1])
    assert re.match(r"  touch 8 \(facet 5, indexation 8: B 180 C 7", lines[8])
    assert (more in lines) if more else not any("more" in line for line in lines)


def test_an_axis_is_outside_beyond_the_hair_that_rounding_leaves() -> None:
    made = machine("wCBXfZY(S)t")
    at = np.zeros((7, len(made.names)))
    at[:, made.column("X")] = [4000.0, 4000.0 + 5e-7, 4000.5, 4100.0, -4000.0 - 5e-7, -4000.5, -5000.0]
    at[:, made.column("S")] = 1e6  # a spindle has no travel
    beyond = outside(made, at)
    assert beyond[:, made.column("X")].tolist() == [0.0, 0.0, 0.5, 100.0, 0.0, -0.5, -1000.0]
    assert not np.delete(beyond, made.column("X"), axis=1).any()
