"""Long plans: a program is written line by line, so that its length costs time and no memory."""

from __future__ import annotations

import pytest
from support.memory import growth


@pytest.mark.long
@pytest.mark.parametrize("post", ["linuxcnc", "fanuc", "heidenhain"])
def test_a_program_is_never_in_memory_as_a_whole(post: str) -> None:
    """Lines that are kept would be noticed."""
    bytes_a_byte, of_kept_lines = growth(f"program.{post}", f"program.{post} kept")
    assert bytes_a_byte < 0.3
    assert of_kept_lines > 1


@pytest.mark.long
def test_plan_csv_is_never_in_memory_as_a_whole() -> None:
    """Lines that are kept would be noticed."""
    bytes_a_byte, of_kept_lines = growth("plan.csv", "plan.csv kept")
    assert bytes_a_byte < 0.3
    assert of_kept_lines > 1


@pytest.mark.long
def test_a_plan_takes_little_more_than_the_list_of_its_touches() -> None:
    """Two touches an indexation; of what is made and not kept there is a block at a time. Records would be noticed."""
    bytes_a_touch, of_records = growth("plan", "plan kept")
    assert 100 < bytes_a_touch < 300
    assert 1000 < of_records < 9000


@pytest.mark.few(0)
def test_a_strategy_is_read_into_little_more_than_its_words() -> None:
    """yaml's own nodes take so much that this measures it."""
    bytes_a_touch, of_nodes = growth("strategy", "strategy as nodes")
    assert bytes_a_touch < 1000
    assert of_nodes > 2000
