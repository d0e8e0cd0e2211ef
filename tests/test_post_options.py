"""What a profile may state for an option: every kind of value, at the limit of what is allowed and right beyond it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from support.readback import golden

from postprocessors import Option, load, program, settings
from tango_cnc.records import InputError

MOST = 1000  # characters of a value, its quotes with it

TEXT, NUMBER, WHOLE = Option("a", "x", "text"), Option("b", 1.0, "number"), Option("c", 7000, "whole")
FLAG, TABLE = Option("d", False, "flag"), Option("e", {}, "table")
CHOICE = Option("f", "44", "choice", choices=("44", "100"))
MEMORY = Option("g", 512, "memory", instead="none")
CODE, STAR = Option("h", "", "code", codes=True), Option("i", "", "code", codes=True, also=r"\*")


def stated(option: Option, value: Any) -> Any:
    """→ the value as posts take it, of a post that has this option alone."""
    return settings(replace(load("fanuc"), options=(option,)), {option.name: value})[option.name]


ALLOWED: list[tuple[Option, Any, Any]] = [
    (TEXT, "", ""),
    (TEXT, "x" * (MOST - 2), "x" * (MOST - 2)),  # with its quotes as long as anything may be
    (NUMBER, 2, 2.0),
    (NUMBER, -0.5, -0.5),
    (WHOLE, 0, 0),
    (FLAG, True, True),
    (TABLE, {"B": "M11"}, {"B": "M11"}),
    (CHOICE, 44, "44"),
    (CHOICE, "100", "100"),
    (MEMORY, "none", "none"),
    (MEMORY, 64, 64),
    (CODE, "M80 P-1.5", "M80 P-1.5"),
    (STAR, "M80*", "M80*"),
]
REFUSED: list[tuple[Option, Any, str]] = [
    (TEXT, "x" * (MOST - 1), f"at most {MOST} characters"),
    (TEXT, 5, "a text"),
    (TEXT, None, "a text"),
    (NUMBER, True, "a number"),
    (NUMBER, "1", "a number"),
    (NUMBER, math.nan, "a finite number"),
    (NUMBER, math.inf, "a finite number"),
    (WHOLE, 1.0, "a whole number"),
    (WHOLE, True, "a whole number"),
    (FLAG, 1, "true or false"),
    (TABLE, ["M11"], "a mapping"),
    (CHOICE, 45, "44, 100"),
    (CHOICE, "none", "44, 100"),
    (MEMORY, "some", "a whole number, or none"),
    (CODE, "M80*", "capital letters"),
    (CODE, "m80", "capital letters"),
    (CODE, "M80\n", "capital letters"),
    (STAR, "M80(", "capital letters"),
]


@pytest.mark.parametrize(("option", "value", "taken"), ALLOWED)
def test_what_a_profile_may_state_is_taken_as_posts_need_it(option: Option, value: Any, taken: Any) -> None:
    found = stated(option, value)
    assert found == taken and type(found) is type(taken)


@pytest.mark.parametrize(("option", "value", "words"), REFUSED)
def test_what_it_may_not_state_is_refused_with_its_key_and_what_is_allowed(option: Option, value: Any, words: str) -> None:
    with pytest.raises(InputError, match=rf"^controller.{option.name}: found .*; allowed: .*{words}"):
        stated(option, value)


@pytest.mark.parametrize(
    ("post", "key", "good", "bad", "said"),
    [
        ("okuma", "common", (1, 192), (0, 193), "allowed: 1 … 192"),
        ("fanuc", "program_number", (1, 9995), (0, 9996), "allowed: 1"),
    ],
)
def test_a_number_is_taken_up_to_its_limits(post: str, key: str, good: tuple[int, int], bad: tuple[int, int], said: str) -> None:
    for value in good:
        assert program(load(post), golden(), {key: value}, "0" * 12)[2]()
    for value in bad:
        with pytest.raises(InputError, match=f"controller.{key}: found {value}; {said}"):
            list(program(load(post), golden(), {key: value}, "0" * 12)[2]())
