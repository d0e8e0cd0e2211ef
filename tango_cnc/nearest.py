"""Misspelt names: which of the known ones was meant; one answer for files, options, posts, commands and the simulator."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(word: str, known: Iterable[object]) -> str | None:
    """misspelt word, known words → the one that is most like it, None when none is; capitals make no difference."""
    words = {str(k).lower(): str(k) for k in known}
    near = difflib.get_close_matches(word.lower(), words, n=1)
    return words[near[0]] if near else None


def suggestion(word: str, known: Iterable[object]) -> str:
    """misspelt word, known words → ' Did you mean …?', or nothing."""
    near = nearest(word, known)
    return f" Did you mean {near!r}?" if near else ""
