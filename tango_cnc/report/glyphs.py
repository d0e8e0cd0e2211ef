"""Text of a PDF → the writings of which no font of this computer has the letters: typst draws boxes in their place."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .texts import Texts

SURE = 0x530  # Latin, Greek and Cyrillic end here: typst brings fonts for them
SIGNS = range(0x2000, 0x2C00)  # punctuation and signs of the program's own sentences
MOST = 12  # writings that are looked for
NAMES = {"Cjk": "Chinese characters"}
LACKS = re.compile(r'`"(.*?)"`', re.DOTALL)  # the first quoted thing of the error is the letter


def _of(letter: str) -> str:
    """letter → its writing, as Unicode begins its name: 'HIRAGANA LETTER A' → 'Hiragana'."""
    first = unicodedata.name(letter, "OTHER").split()[0].title()
    return NAMES.get(first, first)


def lacking(text: str, fonts: Sequence[Path] = ()) -> tuple[str, ...]:
    """what a PDF shows, folders of further fonts → its writings of which no font has every letter, in order.

    typst says so of the first letter only when it writes PDF/A-2u, so the letters are tried until it is content. A text in Latin,
    Greek or Cyrillic costs nothing.
    """
    import typst

    left = sorted({c for c in text if ord(c) >= SURE and ord(c) not in SIGNS and unicodedata.category(c)[0] in "LN"})
    found: list[str] = []
    compiled: Any = typst.compile  # typed for sources and folders of one kind
    while left and len(found) < MOST:
        source = "".join(f'#text("{c}")\n' for c in left)
        try:
            compiled(source.encode(), pdf_standards="a-2u", font_paths=[str(folder) for folder in fonts])
            break
        except typst.TypstError as error:
            named = LACKS.search(str(error))
        if named is None or not set(named[1]) & set(left):
            break
        found.append(_of(next(c for c in left if c in named[1])))
        left = [c for c in left if _of(c) != found[-1]]
    return tuple(found)


def note(text: str, t: Texts, fonts: Sequence[Path] = ()) -> str:
    """what a PDF shows, sentences, folders of further fonts → what its reader has to know of boxes in it; '' for none."""
    found = lacking(text, fonts)
    return t("report.no_font", writings=", ".join(found)) if found else ""
