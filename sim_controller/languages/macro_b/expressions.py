"""Expressions of Custom Macro B: `[#1+SIN[#2]*2.5]`, conditions included; a vacant variable is None.

Order of operations: functions, then * / AND MOD, then + - OR XOR, then EQ NE GT LT GE LE; at most five brackets deep.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from .alarms import alarm

Value = float | bool | None
Get = Callable[[int], float | None]

_INDEX = re.compile(r"\d+")
_NUMBER = re.compile(r"\d+\.?\d*|\.\d+")
_FUNCTION = re.compile(r"(ASIN|ACOS|ATAN|SQRT|ABS|SIN|COS|TAN|ROUND|FIX|FUP|LN|EXP|BIN|BCD)\[")
_PRODUCT = re.compile(r"\*|/|AND|MOD")
_SUM = re.compile(r"\+|-|XOR|OR")
_COMPARE = re.compile(r"EQ|NE|GT|LT|GE|LE")
DEEPEST = 5
DIGITS = 12


class Expression:
    """Reads one text from the left; `at` is where it stands."""

    def __init__(self, text: str, get: Get, at: int = 0) -> None:
        self.text, self.at = text, at
        self._get, self._depth = get, 0

    def value(self) -> Value:
        """→ value of the expression that begins here. Raises Alarm when it is none."""
        left = self._sum()
        operator = self._take(_COMPARE)
        if operator is None:
            return left
        return _compare(operator, left, self._sum())

    def bracketed(self) -> Value:
        """→ value of the `[…]` that begins here."""
        if not self.text.startswith("[", self.at):
            raise alarm("PS0114", f"'[' expected in {self.text!r}")
        self.at += 1
        self._depth += 1
        if self._depth > DEEPEST:
            raise alarm("PS0118", self.text)
        value = self.value()
        if not self.text.startswith("]", self.at):
            raise alarm("PS0114", f"']' expected in {self.text!r}")
        self.at += 1
        self._depth -= 1
        return value

    def reference(self) -> int:
        """`#5`, `#[#1+2]`, `##3` → number of the variable meant."""
        self.at += 1
        if self.text.startswith("[", self.at):
            number = self.bracketed()
        elif self.text.startswith("#", self.at):
            number = self._get(self.reference())
        else:
            match = _INDEX.match(self.text, self.at)
            if match is None:
                raise alarm("PS0114", f"variable number expected in {self.text!r}")
            self.at = match.end()
            number = float(match.group())
        index = arithmetic(number)
        if index != math.floor(index) or index < 0:
            raise alarm("PS0115", f"#{index:g}")
        return int(index)

    def primary(self) -> Value:
        """→ value of a number, variable, function or bracket, with its sign."""
        sign = 1.0
        signed = False
        while self.text.startswith(("+", "-"), self.at):
            sign, signed = (-sign if self.text[self.at] == "-" else sign), True
            self.at += 1
        value = self._unsigned()
        return sign * arithmetic(value) if signed else value

    def _unsigned(self) -> Value:
        if self.text.startswith("#", self.at):
            return self._get(self.reference())
        if self.text.startswith("[", self.at):
            return self.bracketed()
        function = _FUNCTION.match(self.text, self.at)
        if function:
            return self._function(function[1])
        number = self._take(_NUMBER)
        if number is None:
            raise alarm("PS0114", f"{self.text[self.at :]!r} in {self.text!r}")
        if len(number.replace(".", "")) > DIGITS:
            raise alarm("PS0003", number)
        return float(number)

    def _function(self, name: str) -> float:
        self.at += len(name)
        argument = arithmetic(self.bracketed())
        if name == "ATAN":
            if self.text.startswith("/[", self.at):
                self.at += 1
                return math.degrees(math.atan2(argument, arithmetic(self.bracketed()))) % 360
            return math.degrees(math.atan(argument))
        return function(name, argument)

    def _sum(self) -> Value:
        value = self._product()
        while (operator := self._take(_SUM)) is not None:
            value = _combine(operator, value, self._product())
        return value

    def _product(self) -> Value:
        value = self.primary()
        while (operator := self._take(_PRODUCT)) is not None:
            value = _combine(operator, value, self.primary())
        return value

    def _take(self, pattern: re.Pattern[str]) -> str | None:
        match = pattern.match(self.text, self.at)
        if match is None:
            return None
        self.at = match.end()
        return match.group()


def arithmetic(value: Value) -> float:
    """value → number; vacant counts as 0. Raises Alarm for a truth value."""
    if isinstance(value, bool):
        raise alarm("PS0114", "a condition used as a number")
    return 0.0 if value is None else value


def half_away(value: float) -> float:
    """→ nearest whole number, halves away from zero."""
    return math.copysign(math.floor(abs(value) + 0.5), value)


def function(name: str, x: float) -> float:
    """name, argument → value, angles in degrees. Raises Alarm outside the range of the function."""
    if (name in ("ASIN", "ACOS") and abs(x) > 1) or (name == "SQRT" and x < 0) or (name == "LN" and x <= 0):
        raise alarm("PS0119", f"{name}[{x:g}]")
    if name in ("BIN", "BCD"):
        base, other = (10, 16) if name == "BCD" else (16, 10)
        digits, rest, place = 0, int(abs(x)), 1
        while rest:
            rest, digit = divmod(rest, base)
            digits, place = digits + digit * place, place * other
        return float(digits)
    table: dict[str, Callable[[float], float]] = {
        "SIN": lambda v: math.sin(math.radians(v)),
        "COS": lambda v: math.cos(math.radians(v)),
        "TAN": lambda v: math.tan(math.radians(v)),
        "ASIN": lambda v: math.degrees(math.asin(v)),
        "ACOS": lambda v: math.degrees(math.acos(v)),
        "SQRT": math.sqrt,
        "ABS": abs,
        "ROUND": half_away,
        "FIX": lambda v: float(math.trunc(v)),
        "FUP": lambda v: math.copysign(math.ceil(abs(v)), v),
        "LN": math.log,
        "EXP": math.exp,
    }
    try:
        return float(table[name](x))
    except OverflowError:
        raise alarm("PS0119", f"{name}[{x:g}]") from None


def _combine(operator: str, left: Value, right: Value) -> Value:
    if isinstance(left, bool) and isinstance(right, bool) and operator in ("AND", "OR", "XOR"):
        return {"AND": left and right, "OR": left or right, "XOR": left != right}[operator]
    a, b = arithmetic(left), arithmetic(right)
    if operator in ("AND", "OR", "XOR"):
        i, j = int(half_away(a)), int(half_away(b))
        return float({"AND": i & j, "OR": i | j, "XOR": i ^ j}[operator])
    if operator in ("/", "MOD"):
        if b == 0:
            raise alarm("PS0112")
        return a / b if operator == "/" else math.fmod(a, b)
    return {"+": a + b, "-": a - b, "*": a * b}[operator]


def _compare(operator: str, left: Value, right: Value) -> bool:
    """Vacant and 0 are different for EQ and NE, and the same for the others."""
    if operator in ("EQ", "NE"):
        same = (left is None) == (right is None) and arithmetic(left) == arithmetic(right)
        return same == (operator == "EQ")
    a, b = arithmetic(left), arithmetic(right)
    return {"GT": a > b, "LT": a < b, "GE": a >= b, "LE": a <= b}[operator]
