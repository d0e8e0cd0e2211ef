"""Expressions of parametric programs (#1, #<name>, brackets, functions, comparisons) → functions of the variables."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any

Value = float | None  # None: a variable that holds nothing
Get = Callable[[int | str], Value]
Expression = Callable[[Get], Value]

LONGEST = 300  # characters of an expression; a longer one would be as deep as Python can go
DEEPEST = 40  # brackets in it
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
TOKEN = re.compile(r"\s*(\d+\.?\d*|\.\d+|#<\w+>|\*\*|[A-Z]{2,4}|[-+*/#\[\]])")
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "ABS": abs,
    "SQRT": math.sqrt,
    "FIX": math.trunc,
    "POT": lambda a: a * a,
    "SIN": lambda a: math.sin(math.radians(a)),
}
LEVELS: tuple[dict[str, Callable[[Any, Any], float]], ...] = (
    {"AND": lambda a, b: float(bool(a) and bool(b)), "OR": lambda a, b: float(bool(a) or bool(b))},
    {
        "EQ": lambda a, b: float(a == b),
        "NE": lambda a, b: float(a != b),
        "GT": lambda a, b: float(a > b),
        "GE": lambda a, b: float(a >= b),
        "LT": lambda a, b: float(a < b),
        "LE": lambda a, b: float(a <= b),
    },
    {"+": lambda a, b: a + b, "-": lambda a, b: a - b},
    {"*": lambda a, b: a * b, "/": lambda a, b: a / b},
    {"**": lambda a, b: a**b},
)


@lru_cache(maxsize=4096)
def expression(text: str) -> Expression:
    """text → function of the variables. Raises ValueError for what is no expression."""
    if len(text) > LONGEST or text.count("[") > DEEPEST:
        raise ValueError(f"an expression of {len(text)} characters and {text.count('[')} brackets, which no control takes")
    tokens, at = [], 0
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            raise ValueError(f"no expression at {text[at:]!r}")
        tokens.append(match[1])
        at = match.end()
    tokens.reverse()
    result = _level(tokens, 0)
    if tokens:
        raise ValueError(f"no expression at {tokens[-1]!r}")
    return result


@lru_cache(maxsize=4096)
def constant(text: str) -> tuple[float, ...]:
    """text → its value where it is one number and nothing else, which is the same whatever has gone wrong; none elsewhere."""
    return (float(text) or 0.0,) if len(text) <= LONGEST and NUMBER.fullmatch(text) else ()


def _level(tokens: list[str], depth: int) -> Expression:
    if depth == len(LEVELS):
        return _primary(tokens)
    left = _level(tokens, depth + 1)
    while tokens and tokens[-1] in LEVELS[depth]:
        word = tokens.pop()
        left = _joined(word, LEVELS[depth][word], left, _level(tokens, depth + 1))
    return left


def _joined(word: str, join: Callable[[Any, Any], float], left: Expression, right: Expression) -> Expression:
    if word in ("EQ", "NE"):  # a variable that is empty equals another empty one, and no number, not even 0
        return lambda get: join(left(get), right(get))
    return lambda get: join(left(get) or 0.0, right(get) or 0.0)


def _primary(tokens: list[str]) -> Expression:
    if not tokens:
        raise ValueError("the expression ends too soon")
    word = tokens.pop()
    if word in FUNCTIONS:
        function, inner = FUNCTIONS[word], _bracket(tokens)
        return lambda get: function(inner(get) or 0.0)
    if word in "+-":
        operand, sign = _primary(tokens), -1.0 if word == "-" else 1.0
        return lambda get: sign * (operand(get) or 0.0)
    if word == "[":
        tokens.append(word)
        return _bracket(tokens)
    if word == "#":
        if tokens and tokens[-1] == "[":
            place = _bracket(tokens)
            return lambda get: get(_whole(place(get) or 0.0))
        if not tokens or not tokens[-1].isdigit():
            raise ValueError("# without a number")
        number = int(tokens.pop())
        return lambda get: get(number)
    if word.startswith("#<"):
        return lambda get: get(word[2:-1])
    try:
        constant = float(word)
    except ValueError:
        raise ValueError(f"no expression at {word!r}") from None
    return lambda get: constant


def _whole(number: float) -> int:
    if number != int(number):
        raise ValueError(f"# of {number:g}, which some controls round and others cut off")
    return int(number)


def _bracket(tokens: list[str]) -> Expression:
    if not tokens or tokens.pop() != "[":
        raise ValueError("[ is missing")
    inner = _level(tokens, 0)
    if not tokens or tokens.pop() != "]":
        raise ValueError("] is missing")
    return inner
