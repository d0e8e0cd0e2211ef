"""Values of RS-274/NGC: numbers, parameters, brackets, functions, operators; read from condensed lower-case text.

NIST RS274/NGC version 3 (NISTIR 6556) sections 3.3.2.2 to 3.3.2.4, and the relations that LinuxCNC added (gcode/overview.adoc).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from .._shared.alarm import Alarm

Key = int | str
Get = Callable[[Key], float]
Operator = Callable[[float, float], float]

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
_NAME = re.compile(r"#<([^<>]+)>")
_EXISTS = re.compile(r"exists\[#<([^<>]+)>\]")
_FUNCTION = re.compile(r"(abs|acos|asin|atan|cos|exp|fix|fup|ln|round|sin|sqrt|tan)(?=\[)")


def _truth(test: Callable[[float, float], bool]) -> Operator:
    return lambda a, b: float(test(a, b))


def _divided(a: float, b: float) -> float:
    if b == 0:
        raise Alarm("RS274", "Attempt to divide by zero")
    return a / b


def _modulo(a: float, b: float) -> float:
    if b == 0:
        raise Alarm("RS274", "Attempt to divide by zero")
    return math.fmod(a, b) + (abs(b) if math.fmod(a, b) < 0 else 0.0)


def _power(a: float, b: float) -> float:
    if a < 0 and b != round(b):
        raise Alarm("RS274", "Attempt to raise negative to non-integer power")
    return float(a**b)


LOGIC: Mapping[str, Operator] = {
    "and": _truth(lambda a, b: a != 0 and b != 0),
    "xor": _truth(lambda a, b: (a != 0) != (b != 0)),
    "or": _truth(lambda a, b: a != 0 or b != 0),
}
RELATIONS: Mapping[str, Operator] = {
    "eq": _truth(lambda a, b: a == b),
    "ne": _truth(lambda a, b: a != b),
    "gt": _truth(lambda a, b: a > b),
    "ge": _truth(lambda a, b: a >= b),
    "lt": _truth(lambda a, b: a < b),
    "le": _truth(lambda a, b: a <= b),
}
SUMS: Mapping[str, Operator] = {"+": lambda a, b: a + b, "-": lambda a, b: a - b}
PRODUCTS: Mapping[str, Operator] = {"*": lambda a, b: a * b, "/": _divided, "mod": _modulo}
POWERS: Mapping[str, Operator] = {"**": _power}
NIST = ({**SUMS, **LOGIC}, PRODUCTS, POWERS)  # logical operators bind like sums there
LINUXCNC = (LOGIC, RELATIONS, SUMS, PRODUCTS, POWERS)
Levels = tuple[Mapping[str, Operator], ...]


class Reader:
    """A position in condensed text; every method takes what it reads. Raises Alarm where a control would complain."""

    def __init__(self, text: str, get: Get, levels: Levels = LINUXCNC) -> None:
        self.text, self.at, self._get, self._levels = text, 0, get, levels

    @property
    def done(self) -> bool:
        """→ whether nothing is left."""
        return self.at >= len(self.text)

    def take(self, what: str) -> bool:
        """text → whether it stood here, and was taken."""
        if self.text.startswith(what, self.at):
            self.at += len(what)
            return True
        return False

    def key(self) -> Key:
        """#… → number or name of the parameter."""
        if match := _NAME.match(self.text, self.at):
            self.at = match.end()
            return match[1]
        if not self.take("#"):
            raise self.wrong("a parameter")
        value = self.value()
        if abs(value - round(value)) > 1e-4:
            raise Alarm("RS274", "Non integer value for integer", self.text)
        return round(value)

    def value(self) -> float:
        """Number, parameter, bracket or function."""
        if self.text.startswith("#", self.at):
            return self._get(self.key())
        if self.text.startswith("[", self.at):
            return self.bracket()
        if match := _EXISTS.match(self.text, self.at):
            self.at = match.end()
            return self._exists(match[1])
        if match := _FUNCTION.match(self.text, self.at):
            self.at = match.end()
            return self._function(match[1])
        for sign, factor in (("-", -1.0), ("+", 1.0)):
            behind = self.text.startswith((f"{sign}#", f"{sign}["), self.at) or _FUNCTION.match(self.text, self.at + 1)
            if behind and self.take(sign):
                return factor * self.value()
        match = _NUMBER.match(self.text, self.at)
        if match is None:
            raise self.wrong("a number")
        self.at = match.end()
        return float(match[0])

    def _exists(self, name: str) -> float:
        try:
            self._get(name)
        except Alarm:
            return 0.0
        return 1.0

    def bracket(self) -> float:
        """[expression]."""
        if not self.take("["):
            raise self.wrong("[")
        value = self._level(0)
        if not self.take("]"):
            raise self.wrong("]")
        return value

    def whole(self) -> float:
        """An expression without brackets around it, as some relatives allow."""
        return self._level(0)

    def wrong(self, due: str) -> Alarm:
        """→ the complaint that something else is due here."""
        return Alarm("RS274", "Bad format", f"{due} expected at {self.text[self.at :]!r} of {self.text!r}")

    def _level(self, depth: int) -> float:
        if depth == len(self._levels):
            return self.value()
        left = self._level(depth + 1)
        while word := next((w for w in self._levels[depth] if self.text.startswith(w, self.at)), None):
            if word == "*" and self.text.startswith("**", self.at):
                break
            self.at += len(word)
            left = self._levels[depth][word](left, self._level(depth + 1))
        return left

    def _function(self, name: str) -> float:
        x = self.bracket()
        if name == "atan":
            if not self.take("/"):
                raise self.wrong("/")
            return math.degrees(math.atan2(x, self.bracket()))
        if (name in ("acos", "asin") and abs(x) > 1) or (name == "sqrt" and x < 0) or (name == "ln" and x <= 0):
            raise Alarm("RS274", f"Argument to {name} out of range", f"{x:g}")
        table: dict[str, Callable[[float], float]] = {
            "abs": abs,
            "acos": lambda v: math.degrees(math.acos(v)),
            "asin": lambda v: math.degrees(math.asin(v)),
            "cos": lambda v: math.cos(math.radians(v)),
            "exp": math.exp,
            "fix": math.floor,
            "fup": math.ceil,
            "ln": math.log,
            "round": lambda v: math.copysign(math.floor(abs(v) + 0.5), v),
            "sin": lambda v: math.sin(math.radians(v)),
            "sqrt": math.sqrt,
            "tan": lambda v: math.tan(math.radians(v)),
        }
        return float(table[name](x))
