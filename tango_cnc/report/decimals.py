"""Numbers of a page or a message with the decimal sign of its language: 5.4 µm is 5,4 µm for most of Europe."""

from __future__ import annotations

import re

from .texts import Texts

# A number alone: no part of a word, a version (0.1.0), an address, a date or a time.
NUMBER = re.compile(r"(?<![\w.,:/@-])([+\-−]?\d+)\.(\d+(?:e[+-]?\d+)?)(?![\w@/:]|\.\w)")
TAGS = re.compile(r"(<(script|style|code|pre)\b.*?</\2>|<[^>]*>)", re.DOTALL)
TYPED = re.compile(r"('tango [^']*')")  # a command stays as it is typed


def decimals(text: str, t: Texts) -> str:
    """sentences, texts → the same with the decimal sign of that language; commands stay."""
    sign = t("number.decimal")
    if sign == ".":
        return text
    parts = TYPED.split(text)
    return "".join(x if i % 2 else NUMBER.sub(rf"\g<1>{sign}\g<2>", x) for i, x in enumerate(parts))


def decimals_of_page(page: str, t: Texts) -> str:
    """HTML, texts → the same; what is between tags is read by people, and no script, style or command is."""
    if t("number.decimal") == ".":
        return page
    parts = TAGS.split(page)  # text, tag, its name where it is a block, text …
    return "".join(decimals(x or "", t) if i % 3 == 0 else (x or "") if i % 3 == 1 else "" for i, x in enumerate(parts))
