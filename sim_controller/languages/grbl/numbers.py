"""What grblHAL and FluidNC take for a number: digits, parameters, brackets; and what `(PRINT,…)` says of them.

Facts: ngc_expr.c and ngc_params.c of grblHAL core of August 2026, Parameters.cpp, Expression.cpp and GCode.cpp of FluidNC. All
values are of single precision. Functions (`SIN[…]`) and comparisons are not simulated and refused.
"""

from __future__ import annotations

import math
import re
import struct

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
LEVELS = {"]": 1, "-": 4, "+": 4, "/": 5, "*": 5, "**": 6}
LONGEST = 20  # characters of a name (NGC_MAX_PARAM_LENGTH)
PLACES = 3  # of %f in mm


class Refusal(Exception):
    """The number of the error with which a line is refused."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Parameters:
    """The parameters of one control: named ones are kept until it is switched off, numbered ones are 0 where nobody set them."""

    def __init__(self, known: bool, forgiving: bool) -> None:
        """whether the firmware has expressions at all; whether `##` reads a number that nobody set as 0 (grblHAL) → none set."""
        self._known, self._forgiving = known, forgiving
        self._named: dict[str, float] = {}
        self._numbered: dict[int, float] = {}
        self.system: dict[str, float] = {}  # read only: where it stands, what is modal

    def assigned(self, text: str, at: int) -> int:
        """condensed line, place behind a # that begins a word → place behind the assignment, which is made. Raises Refusal."""
        if not self._known:
            raise Refusal(1)
        key, at = self._name(text, at) if text[at : at + 1] == "<" else self._number(text, at)
        if text[at : at + 1] != "=":
            raise Refusal(2)
        found, at = self.value(text, at + 1)
        if isinstance(key, str):
            if not key or key in self.system:
                raise Refusal(2)
            self._named[key] = found
        else:
            self._numbered[key] = found
        return at

    def value(self, text: str, at: int) -> tuple[float, int]:
        """condensed line, place of a value → the value, place behind it. Raises Refusal."""
        first, second = text[at : at + 1], text[at + 1 : at + 2]
        if self._known and first == "[":
            return self._bracket(text, at + 1)
        if self._known and first == "#":
            if second == "<":
                name, at = self._name(text, at + 1)
                if name in self.system:
                    return self.system[name], at
                if name not in self._named:
                    raise Refusal(2)
                return self._named[name], at
            number, at = self._number(text, at + 1)
            if number not in self._numbered and not self._forgiving:
                raise Refusal(2)
            return self._numbered.get(number, 0.0), at
        if self._known and first in ("+", "-") and second and not second.isdigit() and second != ".":
            found, at = self.value(text, at + 1)
            return (found if first == "+" else -found), at
        digits = NUMBER.match(text, at)
        if digits is None:
            raise Refusal(71 if self._known and first.isalpha() else 2)
        return single(float(digits[0])), digits.end()

    def printed(self, text: str) -> str | None:
        """remark, as it came → what is said of it, or None. A parameter that is not there is N/A."""
        if not self._known or text[:6].upper() != "PRINT,":
            return None
        said, places, at = "", PLACES, 6
        while at < len(text):
            shape = re.compile(r"%(?:\.(\d)f|(d)|f)").match(text, at)
            if shape:
                places, at = int(shape[1]) if shape[1] else 0 if shape[2] else PLACES, shape.end()
            elif text[at] == "#":
                try:
                    found, at = self.value(text.upper(), at)
                    said += f"{found:.{places}f}"
                except Refusal:
                    said, at = said + "N/A", at + 1
            else:
                said, at = said + text[at], at + 1
        return said.strip()

    def _name(self, text: str, at: int) -> tuple[str, int]:
        end = text.find(">", at)
        if end < 0 or end - at - 1 > LONGEST:
            raise Refusal(2)
        return text[at + 1 : end].lower().strip(), end + 1

    def _number(self, text: str, at: int) -> tuple[int, int]:
        """→ the number of a numbered parameter; what is not within 0.0001 of a whole one is none. FluidNC takes it as it is."""
        found, at = self.value(text, at)
        whole = math.floor(found + (1e-4 if self._forgiving else 0.0))
        if (self._forgiving and abs(found - whole) > 1e-4) or not 0 < whole <= 5000:
            raise Refusal(39)
        return whole, at

    def _bracket(self, text: str, at: int) -> tuple[float, int]:
        """→ value of what stands between brackets, by the precedence of the operators."""
        found, at = self.value(text, at)
        values, operators = [found], list[str]()
        while True:
            sign = next((sign for sign in ("**", "*", "/", "+", "-", "]") if text.startswith(sign, at)), None)
            if sign is None:
                raise Refusal(71)
            at += len(sign)
            while operators and LEVELS[sign] <= LEVELS[operators[-1]]:
                right, left = values.pop(), values.pop()
                values.append(single(_combined(left, operators.pop(), right)))
            if sign == "]":
                return values[0], at
            operators.append(sign)
            found, at = self.value(text, at)
            values.append(found)


def single(value: float) -> float:
    """any number → the nearest of single precision."""
    return float(struct.unpack("f", struct.pack("f", value))[0])


def code(value: float) -> float:
    """number behind G or M → which code it is: whole part and two places, as the firmwares take them.

    Where a negative one becomes unsigned is undefined in C, and 0 on ARM: `G-8.3` is a G0.
    """
    if value < 0:
        return 0.0
    whole = int(value)
    return whole + math.floor(100 * (value - whole) + 0.5) / 100


def _combined(left: float, sign: str, right: float) -> float:
    try:
        return (
            {"+": left + right, "-": left - right, "*": left * right}[sign]
            if sign in "+-*"
            else (left / right if sign == "/" else float(left**right))
        )
    except (ZeroDivisionError, OverflowError, TypeError):
        raise Refusal(72) from None
