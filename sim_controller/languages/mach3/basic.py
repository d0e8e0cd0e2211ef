"""The part of Basic (Cypress Enable) that Mach3's macros are written in: assignments, If, While, calls, files.

`Host` is the control: functions and statements by lower-case name. Whatever is not known is an Alarm, never ignored.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from .._shared.alarm import Alarm

Value = float | str
Host = Mapping[str, Callable[..., Any]]

TOKEN = re.compile(r'\s*("[^"]*"|\d+\.?\d*|\.\d+|<>|<=|>=|[A-Za-z_]\w*|[-+*/&=<>(),#])')
COMPARE: Mapping[str, Callable[[Any, Any], bool]] = {
    "=": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
}
LONGEST = 10_000  # statements without a line of a file between: a loop that never ends


def _format(value: float, form: str) -> str:
    match = re.fullmatch(r"0(?:\.(0+))?", form)
    if match is None:
        raise Alarm("BASIC", f"format {form}")
    return f"{value:.{len(match[1] or '')}f}"


LIBRARY: Host = {
    "abs": abs,
    "sqr": math.sqrt,
    "sin": math.sin,
    "int": math.floor,
    "len": lambda text: float(len(text)),
    "instr": lambda text, part: float(text.find(part) + 1),
    "mid": lambda text, start, count: text[int(start) - 1 : int(start) - 1 + int(count)],
    "format": _format,
}


@lru_cache(10_000)
def _tokens(text: str) -> tuple[str, ...]:
    """expression → its tokens, the last one first; the turns of a loop ask for the same. Raises Alarm for none."""
    tokens, at = [], 0
    while text[at:].strip():
        match = TOKEN.match(text, at)
        if match is None:
            raise Alarm("BASIC", "no expression", text)
        tokens.append(match[1])
        at = match.end()
    return tuple(reversed(tokens))


class Leave(Exception):
    """Exit Sub."""


class Script:
    """One macro on its way."""

    def __init__(self, text: str, host: Host) -> None:
        self._lines = [re.sub(r"^([^'\"]*(?:\"[^\"]*\"[^'\"]*)*)'.*$", r"\1", line).strip() for line in text.splitlines()]
        self._host = {**LIBRARY, **host}
        self._values: dict[str, Value] = {}
        self._steps = 0

    def run(self) -> None:
        """Carries the macro out. Raises Alarm where Basic would complain."""
        try:
            self._block(0, len(self._lines))
        except Leave:
            return
        except (TypeError, ValueError, LookupError, ArithmeticError) as error:
            raise Alarm("BASIC", f"{type(error).__name__}: {error}") from None

    def _block(self, index: int, end: int) -> None:
        while index < end:
            self._steps += 1
            if self._steps > LONGEST:
                raise Alarm("BASIC", "the macro never ends")
            line = self._lines[index]
            word = line.split("(")[0].split(" ")[0].lower() if line else ""
            if word == "while":
                after = self._partner(index, end, "while", "wend")
                while self._whole(line[5:]):
                    self._block(index + 1, after)
                    self._steps += 1
                    if self._steps > LONGEST:
                        raise Alarm("BASIC", "the macro never ends", line)
                index = after + 1
            elif word == "if" and line.lower().endswith(" then"):
                index = self._if(index, end)
            else:
                self._statement(line)
                index += 1

    def _if(self, index: int, end: int) -> int:
        last = self._partner(index, end, "if", "end if")
        otherwise = self._otherwise(index, last)
        if self._whole(self._lines[index][2:-4]):
            self._block(index + 1, otherwise)
        elif otherwise < last:
            self._block(otherwise + 1, last)
        return last + 1

    def _otherwise(self, index: int, last: int) -> int:
        depth = 0
        for i in range(index + 1, last):
            low = self._lines[i].lower()
            depth += (low.startswith("if ") and low.endswith(" then")) - (low == "end if")
            if depth == 0 and low == "else":
                return i
        return last

    def _partner(self, index: int, end: int, opens: str, closes: str) -> int:
        depth = 0
        for i in range(index, end):
            low = self._lines[i].lower()
            depth += low.startswith(f"{opens} ") and (opens != "if" or low.endswith(" then"))
            depth -= low == closes
            if depth == 0:
                return i
        raise Alarm("BASIC", f"{closes} is missing", self._lines[index])

    def _statement(self, line: str) -> None:
        low = line.lower()
        if not line or low.startswith("dim "):
            return
        if low == "exit sub":
            raise Leave
        if match := re.fullmatch(r"open (.+) for (append|input) as #(\d)", line, re.IGNORECASE):
            self._host["open"](self._whole(match[1]), match[2].lower(), int(match[3]))
        elif match := re.fullmatch(r"print #(\d), (.+)", line, re.IGNORECASE):
            self._host["print"](int(match[1]), self._whole(match[2]))
        elif match := re.fullmatch(r"line input #(\d), (\w+)", line, re.IGNORECASE):
            self._values[match[2].lower()] = self._host["line input"](int(match[1]))
            self._steps = 0  # a file has an end
        elif match := re.fullmatch(r"close #(\d)", line, re.IGNORECASE):
            self._host["close"](int(match[1]))
        elif match := re.fullmatch(r"call (\w+\(.*\))", line, re.IGNORECASE):
            self._whole(match[1])
        elif match := re.fullmatch(r"(\w+) = (.+)", line):
            self._values[match[1].lower()] = self._whole(match[2])
        elif (match := re.fullmatch(r"(\w+) (.+)", line)) and match[1].lower() in self._host:
            self._host[match[1].lower()](self._whole(match[2]))
        else:
            raise Alarm("BASIC", "no statement", line)

    def _whole(self, text: str) -> Any:
        tokens = list(_tokens(text))
        value = self._or(tokens)
        if tokens:
            raise Alarm("BASIC", "no expression", text)
        return value

    def _next(self, tokens: list[str]) -> str:
        return tokens[-1].lower() if tokens else ""

    def _or(self, tokens: list[str]) -> Any:
        value = self._and(tokens)
        while self._next(tokens) == "or":
            tokens.pop()
            value = bool(self._and(tokens)) or bool(value)
        return value

    def _and(self, tokens: list[str]) -> Any:
        value = self._not(tokens)
        while self._next(tokens) == "and":
            tokens.pop()
            value = bool(self._not(tokens)) and bool(value)
        return value

    def _not(self, tokens: list[str]) -> Any:
        if self._next(tokens) == "not":
            tokens.pop()
            return not self._not(tokens)
        value = self._joined(tokens)
        if self._next(tokens) in COMPARE:
            return COMPARE[tokens.pop()](value, self._joined(tokens))
        return value

    def _joined(self, tokens: list[str]) -> Any:
        value = self._sum(tokens)
        while self._next(tokens) == "&":
            tokens.pop()
            value = _text(value) + _text(self._sum(tokens))
        return value

    def _sum(self, tokens: list[str]) -> Any:
        value = self._product(tokens)
        while self._next(tokens) in ("+", "-"):
            value = value + self._product(tokens) if tokens.pop() == "+" else value - self._product(tokens)
        return value

    def _product(self, tokens: list[str]) -> Any:
        value = self._primary(tokens)
        while self._next(tokens) in ("*", "/"):
            value = value * self._primary(tokens) if tokens.pop() == "*" else value / self._primary(tokens)
        return value

    def _primary(self, tokens: list[str]) -> Any:
        if not tokens:
            raise Alarm("BASIC", "the expression ends too soon")
        word = tokens.pop()
        if word.startswith('"'):
            return word[1:-1]
        if word == "-":
            return -self._primary(tokens)
        if word == "(":
            value = self._or(tokens)
            self._close(tokens)
            return value
        if word[0].isdigit() or word[0] == ".":
            return float(word)
        name = word.lower()
        if self._next(tokens) == "(":
            tokens.pop()
            given = []
            while self._next(tokens) not in (")", ""):
                given.append(self._or(tokens))
                if self._next(tokens) == ",":
                    tokens.pop()
            self._close(tokens)
            if name not in self._host:
                raise Alarm("BASIC", f"{word} is not known")
            return self._host[name](*given)
        if name not in self._values:
            raise Alarm("BASIC", f"{word} has no value")
        return self._values[name]

    def _close(self, tokens: list[str]) -> None:
        if not tokens or tokens.pop() != ")":
            raise Alarm("BASIC", ") is missing")


def _text(value: Any) -> str:
    """→ as Basic joins it to a text: whole numbers without a point."""
    return value if isinstance(value, str) else f"{value:g}"
