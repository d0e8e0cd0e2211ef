"""Lines of an RS-274/NGC program: comments apart, condensed, with their O-words; and where each O-word's partners stand."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from .._shared.alarm import Alarm

LONGEST = 255
_LABEL = re.compile(
    r"o(<[^<>]+>|\d+)(sub|endsub|call|return|if|elseif|else|endif|while|endwhile|do|repeat|endrepeat|break|continue)"
)
ACTIVE = ("msg", "debug", "print", "log", "logopen", "logappend", "logclose", "probeopen", "probeclose", "abort")


@dataclass(frozen=True)
class Line:
    """One line: text without blanks, lower case; its last active comment; label and keyword of an O-word."""

    text: str
    comment: str
    label: str
    word: str
    raw: str


def line(raw: str) -> Line:
    """line without its end → Line. Raises Alarm for what no RS-274/NGC interpreter reads."""
    if len(raw) > LONGEST:
        raise Alarm("RS274", "Command too long", raw[:40])
    comments: list[str] = []
    code, inside = "", ""
    open_ = False
    for i, char in enumerate(raw):
        if open_:
            if char == "(":
                raise Alarm("RS274", "Nested comment found", raw)
            if char == ")":
                comments.append(inside)
                open_, inside = False, ""
            else:
                inside += char
        elif char == "(":
            open_ = True
        elif char == ")":
            raise Alarm("RS274", "Bad character ')' used", raw)
        elif char == ";":
            comments.append(raw[i + 1 :])
            break
        elif not char.isspace():
            code += char.lower()
    if open_:
        raise Alarm("RS274", "Unclosed comment found", raw)
    code = code.removeprefix("/")
    code = re.sub(r"^n\d+(\.\d+)?", "", code)
    active = [text for text in comments if re.match(r"\s*(" + "|".join(ACTIVE) + r")\s*(,|$|\s)", text, re.IGNORECASE)]
    match = _LABEL.match(code)
    if code.startswith("o") and match is None and not re.fullmatch(r"o\d+", code):
        raise Alarm("RS274", "Unknown control command in O word", raw)
    if match is None:
        return Line("" if re.fullmatch(r"o\d+", code) else code, active[-1] if active else "", "", "", raw)
    return Line(code[match.end() :], active[-1] if active else "", match[1], match[2], raw)


def lines(raw: Iterable[str]) -> list[Line]:
    """lines of a file → Line objects up to the second %. Raises Alarm as `line`."""
    found: list[Line] = []
    framed = False
    for text in raw:
        if text.strip() == "%":
            if found or framed:
                break
            framed = True
            continue
        found.append(line(text))
    return found


class Program:
    """Lines with their O-words matched."""

    def __init__(self, raw: Iterable[str]) -> None:
        self.lines = lines(raw)
        self.subs = {item.label: i for i, item in enumerate(self.lines) if item.word == "sub"}

    def partner(self, start: int, words: tuple[str, ...]) -> int:
        """index, keywords → index of the next line of the same label with one of them. Raises Alarm when there is none."""
        label = self.lines[start].label
        for i in range(start + 1, len(self.lines)):
            if self.lines[i].label == label and self.lines[i].word in words:
                return i
        raise Alarm("RS274", "Unclosed O word", self.lines[start].raw)

    def opener(self, end: int, words: tuple[str, ...]) -> int:
        """index, keywords → index of the line before it of the same label with one of them. Raises Alarm when there is none."""
        label = self.lines[end].label
        for i in range(end - 1, -1, -1):
            if self.lines[i].label == label and self.lines[i].word in words:
                return i
        raise Alarm("RS274", "O word without its beginning", self.lines[end].raw)
