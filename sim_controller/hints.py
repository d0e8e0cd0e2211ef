"""Misspelt names: which of the known ones was meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[object]) -> str:
    """misspelt word, known words → ' Did you mean …?' or nothing; capitals are not what makes words differ."""
    words = {str(k).lower(): str(k) for k in known}
    near = difflib.get_close_matches(word.lower(), words, n=1)
    return f" Did you mean {words[near[0]]!r}?" if near else ""
