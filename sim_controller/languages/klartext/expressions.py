"""Formulas of Klartext: `Q36 = ( Q41 - Q24 ) * Q31 / Q34`, and texts: `QS1 = QS2 || TOCHAR ( DAT+Q56 DECIMALS0 )`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from .._shared.alarm import Alarm

_TOKEN = re.compile(r"\s*(\d+\.?\d*|\.\d+|Q\d+|[A-Z]+|[-+*/^()])")
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "SQRT": math.sqrt,
    "ABS": abs,
    "NEG": lambda v: -v,
    "INT": lambda v: float(math.trunc(v)),
    "SIN": lambda v: math.sin(math.radians(v)),
    "COS": lambda v: math.cos(math.radians(v)),
}
_PART = re.compile(r"\s*(?:(QS\d+)|TOCHAR\s*\(\s*DAT\s*\+?(Q\d+)\s+DECIMALS(\d)\s*\))\s*")


def error(text: str, detail: str = "") -> Alarm:
    """text, what it is about → the error message to raise; texts of the simulation, not of the control."""
    return Alarm("TNC", text, detail)


def number(text: str, values: Mapping[int, float]) -> float:
    """`+Q34` or `-0.5` → its value. Raises Alarm for what is neither or a parameter without value."""
    match = re.fullmatch(r"([+-]?)(?:Q(\d+)|(\d+\.?\d*|\.\d+))", text.strip())
    if match is None:
        raise error("NC BLOCK FAULTY", text)
    value = float(match[3]) if match[3] else _parameter(int(match[2]), values)
    return -value if match[1] == "-" else value


def formula(text: str, values: Mapping[int, float]) -> float:
    """formula, Q parameters → its value. Raises Alarm when it is none."""
    tokens, at = [], 0
    while text[at:].strip():
        match = _TOKEN.match(text, at)
        if match is None:
            raise error("NC BLOCK FAULTY", text)
        tokens.append(match[1])
        at = match.end()
    tokens.reverse()
    try:
        value = _sum(tokens, values)
    except (IndexError, TypeError, ValueError, ZeroDivisionError, OverflowError):
        raise error("FORMULA FAULTY", text) from None
    if tokens:
        raise error("NC BLOCK FAULTY", text)
    return value


def text_of(source: str, values: Mapping[int, float], texts: Mapping[int, str]) -> str:
    """`QS1 || QS2` → its text; only DECLARE STRING takes characters. Raises Alarm for anything else, or beyond 255."""
    found, at = "", 0
    while True:
        match = _PART.match(source, at)
        if match is None:
            raise error("NC BLOCK FAULTY", source)
        if match[1]:
            if int(match[1][2:]) not in texts:
                raise error("PARAMETER NOT DEFINED", match[1])
            found += texts[int(match[1][2:])]
        else:
            found += f"{_parameter(int(match[2][1:]), values):.{int(match[3])}f}"
        at = match.end()
        if at == len(source):
            break
        if not source.startswith("||", at):
            raise error("NC BLOCK FAULTY", source)
        at += 2
    if len(found) > 255:
        raise error("STRING TOO LONG", source)
    return found


def _sum(tokens: list[str], values: Mapping[int, float]) -> float:
    value = _product(tokens, values)
    while tokens and tokens[-1] in "+-":
        sign = 1.0 if tokens.pop() == "+" else -1.0
        value += sign * _product(tokens, values)
    return value


def _product(tokens: list[str], values: Mapping[int, float]) -> float:
    value = _power(tokens, values)
    while tokens and tokens[-1] in "*/":
        if tokens.pop() == "*":
            value *= _power(tokens, values)
        else:
            value /= _power(tokens, values)
    return value


def _power(tokens: list[str], values: Mapping[int, float]) -> float:
    value = _factor(tokens, values)
    while tokens and tokens[-1] == "^":
        tokens.pop()
        value = float(value ** _factor(tokens, values))
    return value


def _factor(tokens: list[str], values: Mapping[int, float]) -> float:
    token = tokens.pop()
    if token in "+-":
        value = _factor(tokens, values)
        return value if token == "+" else -value
    if token == "(":
        value = _sum(tokens, values)
        if tokens.pop() != ")":
            raise ValueError
        return value
    if token in _FUNCTIONS:
        return float(_FUNCTIONS[token](_factor(tokens, values)))
    if token.startswith("Q"):
        return _parameter(int(token[1:]), values)
    return float(token)


def _parameter(which: int, values: Mapping[int, float]) -> float:
    if which not in values:
        raise error("PARAMETER NOT DEFINED", f"Q{which}")
    return values[which]
