"""Expressions of the Sinumerik language: `ABS($AA_IM[X]-(-3.5))>0.02`, strings with `<<` included.

Order of operations: NOT, then * / DIV MOD, then + -, then AND, XOR, OR, then <<, then comparisons; whoever mixes them writes
brackets.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import lru_cache

from .alarms import alarm

Value = float | int | bool | str
Get = Callable[[str, Value | None], Value]  # name, index or None → value

_TOKEN = re.compile(
    r"""\s*(?:(?P<number>\d+\.?\d*(?:EX-?\d+)?|\.\d+)|(?P<string>"[^"]*")|(?P<name>\$?[A-Z_][A-Z0-9_]*)"""
    r"""|(?P<sign><<|<>|==|>=|<=|[-+*/<>=()\[\],:]))"""
)
_COMPARE = ("==", "<>", ">", "<", ">=", "<=")


class Reader:
    """Reads one text from the left; letters outside strings count as capitals."""

    def __init__(self, text: str, get: Get, at: int = 0) -> None:
        self.text, self.at, self._get = text, at, get

    def peek(self) -> str:
        """→ next token as text, '' at the end. Raises Alarm for what is none."""
        return self._match()[1]

    def take(self, *wanted: str) -> str | None:
        """→ the next token if it is one of these, which is then read; else None."""
        kind, token, end = self._match()
        if kind != "string" and token in wanted:
            self.at = end
            return token
        return None

    def expect(self, wanted: str) -> None:
        """Reads this token. Raises Alarm for any other."""
        if self.take(wanted) is None:
            raise alarm("12080", f"{wanted!r} expected before {self.text[self.at :]!r}")

    def name(self) -> str:
        """→ the name that comes next. Raises Alarm when none comes."""
        kind, token, end = self._match()
        if kind != "name":
            raise alarm("12080", f"a name expected before {self.text[self.at :]!r}")
        self.at = end
        return token

    def value(self) -> Value:
        """→ value of the expression that begins here."""
        left = self._concatenated()
        operator = self.take(*_COMPARE)
        return left if operator is None else _compare(operator, left, self._concatenated())

    def arguments(self) -> list[Value]:
        """`(a,b)` → values."""
        self.expect("(")
        found: list[Value] = []
        while self.take(")") is None:
            if found:
                self.expect(",")
            found.append(self.value())
        return found

    def _match(self) -> tuple[str, str, int]:
        return _token(self.text, self.at)

    def _concatenated(self) -> Value:
        left = self._or()
        while self.take("<<"):
            left = _text(left) + _text(self._or())
        return left

    def _or(self) -> Value:
        return self._logical(("OR", "XOR"), lambda: self._logical(("AND",), self._sum))

    def _logical(self, operators: tuple[str, ...], inner: Callable[[], Value]) -> Value:
        left = inner()
        while (operator := self.take(*operators)) is not None:
            a, b = truth(left), truth(inner())
            left = {"OR": a or b, "XOR": a != b, "AND": a and b}[operator]
        return left

    def _sum(self) -> Value:
        left = self._product()
        while (operator := self.take("+", "-")) is not None:
            a, b = real(left), real(self._product())
            left = a + b if operator == "+" else a - b
        return left

    def _product(self) -> Value:
        left = self._factor()
        while (operator := self.take("*", "/", "DIV", "MOD")) is not None:
            a, b = real(left), real(self._factor())
            left = _combined(operator, a, b, self.text)
        return left

    def _factor(self) -> Value:
        if self.take("-"):
            return -real(self._factor())
        if self.take("+"):
            return real(self._factor())
        if self.take("NOT"):
            return not truth(self._factor())
        if self.take("("):
            value = self.value()
            self.expect(")")
            return value
        kind, token, end = self._match()
        if kind == "number":
            self.at = end
            number = float(token.replace("EX", "E"))
            return int(number) if token.isdigit() else number
        if kind == "string":
            self.at = end
            return string(token)
        name = self.name()
        if self.peek() == "(":
            return _function(name, self.arguments())
        if self.take("["):
            index = self.name() if self._match()[0] == "name" else self.value()
            if self.take(","):  # the component of a frame
                index = f"{index},{self.name()}"
            self.expect("]")
            return self._get(name, index)
        return self._get(name, None)


@lru_cache(maxsize=65_536)  # each is asked for by every rule that it might belong to, in every pass of a loop
def _token(text: str, at: int) -> tuple[str, str, int]:
    """text, place in it → kind of the next token, the token, where it ends. Raises Alarm where no token begins."""
    if not text[at:].strip():
        return "end", "", len(text)
    match = _TOKEN.match(text.upper(), at)
    if match is None or match.lastgroup is None:
        raise alarm("12080", text[at:])
    kind = match.lastgroup
    token = match[kind] if kind != "string" else text[match.start(kind) : match.end(kind)]
    return kind, token, match.end()


def _combined(operator: str, a: float, b: float, text: str) -> float:
    if operator == "*":
        return a * b
    if b == 0:
        raise alarm("14051", text)
    return a / b if operator == "/" else math.trunc(a / b) if operator == "DIV" else math.fmod(a, b)


def string(token: str) -> str:
    """`"…'H0A'…"` → its characters."""
    return re.sub(r"'H([0-9A-F]{1,2})'", lambda m: chr(int(m[1], 16)), token[1:-1])


def real(value: Value) -> float:
    """value → number. Raises Alarm for a text."""
    if isinstance(value, str):
        raise alarm("12150", repr(value))
    return value


def truth(value: Value) -> bool:
    """value → truth. Raises Alarm for a text."""
    return bool(real(value))


def _text(value: Value) -> str:
    """Numbers as `<<` spells them."""
    if isinstance(value, str):
        return value
    return str(int(value)) if isinstance(value, (bool, int)) else f"{value:.15g}"


def _compare(operator: str, left: Value, right: Value) -> bool:
    if isinstance(left, str) and isinstance(right, str):
        if operator not in ("==", "<>"):
            raise alarm("12150", operator)
        return (left == right) == (operator == "==")
    a, b = real(left), real(right)
    return {"==": a == b, "<>": a != b, ">": a > b, "<": a < b, ">=": a >= b, "<=": a <= b}[operator]


def _function(name: str, given: list[Value]) -> Value:
    if name == "SPRINT":
        return _printed(given)
    functions: dict[str, Callable[[float], float]] = {
        "ABS": abs,
        "SQRT": math.sqrt,
        "POT": lambda v: v * v,
        "TRUNC": lambda v: float(math.trunc(v)),
        "ROUND": lambda v: math.copysign(math.floor(abs(v) + 0.5), v),
        "SIN": lambda v: math.sin(math.radians(v)),
        "COS": lambda v: math.cos(math.radians(v)),
    }
    if name not in functions:
        raise alarm("12550", name)
    if len(given) != 1:
        raise alarm("12090", name)
    try:
        return functions[name](real(given[0]))
    except (ValueError, OverflowError):
        raise alarm("14051", name) from None


def _printed(given: list[Value]) -> str:
    """SPRINT: %D, %F, %.mF, %n.mF, %S, %%."""
    if not given or not isinstance(given[0], str):
        raise alarm("12090", "SPRINT")
    rest = list(given[1:])

    def one(match: re.Match[str]) -> str:
        if match[0] == "%%":
            return "%"
        if not rest:
            raise alarm("12090", "SPRINT: fewer values than formats")
        value = rest.pop(0)
        if match["kind"] == "S":
            return _text(value)
        width = int(match["width"] or 0)
        if not math.isfinite(real(value)):
            raise alarm("14051", "SPRINT")
        if match["kind"] == "D":
            return f"{round(real(value)):{width}d}"
        return f"{real(value):{width}.{match['decimals'] or 6}f}"

    text = re.sub(r"%%|%(?P<width>\d*)(?:\.(?P<decimals>\d+))?(?P<kind>[DFS])", one, given[0])
    if rest:
        raise alarm("12090", "SPRINT: more values than formats")
    return text
