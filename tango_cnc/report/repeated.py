"""What nights said, one below the other → the same without what the night above has said already."""

from __future__ import annotations

from collections.abc import Sequence

from ..texts import Said, say

STANDING = "night.words.changed_since_night"
BEYOND = "night.words.allowed"


def shortened(headlines: Sequence[str]) -> list[str]:
    """headlines, newest first → the same; an older one about the same alarm or the same limit keeps only what is its own."""
    above = ["", *headlines]
    return [_short(text) if _same(text, newer) else text for newer, text in zip(above, headlines, strict=False)]


def _same(text: str, newer: str) -> bool:
    if not isinstance(text, Said) or not isinstance(newer, Said) or text.key != newer.key:
        return False
    if text.key == STANDING:
        return all(text.values.get(name) == newer.values.get(name) for name in ("night", "text"))
    return text.key == BEYOND and text.values["what"] == newer.values["what"] and _cause(text) == _cause(newer)


def _cause(text: Said) -> tuple[str, str]:
    """a crossed limit → what stands behind it, without its size: key of the sentence and the parameter."""
    found = text.values.get("cause")
    parts = [x for x in found.values.values() if isinstance(x, Said)] if isinstance(found, Said) else []
    return (parts[0].key, str(parts[0].values.get("name", ""))) if parts else ("", "")


def _short(text: str) -> str:
    assert isinstance(text, Said)
    if text.key == BEYOND:
        return text.but(cause="")
    own = {name: text.values[name] for name in ("night", "now", "part", "gap")}
    return say("night.words.still_changed_since", **own)
