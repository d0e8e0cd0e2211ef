"""Expressions in square brackets, `ABS[VAPAX-PX]+2.5*[TGS-1]`: a family states its names, functions and operators."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Value = float | None  # None: a variable that holds nothing
Get = Callable[[str, float | None], Value]  # name, index in brackets or None → value
Operator = Callable[[float, float], float]

ARITHMETIC: tuple[Mapping[str, Operator], ...] = (
    {"+": lambda a, b: a + b, "-": lambda a, b: a - b},
    {"*": lambda a, b: a * b, "/": lambda a, b: a / b},
)
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "ABS": abs,
    "SQRT": math.sqrt,
    "SIN": lambda v: math.sin(math.radians(v)),
    "COS": lambda v: math.cos(math.radians(v)),
    "FIX": lambda v: float(math.floor(v)) if v >= 0 else float(math.ceil(v)),
    "FUP": lambda v: float(math.ceil(v)) if v >= 0 else float(math.floor(v)),
    "ROUND": lambda v: math.copysign(math.floor(abs(v) + 0.5), v),
}


class Mistake(Exception):
    """What the control complains of: `kind` is syntax, arithmetic or empty."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


@dataclass(frozen=True)
class Grammar:
    """What differs: how a token looks (groups number, name, sign), functions, operators from the loosest to the tightest."""

    token: re.Pattern[str]
    functions: Mapping[str, Callable[[float], float]]
    levels: tuple[Mapping[str, Operator], ...]
    compare: Mapping[str, Operator]  # those that take a variable that holds nothing


class Reader:
    """Reads one text from the left; `at` is where it stands. Raises Mistake."""

    def __init__(self, text: str, grammar: Grammar, get: Get, at: int = 0) -> None:
        self.text, self.at, self._grammar, self._get = text, at, grammar, get

    def value(self) -> Value:
        """→ value of the expression that begins here."""
        return self._level(0)

    def number(self) -> float:
        """→ the same, of a variable that holds something."""
        return held(self.value(), self.text)

    def whole(self) -> Value:
        """→ value of the expression that is all there is."""
        value = self.value()
        if self.text[self.at :].strip():
            raise Mistake("syntax", self.text[self.at :])
        return value

    def take(self, *wanted: str) -> str | None:
        """→ the next token if it is one of these, which is then read; else None."""
        _, token, end = self._next()
        if token not in wanted:
            return None
        self.at = end
        return token

    def _next(self) -> tuple[str, str, int]:
        match = self._grammar.token.match(self.text, self.at)
        if match is None or match.lastgroup is None:
            return "end", "", self.at
        return match.lastgroup, match[match.lastgroup], match.end()

    def _level(self, depth: int) -> Value:
        if depth == len(self._grammar.levels):
            return self._primary()
        operators = self._grammar.levels[depth]
        left = self._level(depth + 1)
        while (word := self.take(*operators)) is not None:
            left = self._combined(word, operators[word], left, self._level(depth + 1))
        return left

    def _combined(self, word: str, operator: Operator, left: Value, right: Value) -> float:
        if word in self._grammar.compare and (left is None or right is None):
            return float(self._grammar.compare[word](float(left is None), float(right is None)))
        try:
            return float(operator(held(left, self.text), held(right, self.text)))
        except (ZeroDivisionError, OverflowError, ValueError):
            raise Mistake("arithmetic", self.text) from None

    def _primary(self) -> Value:
        kind, token, end = self._next()
        if kind == "end":
            raise Mistake("syntax", self.text[self.at :] or self.text)
        self.at = end
        if token in ("+", "-"):
            return (1.0 if token == "+" else -1.0) * held(self._primary(), self.text)
        if token == "[":
            return self._closed()
        if kind == "number":
            return float(token)
        if kind != "name":
            raise Mistake("syntax", token)
        if token in self._grammar.functions:
            if self.take("[") is None:
                raise Mistake("syntax", self.text)
            try:
                return float(self._grammar.functions[token](held(self._closed(), self.text)))
            except (ValueError, OverflowError):
                raise Mistake("arithmetic", self.text) from None
        index = held(self._closed(), self.text) if self.take("[") else None
        return self._get(token, index)

    def _closed(self) -> Value:
        value = self.value()
        if self.take("]") is None:
            raise Mistake("syntax", f"']' expected in {self.text!r}")
        return value


def held(value: Value, where: str) -> float:
    """value → number. Raises Mistake for a variable that holds nothing, or too much."""
    if value is None:
        raise Mistake("empty", where)
    if not math.isfinite(value):
        raise Mistake("arithmetic", where)
    return value
