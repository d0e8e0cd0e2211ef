"""Misspelt names: which of the known ones was meant, and how what was found is shown; one answer for every part of the program."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

LONGEST = 1000  # characters that a message shows of what was found


def nearest(word: str, known: Iterable[object]) -> str | None:
    """misspelt word, known words → the one that is most like it, None when none is; capitals make no difference."""
    words = {str(k).lower(): str(k) for k in known}
    near = difflib.get_close_matches(word.lower(), words, n=1)
    return words[near[0]] if near else None


def suggestion(word: str, known: Iterable[object]) -> str:
    """misspelt word, known words → ' Did you mean …?', or nothing."""
    near = nearest(word, known)
    return f" Did you mean {near!r}?" if near else ""


def printable(text: str, longest: int = LONGEST) -> str:
    """what was found → the same for a message: any terminal can show it, and what is too long loses its middle."""
    shown = text.encode("utf-8", "backslashreplace").decode("utf-8")
    if len(shown) <= longest:
        return shown
    return f"{shown[: longest // 2]} … ({len(shown)} characters) … {shown[-longest // 4 :]}"
